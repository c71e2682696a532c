"""The paper's cylinder as programs: equal to the built-in one, and as short as stated."""

from __future__ import annotations

from dataclasses import fields
from time import perf_counter

import numpy as np
import pytest
import sympy as sp

from conftest import random_points
from defaults import MODEL
from fisherpoint.models.tape.branch import Select
from fisherpoint.models.tape.program import Program
from fisherpoint.models.tape.programs import Programs, Surfaces, build_programs
from oracle import Floats
from tape_cases import cylinder, written

COUNTS = {  # operations of setup, of the stage, and registers
    "rates": (1, 36, 41),
    "output": (0, 0, 22),
    "surfaces": (0, 7, 32),
    "surface_rates": (0, 4, 29),
    "rate_jacobian": (7, 77, 64),
    "output_jacobian": (0, 0, 23),
}
N_X = 5


@pytest.fixture(scope="module")
def programs() -> Programs:
    return build_programs(**cylinder())


@pytest.fixture(scope="module")
def rows() -> dict[str, Floats]:
    """Random points with a random theta each."""
    rng = np.random.default_rng(4)
    points = random_points(rng, 500)
    theta = np.array(list(MODEL.nominal.values())) * rng.uniform(0.7, 1.3, (500, 9))
    side = np.where(MODEL.switching(points.x0, points.u, theta) > 0, 1.0, -1.0)
    dx = rng.normal(size=(500, N_X)) * [1, 1, 1e9, 1e9, 100]
    return {"theta": theta, "u": points.u, "x": points.x0, "side": side, "dx": dx}


def relative(got: Floats, expected: Floats) -> float:
    return float((np.abs(got - expected) / np.abs(expected).max(axis=0)).max())


def by_sympy(expressions: list[sp.Expr], rows: dict[str, Floats]) -> Floats:
    """Values (K, m) through SymPy's own printer."""
    arguments = cylinder()
    known = [expression.subs(arguments["constants"]).rewrite(sp.Piecewise) for expression in expressions]
    symbols = [*arguments["parameters"], *arguments["inputs"], *arguments["states"], *arguments["surfaces"].sides]
    columns = np.hstack([rows["theta"], rows["u"], rows["x"], rows["side"]]).T
    values = sp.lambdify(symbols, known, "numpy")(*columns)
    return np.stack([np.broadcast_to(value, len(rows["x"])) for value in values], axis=1)


def test_equal_to_the_built_in_cylinder(programs: Programs, rows: dict[str, Floats]) -> None:
    x, u, theta = rows["x"], rows["u"], rows["theta"]
    assert relative(programs.rates.evaluate(**rows), MODEL.rhs(x, u, theta)) < 1e-13
    assert relative(programs.rate_jacobian.evaluate(**rows)[:, :N_X], MODEL.rhs(x, u, theta)) < 1e-13
    assert (programs.output.evaluate(**rows) == MODEL.output(x, u, theta)).all()
    values = np.hstack([MODEL.switching(x, u, theta), MODEL.core.limits(x, u, theta)])
    assert relative(programs.surfaces.evaluate(**rows), values) < 1e-13


def test_rates_of_surfaces(programs: Programs, rows: dict[str, Floats]) -> None:
    A_A, A_B = MODEL.core.A_A, MODEL.core.A_B
    dq, dv, dp_A, dp_B, dx_v = rows["dx"].T
    expected = np.stack([dv, dx_v, dp_A, -dp_A, dp_B, -dp_B, A_A * dq, -A_B * dq], axis=1)
    assert relative(programs.surface_rates.evaluate(**rows), expected) < 1e-14


def test_derivatives_are_those_of_sympy(programs: Programs, rows: dict[str, Floats]) -> None:
    """At every entry the value; where there is none, the derivative is zero, or by x_v, which no parameter reaches."""
    arguments = cylinder()
    variables = [*arguments["states"], *arguments["parameters"]]
    for part, entries, program in (
        ("rates", programs.rate_entries, programs.rate_jacobian),
        ("output", programs.output_entries, programs.output_jacobian),
    ):
        functions = arguments[part]
        expected = by_sympy([functions[i].diff(variables[k]) for i, k in entries], rows)
        assert relative(program.evaluate(**rows)[:, len(functions) :], expected) < 1e-12
        for i, function in enumerate(functions):
            others = [k for k in range(len(variables)) if (i, k) not in entries and k != 4]
            assert all(function.diff(variables[k]) == 0 for k in others)
            assert (i, 4) not in entries


