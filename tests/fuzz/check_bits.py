"""Results that must not change: beside other points, with more threads, from a copy, on another instruction set, or compiled."""

from __future__ import annotations

import io
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import fisherpoint as fp
from check_covariances import deviations_room
from checks import OK, ROUNDING, Bench, magnification
from random_models import Case
from reading import Floats
from room import by_own_rounding, output_room, output_undecided, slope_room

Numbers = dict[str, Floats]
RTOL, SAME = 1e-6, 1e-10  # of what is computed, and what rounding may do between instruction sets
SMALL = 1e-3  # share of a state or output per share of a parameter
EXACT = 1e-10  # the tolerance of what both are compared with
WORST = 10.0  # times the tolerance and what a model magnifies: the worst of many trajectories (checks.py)


def numbers(model: Any, case: Case, points: fp.Experiments, theta: Floats, threads: int = 1, rtol: float = RTOL) -> Numbers:
    """All that is computed of some points, by name."""
    settings: dict[str, Any] = {"rtol": rtol, "threads": threads, "jumps": "exclude"}
    done, sensitive = (of(model, points, theta, **settings) for of in (fp.simulate, fp.sensitivities))
    found = {"x": done.x, "y": done.y, "status": done.status, "dx": sensitive.dx_dtheta, "dy": sensitive.dy_dtheta}
    found["sensitive status"] = sensitive.status
    try:
        spread = fp.predictive_covariance(model, points[:3], case.prior(), case.rule_of(), **settings)
    except ValueError:
        return found
    found |= {"covariance": spread.covariance, "lost weight": spread.lost_weight}
    return found


def same_bits(a: Floats, b: Floats) -> bool:
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def check_bits(bench: Bench) -> None:
    """The same bits in another batch, with two threads, from a pickled copy and from a file."""
    points, theta, case = bench.points, bench.theta, bench.case
    if not len(points):
        return
    expected = numbers(bench.model, case, points, theta)
    bench.figures.count("calls", 3)
    others: dict[str, Any] = {"two threads": numbers(bench.model, case, points, theta, 2)}
    others["a pickled copy"] = numbers(pickle.loads(pickle.dumps(bench.model)), case, points, theta)
    if not bench.model.compiled:
        others["a TOML file"] = numbers(_from_toml(bench.model), case, points, theta)
    for name, other in others.items():
        for kind, array in expected.items():
            if not same_bits(array, other[kind]):
                bench.report(f"bits change: {name}", 1.0, 0, "model", f"{kind} of {len(points)} points (see the seed) changes")
    order = np.random.default_rng(case.seed).permutation(len(points))
    settings: dict[str, Any] = {"rtol": RTOL, "threads": 1, "jumps": "exclude"}
    shuffled = [of(bench.model, points[order], theta[order], **settings) for of in (fp.simulate, fp.sensitivities)]
    fields = ({"x": "x", "y": "y", "status": "status"}, {"dx": "dx_dtheta", "dy": "dy_dtheta", "sensitive status": "status"})
    alone = order[:3].tolist()
    for at, of in enumerate((fp.simulate, fp.sensitivities)):
        own = [of(bench.model, points[k], theta[k], **settings) for k in alone]
        for k, one in zip(alone, own, strict=True):
            place = int(np.flatnonzero(order == k)[0])
            if not all(same_bits(a, b[place : place + 1]) for a, b in zip(one, shuffled[at], strict=True)):
                bench.report(
                    "bits change: other points beside", 1.0, k, f"fp.{of.__name__}(model, points, theta)", "alone and among others"
                )
        for name, field in fields[at].items():
            if not same_bits(getattr(shuffled[at], field), expected[name][order]):
                bench.report(
                    "bits change: another order", 1.0, 0, "model", f"{name} of {len(points)} points (see the seed) changes"
                )
    if "covariance" in expected and len(points):
        one = fp.predictive_covariance(bench.model, points[0], case.prior(), case.rule_of(), **settings)
        if not same_bits(one.covariance, expected["covariance"][:1]):
            bench.report(
                "bits change: other points beside", 1.0, 0, "fp.predictive_covariance(model, points, prior, rule)", "", theta=False
            )
    bench.figures.count("compared bit by bit")


def _from_toml(model: Any) -> Any:
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "model.toml"
        path.write_text(model.to_toml())
        return fp.load_model(path)


# --- other instruction sets, other kernels ---------------------------------------------------------------------------------


