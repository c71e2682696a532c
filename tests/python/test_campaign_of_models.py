"""The random campaign of `tests/fuzz` in short: the same cases every time, some twenty seconds of them."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from check_bits import Levels, compare_numbers
from check_covariances import check_covariance
from check_floats import check_floats, in_floats
from check_local import check_local
from check_nice import Depot, check_nice, compare
from check_noise import check_noise
from check_runs import by_points, check_runs
from check_runs import compare as compare_run
from check_sensitivities import check_sensitivities, largest_column
from check_shared import brute_force, check_shared
from check_states import judge
from checks import Bench, check_functions
from figures import Figures
from fisherpoint.noise.sensors import Sensors
from given_cases import At
from random_cylinders import MEAN, RATES, CylinderCase
from random_models import Case
from random_runs import Run, event
from reading import Reading
from rounds import Hangs, examined, no_longer_than, run_round
from scipy_route import End, course
from scipy_slope import slope

pytestmark = pytest.mark.kernels

SEEDS = range(2)
CASES = 12


# --- the routes that it checks against -----------------------------------------------------------------------------------


def test_texts_are_read_with_their_sides_held() -> None:
    reading = Reading(["max(x - 0.3, 0)*p - sign(u)*x"], ["abs(x)"], ["x"], ["u"], ["p"], {})
    assert reading.surfaces == ["x - 0.3"]
    assert reading.held([1.0], [2.0], [3.0], [1]) == pytest.approx([0.7 * 3 - 1])
    assert reading.held([1.0], [2.0], [3.0], [-1]) == [-1.0]  # the other branch, past its surface
    assert reading.output([-2.0], [0.0], [0.0]) == [2.0]


def test_a_kink_is_crossed_and_differentiated() -> None:
    """x' = p max(1 - t, 0) with a clock: x(2) = p / 2."""
    reading = Reading(["1", "p*max(1 - a, 0)"], ["x"], ["a", "x"], [], ["p"], {})
    size, start, p = np.ones(2), np.zeros(2), np.array([3.0])
    done = course(reading, start, np.empty(0), p, 2.0, size)
    assert done.end is End.ok and done.crossed == [0]
    assert done.x == pytest.approx([2.0, 1.5], abs=1e-9)
    beside = slope(reading, done, start, np.empty(0), p.tolist(), 2.0, size, 0)
    assert beside is not None and beside.x == pytest.approx([0.0, 0.5], abs=1e-8)


def test_kinks_close_together_are_no_jump() -> None:
    """Of three kinks between two looks, the sides of one are the same after them as before."""
    reading = Reading(["1", "abs(abs(a - 1) - 0.001)"], ["x"], ["a", "x"], [], [], {})
    done = course(reading, np.zeros(2), np.empty(0), np.empty(0), 2.0, np.ones(2))
    assert done.end in (End.ok, End.unknown)


def test_a_surface_that_a_state_tends_to_is_met_to_no_depth() -> None:
    """y follows cos(x) to 1 from below, and SciPy's error leads it across."""
    reading = Reading(["-2*x", "where(y > 1, 1, 0)", "-100*(y - cos(x))"], ["x"], ["x", "z", "y"], [], [], {})
    done = course(reading, np.array([-1.629, 0.0, -1.322]), np.empty(0), np.empty(0), 6.25, np.ones(3))
    assert done.end is End.ok or done.depth < 1e-7


def test_differences_over_an_oscillation_are_not_believed() -> None:
    """Next to a blow-up the ends are many radians apart; wide differences agree with each other, and not with narrow ones."""
    reading = Reading(["p*x*x + 0.3753225806/(1.2 + sin(x))"], ["x"], ["x"], [], ["p"], {})
    start, p = np.array([0.2691]), np.array([0.06633])
    done = course(reading, start, np.empty(0), p, 11.43, np.ones(1))
    beside = slope(reading, done, start, np.empty(0), p.tolist(), 11.43, np.ones(1), 0)
    assert beside is not None and beside.x_error == np.inf


