"""``python -m bench.joint``: a free motion of a robot joint next to the best chirps and multisines of a thousand each.

The joint is held by a position controller, whose set value comes late over a bus; friction is sharp. A motion takes 5 s, is read
every millisecond, and keeps limits of position and speed. A classical motion counts where 99 % of the plants that the prior allows
can run it, as the free one does. The ratio is that of D-information, the determinant's root by the number of parameters.
"""

from __future__ import annotations

import argparse

import numpy as np

import fisherpoint as fp
from fisherpoint.basics.values import Array
from fisherpoint.information.fewer_samples import with_fewer_samples
from fisherpoint.information.run_information import run_rows
from fisherpoint.points.run_coordinates import RunCoordinates

THETA = {"J": 0.05, "b": 0.1, "F": 0.4, "G": 0.6, "B": 0.1, "tau": 0.005}
STD = {"J": 0.2, "b": 0.3, "F": 0.3, "G": 0.3, "B": 0.5, "tau": 0.4}
LIMITS = ["abs(q) < 1", "abs(w) < 8"]
PROFILES = {"chirp": fp.Chirp((0.2, 8)), "multisine": fp.Multisine(5, bandwidth=(0.2, 8)), "free": None}
DRAWN, SHARE, LOOKED_AT = 1000, 0.99, 200


def problem(name: str) -> fp.DesignProblem:
    """The joint with one kind of motions, at 50 Hz."""
    model = fp.SymbolicModel(
        ["w", "(min(max(60*(delay(r, tau) - q) - 1.5*w, -M), M) - b*w - F*sign(w) - G*sin(q) - B)/J"],
        ["q"],
        {"q": "rad", "w": "rad/s"},
        {"r": "rad"},
        {"J": "kg m2", "b": "N m s/rad", "F": "N m", "G": "N m", "B": "N m", "tau": "s"},
        {"q": "rad"},
        constants={"M": (8.0, "N m")},
        check_units=False,
        name="joint",
    )
    prior = fp.GaussianPrior(THETA, relative_std=STD)
    region = fp.RunRegion({"q": 0.0, "w": 0.0, "r": (-1, 1), "dt": 0.02}, 250, sample_every=0.001, profile=PROFILES[name])
    return fp.DesignProblem(model, prior, region, noise={"q": 1e-3}, along=LIMITS)


def best_of_random(name: str, seed: int) -> float:
    """log det F of the best of the random motions, of those with the most information, that enough plants can run."""
    of = problem(name)
    fewer, region = with_fewer_samples(of, of.run_region)
    searched, whole = RunCoordinates(region, of.model), RunCoordinates(of.run_region, of.model)
    rng, numbers, values = np.random.default_rng(seed), list[Array](), list[float]()
    while len(values) < DRAWN:
        z = rng.uniform(size=(256, len(searched)))
        rows = run_rows(fewer, searched.runs(z), of.theta, of.integration(None))
        for k in np.flatnonzero(rows.status == fp.Status.ok):
            jacobian = rows.sensitivity[k].reshape(-1, len(THETA)) / np.sqrt(fewer.noise_covariance[0, 0])
            numbers.append(z[k])
            values.append(float(np.linalg.slogdet(jacobian.T @ jacobian)[1]))
    for k in np.argsort(-np.array(values))[:LOOKED_AT]:
        if fp.feasibility(of, whole.held(numbers[k][None])).share >= SHARE:
            return float(values[k])
    return float("-inf")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.joint", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="for the search")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    best = {name: best_of_random(name, options.seed) for name in ("chirp", "multisine")}
    design = fp.design_runs(problem("free"), n_starts=1, n_candidates=300, seed=options.seed, time_limit=options.seconds)
    for name, value in best.items():
        ratio = np.exp((design.log_det - value) / len(THETA))
        print(f"best {name} of {DRAWN}: log det F {value:.2f}; the free motion has {ratio:.1f} times its D-information")
    print(f"free motion: log det F {design.log_det:.2f}, {100 * design.feasibility.share:.1f} % of the plants can run it")


if __name__ == "__main__":
    main()
