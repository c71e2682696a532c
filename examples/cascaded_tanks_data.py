"""The cascaded tanks from their measured records: what each part of the model is worth, in volts of simulation error.

    python examples/cascaded_tanks_data.py cascaded_tanks.csv

Every model is fitted to the first record and simulated along the second one from the same start, which is not known and estimated
with the parameters. Records: M. Schoukens, P. Mattsson, T. Wigren, J.P. Noel, Cascaded tanks benchmark combining soft and hard
nonlinearities, Workshop on Nonlinear System Identification Benchmarks, Brussels 2016 (doi:10.4121/12960104).
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

import fisherpoint as fp

RIM = 10.0  # V, of both tanks; the sensor reads no more
SPILL_RATE = 2.0  # 1/s, of the lower tank: so fast that its level hardly rises above the rim
LEVELS = {"h1": ("V", 5.0), "h2": ("V", 5.0)}
NOISE_STD = {"level": 0.05}  # V, 40 dB below the signal; it scales standard errors, not the estimate
FLOWS = {"k1": 0.049, "k2": 0.048, "k3": 0.048, "k4": 0.041}
SPILLS = {"k5": 1.5, "s1": 0.1}
LEAKS = {"l1": 0.0, "l2": 0.0, "offset": 0.0}
SPREAD = {"l1": 0.01, "l2": 0.01, "offset": 0.2, "x0_h1": 2.0, "x0_h2": 0.2}  # of the searches' starts; others 30 %


def model_of(nominal: dict[str, float]):
    """What `equations` of the same parameters becomes."""
    return fp.model(
        states=LEVELS, inputs={"u": "V"}, parameters=dict.fromkeys(nominal, "1"), outputs={"level": "V"}, nominal=nominal
    )


@model_of(FLOWS)
def plain(x, u, p):
    return [-p.k1 * fp.math.sqrt(x.h1) + p.k4 * u.u, p.k2 * fp.math.sqrt(x.h1) - p.k3 * fp.math.sqrt(x.h2)], [x.h2]


def overflowing(x, u, p):
    """Levels of two tanks that spill what rises above their rims; a share of the upper one's runs into the lower one."""
    spill = p.s1 * fp.math.max(x.h1 - RIM, 0.0)
    upper = -p.k1 * fp.math.sqrt(x.h1) + p.k4 * u.u - spill
    return upper, p.k2 * fp.math.sqrt(x.h1) - p.k3 * fp.math.sqrt(x.h2) + p.k5 * spill - SPILL_RATE * fp.math.max(x.h2 - RIM, 0.0)


@model_of(FLOWS | SPILLS)
def with_overflow(x, u, p):
    return list(overflowing(x, u, p)), [fp.math.min(x.h2, RIM)]


@model_of(FLOWS | SPILLS | LEAKS)
def with_leaks(x, u, p):
    upper, lower = overflowing(x, u, p)
    return [upper - p.l1 * x.h1, lower - p.l2 * x.h2], [fp.math.min(x.h2, RIM) + p.offset]


class Result(NamedTuple):
    """A fit, and root mean squares of the simulation's error on both records, V."""

    fit: fp.Fit
    estimation: float
    validation: float


def records(path: Path) -> tuple[fp.Record, fp.Record]:
    data = np.genfromtxt(path, delimiter=",", names=True)
    return tuple(fp.Record(data["t_s"], data[f"u_{name}_V"], data[f"y_{name}_V"]) for name in ("est", "val"))


def results(estimation: fp.Record, validation: fp.Record) -> Iterator[Result]:
    """Fits of one model after the other."""
    for model in (plain, with_overflow, with_leaks):
        bounds = {"s1": (None, SPILL_RATE)} if "s1" in model.nominal else {}  # what spills faster only takes longer to simulate
        fit = fp.estimate(model, estimation, start=spread(model), noise=NOISE_STD, bounds=bounds, starts=16, rtol=1e-7)
        x0 = {name: fit.estimate[f"x0_{name}"] for name in LEVELS}
        simulated = fp.simulate_record(model, validation.t, validation.u, fit.theta, x0)
        yield Result(fit, *(float(np.sqrt(np.mean(np.square(e)))) for e in (fit.residuals, validation.y - simulated.y)))


def spread(model: fp.Model) -> fp.GaussianPrior:
    """Where searches start; it takes no part in the estimate, but what spills stays positive."""
    mean = {**model.nominal, "x0_h1": 6.0, "x0_h2": 5.2}
    std = {name: SPREAD.get(name, 0.3 * value) for name, value in mean.items()}
    return fp.GaussianPrior(mean, std, log=[name for name in SPILLS if name in mean])


def main(path: Path) -> None:
    print("model            estimation  validation")
    for fit, estimation, validation in results(*records(path)):
        print(f"{fit.model.name:<16}{estimation:>9.3f} V{validation:>10.3f} V")
        for direction in (*fit.null_directions, *fit.weak_directions):
            print(f"  hardly shows: {direction}")
        print(f"  {fit.reached} of {fit.starts} starts came there; {fit.stop_reason.words}")
        print("  " + ", ".join(f"{name} {value:.4g}" for name, value in fit.estimate.items()))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
