"""What a page says of equations at their limits: each row, beside an integration that ends its pieces at the events."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fisherpoint as fp

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "equations.md"
THETA = {"a": 0.7, "b": 1.3}
CONSTANTS = {"c": (0.4, "1"), "d": (0.25, "1")}

#: x' of a side of the surface, at a time, of x, a and b.
Rate = Callable[[int, float, float, float, float], float]
#: What is zero on the surface, at a time, of x, a and b.
Surface = Callable[[float, float, float, float], float]


@dataclass(frozen=True)
class Row:
    """An equation x' = f, where it starts and how long it goes, f of either side of its surface, and where it comes to rest."""

    f: str
    x0: float
    duration: float
    rate: Rate
    surface: Surface = lambda t, x, a, b: x
    rests: bool = False
    g: str = "x"
    output: Callable[[float, float, float], float] = lambda x, a, b: x

    def right(self, a: float, b: float) -> float:
        """The output at the end, to about 1e-11."""
        t, x = 0.0, self.x0
        ahead = self.surface(1e-9, x + 1e-9 * self.rate(1, 0.0, x, a, b), a, b)
        side = 1 if (self.surface(0.0, x, a, b) or ahead) > 0 else -1
        while t < self.duration:
            done = solve_ivp(
                lambda s, y, side=side: [self.rate(side, s, y[0], a, b)],
                (t, self.duration),
                [x],
                method="DOP853",
                rtol=1e-12,
                atol=1e-14,
                dense_output=True,
                max_step=self.duration / 50,
            )
            h = [side * self.surface(s, y, a, b) for s, y in zip(done.t, done.y[0], strict=True)]
            crossed = next((n for n in range(1, len(h)) if h[n] < 0 and h[n - 1] > 0), None)
            if crossed is None:
                x, t = float(done.y[0, -1]), self.duration
                break
            place = lambda s, side=side, done=done: side * self.surface(s, done.sol(s)[0], a, b)  # noqa: E731
            t = brentq(place, done.t[crossed - 1], done.t[crossed], xtol=1e-15)
            x = float(done.sol(t)[0])
            if self.rests:
                break
            side = -side
        return self.output(x, a, b)


def root(x: float) -> float:
    return float(np.sqrt(abs(x)))


CASES: dict[str, Row] = {
    "sign(x)*sqrt(abs(x))": Row(
        "a*cos(b*t) - sign(x)*sqrt(abs(x))", 0.3, 6.0, lambda side, t, x, a, b: a * np.cos(b * t) - side * root(x)
    ),
    "sqrt(max(x, 0))": Row(
        "a*cos(b*t) - sqrt(max(x, 0))", -0.2, 6.0, lambda side, t, x, a, b: a * np.cos(b * t) - (side > 0) * root(x)
    ),
    "where(x > 0, x**1.5, 0)": Row(
        "a*cos(b*t) - where(x > 0, x**1.5, 0)", -0.2, 6.0, lambda side, t, x, a, b: a * np.cos(b * t) - (side > 0) * abs(x) ** 1.5
    ),
    "-a*sqrt(max(x, 0))": Row("-a*sqrt(max(x, 0))", 0.5, 4.0, lambda side, t, x, a, b: -a * root(x), rests=True),
    "x**b": Row("1 - a*x**b", 0.0, 2.0, lambda side, t, x, a, b: 1 - a * abs(x) ** b, lambda t, x, a, b: 1.0),
    "where(x > 0, 1/(x + 1), 1)": Row(
        "a*where(x > 0, 1/(x + 1), 1) - b*t", -1.2, 3.0, lambda side, t, x, a, b: a * (1 / (x + 1) if side > 0 else 1) - b * t
    ),
    "log(x)": Row(
        "a*cos(b*t)", 0.0, 1.0, lambda side, t, x, a, b: a * np.cos(b * t), lambda t, x, a, b: 1.0, g="log(x)",
        output=lambda x, a, b: float(np.log(x)),
    ),
    "abs(x)": Row("a*cos(b*t) - abs(x)", -0.3, 6.0, lambda side, t, x, a, b: a * np.cos(b * t) - side * x),
    "a + b*x + (c - b)*max(x - d, 0)": Row(
        "cos(t) - 0.2*(a + b*x + (c - b)*max(x - d, 0))", 0.0, 6.0,
        lambda side, t, x, a, b: np.cos(t) - 0.2 * (a + b * x + (0.4 - b) * (side > 0) * (x - 0.25)),
        lambda t, x, a, b: x - 0.25,
    ),
    "sign(x)": Row("2*cos(b*t) - a*sign(x)", 0.3, 3.0, lambda side, t, x, a, b: 2 * np.cos(b * t) - a * side),
    "where(t < a, b, 0)": Row(
        "where(t < a, b, 0) - x", 0.2, 2.0, lambda side, t, x, a, b: b * (side < 0) - x, lambda t, x, a, b: t - a
    ),
    "where(x > 0, -a, 0)": Row("where(x > 0, -a, 0)", 0.5, 2.0, lambda side, t, x, a, b: -a * (side > 0), rests=True),
}  # fmt: skip

