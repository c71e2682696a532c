"""``python -m bench.budgets``: whether limits of time hold, for models of 5, 30 and 200 states, points and runs.

Prints elapsed seconds over the limit, the time to the first report of the progress, what ended the search, and the load of the
machine. The exit code is 1 where a limit was exceeded by more than a tenth, or the first report came after two seconds. ``--limit``
sets the seconds.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import fisherpoint as fp

CHAIN = 200
LEGS = range(1, 7)


class Case(NamedTuple):
    """A model, what is known of it, and regions of points and of runs but for the durations."""

    problem: Any
    points: Mapping[str, Any]
    runs: Mapping[str, Any]
    dt: tuple[float, float]
    n_points: int


def cylinder() -> Case:
    """Five states."""
    model = fp.HydraulicCylinder()
    spread = dict(a_tau=0.3, b_tau=0.2, m_q=0.05, E_oil=0.2, p_t=0.2, B_v=0.1, c_L=0.3, V_0A=0.1, V_0B=0.1)
    prior = fp.GaussianPrior(model.nominal, relative_std=spread)
    points = dict(q=(0.05, 0.45), v=(-0.5, 0.5), p_A=(2e6, 19e6), p_B=(2e6, 19e6), x_v=(-1, 1), u=(-1, 1))
    runs = dict(q=0.2, v=0.05, p_A=8e6, p_B=12e6, x_v=0.0, u=(-1, 1))
    return Case(fp.DesignProblem(model, prior, None, noise=dict(q=1e-5, p_A=2e4, p_B=2e4)), points, runs, (1e-3, 1e-2), 12)


def chain(states: int = CHAIN) -> Case:
    """Diffusion along a chain of so many cells, with a reaction at its end."""
    rates = []
    for c in range(1, states + 1):
        inner = f"(c{c - 1} - c{c})" if c > 1 else "u"
        outer = f"(c{c + 1} - c{c})" if c < states else f"(0.5 - k*sinh(4*(c{c} - 0.5)))/{states}"
        rates.append(f"D*{states**2}*({inner} + {outer})")
    names = [f"c{c}" for c in range(1, states + 1)]
    ones = dict.fromkeys(names, "1")
    model = fp.SymbolicModel(rates, [names[0], names[-1]], ones, {"u": "1"}, {"D": "1", "k": "1"}, check_units=False)
    prior = fp.GaussianPrior({"D": 1.0, "k": 0.7}, std={"D": 0.1, "k": 0.1})
    problem = fp.DesignProblem(model, prior, None, noise=dict.fromkeys((q.name for q in model.outputs), 0.01))
    points = dict.fromkeys(names, (0.8, 1.2)) | {"u": (-0.01, 0.01)}
    return Case(problem, points, dict.fromkeys(names, 1.0) | {"u": (-0.01, 0.01)}, (0.01, 0.1), 12)


def legs() -> Case:
    """Six cylinders side by side under one load: 30 states, 54 parameters, which are designed for together."""
    states: dict[str, Any] = {}
    parameters: dict[str, str] = {}
    nominal: dict[str, float] = {}
    outputs, rates = [], []
    values = dict(a=400.0, b=1500.0, m=80.0, E=1.2e9, B=1.8e-7, c=2.5e-9, V=5e-5, W=4e-5, T=2.2e-3)
    units = dict(a="N", b="N s/m", m="kg", E="Pa", B="m3/(s sqrt(Pa))", c="m3/(s sqrt(Pa))", V="m3", W="m3", T="s")
    for i in LEGS:
        states |= {f"q{i}": "m", f"v{i}": "m/s", f"A{i}": ("Pa", 1e7), f"Z{i}": ("Pa", 1e7), f"x{i}": "1"}
        parameters |= {f"{k}{i}": units[k] for k in values}
        nominal |= {f"{k}{i}": value * (1 + 0.02 * (i - 3.5)) for k, value in values.items()}
        beside, supply, back = i % 6 + 1, f"where(x{i} > 0, 21e6 - A{i}, A{i})", f"where(x{i} > 0, Z{i}, 21e6 - Z{i})"
        rates += [
            f"v{i}",
            f"(1.96e-3*A{i} - 9.5e-4*Z{i} - a{i}*tanh(v{i}/0.005) - b{i}*v{i} - 4e3*(q{i} - q{beside}))/m{i}",
            f"E{i}/(1.96e-3*q{i} + V{i})*(-1.96e-3*v{i} + B{i}*x{i}*sqrt({supply}) + c{i}*sqrt(21e6 - A{i}))",
            f"E{i}/(9.5e-4*(0.5 - q{i}) + W{i})*(9.5e-4*v{i} - B{i}*x{i}*sqrt({back}) + c{i}*sqrt(21e6 - Z{i}))",
            f"(u{i} - x{i})/T{i}",
        ]
        outputs += [f"q{i}", f"A{i}", f"Z{i}", f"x{i}"]
    model = fp.SymbolicModel(rates, outputs, states, {f"u{i}": "1" for i in LEGS}, parameters, check_units=False)
    prior = fp.GaussianPrior(nominal, std={name: 0.1 * value for name, value in nominal.items()})
    noise = dict(zip((q.name for q in model.outputs), 6 * [5e-6, 2e4, 2e4, 1e-3], strict=True))
    points: dict[str, Any] = {}
    runs: dict[str, Any] = {}
    for i in LEGS:
        points |= {f"q{i}": (0.1, 0.4), f"v{i}": (-0.15, 0.15), f"A{i}": (2e6, 19e6), f"Z{i}": (2e6, 19e6), f"x{i}": (-1, 1)}
        points |= {f"u{i}": (-1, 1)}
        runs |= {f"q{i}": 0.25, f"v{i}": 0.0, f"A{i}": 6e6, f"Z{i}": 12.4e6, f"x{i}": 0.0, f"u{i}": (-0.4, 0.4)}
    return Case(fp.DesignProblem(model, prior, None, noise=noise), points, runs, (1e-3, 1e-2), 40)


def main() -> int:
    """Run all cases, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--limit", type=float, default=10.0, help="seconds of each search")
    limit = parser.parse_args().limit
    warnings.simplefilter("ignore")
    missed = False
    print(f"{'states':>6} {'':9} {'of limit':>9} {'CPU':>7} {'first':>7} {'ended by':12} {'log det':>9} {'load':>5}")
    for case in (cylinder(), legs(), chain()):
        of_points = case.problem.replace(region=fp.ExperimentRegion(dict(case.points, dt=case.dt)))
        of_runs = case.problem.replace(region=fp.RunRegion(dict(case.runs, dt=case.dt), 20))
        searches: dict[str, Any] = {
            "exchange": lambda report, p=of_points, n=case.n_points: fp.exchange(p, n, time_limit=limit, progress=report),
            "sweep": lambda report, p=of_points, n=case.n_points: fp.sweep(p, (n, n + 2), time_limit=limit, progress=report),
            "runs": lambda report, p=of_runs: fp.design_runs(p, 1, time_limit=limit, progress=report),
        }
        for name, search in searches.items():
            began, cpu, reports = time.perf_counter(), time.process_time(), list[float]()

            def report(_: fp.Progress, reports: list[float] = reports, began: float = began) -> None:
                reports.append(time.perf_counter() - began)

            found = search(report)
            seconds, cpu = time.perf_counter() - began, time.process_time() - cpu
            first = reports[0] if reports else seconds
            missed |= seconds > 1.1 * limit or first > 2.0
            value = found.log_det if name == "runs" else (found.designs[-1] if name == "sweep" else found).evaluation.log_det
            line = f"{len(case.problem.model.states):6} {name:9} {seconds / limit:9.3f} {cpu:7.1f} {first:7.2f} "
            print(f"{line}{found.stop_reason:12} {value:9.2f} {os.getloadavg()[0]:5.1f}", flush=True)
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