def compare_numbers(bench: Bench, kind: str, expected: Numbers, other: Numbers) -> None:
    """Numbers of other kernels.

    They differ by rounding: SAME, times what a model magnifies. Where rounding decides whether a step is taken, both results are
    good to the tolerance and no better; these are counted.
    """
    bench.figures.count(f"compared with {kind}")
    for name in ("status", "sensitive status"):
        for k in np.flatnonzero(expected[name] != other[name]).tolist():
            bench.figures.count(f"{kind}: another status")
            if OK in (expected[name][k], other[name][k]) and bench.case.rates:
                bench.figures.count(f"{kind}: ok or not, by SciPy {bench.course(k).end.name}")
    units = units_of(bench, expected)
    for name, unit in units.items():
        a, b = expected[name], other[name]
        failed = "sensitive status" if name in ("dx", "dy") else "status"
        both = (expected[failed][: len(a)] == OK) & (other[failed][: len(a)] == OK)
        if name == "covariance":
            both = (expected["lost weight"] == other["lost weight"]) & (expected["lost weight"] < 1)
        for k in np.flatnonzero(both).tolist():
            ratio = float(np.max(np.abs(a[k] - b[k]) / unit[k], initial=0.0)) / SAME
            growth = magnification(bench, k, RTOL) if ratio > 1 and bench.case.rates else 1.0
            ratio /= growth
            bench.figures.ratio(f"{kind}: {name}, in units of {SAME:g}", ratio)
            if ratio <= 1:
                continue
            if ratio <= RTOL / SAME:
                bench.figures.count(f"{kind}: {name} differs within the tolerance")
            elif excuse := excused(bench, k, name, expected, other, units, growth):
                bench.figures.count(f"{kind}: {name}, {excuse}")
            else:
                remark = f"{kind}: expected {a[k].tolist()}, given {b[k].tolist()}"
                bench.report(f"{kind}: {name}", ratio * SAME / RTOL, k, f"model  # {name}", remark)


def excused(bench: Bench, k: int, name: str, expected: Numbers, other: Numbers, units: Numbers, growth: float) -> str:
    """Why numbers that differ by more than the tolerance are no fault; empty where they are."""
    a, b, x = expected[name][k], other[name][k], expected["x"][k]
    u, p, room = bench.points.u[k].tolist(), bench.theta[k].tolist(), WORST * RTOL * growth * units["x"][k]
    if on_condition(bench, k) or bench.undecided(k) or (name != "x" and output_undecided(bench.reading, x.tolist(), u, p)):
        return "where rounding decides about a condition"
    if name == "covariance" and within_deviations(bench, k, a, b, x, growth):
        return "of deviations below the tolerance"
    if not bench.case.rates:
        y = expected["y"][k]
        own = by_own_rounding(bench.reading.rough.output, y, x.tolist(), u, p)
        room = own if name == "y" else _room_of_covariance(a, own) if name == "covariance" else np.zeros(1)
        return "of terms that cancel" if (np.abs(a - b) <= room).all() else ""
    if as_good(bench, k, name, a, b, units[name][k], WORST * RTOL * growth if name in ("x", "dx") else 0.0):
        return "as good as each other"
    if name == "y" and (np.abs(a - b) <= output_room(bench.reading, x, u, p, room)).all():
        return "of states at the tolerance"
    if name == "dy":
        columns = expected["dx"][k], WORST * RTOL * growth * units["dx"][k]
        if (np.abs(a - b) <= slope_room(bench.reading, x, u, p, room, *columns)).all():
            return "of states and columns at the tolerance"
    return ""


def _room_of_covariance(covariance: Floats, error: Floats) -> Floats:
    """What errors of the outputs of every node do to their covariance."""
    deviation = np.sqrt(np.diag(covariance))
    return np.outer(deviation + 2 * error, deviation + 2 * error) - np.outer(deviation, deviation)


def as_good(bench: Bench, k: int, name: str, a: Floats, b: Floats, unit: Floats, room: float) -> bool:
    """Whether two results are as far from an exact one as each other, or both within `room`: a step that rounding decides about
    leads one of them another way."""
    true = numbers(bench.model, bench.case, bench.points[k], bench.theta[k : k + 1], rtol=EXACT)
    if true["status"][0] != OK or true["sensitive status"][0] != OK or name not in true:
        return False
    by_column = 0 if name in ("dx", "dy") else None
    errors = [np.max(np.abs(of - true[name][0]) / unit, axis=by_column) for of in (a, b)]
    return bool((np.maximum(*errors) <= np.maximum(room, 3 * np.minimum(*errors))).all())


