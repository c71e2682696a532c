"""The same numbers to the last bit, whatever works beside them; and the same to rounding on every instruction set."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import experiments, random_points
from defaults import KINDS, MODEL, NAMES, NOISE, PRIOR, SMALL, grid, problem, same_bits

pytestmark = pytest.mark.kernels

PACKAGE = Path(fp.__file__).parent
THREADS = (1, 2, 5)
INTERPRETED = MODEL.symbolic()


def random_theta(count: int, seed: int) -> np.ndarray[Any, Any]:
    rng = np.random.default_rng(seed)
    return np.array(list(PRIOR.mean.values())) + rng.uniform(-1.5, 1.5, (count, 9)) * np.array(list(PRIOR.std.values()))


def all_same(results: list[tuple[Any, ...]]) -> bool:
    return all(same_bits(a, b) for result in results[1:] for a, b in zip(results[0], result, strict=True))


# --- threads ------------------------------------------------------------------------------------------------------------


def output_sensitivities(model: fp.Model, points: fp.Experiments, theta: Any, threads: int = 0, kinks: str = "cross") -> Any:
    """x, y, dy_dtheta and status by rows, as information is made of them."""
    settings = 1e-6, kinks == "cross", False, "fastest", threads or os.cpu_count() or 1
    x, y, _, dy, status = model.kernels.sensitivities(
        model.core, points.x0, points.u, points.dt, theta, *settings, outputs_alone=True
    )
    return x, y, dy, status


@pytest.mark.parametrize("function", [fp.simulate, fp.sensitivities, output_sensitivities])
@pytest.mark.parametrize("kinks", ["cross", "exclude"])
def test_threads_do_not_change_trajectories(function: Any, kinks: str) -> None:
    points, theta = random_points(np.random.default_rng(0), 301), random_theta(301, 1)
    assert all_same([function(MODEL, points, theta, threads=n, kinks=kinks) for n in THREADS])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="asks a fork")
def test_a_fork_computes_with_threads_of_its_own() -> None:
    """Those that wait for work in its parent are not in it."""
    points, theta = random_points(np.random.default_rng(0), 301), random_theta(301, 1)
    before = fp.sensitivities(MODEL, points, theta, threads=2)
    child = os.fork()
    if not child:
        os._exit(0 if all_same([before, fp.sensitivities(MODEL, points, theta, threads=2)]) else 1)
    assert os.waitpid(child, 0)[1] == 0


def test_calls_side_by_side_do_not_meet() -> None:
    points, theta = random_points(np.random.default_rng(0), 301), random_theta(301, 1)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: tuple(fp.sensitivities(MODEL, points, theta, threads=3)), range(12)))
    assert all_same(found)


@pytest.mark.parametrize("rule", [SMALL, fp.TensorGrid(3, span=1.5)], ids=["27 nodes", "19683 nodes"])
def test_threads_do_not_change_predictive_covariances(rule: fp.TensorGrid) -> None:
    points = random_points(np.random.default_rng(2), 25)  # some fail at a node: which one is found first must not matter
    results = [fp.predictive_covariance(MODEL, points, PRIOR, rule, threads=n) for n in THREADS]
    assert all_same(list(results))
    assert (results[0].status == 0).any() and (results[0].status != 0).any()


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_threads_do_not_change_a_design(kind: str) -> None:
    designs = [
        fp.exchange(
            problem(output_covariance=kind),
            9,
            n_candidates=6,
            max_iterations=8,
            seed=3,
            threads=n,
            method=fp.ExchangeMethod(references=True),
        )
        for n in THREADS
    ]
    for other in designs[1:]:
        assert same_bits(other.points.table, designs[0].points.table)
        assert [(r.log_det, r.exchanged, r.drawn) for r in other.trace] == [
            (r.log_det, r.exchanged, r.drawn) for r in designs[0].trace
        ]
        assert (other.rejected, other.efficiency) == (designs[0].rejected, designs[0].efficiency)
        assert same_bits(other.evaluation.fisher, designs[0].evaluation.fisher)


# --- neighbours ---------------------------------------------------------------------------------------------------------


def shared_call(kind: str, points: fp.Experiments, theta: Any) -> tuple[Any, ...]:
    match kind:
        case "simulate":
            return fp.simulate(MODEL, points, theta)
        case "sensitivities":
            return fp.sensitivities(MODEL, points, theta)
        case "output_sensitivities":
            return tuple(output_sensitivities(MODEL, points, theta))
        case "interpreted output_sensitivities":
            return tuple(output_sensitivities(INTERPRETED, points, theta))
    return fp.predictive_covariance(MODEL, points, PRIOR, SMALL)


@pytest.mark.parametrize(
    "kind",
    ["simulate", "sensitivities", "output_sensitivities", "interpreted output_sensitivities", "predictive_covariance"],
)
def test_a_point_does_not_feel_its_neighbours(kind: str) -> None:
    count = 67  # no multiple of any pack's width
    points, theta = random_points(np.random.default_rng(4), count), random_theta(count, 5)
    together = shared_call(kind, points, theta)
    status = together[-1]
    assert (status == 0).any() and (status != 0).any()
    alone = [shared_call(kind, points[k], theta[k : k + 1]) for k in range(count)]
    order = np.random.default_rng(6).permutation(count)
    shuffled = shared_call(kind, points[order], theta[order])
    healthy = np.flatnonzero(status == 0)
    without_failures = shared_call(kind, points[healthy], theta[healthy])
    for at, array in enumerate(together):
        assert same_bits(np.concatenate([result[at] for result in alone]), array)
        assert same_bits(shuffled[at], array[order])
        assert same_bits(without_failures[at], array[healthy])


def test_a_point_does_not_feel_troubled_neighbours() -> None:
    """Neighbours that crawl, that fail at once, and that last a thousand times as long."""
    points = random_points(np.random.default_rng(7), 40)
    table = points.table.copy()
    table[1::4, 6] = 10.0
    table[2::4, 2] = 3e7
    table[3::4, 1] *= 1e9
    mixed = fp.Experiments(table[:, :5], table[:, 5:6], table[:, 6])
    expected = fp.sensitivities(MODEL, points[::4], MODEL.nominal)
    given = fp.sensitivities(MODEL, mixed, MODEL.nominal)
    assert (expected.status == 0).any()
    for a, b in zip(expected, given, strict=True):
        assert same_bits(a, b[::4])
    for model in (MODEL, INTERPRETED):
        alone = output_sensitivities(model, points[::4], np.array(list(PRIOR.mean.values())))
        among = output_sensitivities(model, mixed, np.array(list(PRIOR.mean.values())))
        for a, b in zip(alone, among, strict=True):
            assert same_bits(a, b[::4])


def test_one_theta_for_all_is_the_same_as_one_each() -> None:
    points = random_points(np.random.default_rng(8), 33)
    theta = np.array(list(MODEL.nominal.values()))
    for function in (fp.simulate, fp.sensitivities):
        named = function(MODEL, points, MODEL.nominal)
        assert all_same([named, function(MODEL, points, theta), function(MODEL, points, np.tile(theta, (33, 1)))])


def test_the_order_of_the_priors_names_does_not_matter() -> None:
    points = random_points(np.random.default_rng(9), 12)
    backwards = fp.GaussianPrior({n: PRIOR.mean[n] for n in NAMES[::-1]}, {n: PRIOR.std[n] for n in NAMES[::-1]})
    assert all_same([fp.predictive_covariance(MODEL, points, p, grid(a_tau=3, E_oil=2)) for p in (PRIOR, backwards)])
    designs = [
        fp.exchange(
            problem(prior=p, output_covariance="pooled"),
            9,
            n_candidates=4,
            max_iterations=4,
            method=fp.ExchangeMethod(references=False),
        )
        for p in (PRIOR, backwards)
    ]
    assert same_bits(designs[0].points.table, designs[1].points.table)


# --- instruction sets ---------------------------------------------------------------------------------------------------

PROGRAM = """
import json, sys
import numpy as np
import fisherpoint as fp
data, out = json.load(open(sys.argv[1])), sys.argv[2]
points = [p for p in data["points"]]
model = fp.HydraulicCylinder(**data["constants"])
experiments = fp.Experiments([p["x0"] for p in points], [[p["u"]] for p in points], [p["dt"] for p in points])
prior = fp.GaussianPrior(data["theta"], relative_std=data["relative_std"])
result = fp.sensitivities(model, experiments, data["theta"], rtol=1e-9)
rule = fp.TensorGrid({name: 2 if name in ("a_tau", "E_oil", "p_t") else 1 for name in prior.names})
spread = fp.predictive_covariance(model, experiments, prior, rule, rtol=1e-9)
states = fp.simulate(model, experiments, data["theta"], rtol=1e-9)
np.savez(out, isa=fp.instruction_set(), x=states.x, x_sensitive=result.x, dx=result.dx_dtheta, status=result.status,
         covariance=spread.covariance, spread_status=spread.status)
