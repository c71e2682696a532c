# %% [markdown]
# # From nothing to a certified plan
#
# A tank of water is heated from below. How much heat does it take, how fast does it lose it, and how much of the electric power
# arrives in the water at all? This lesson writes the model, finds a mistake in it and a question that no experiment can answer,
# and ends with a plan of six experiments and a proof of how good it is. It takes a quarter of an hour; the code runs in seconds.
#
# ## Equations
#
# The temperature T obeys
#
#     C dT/dt = eta P - G (T - T_a)
#
# with the heat capacity C, the conductance G of the walls, the share eta of the power that arrives, and the temperature T_a of
# the room:

# %%
import warnings

import fisherpoint as fp

quantities = {
    "states": {"T": ("K", 300.0)},  # unit, and natural size
    "inputs": {"P": "W"},
    "parameters": {"C": "J/K", "G": "W/K", "eta": "1"},
    "constants": {"T_a": (293.15, "K")},
    "outputs": {"T": "K"},
}

with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")

    @fp.model(**quantities)
    def tank(x, u, p):
        return [(p.eta * u.P - p.G * x.T - p.T_a) / p.C], [x.T]


print(caught[0].message)

# %% [markdown]
# ```text
# units of tank: equations.T: -T_a in K and -G*T in kg m2/s3 cannot be added. If that is meant, check_units = false keeps quiet
# ```
#
# The brackets around T - T_a are missing. Equations are checked for [units that do not
# fit](../how_to/models.md#units-that-do-not-fit); here the warning is caught, to be shown. Once more, with brackets:


# %%
@fp.model(**quantities)
def tank(x, u, p):
    return [(p.eta * u.P - p.G * (x.T - p.T_a)) / p.C], [x.T]


print(tank.mistakes_in_units, tank.jumps, tank.kinks)

# %% [markdown]
# ```text
# () () ()
# ```
#
# ## What is known, what is possible, and what can be known
#
# The tank holds about a third of a litre. An experiment starts at a temperature that was waited for, between that of the room and
# 80 degC, holds a power of up to 100 W, and measures the temperature once, after ten minutes at most:

# %%
prior = fp.GaussianPrior({"C": 1500.0, "G": 2.0, "eta": 0.9}, relative_std={"C": 0.1, "G": 0.3, "eta": 0.05})
warm, hot = fp.convert_unit([20.0, 80.0], "degC", "K")
region = fp.ExperimentRegion({"T": (warm, hot), "P": (0.0, 100.0), "dt": (10.0, 600.0)})
found = fp.identifiability(tank, prior, region)
print(found.identifiable, found.rank)

# %% [markdown]
# ```text
# False 2
# ```
#
# `print(found)` says why:
#
#     null      C up 1 %, G up 1 %, eta up 1 %: no output changes; only G/C and eta/C can be identified
#
# No experiment of this kind determines all three: capacity, conductance and share can grow by one factor, and no temperature
# changes. One of them has to come from elsewhere. The share of power that arrives is measured once by the supplier, say, as
# 0.92:

# %%
known = tank.fix(eta=0.92)
prior = fp.GaussianPrior({"C": 1500.0, "G": 2.0}, relative_std={"C": 0.1, "G": 0.3})
problem = fp.DesignProblem(known, prior, region, noise={"T": 0.05})
print(fp.identifiability(known, prior, region).identifiable)

# %% [markdown]
# ```text
# True
# ```
#
# ## The best there is
#
# `fp.approximate_design` finds which share of all measurements each experiment should get, and proves by how much at most any other
# design can be better:

# %%
best = fp.approximate_design(problem)
print(best.to_pandas().sort_values(["T", "P"]).round(2).to_string(index=False))
print(best.efficiency > 0.999)

# %% [markdown]
# ```text
#      T     P    dt  weight
# 293.15 100.0 600.0    0.33
# 353.15   0.0 600.0    0.33
# 353.15 100.0 600.0    0.33
# True
# ```
#
# Full power from cold and from hot, and cooling down, a third of the measurements each, and all as long as allowed.
#
# ## A plan
#
# Six experiments are what there is time for. They are found by a search, and are held against the best weights:

# %%
plan = fp.exchange(problem, n_experiments=6)
print(plan.points.table[plan.points.table[:, 0].argsort()].round(1))
print(best.efficiency_of(plan) > 0.999)
for name, share in plan.under_noise.rse.items():
    print(f"{name} will be known to {100 * share:.2f} %")

# %% [markdown]
# C will be known to 0.14 %, and G to 0.10 %. `efficiency_of` is the certificate: whatever six measurements of this region
# anyone proposes, they are worth at most a thousandth more than these, each of the three twice. It holds for the model, the
# prior mean and the noise as they were given. A hundred simulated experiments show whether the promised errors are kept where
# the truth is elsewhere:

# %%
fp.validate(problem, plan, runs=100).print()

# %% [markdown]
# And a table for the laboratory:

# %%
plan.points.to_csv("plan.csv", known)

# %% [markdown]
# `plan.save("plan")` keeps the whole design, and `plan.to_html("plan.html")` writes a page of it to send around. What to do with
# the measurements is the subject of [a first estimate](first_estimate.md); [designs with a proof](../how_to/approximate.md) has
# more on certificates.
