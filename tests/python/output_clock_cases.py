"""A joint, its runs, problems and regions for outputs that are measured at instants of their own."""

from __future__ import annotations

from typing import Any

import numpy as np

import fisherpoint as fp
from sampling_cases import THETA

CLOCKS: dict[str, Any] = {
    "multiples": {"q": 1e-3, "s": "10 ms"},
    "others": {"q": (7, "ms"), "s": 0.003},
    "slow": {"q": 0.0013, "s": 0.03},
    "tables": {"q": 0.004, "s": [0.0053, 0.02, 0.041]},
}

NOISE: dict[str, Any] = {
    "white": {"q": 1e-3, "s": 1e-2},
    "growing": {"q": fp.Noise(1e-3, relative=0.05), "s": fp.Noise(1e-2, relative=0.1)},
    "rounded": {"q": fp.Noise(1e-3, resolution=3e-3), "s": 1e-2},
    "limited": {"q": fp.Noise(1e-3, limits=(-0.02, 0.02)), "s": fp.Noise(1e-2, limits=(None, 1.0))},
    "memory": {"q": fp.Noise(1e-3, colored=fp.GaussMarkov(2e-3, 0.01)), "s": fp.Noise(1e-2, colored=fp.GaussMarkov(1e-2, 0.05))},
}


def model(kind: str = "plain") -> fp.SymbolicModel:
    """A joint whose position and velocity are read, of smooth friction; late, or with a controller's updates."""
    torque, more, resets = "u", {"tau": (0.0077, "s")} if kind == "late" else {}, None
    states = {"q": "rad", "w": "rad/s"}
    f = ["w", "(u - b*w - F*tanh(w/w_s))/J"]
    if kind == "updates":
        states["c"], f = "N m", [*f, "0"]
        f[1], resets = f[1].replace("u -", "c -"), {"every 5 ms": {"c": "u - 0.3*w"}}
    return fp.SymbolicModel(
        f=f,
        g=["delay(q, tau)" if kind == "late" else "q", "w + q"],
        states=states,
        inputs={torque: "N m"},
        parameters={"J": "kg m2", "b": "N m s/rad", "F": "N m"},
        outputs={"q": "rad", "s": "rad/s"},
        constants={"w_s": (0.2, "rad/s"), **more},
        resets=resets,
        check_units=False,
    )


def held(of: fp.SymbolicModel, seed: int = 0, shapes: Any = ((0.02,) * 5, (0.013,) * 5)) -> fp.Runs:
    dt = np.array(shapes)
    return fp.Runs(np.zeros((len(dt), len(of.states))), np.random.default_rng(seed).uniform(-2, 2, dt.shape), dt)


def problem(of: fp.SymbolicModel, noise: Any, region: fp.RunRegion | None = None, **changes: Any) -> fp.DesignProblem:
    prior = fp.GaussianPrior(THETA, relative_std=dict.fromkeys(THETA, 0.2))
    return fp.DesignProblem(of, prior, region, **{"noise": noise, "output_covariance": "noise", "rtol": 1e-9} | changes)


def information(of: fp.DesignProblem, runs: fp.Runs) -> Any:
    """F (p, p) as the sum over samples."""
    found = fp.evaluate(of, runs)
    return found.fisher * found.n_points / 2


def region(every: Any, **changes: Any) -> fp.RunRegion:
    bounds = {"q": 0.0, "w": 0.0, "u": (-2.0, 2.0), "dt": 0.02} | changes.pop("bounds", {})
    return fp.RunRegion(bounds, **{"segments": 5, "sample_every": every} | changes)


def instants(runs: fp.Runs, run: int, output: int) -> Any:
    return runs.t[run, runs.readings[run, :, output]]