"""


def run(program: str, *arguments: str, isa: str | None = None) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name != "FISHERPOINT_ISA"}
    environment["PYTHONPATH"] = str(PACKAGE.parent)
    if isa is not None:
        environment["FISHERPOINT_ISA"] = isa
    return subprocess.run([sys.executable, "-c", program, *arguments], env=environment, capture_output=True, text=True, timeout=60)


def test_every_instruction_set_gives_the_same_numbers(tmp_path: Path) -> None:
    levels = fp.instruction_sets()
    if len(levels) < 2:
        pytest.skip("only one instruction-set level is installed")
    data = Path(__file__).parent / "data" / "cylinder.json"
    results = {}
    for level in levels:
        done = run(PROGRAM, str(data), str(tmp_path / f"{level}.npz"), isa=level)
        assert done.returncode == 0, done.stderr
        with np.load(tmp_path / f"{level}.npz") as arrays:
            results[level] = {name: arrays[name] for name in arrays}
        assert str(results[level]["isa"]) == level
    first = results[levels[0]]
    assert not first["status"].any() and not first["spread_status"].any()
    for level in levels[1:]:
        other = results[level]
        np.testing.assert_array_equal(other["status"], first["status"])
        for name in ("x", "x_sensitive", "dx", "covariance"):
            # relative to the largest entry of the same kind over the points: an entry that cancels has no digits of its own
            scale = np.abs(first[name]).max(axis=0)
            error = np.abs(other[name] - first[name])
            assert np.all(error <= 1e-10 * scale), f"{level}, {name}: {np.max(error / np.where(scale > 0, scale, 1)):.1e}"


@pytest.mark.parametrize("wrong", ["v9", "", "V3", "generic,v2"])
def test_an_unknown_instruction_set_is_one_clear_import_error(wrong: str) -> None:
    done = run("import fisherpoint; fisherpoint.HydraulicCylinder", isa=wrong)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last == f"ImportError: FISHERPOINT_ISA: expected one of {', '.join(fp.instruction_sets())}, given {wrong!r}"


def test_the_best_level_is_taken_by_default() -> None:
    done = run("import fisherpoint; print(fisherpoint.instruction_set())")
    assert done.stdout.strip() == fp.instruction_sets()[-1]
    assert fp.instruction_set() in fp.instruction_sets()


@pytest.mark.skipif(shutil.which("nm") is None, reason="nm (binutils) is not installed")
@pytest.mark.parametrize("level", fp.instruction_sets())
def test_a_kernel_module_exports_its_entry_alone(level: str) -> None:
    library = find_spec(f"fisherpoint.engine._kernels_{level}")
    assert library is not None
    outside = ["-gU"] if sys.platform == "darwin" else ["-D", "--defined-only"]
    listed = subprocess.run(["nm", *outside, str(library.origin)], capture_output=True, text=True, check=True).stdout
    symbols = [line.split()[-1].removeprefix("_") for line in listed.splitlines()]
    assert symbols == [f"PyInit__kernels_{level}"]


def test_the_reference_points_are_points(reference: Any) -> None:
    """What the comparison of instruction sets rests on."""
    status = fp.sensitivities(MODEL, experiments(reference["points"]), reference["theta"]).status
    assert len(status) >= 5 and not status.any()
    assert set(NOISE) == {quantity.name for quantity in MODEL.outputs}