#: Rows that end with a status, from a start and after a time.
ENDS = {
    "sqrt(x)": ("-a*sqrt(x) - b", 0.5, "left_domain"),
    "1/x": ("-a - b/x", 0.5, "left_domain"),
}

#: A triangle and a saw between -a and a at the speed b, and a mass that bounces, by their first event and what follows.
MEMORY: dict[str, Callable[[], tuple[fp.SymbolicModel, Callable[[float, float], float]]]] = {
    "latch(x < -a, x > a)": lambda: (
        model("b*(2*latch(x < -a, x > a) - 1)"),
        lambda a, b: 2 * a - abs((b * 3.7 - 0.2 - a) % (4 * a) - 2 * a) - a,
    ),
    'resets={"x < -a": {"x": "a"}}': lambda: (
        model("-b", resets={"x < -a": {"x": "a"}}),
        lambda a, b: a - (b * 3.7 - 0.2 - a) % (2 * a),
    ),
}

#: Rows that are refused, with what the message proposes.
REFUSED = {"floor(x)": "where", "x % a": "where", "x == a": r"abs\(a - b\) < width"}
REFUSED |= {
    "delay(x, a)": "states are delayed in outputs alone",
    "delay(2*u, a)": r"delay\(u, tau\) with an input",
    "u + delay(u, a)": "second input",
}

#: Rows of inputs that act late, with their dead times.
LATE = {"delay(u, a)": THETA["a"], "delay(u, 0.3)": 0.3}


def model(f: str, g: str = "x", resets: dict[str, dict[str, str]] | None = None) -> fp.SymbolicModel:
    given = dict.fromkeys(THETA, "1")
    inputs = {"u": "1"} if "u" in f.replace("sqrt", "") else {}
    return fp.SymbolicModel([f], [g], {"x": "1"}, inputs, given, {"y": "1"}, constants=CONSTANTS, resets=resets, check_units=False)


def alone(x0: float, duration: float) -> fp.Experiments:
    return fp.Experiments([[x0]], np.empty((1, 0)), [duration])


@pytest.mark.parametrize("name", CASES)
def test_a_row_is_right(name: str) -> None:
    row = CASES[name]
    assert row.f.count(name) == 1 or row.g == "log(x)"
    done = fp.sensitivities(model(row.f, row.g), alone(row.x0, row.duration), THETA, rtol=1e-10)
    a, b = THETA.values()
    h = 1e-5
    slopes = [
        (row.right(a + h, b) - row.right(a - h, b)) / (2 * h),
        (row.right(a, b + h) - row.right(a, b - h)) / (2 * h),
    ]
    assert str(done.statuses[0]) == "ok"
    assert done.y[0, 0] == pytest.approx(row.right(a, b), abs=1e-8)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], slopes, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", MEMORY)