@pytest.mark.parametrize(
    ("rate", "end", "at"),
    [("sign(x - 2)*x + 2*x", End.jump, np.log(2.0)), ("-1/(2*x)", End.domain, 1.0), ("x**2", End.blow_up, 1.0)],
)
def test_what_ends_a_trajectory_is_seen(rate: str, end: End, at: float) -> None:
    done = course(Reading([rate], ["x"], ["x"], [], [], {}), np.ones(1), np.empty(0), np.empty(0), 1.5, np.ones(1))
    assert done.end is end and done.at == pytest.approx(at, abs=1e-6)


@pytest.mark.parametrize(
    "rate",
    [
        "max(heaviside(x - 1) - 0, sign(x - 2), 0)",  # 1 on both sides of x = 2, by another branch
        "1 + heaviside(sign(x - 2) - 1)",  # whose argument is zero on the whole side beyond
        "sqrt(abs(heaviside(x - 2)*heaviside(x - 0.5) - 0.5) + 0.1)",  # |1 - 0.5| and |0 - 0.5|
        "1 + sqrt(max(x - 2, 0))",
        "1 - where(x > 2, x - 2, 0)**0.5",
    ],
)
def test_a_surface_where_f_is_the_same_on_both_sides_is_passed(rate: str) -> None:
    start, empty = np.array([1.2]), np.empty(0)
    done = course(Reading([rate], ["x"], ["x"], [], [], {}), start, empty, empty, 1.5, np.ones(1))
    assert done.end is End.ok and done.crossed


@pytest.mark.parametrize(("start", "end"), [(0.5, End.unknown), (2.2, End.ok)])
def test_rest_on_a_kink_is_not_left_by_errors(start: float, end: End) -> None:
    """x' = |x - 2| comes to rest at 2, off which an error of 1e-16 grows to anything."""
    reading, empty = Reading(["20*abs(x - 2)/(1 + abs(x - 2))"], ["x"], ["x"], [], [], {}), np.empty(0)
    assert course(reading, np.array([start]), empty, empty, 5.0, np.ones(1)).end is end


def test_rounding_at_the_edge_of_a_root_is_no_end() -> None:
    """The place of x = 0.98 is found to rounding, on either side of it; on one of them the root has no value."""
    reading, empty = Reading(["1 + sqrt(max(x - 0.98, 0))**3"], ["x"], ["x"], [], [], {}), np.empty(0)
    for start in np.linspace(0.1, 0.9, 40):
        done = course(reading, np.array([start]), empty, empty, 1.5, np.ones(1))
        assert done.end is End.ok and done.crossed == [0]


@pytest.mark.parametrize(
    "rate", ["max(heaviside(x - 1), 2*sign(x - 2), 0)", "2 + sign(sign(x - 2) - 1)", "1 + where(x > 2, 1/x, 0)"]
)
def test_a_jump_is_seen_whose_surface_is_no_root(rate: str) -> None:
    """At x = 2, wherever the looks at the trajectory are."""
    start, empty = np.array([1.2]), np.empty(0)
    done = course(Reading([rate], ["x"], ["x"], [], [], {}), start, empty, empty, 1.5, np.ones(1))
    assert done.end is End.jump and done.x == pytest.approx([2.0], abs=1e-12)


# --- what is no fault ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CylinderAt(CylinderCase, At):
    """A cylinder with given points."""

    points = At.points


def found(bench: Bench) -> list[str]:
    return [finding.title for finding in bench.findings]


def test_a_column_that_underflows_is_compared() -> None:
    """The tolerance times a column of 1e-318 is zero."""
    case = At(("-p1*x1",), ("x1",), (2.0,), (), (1.0,), given=(([[1e-318]], [[]], [1.0]), [[1.0]]))
    bench = Bench(case, Figures())
    check_sensitivities(bench, 1e-6, "DOP853")
    assert not found(bench) and bench.figures.counts["columns compared with differences"] == 1


