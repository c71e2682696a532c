# %% [markdown]
# # The cylinder from rest
#
# A servo-hydraulic cylinder stands still. Its valve can be moved, its position, its pressures and its spool are measured, and
# nine numbers are not known: friction, mass, the oil, the leakage. This lesson finds out how to move the valve for a tenth of a
# second so that they can be estimated, and does so on a simulated rig. The code runs in a minute.
#
# ## The problem
#
# The [built-in model](../reference/api/models.md) has sharp Coulomb friction: the piston sticks, breaks away and reverses.

# %%
import fisherpoint as fp

model = fp.HydraulicCylinder()
shares = {"a_tau": 0.3, "b_tau": 0.2, "m_q": 0.05, "E_oil": 0.2, "p_t": 0.2, "B_v": 0.1, "c_L": 0.3, "V_0A": 0.1, "V_0B": 0.1}
prior = fp.GaussianPrior(mean=model.nominal, relative_std=shares)
noise = {"q": 5e-6, "p_A": 2e4, "p_B": 2e4, "x_v": 1e-3}

# %% [markdown]
# A run begins at rest, with pressures that hold the piston. The search chooses where the piston stands, and the valve's set value
# in each of twenty segments of 5 ms. The stroke has ends, and on the whole way the piston must stay off them:

# %%
at_rest = {"v": 0.0, "p_A": 5e6, "p_B": 10.382e6, "x_v": 0.0}
region = fp.RunRegion({"q": (0.03, 0.27), **at_rest, "u": (-1.0, 1.0), "dt": 5e-3}, segments=20)
problem = fp.DesignProblem(model, prior, region, noise=noise, along=["0.01 < q < 0.29"])

# %% [markdown]
# ## The run
#
# A thorough search takes minutes; a single start with few candidates shows how it goes:

# %%
design = fp.design_runs(problem, n_runs=1, n_starts=1, n_candidates=40, seed=1)
print(design.runs)
print(f"{100 * design.feasibility.share:.0f} % of the plants that the prior allows can run it")
design.print()

# %% [markdown]
# The table of the report has the standard error of each parameter. The oil, the valve and the leakage will be known well, as they
# move pressures at once; some others hardly better than before, as twenty samples in a tenth of a second see little of them.
# Longer runs help: `segments=48`, as in `examples/cylinder_runs.toml`, or `n_runs=2`. What the run looks like, with the spread
# over the prior:

# %%
design.plot("runs", path="runs.png")

# %% [markdown]
# ![A run of the cylinder from rest: set values of the valve, and outputs](../images/examples/cylinder_runs.png)
#
# (The picture is of the longer run of `examples/cylinder_runs.toml`.) `design.save("from_rest")` writes the run as a table and as
# a time table, `plan.csv`, that a sequencer can follow.
#
# ## Measured
#
# A *virtual rig* does what the real one would, with parameters that only it knows. It runs the plan twice:

# %%
truth = dict(prior.mean) | {"c_L": 3.2e-9, "E_oil": 1.05e9, "a_tau": 470.0}
rig = fp.VirtualRig(model, truth, noise, seed=4)
data = rig.measure(design.runs, repeats=2)
print(data)

# %% [markdown]
# ## Estimated

# %%
fit = fp.estimate(model, data, prior, noise=noise)
for name in ("c_L", "E_oil", "a_tau"):
    off = (fit.estimate[name] - truth[name]) / fit.standard_errors[name]
    print(f"{name}: {fit.estimate[name]:.4g}, the truth is {truth[name]:.4g}", "within 4 std errors" if abs(off) < 4 else "")
print(fit.converged)

# %% [markdown]
# `print(fit)` has all nine, with intervals and a test of the residuals. `fit.plot("time")` draws the run as it was measured, with
# the trajectory of the estimate between the samples.
#
# ## And then
#
# The estimate is where the next run should be designed: [a campaign](virtual_rig.md) does that until everything is known well
# enough. [Designing runs](../how_to/runs.md) has what may vary in a run, [limits and feasibility](../how_to/limits.md) what must
# not.