def test_a_row_of_memory_is_right(name: str) -> None:
    remembers, right = MEMORY[name]()
    done = fp.sensitivities(remembers, alone(0.2, 3.7), THETA, rtol=1e-10)
    a, b = THETA.values()
    h = 1e-5
    slopes = [(right(a + h, b) - right(a - h, b)) / (2 * h), (right(a, b + h) - right(a, b - h)) / (2 * h)]
    assert str(done.statuses[0]) == "ok"
    assert done.y[0, 0] == pytest.approx(right(a, b), abs=1e-8)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], slopes, rtol=1e-5, atol=1e-6)


def test_a_stop_with_restitution_is_right_until_impacts_pile_up() -> None:
    ball = fp.SymbolicModel(
        ["v", "-g"], ["x"], {"x": "m", "v": "m/s"}, {}, {"g": "m/s2", "e": "1"}, resets={"x < 0": {"v": "-e*v"}}
    )
    points = fp.Experiments([[1.0, 0.0]] * 2, np.empty((2, 0)), [1.0, 10.0])
    done = fp.simulate(ball, points, {"g": 8.0, "e": 0.5})
    falls, speed = 0.5, 4.0  # of x = 1 - 4 t^2
    rest = 1.0 - falls
    assert done.x[0, 0] == pytest.approx(0.5 * speed * rest - 4.0 * rest**2, abs=1e-8)
    assert [str(status) for status in done.statuses] == ["ok", "chatters"]


@pytest.mark.parametrize("name", LATE)
def test_a_row_of_a_dead_time_is_right(name: str) -> None:
    """x' = u - b x, from 0.2, under 0 before, 1 for half a second, and 3 for another one."""
    runs = fp.Runs([[0.2]], [[[1.0], [3.0]]], 0.5, before=[0.0])
    done = fp.sensitivities(model(f"{name} - b*x"), runs, THETA, rtol=1e-10)

    def right(late: float, b: float) -> float:
        x, rest = 0.2 * np.exp(-b), [(1.0, min(late, 1.0)), (2.0, min(late + 0.5, 1.0))]
        return float(x + sum(step * (1 - np.exp(-b * (1 - at))) / b for step, at in rest))

    late, b, h = LATE[name], THETA["b"], 1e-5
    slopes = [(right(late + h, b) - right(late - h, b)) / (2 * h) * (name == "delay(u, a)")]
    slopes += [(right(late, b + h) - right(late, b - h)) / (2 * h)]
    assert str(done.statuses[0]) == "ok"
    assert done.y[0, 1, 0] == pytest.approx(right(late, b), abs=1e-8)
    np.testing.assert_allclose(done.dy_dtheta[0, 1, 0], slopes, rtol=1e-5, atol=1e-6)


def test_a_row_of_a_late_output_is_right() -> None:
    """x' = -b x: a state as it was a before."""
    done = fp.sensitivities(model("-b*x", "delay(x, a)"), alone(0.2, 3.7), THETA, rtol=1e-10)
    a, b = THETA["a"], THETA["b"]
    right = 0.2 * np.exp(-b * (3.7 - a))
    assert done.y[0, 0] == pytest.approx(right, abs=1e-8)
    np.testing.assert_allclose(done.dy_dtheta[0, 0], [b * right, -(3.7 - a) * right], rtol=1e-6)


@pytest.mark.parametrize("name", ENDS)
def test_a_row_ends_with_its_status(name: str) -> None:
    f, x0, status = ENDS[name]
    assert str(fp.simulate(model(f), alone(x0, 5.0), THETA).statuses[0]) == status


@pytest.mark.parametrize("name", REFUSED)
def test_a_row_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=REFUSED[name]):
        model(f"where({name}, a, b*x)" if "==" in name else f"a + b*x + {name}")


def test_every_row_of_the_page_is_tested() -> None:
    rows = [cell for line in PAGE.read_text().splitlines() if line.startswith("| `") for cell in [line.split("|")[1]]]
    written = [name for cell in rows for name in re.findall("`([^`]+)`", cell)]
    tested = [*CASES, *MEMORY, *ENDS, *REFUSED, *LATE]
    others = {"min(x, a)", "max(x, a)", "heaviside(x - a)"}  # beside another of the same kind
    others |= {'resets={"x < 0": {"v": "-e*v"}}', "2*delay(u, a)"}  # it has two states; what stands instead
    assert set(written) - others == set(tested)
