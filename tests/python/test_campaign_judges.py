"""The judges of `tests/fuzz`: they let pass what the tolerance allows, however far it is magnified, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import check_records
import fisherpoint as fp
from check_bits import compare_numbers
from check_records import check_derivatives
from check_sensitivities import check_output_sensitivities
from check_states import CHANCE, judge
from checks import Bench, check_functions
from figures import Figures
from given_cases import At
from reading import Reading
from room import output_slopes
from scipy_route import End

pytestmark = pytest.mark.kernels


def kinds(bench: Bench) -> list[str]:
    return [finding.kind for finding in bench.findings]


def test_derivatives_of_steep_outputs_are_exact() -> None:
    """Differences of sin(exp(x)) would span oscillations."""
    reading = Reading(["0"], ["sin(exp(x))*p + x**p"], ["x"], [], ["p"], {})
    x, p = 9.0, 3.0
    by_x = np.cos(np.exp(x)) * np.exp(x) * p + p * x ** (p - 1)
    by_p = np.sin(np.exp(x)) + x**p * np.log(x)
    assert output_slopes(reading, [x], [], [p]) == pytest.approx(np.array([[by_x, by_p]]), rel=1e-9)


@pytest.mark.parametrize(("off", "known"), [(0.0, []), (1e-3, ["output sensitivity differs"])])
def test_output_sensitivities_are_those_of_the_state_that_is_given(off: float, known: list[str]) -> None:
    """sin(x) about x = 10^6."""
    case = At(("p1*x1",), ("sin(x1)",), (1.0,), (), (1.0,), given=(([[2.0]], [[]], [13.0]), [[1.012]]))
    bench = Bench(case, Figures())
    done = fp.sensitivities(bench.model, bench.points, bench.theta)
    done.dy_dtheta[:] *= 1 + off
    check_output_sensitivities(bench, done, np.array([0]), 1e-13, "")
    assert kinds(bench) == known and bench.figures.counts["output sensitivity compared"] == 1


@pytest.mark.parametrize(("output", "off", "known"), [("1/x1", 2e-3, []), ("x1", 0.0, []), ("x1", 5e-3, ["record derivatives"])])
def test_derivatives_of_records_are_good_to_their_states(
    monkeypatch: pytest.MonkeyPatch, output: str, off: float, known: list[str]
) -> None:
    """x decays to 1e-13, of which 1/x says nothing."""

    class Off(check_records.RecordResponse):
        def __call__(self, *arguments: Any) -> Any:
            response = super().__call__(*arguments)
            response.dy[:] *= 1 + off
            return response

    monkeypatch.setattr(check_records, "RecordResponse", Off)
    case = At(("-p1*x1",), (output,), (2.0,), (), (1.0,), given=(([[1.0]], [[]], [1.0]), [[1.2]]))
    bench = Bench(case, Figures())
    theta, t, u = (
        bench.theta[0],
        np.linspace(0, 24 if output == "1/x1" else 3, check_records.SAMPLES),
        np.zeros((check_records.SAMPLES, 0)),
    )
    done, tight = (fp.simulate_record(bench.model, t, u, theta, [1.0], rtol=rtol) for rtol in (1e-6, 1e-12))
    check_derivatives(bench, done, tight, theta, t, u, "")
    assert kinds(bench) == known and bench.figures.counts["record columns compared"]


@pytest.mark.parametrize(("off", "known"), [(1e-12, []), (1e-10, ["other: y"])])
def test_outputs_of_decayed_states_are_good_to_the_states(off: float, known: list[str]) -> None:
    """x decays from 1e-6 to 1e-30; the output is x in units of 1e-6."""
    scale = 1e-6
    case = At(("-p1*x1",), ("x1/1e-6",), (scale,), (), (1.0,), given=(([[scale]], [[]], [50.0]), [[1.0]]))
    bench = Bench(case, Figures())
    x = bench.tight.x
    one = {name: np.zeros(1) for name in ("status", "sensitive status")} | {"x": x, "dx": np.zeros((1, 1, 1))}
    one |= {"y": x / scale, "dy": np.zeros((1, 1, 1))}
    compare_numbers(bench, "other", one, one | {"y": (x + off) / scale})
    assert kinds(bench) == known


def test_conditions_whose_sides_are_the_same_are_left_to_rounding() -> None:
    """p/1000 > p/1000 where a product is rounded on one side alone; u > p is no such thing."""
    for condition, known in (("(p1/1000)*sign(u1) > (p1/1000)", []), ("(p1/1000)*sign(u1) > (p1/999)", ["output differs"])):
        case = At((), (f"where({condition}, 1, 0) + p1",), (), (1.0,), (1e3,), given=(([[]], [[1.5]], [1.0]), [[476.1]]))
        bench = Bench(case, Figures())
        bench.tight.y[:] = 477.1  # as if it were true
        check_functions(bench)
        assert kinds(bench) == known


def test_rates_behind_such_conditions_are_left_to_rounding() -> None:
    for condition, known in (("(p1/1000)*sign(u1) > (p1/1000)", True), ("p1*sign(u1) > 2*p1", False), ("x1*u1 > p1", False)):
        case = At((f"where({condition}, 1, 0) - x1",), ("x1",), (1.0,), (1.0,), (1.0,), given=(([[1.0]], [[1.5]], [1.0]), [[1.1]]))
        assert Bench(case, Figures()).undecided(0) == known


def test_a_chance_of_one_tolerance_is_counted_and_a_fault_is_found() -> None:
    """A step of RK45 whose error's estimate vanishes, where the rate oscillates along it; and other rates."""

    class Liar(At):
        def model(self) -> fp.SymbolicModel:
            return At(**{**self.__dict__, "rates": ("cos(20*x1) - 1.1*exp(-x1)",)}).model()

    for kind, known in ((At, []), (Liar, ["wrong ok: states"])):
        case = kind(("cos(20*x1) - exp(-x1)",), ("x1",), (1.0,), (), (1.0,), given=(([[-1.594]], [[]], [0.09515]), [[1.0]]))
        bench = Bench(case, Figures())
        judge(bench, 0, int(fp.Status.ok), bench.course(0).x + 0.0445, 1e-4, "", "RK45")
        assert kinds(bench) == known and bench.figures.counts[CHANCE] == (not known)