def test_the_spike_of_a_column_is_seen() -> None:
    """x2' = tan(x1) turns from its pole within 1e-4 of the way, where dx2/dp1 is 2,000 times what it is before and behind."""
    case = At(
        ("-3*(x1 - p1) + (x2**2)**3", "p1 - x2 + tan(x1)"), ("x1",), (1.0, 1.0), (), (1.0,),
        given=(([[1.613, 1.595]], [[]], [3.952]), [[0.1732]]),
    )  # fmt: skip
    bench = Bench(case, Figures())
    assert largest_column(bench, 0, 0, 0.0) > 1000


def test_an_output_that_rounding_decides_about_is_compared_loosely() -> None:
    """sqrt(1700/1000 - 1.7) is 0, or 1e-8 where 1/1000 is multiplied with."""
    outputs = ("sqrt(max(u1/1000 - 1.7, 0)) + p1",)
    for u, known in ((1700.0, []), (1700.1, ["output differs"])):
        case = At((), outputs, (), (1e3,), (1.0,), given=(([[]], [[u]], [1.0]), [[1.0]]))
        bench = Bench(case, Figures())
        bench.tight.y[:] += 3e-8
        check_functions(bench)
        assert [finding.kind for finding in bench.findings] == known


def test_a_covariance_that_overflows_is_excluded_with_reason() -> None:
    """Outputs of 1e173 are numbers, and their squares are none."""
    given = ([[0.0]], [[]], [1.0]), [[400.0]]
    case = At(("p1",), ("exp(x1)",), (1.0,), (), (400.0,), rule="Unscented()", relative_std=(0.01,), given=given)
    bench = Bench(case, Figures())
    check_covariance(bench)
    assert not found(bench) and bench.figures.counts["covariances that overflow"] == 1


def test_outputs_of_terms_that_cancel_differ_by_their_rounding() -> None:
    """(p1/1e-12)*sign(u1 - 105) + p1/1e-12 with and without a fused multiplication."""
    case = At((), ("p1/1e-12*sign(u1 - 105) + p1/1e-12",), (), (1.0,), (1e-12,), given=(([[]], [[0.57]], [1.0]), [[5.979e-13]]))
    for off, known in ((2e-17, []), (2e-9, ["other: y"])):
        bench = Bench(case, Figures())
        one = {name: np.zeros((1, 1)) for name in ("x", "y")} | {name: np.zeros((1, 1, 1)) for name in ("dx", "dy")}
        one |= {name: np.zeros(1) for name in ("status", "sensitive status")} | {"x": np.zeros((1, 0)), "dx": np.zeros((1, 0, 1))}
        compare_numbers(bench, "other", one, one | {"y": np.array([[off]])})
        assert [finding.kind for finding in bench.findings] == known


@pytest.mark.parametrize("rule", ["Unscented()", "LinearizedRule()"])
def test_covariances_of_deviations_below_the_tolerance_are_good_to_them(rule: str) -> None:
    """A logistic growth that has all but ended; its deviations are 1e-8 of its size."""
    case = At(("p1*x1*(1 - x1)",), ("x1",), (1.0,), (), (2.0,), rule=rule, given=(([[1.2]], [[]], [10.0]), [[2.0]]))
    bench = Bench(case, Figures())
    one = {name: np.zeros((1, 1)) for name in ("x", "y")} | {name: np.zeros((1, 1, 1)) for name in ("dx", "dy")}
    one |= {name: np.zeros(1) for name in ("status", "sensitive status", "lost weight")} | {"x": bench.tight.x}
    for off, known in ((1e-5, []), (1e8, ["other: covariance"])):
        bench.findings.clear()
        covariance = np.array([[[5e-17]]])
        compare_numbers(bench, "other", one | {"covariance": covariance}, one | {"covariance": covariance * (1 + off)})
        assert [finding.kind for finding in bench.findings] == known