def test_slopes_that_are_constant_read_no_state_and_no_side_of_a_kink() -> None:
    """The side of v = 0, a jump, is the friction's direction."""
    programs = MODEL.symbolic().structure.programs
    constant = {entry for entry, is_constant in zip(programs.rate_entries, programs.constant_slopes, strict=True) if is_constant}
    assert constant == {(0, 1), (1, 1), (1, 2), (1, 3), (1, N_X)}


def test_entries_are_in_order(programs: Programs) -> None:
    for entries in (programs.rate_entries, programs.output_entries):
        by_states = [entry for entry in entries if entry[1] < N_X]
        assert entries == (*sorted(by_states), *sorted(set(entries) - set(by_states), key=lambda entry: entry[::-1]))
    assert (programs.varying_states, programs.varying_surfaces) == ((True, True, True, True, False), (True, False))


@pytest.mark.parametrize("name", COUNTS)
def test_programs_are_as_short_as_stated(programs: Programs, name: str) -> None:
    program: Program = getattr(programs, name)
    counts = len(program.setup), len(program.stage), program.registers
    assert all(count <= stated for count, stated in zip(counts, COUNTS[name], strict=True)), counts
    assert not written(program.setup) & written(program.stage)


def test_programs_are_built_quickly() -> None:
    times = []
    for _ in range(3):
        start = perf_counter()
        build_programs(**cylinder())
        times.append(perf_counter() - start)
    assert min(times) < 0.15


def test_a_constant_may_become_a_parameter() -> None:
    arguments = cylinder()
    T_1 = next(symbol for symbol in arguments["constants"] if symbol.name == "T_1")
    constants = {symbol: value for symbol, value in arguments["constants"].items() if symbol != T_1}
    programs = build_programs(**arguments | {"constants": constants, "parameters": [*arguments["parameters"], T_1]})
    assert (4, 4) in programs.rate_entries and (4, N_X + 9) in programs.rate_entries and (3, 4) in programs.output_entries


def test_a_parameter_reaches_what_switches_by_it() -> None:
    """The time of a switch depends on what the surface reads, and with it the states that f switches."""
    x, y, k, s = sp.symbols("x y k s")
    rates = {"states": [x, y], "inputs": [], "parameters": [k]}
    switch = Surfaces([x - k], [s])
    assert build_programs([Select(s, 1, -1) - x, y], [x, y], switch, **rates).output_entries == ((0, 0),)
    assert build_programs([-x, y + k], [x, y], switch, **rates).output_entries == ((1, 1),)


def test_a_model_may_have_no_state() -> None:
    u, k = sp.symbols("u k")
    programs = build_programs([], [k * u**2], Surfaces(), [], [u], [k])
    assert programs.output_jacobian.evaluate([[3.0]], [[2.0]], np.empty((1, 0)), np.empty((1, 0)), np.empty((1, 0))).tolist() == [
        [12, 4]
    ]
    assert programs.rate_entries == () and programs.output_entries == ((0, 0),)
    assert all(isinstance(getattr(programs, field.name), Program | tuple | int) for field in fields(programs))


def test_misuse_is_named() -> None:
    x, k, s = sp.symbols("x k s")
    surfaces = Surfaces([x], [s])
    given = {"rates": [k * x], "output": [x], "surfaces": surfaces, "states": [x], "inputs": [], "parameters": [k]}
    for changes, message in (
        ({"rates": [x, x]}, "rates: expected one for each of 1 states, given 2"),
        ({"surfaces": Surfaces([], [s])}, "surfaces: expected at least 1"),
        ({"surfaces": Surfaces([x], [s], poles=1)}, "surfaces: expected at least 1 with sides and 1 poles, given 1"),
        ({"output": [x * s]}, "output: expected no side"),
        ({"parameters": [k, x]}, "symbols: expected each to be one"),
        ({"parameters": sp.symbols("p:1001")}, "parameters: expected at most 1000, given 1001"),
    ):
        with pytest.raises(ValueError, match=message):
            build_programs(**given | changes)