def on_condition(bench: Bench, k: int) -> bool:
    """Whether the rounding of an input or a parameter decides which rates the start has."""
    x, u, p = bench.points.x0[k].tolist(), bench.points.u[k].tolist(), bench.theta[k].tolist()
    found = []
    for share in (-ROUNDING, ROUNDING):
        moved = [[value * (1 + share) for value in of] for of in (u, p)]
        found.append(bench.reading.held(x, *moved, bench.reading.sides(x, *moved)))
    if found[0] is None or found[1] is None:
        return found[0] is not found[1]
    return not np.allclose(found[0], found[1], rtol=1e-6, atol=0.0)


def within_deviations(bench: Bench, k: int, a: Floats, b: Floats, x: Floats, growth: float) -> bool:
    """Whether two covariances differ by no more than what their deviations, with trajectories at the tolerance, may be off."""
    room, spread = WORST * growth * deviations_room(bench, k, x.tolist()), np.sqrt(np.maximum(np.diag(a), 0.0))
    allowed = np.outer(spread + room, spread + room) - np.outer(spread, spread)
    return bool((np.abs(a - b) <= allowed).all())


def units_of(bench: Bench, numbers: Numbers) -> Numbers:
    """What differences are measured by."""
    tiny, sizes = 1e-290, bench.case.sizes
    x, y, dx, dy = (numbers[name] for name in ("x", "y", "dx", "dy"))
    largest_theta = np.abs(bench.theta).max(axis=0, initial=0.0)
    relative = SMALL / np.where(largest_theta > 0, largest_theta, 1.0)  # (p,): what has decayed below this share is rounding
    columns = np.max(np.abs(dx) / sizes[:, None], axis=(0, 1), initial=0.0) + relative  # (p,), of all points: some decay to nothing
    largest = np.abs(y).max(axis=0, initial=0.0)
    units = {
        "x": np.abs(x) + sizes,
        "y": np.broadcast_to(largest, y.shape) + tiny,
        "dx": np.broadcast_to(sizes[:, None] * columns, dx.shape) + tiny,
        "dy": np.abs(dy).max(axis=(0, 1), initial=0.0) + largest[:, None] * relative + np.zeros(dy.shape) + tiny,
    }
    if "covariance" in numbers:
        spread = np.sqrt(np.maximum(np.diagonal(numbers["covariance"], axis1=1, axis2=2), 0.0))
        spread = np.maximum(spread, 1e-9 * np.abs(y[: len(spread)]))  # of deviations by rounding nothing is left
        most = spread.max(axis=0, initial=0.0)
        units["covariance"] = np.broadcast_to(np.outer(most, most), numbers["covariance"].shape) + tiny
    return units


class Levels:
    """The other instruction sets of this machine, each a process that computes what it is told."""

    def __init__(self, levels: Sequence[str] | None = None) -> None:
        levels = [level for level in fp.instruction_sets() if level != fp.instruction_set()] if levels is None else levels
        worker = Path(__file__).with_name("isa_worker.py")
        path = os.pathsep.join([str(Path(fp.__file__).parent.parent), str(worker.parent)])
        self.workers = {
            level: subprocess.Popen(
                [sys.executable, str(worker)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=os.environ | {"FISHERPOINT_ISA": level, "PYTHONPATH": path},
            )
            for level in levels
        }

    def close(self) -> None:
        for process in self.workers.values():
            process.kill()
            process.communicate()

    def check(self, bench: Bench) -> None:
        if not self.workers or not len(bench.points):
            return
        expected = numbers(bench.model, bench.case, bench.points, bench.theta)
        for level, process in self.workers.items():
            other = ask(process, (bench.case, bench.points.x0, bench.points.u, bench.points.dt, bench.theta))
            compare_numbers(bench, f"instruction set {level}", expected, other)


def ask(process: subprocess.Popen[bytes], question: Any) -> Any:
    """Send something to a worker and return its answer."""
    assert process.stdin is not None and process.stdout is not None
    send(process.stdin, question)
    return receive(process.stdout)


def send(stream: Any, content: Any) -> None:
    data = pickle.dumps(content)
    stream.write(len(data).to_bytes(8, "little") + data)
    stream.flush()


def receive(stream: Any) -> Any:
    size = stream.read(8)
    if len(size) < 8:
        raise EOFError("the other process has ended")
    return pickle.load(io.BytesIO(stream.read(int.from_bytes(size, "little"))))


def check_compiled(bench: Bench) -> None:
    """The model compiled against the model interpreted; takes a compiler and some seconds."""
    if not len(bench.points):
        return
    compiled = bench.model.compile()
    if compiled.compiled:
        expected, other = (numbers(model, bench.case, bench.points, bench.theta) for model in (bench.model, compiled))
        compare_numbers(bench, "compiled", expected, other)