def test_derivatives_of_a_state_that_a_parameter_does_not_reach_are_good_to_the_others() -> None:
    """x1 decays with p2, on which x2 depends no more than rounding."""
    given = ([[1.7, 0.5]], [[]], [10.0]), [[2.0, 1.0]]
    bench = Bench(At(("-p2*x1", "p1 - x2"), ("x2",), (2.0, 2.0), (), (2.0, 1.0), given=given), Figures())
    one = {name: np.zeros(1) for name in ("status", "sensitive status")} | {"x": bench.tight.x, "y": bench.tight.y}
    one["dx"] = np.array([[[0.0, -8e-4], [1.0, 1e-24]]])
    for off, known in ((1e-24, []), (1e-7, ["other: dy"])):
        bench.findings.clear()
        first, second = (one | {"dy": np.array([[[1.0, value]]])} for value in (1e-24, 1e-24 + off))
        compare_numbers(bench, "other", first, second)
        assert [finding.kind for finding in bench.findings] == known


def test_a_limit_that_is_touched_is_too_close_to_tell() -> None:
    """p_A comes down to p_t and goes up again. At a tolerance that a hair's breadth is not, it has met it."""
    x0 = [0.23947013932661448, 0.2273388055095153, 6770886.039485718, 8796001.413264032, -0.4126025147042829]
    theta = [512.9078761456916, 1190.5057647024248, 121.28738120589065, 943420969.9167564, 640571.8785862388]
    theta += [1.4016220082575243e-07, 2.5459138805568893e-09, 4.9603768558376635e-05, 5.26332855665597e-05]
    constants = {"A_A": 0.0027489, "A_B": 0.00094562, "q_min": 0.0, "q_max": 0.42, "p_s": 21e6, "T_1": 0.00308, "k_u": -1.0}
    case = CylinderAt(
        RATES,
        ("q",),
        (0.5, 1.0, 1e7, 1e7, 1.0),
        (1.0,),
        MEAN,
        tuple(constants.items()),
        given=(([x0], [[-0.8406643418387163]], [0.03200508251484352]), [theta]),
    )
    for rtol, known in ((1e-4, []), (1e-9, ["wrong ok: domain"])):
        bench = Bench(case, Figures())
        judge(bench, 0, fp.Status.ok, np.array(x0), rtol, "as if it were ok")
        assert [finding.kind for finding in bench.findings] == known


def test_what_is_wrong_is_found() -> None:
    """A model whose kernels compute something else than its text says."""

    class Liar(Case):
        def model(self):  # type: ignore[no-untyped-def]
            return Case(**{**self.__dict__, "rates": ("-1.001*p1*x1",)}).model()

    case = Liar(("-p1*x1",), ("x1",), (1.0,), (), (1.0,))
    kinds = {finding.kind for finding in examined(case, Figures())}
    assert {"right-hand side differs", "wrong ok: states", "wrong ok: sensitivities"} <= kinds


