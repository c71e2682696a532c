# %% [markdown]
# # A campaign on a virtual rig
#
# Which experiments are best depends on the parameters, which are not known yet. So one measures a few, estimates, and designs the
# next ones where the estimate is, until everything is known well enough. This lesson does that with a rig that is simulated; with
# a real one, only two lines are different. The code runs in seconds.
#
# ## A rig
#
# Water runs from one tank into another and out of that. Three coefficients and the gain of the pump are to be known to 0.5 %:

# %%
import fisherpoint as fp


@fp.model(
    states={"h1": ("m", 0.1), "h2": ("m", 0.1)},
    inputs={"u": "V"},
    parameters={"k1": "sqrt(m)/s", "k2": "sqrt(m)/s", "c": "m/(V s)"},
    outputs={"h2": "m"},
)
def tanks(x, u, p):
    between = p.k1 * fp.math.sqrt(x.h1)
    return [p.c * u.u - between, between - p.k2 * fp.math.sqrt(x.h2)], [x.h2]


prior = fp.GaussianPrior({"k1": 0.02, "k2": 0.02, "c": 0.002}, relative_std={"k1": 0.3, "k2": 0.3, "c": 0.2})
region = fp.ExperimentRegion({"h1": (0.05, 0.5), "h2": (0.05, 0.5), "u": (0.0, 5.0), "dt": (1.0, 60.0)})
problem = fp.DesignProblem(tanks, prior, region, noise={"h2": 0.002})
rig = fp.VirtualRig(tanks, {"k1": 0.026, "k2": 0.017, "c": 0.0017}, noise={"h2": 0.002}, seed=5)

# %% [markdown]
# The rig's parameters are up to a standard deviation off the prior's mean, and nobody but the rig knows them.
#
# ## The campaign
#
# Batches of four experiments, until every relative standard error is below 0.5 %. The directory keeps all of it: kill the program
# when you like, and the same lines go on where it was.

# %%
campaign = fp.Campaign(problem, batch=4, targets=0.005, directory="campaign", max_iterations=40)
while not campaign.done:
    points = campaign.next()  # the same ones until their data are given
    data = rig.measure(points)  # of a real rig: fp.Measurements.from_table("measured.csv", tanks)
    campaign.tell(data)
    rse = ", ".join(f"{name} {100 * share:.2f} %" for name, share in campaign.rse.items())
    print(f"batch {len(campaign.history)}: {rse}")

# %% [markdown]
# With a real rig, `campaign.next().to_csv("batch.csv", tanks)` is the table to take there, and what comes back is read from its
# file. `fisherpoint campaign` does the same on [the command line](../how_to/campaigns.md#on-the-command-line).
#
# ## What was learnt

# %%
truth = {"k1": 0.026, "k2": 0.017, "c": 0.0017}
for name, interval in campaign.fit.intervals().items():
    print(f"{name}: {interval[0]:.5f} to {interval[1]:.5f}, the truth is {truth[name]}")
print(campaign.fit.converged)

# %% [markdown]
# The intervals are those of all data and the first prior: nothing is counted twice. `campaign.plot()` draws how the standard
# errors came down, and `campaign.report()` has the tables.
#
# What would it have been without batches? All experiments at once, designed where the prior's mean is:

# %%
at_once = fp.exchange(
    problem, n_experiments=4 * len(campaign.history), max_iterations=40, method=fp.ExchangeMethod(references=False)
)
alone = fp.estimate(tanks, rig.measure(at_once.points), prior, noise={"h2": 0.002})
print({name: f"{100 * share:.2f} %" for name, share in alone.rse.items()})

# %% [markdown]
# [The study of campaigns](../studies/campaigns.md) repeats such comparisons many times.
