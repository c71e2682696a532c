# %% [markdown]
# # A servo axis with its bus
#
# A drive takes a torque every 20 ms over a bus, obeys some milliseconds late, and has an encoder with steps that is read every
# millisecond. Its friction, its inertia and that dead time are to be known well enough for a simulation, and the load is another
# one tomorrow. This lesson designs the motion, measures it on a virtual axis, and asks whether the result can be trusted. The code
# runs in about a minute.
#
# ## The axis
#
# Dry friction is sharp, `sign(w)`: where the axis stands still it sticks. `delay(u, tau)` is the torque as the drive was given it
# tau before, and tau is a parameter like the others.

# %%
import warnings

import numpy as np

import fisherpoint as fp

theta = {"J": 0.02, "b": 0.05, "F": 0.3, "tau": 0.004}
relative_std = {"J": 0.2, "b": 0.3, "F": 0.3, "tau": 0.5}


def axis(torque):
    return fp.SymbolicModel(
        f=["w", f"({torque} - b*w - F*sign(w))/J"],
        g=["q"],
        states={"q": "rad", "w": "rad/s"},
        inputs={"u": "N m"},
        parameters={"J": "kg m2", "b": "N m s/rad", "F": "N m"} | ({"tau": "s"} if "tau" in torque else {}),
        outputs={"q": "rad"},
    )


late = axis("delay(u, tau)")
prior = fp.GaussianPrior(theta, relative_std=relative_std)
encoder = {"q": fp.Noise(5e-4, resolution=1e-3)}
both = {"q": float(np.hypot(5e-4, 1e-3 / np.sqrt(12)))}

# %% [markdown]
# The encoder has steps of 1 mrad, and half of that is noise. Steps of less than twice the noise are as good as noise of a twelfth
# of their square, so the design takes both as one number. The axis may turn by one radian to either side, and not faster than
# 8 rad/s.
#
# ## A multisine, and a free motion
#
# Half a second at 50 Hz is 25 torques; the encoder is read 500 times. The best multisine within the limits is what an operator
# would like to have; a free motion sets every torque by itself. Each must be one that 99 % of the axes that the prior allows can
# run.

# %%
bounds = {"q": 0.0, "w": 0.0, "u": (-1.5, 1.5), "dt": 0.02}
limits = ["abs(q) < 1", "abs(w) < 8"]
designs = {}
for name, profile in {"multisine": fp.Multisine(3, bandwidth=(2, 10)), "free": None}.items():
    region = fp.RunRegion(bounds, segments=25, sample_every=(1, "ms"), profile=profile)
    problem = fp.DesignProblem(late, prior, region, noise=both, along=limits)
    designs[name] = fp.design_runs(problem, n_starts=1, n_candidates=40)
    rse = ", ".join(f"{parameter} {100 * share:.2f} %" for parameter, share in designs[name].evaluation.rse.items())
    print(f"{name}: {rse}; {100 * designs[name].feasibility.share:.1f} % of the axes can run it")

# %% [markdown]
# `designs["free"].plot("runs")` draws it, and `designs["free"].save("axis")` writes the table of torques that the drive is given,
# a row for each of them.
#
# ## Measured, and judged
#
# The virtual axis is off the prior's mean, and its dead time is 6 ms. What if nobody had thought of the bus?

# %%
truth = {"J": 0.022, "b": 0.04, "F": 0.35, "tau": 0.006}
rig = fp.VirtualRig(late, truth, noise=encoder, seed=3)
data = rig.measure(designs["free"].runs)

with warnings.catch_warnings(action="ignore"):  # the fit warns of what its report says below
    without = fp.estimate(axis("u"), data, start={name: theta[name] for name in ("J", "b", "F")})
print(f"without a dead time: J = {without.estimate['J']:.4f} +- {without.standard_errors['J']:.4f}")
print(without.report().warnings[0])

# %% [markdown]
# The fit says by itself that its residuals are not those of a sensor. With the dead time they are, and the inertia is right:

# %%
fit = fp.estimate(late, data, prior, noise=encoder)
for name, value in fit.estimate.items():
    print(f"{name}: {value:.5f} +- {fit.standard_errors[name]:.5f}, the truth is {truth[name]}")
print("warnings:", list(fit.report().warnings))

# %% [markdown]
# A tenth of a millisecond of the dead time is a tenth of the time between two samples.
#
# ## Another load in each run
#
# Tomorrow the axis carries something else. The load is a number of each run, the friction and the bus are common to all: `local`
# says so, in designs and in fits.

# %%
loaded = fp.SymbolicModel(
    f=["w", "(delay(u, tau) - b*w - F*sign(w))/(J + J_load)"],
    g=["q"],
    states={"q": "rad", "w": "rad/s"},
    inputs={"u": "N m"},
    parameters={"J_load": "kg m2", "b": "N m s/rad", "F": "N m", "tau": "s"},
    constants={"J": (0.022, "kg m2")},
    outputs={"q": "rad"},
)
parts = []
for seed, load in enumerate((0.0, 0.004, 0.01)):
    plant = {"J_load": load, **{name: truth[name] for name in ("b", "F", "tau")}}
    parts.append(fp.VirtualRig(loaded, plant, noise=encoder, seed=seed).measure(designs["free"].runs))
runs = fp.Measurements.join(parts)
of_run = fp.Deviations(local={"J_load": "run"})
common = fp.estimate(loaded, runs, start={"J_load": 0.005, "b": 0.05, "F": 0.3, "tau": 0.004}, noise=encoder, deviations=of_run)
for name, value in common.estimate.items():
    print(f"{name}: {value:.5f} +- {common.standard_errors[name]:.5f}")

# %% [markdown]
# Each load comes with a standard error, and friction and dead time with those of all runs together. How a design counts loads that
# nobody knows beforehand, and fleets of axes, is described under [local parameters](../how_to/local_parameters.md); a controller
# with sample and hold in the loop under [updates](../how_to/updates.md); more motions than multisines under
# [signals](../how_to/signals.md).