@pytest.mark.parametrize(("waits", "hang"), [(10, lambda: all(iter(int, 1))), (1, lambda: time.sleep(60))])
def test_what_hangs_is_ended(waits: int, hang: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the processor, or waiting."""
    monkeypatch.setattr("rounds.WAITS", waits)
    with pytest.raises(Hangs), no_longer_than(1):
        while True:
            hang()


# --- nice numbers ----------------------------------------------------------------------------------------------------------


def bench_of(seed: int, **more: Any) -> Bench:
    return Bench(replace(Case(("-p1*x1",), ("x1",), (1.0,), (), (1.0,), seed=seed), **more), Figures())


def test_whole_numbers_are_written_as_floats() -> None:
    assert in_floats("2*x1**2 + max(0.5*u1/1e+06, 0) + c12") == "2.0*x1**2.0 + max(0.5*u1/1e+06, 0.0) + c12"


@pytest.mark.parametrize("rate", ["-p1*where(max(x1, 0) > 0, x1, 0)", "sqrt(max(x1 - 1, 0)) - p1", "max(x1, 1)**2 - 2*p1"])
def test_whole_numbers_and_floats_are_the_same_model(rate: str) -> None:
    bench = bench_of(1, rates=(rate,))
    check_floats(bench)
    assert not found(bench) and bench.figures.counts["floats: trajectories"]


@pytest.mark.parametrize("seed", range(6))
def test_closed_forms_at_nice_numbers(seed: int) -> None:
    bench = bench_of(seed)
    check_nice(bench)
    assert not found(bench) and bench.figures.counts["nice: records compared"]


def test_a_wrong_closed_form_is_found() -> None:
    """The edge is met at the end of the first of two segments, and the closed form has it elsewhere."""
    states: dict[str, Any] = {"states": {"a": "1", "b": "1"}, "inputs": {"u": "1"}, "g": ["a", "b"]}
    rates = {"f": ["-u*where(a > e, k, m)", "u*where(a > e, k, m)"], "parameters": {"k": "1", "m": "1"}}
    for off, known in ((0.0, set()), (0.1, {"runs", "records", "points", "derivatives of runs", "derivatives of points"})):

        class Elsewhere(Depot):
            def state(self, tau: float, theta: Any, off: float = off) -> Any:
                return super().state(tau, theta * (1 + off))

        bench = bench_of(0)
        exact = Elsewhere(states | rates | {"constants": {"e": (0.5, "1")}}, [1.0, 0.0], [1.0, 0.3], [0.5])
        compare(bench, exact, np.array([1.0, 1.0]), np.array([0.4, 1.0]))
        assert {finding.kind.removeprefix("wrong ok: nice ") for finding in bench.findings} == known


SMALL = pytest.mark.filterwarnings("ignore:.* expected its natural size")
COUNTER = {"rates": ("-p1", "where(x1 > 0, 0, p2*u1)"), "outputs": ("x2",), "state_sizes": (1.0, 1.0), "input_sizes": (1.0,)}
COUNTER |= {"parameter_sizes": (1.5, 1.0), "relative_std": (0.1, 0.1), "log": (False, False)}


@SMALL
@pytest.mark.parametrize("seed", range(4))
def test_runs_of_several_segments_by_other_routes(seed: int) -> None:
    figures = Figures()
    for rates in (COUNTER["rates"], ("-p1*x1", "max(x1 - 0.5, 0)*u1 - p2*x2"), ("x2", "u1 - p2*sign(x2) - p1*x1")):
        bench = bench_of(seed, **COUNTER | {"rates": rates})
        check_runs(bench)
        assert not found(bench)
        figures.add(bench.figures)
    for what in ("runs: ends of segments on surfaces", *(f"runs compared with {route}" for route in ("points", "SciPy"))):
        assert figures.counts[what]


def counted(lost: float) -> Run:
    """It counts from 0.6 / p1 on, which is the end of its first segment, and loses a share of dx/dtheta."""

    class Loses(Run):
        def sensitivities(self, rtol: float) -> fp.Sensitivities:
            done = super().sensitivities(rtol)
            return done._replace(dx_dtheta=done.dx_dtheta * (1 - lost))

    bench = bench_of(0, **COUNTER)
    theta = np.array([1.5, 1.0])
    run = Loses(bench, fp.Runs([[0.6, 0.0]], [[[1.0], [1.0], [1.0]]], [[0.5, 1.0, 0.5]], [[False, True, True]]), theta)
    assert event(run, 0) == pytest.approx(0.4, rel=1e-12)
    return Loses(bench, fp.Runs([[0.6, 0.0]], run.runs.u, [[event(run, 0), 1.0, 0.5]], run.runs.measured), theta)


@SMALL
def test_a_wrong_derivative_of_a_run_is_found() -> None:
    for lost, known in ((0.0, set()), (0.01, {"wrong ok: run derivatives", "wrong ok: run derivatives, as a point"})):
        one = counted(lost)
        compare_run(one, by_scipy=True)
        assert {finding.kind for finding in one.bench.findings} == known
        assert one.bench.figures.counts["run columns compared"] == 2


@SMALL
def test_a_run_that_is_another_than_its_points_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if its second segment began elsewhere."""
    one = counted(0.0)
    elsewhere = by_points(one) + np.array([[0.0, 0.0]] * 2 + [[0.0, 1e-3]] * 2)
    monkeypatch.setattr("check_runs.by_points", lambda run: elsewhere)
    compare_run(one, by_scipy=False)
    assert {finding.kind for finding in one.bench.findings} == {"wrong ok: run against points"}


def test_what_is_shared_is_counted_once() -> None:
    """Of one run it is the same whether a constant is drawn for it or for the plant; of many it is not."""
    for count in (1, 50):
        u = np.tile([[[1.0]], [[2.0]]], (1, 4, 1))[:1].repeat(count, axis=0)
        runs = fp.Runs(np.zeros((count, 2)), u, np.full((count, 4), 0.5))
        shared = brute_force(runs, {"uncertain": {"c": 0.1}, "varies": {}})
        anew = brute_force(runs, {"uncertain": {}, "varies": {"c": 0.1}})
        assert shared is not None and anew is not None
        if count == 1:
            np.testing.assert_allclose(shared, anew, rtol=1e-6)
        else:
            assert not np.allclose(shared, anew, rtol=1e-5, atol=0)


@pytest.mark.parametrize("seed", range(8))
def test_shared_constants_by_brute_force(seed: int) -> None:
    bench = bench_of(seed)
    check_shared(bench)
    assert not found(bench)


@pytest.mark.parametrize("seed", range(8))
def test_noise_by_whole_covariances_and_sums(seed: int) -> None:
    bench = bench_of(seed)
    check_noise(bench)
    assert not found(bench)
    assert bench.figures.counts["noise: designs compared"]


def test_a_forgotten_memory_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if a filter took samples for less correlated than they are."""
    true = Sensors.of

    def forgetful(noise: Any, names: Any) -> Sensors:
        sensors = true(noise, names)
        return replace(sensors, parts=tuple((output, std, 0.9 * time) for output, std, time in sensors.parts))

    monkeypatch.setattr(Sensors, "of", staticmethod(forgetful))
    kinds = set[str]()
    for seed in range(8):
        bench = bench_of(seed)
        check_noise(bench)
        kinds |= {finding.kind for finding in bench.findings}
    assert kinds == {"wrong ok: covariance under noise", "wrong ok: estimate under noise"}


@pytest.mark.parametrize("seed", range(8))
def test_local_parameters_by_brute_force(seed: int) -> None:
    bench = bench_of(seed)
    check_local(bench)
    assert not found(bench)


# --- the campaign ----------------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("number", SEEDS)
def test_random_models(number: int) -> None:
    done = run_round(number, CASES, {}, time.monotonic() + 300)
    assert not done.findings, done.findings[0].title + "\n\n" + done.findings[0].code
    assert done.figures.counts["cases"] == CASES


@pytest.mark.skipif(len(fp.instruction_sets()) < 2, reason="one instruction set is installed")
@pytest.mark.skipif("FISHERPOINT_ISA" in os.environ, reason="the best instruction set is compared with the others")
def test_random_models_on_the_other_instruction_sets() -> None:
    levels = Levels()
    try:
        done = run_round(SEEDS[-1] + 1, CASES, {}, time.monotonic() + 300, levels, also="levels")
    finally:
        levels.close()
    assert not done.findings, done.findings[0].title + "\n\n" + done.findings[0].code
    assert any(name.startswith("compared with ") for name in done.figures.counts)