def test_surfaces_that_are_met_at_once_are_looked_for_so_often_only() -> None:
    """The side of the second is lost in front of every crossing of the first."""
    case = At(
        ("0.001*(p1/(0.5 - x1) + heaviside(p2)*sign(heaviside(x2 - 5)*heaviside(x1 - 0.5)))", "p1 - x2"),
        ("x2",),
        (1.0, 1.0),
        (),
        (1.0, 1.0),
        given=(([[0.4999, 1.0]], [[]], [100.0]), [[1.0, 1.0]]),
    )
    bench = Bench(case, Figures())
    assert bench.course(0).end is not None


@pytest.mark.parametrize(("rtol", "known"), [(1e-4, []), (1e-6, ["wrong ok: states"])])
def test_a_pair_of_kinks_that_a_long_step_misses_is_a_chance_of_loose_tolerances(rtol: float, known: list[str]) -> None:
    case = At(
        ("2000*p1", "1000*max(p1*x2 - 1.7, cos(20*x1), 0)"),
        ("x2",),
        (1.0, 1.0),
        (),
        (1.0,),
        given=(([[1.834, 1.028]], [[]], [0.001109]), [[2.017]]),
    )
    bench = Bench(case, Figures())
    true = bench.course(0)
    assert true.crossed
    judge(bench, 0, int(fp.Status.ok), np.add(true.x, [0.0, 2.0]), rtol, "", "RK45")
    assert kinds(bench) == known and bench.figures.counts[CHANCE] == (not known)


@pytest.mark.parametrize(
    ("base", "ends"), [("max(x1 - 0.02, 0)*max(u1 - 0.3, 0)", "unknown"), ("(x1 - 0.02)*max(u1 - 0.3, 0)", "domain")]
)
def test_a_limit_that_is_met_with_a_kink_is_left_open(base: str, ends: str) -> None:
    """A product of maxima is zero there for good, and has a power of 1.5; a product that becomes negative has none."""
    case = At(
        ("3*x2", "-3*x1", f"({base})**1.5"),
        ("x3",),
        (1.0, 1.0, 1.0),
        (1.0,),
        (1.0,),
        given=(([[1.175, -0.083, 0.0]], [[0.9616]], [1.0]), [[1.0]]),
    )
    assert Bench(case, Figures()).course(0).end is End[ends]


@pytest.mark.parametrize(
    ("flow", "jumps"), [("sqrt(max(max(x1 - 1, 0) - 1.2, 0))", False), ("heaviside(max(x1 - 1, 0) - 1.2)", True)]
)
def test_a_root_is_no_jump_where_its_surface_is_missed_by_rounding(flow: str, jumps: bool) -> None:
    """Rounding of the time alone leaves a root a millionth of its size, where it was zero all the time before."""
    case = At(
        ("1000*(p1/0.001)", "1000*(-(p1/0.001)*x2)", f"0.001*({flow})", "1e9*((p1/0.001) - (x4/1e6))"),
        ("x1",),
        (1.0, 1.0, 1e-6, 1e6),
        (1e-6,),
        (1e-3,),
        given=(([[1.072, 1.906, 3.739e-07, 1902000.0]], [[3.013e-07]], [0.00193]), [[1e-3]]),
    )
    assert (Bench(case, Figures()).course(0).end is End.jump) == jumps
