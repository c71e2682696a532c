"""Which parameter reaches which output, and which parameters can be identified apart from the others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL, NAMES

MECHANICAL, HYDRAULIC = NAMES[:3], NAMES[3:]


def cylinder_measuring(*names: str) -> fp.SymbolicModel:
    """The cylinder with other outputs."""
    whole = MODEL.symbolic()
    states = {quantity.name: quantity for quantity in whole.states}
    constants = {quantity.name: (whole.constants[quantity.name], quantity) for quantity in whole.constant_quantities}
    outputs = [states[name] for name in names]
    return fp.SymbolicModel(
        whole.texts[0], names, whole.states, whole.inputs, whole.parameters, outputs, constants=constants, domain=whole.texts[2]
    )


def model(f: list[str], g: list[str], parameters: str, **constants: float) -> fp.SymbolicModel:
    """A model with states a, b, c, ... as many as there are rates, and one input u."""
    states = {name: "1" for name in "abcdef"[: len(f)]}
    return fp.SymbolicModel(f, g, states, {"u": "1"}, dict.fromkeys(parameters.split(), "1"), constants=constants)


def test_the_cylinder_has_the_papers_two_blocks() -> None:
    assert MODEL.blocks == MODEL.symbolic().blocks == (MECHANICAL, HYDRAULIC)
    assert MODEL.idle == ()
    assert dict(MODEL.reaches) == dict.fromkeys(NAMES, ("q", "p_A", "p_B"))


@pytest.mark.parametrize(
    ("outputs", "blocks"),
    [
        (("q", "p_A", "p_B"), (MECHANICAL, HYDRAULIC)),  # no parameter moves x_v, so it need not be measured
        (("v", "p_A", "p_B"), (MECHANICAL, HYDRAULIC)),  # q follows from v and the start
        (("q", "x_v"), (NAMES,)),
        (("q", "v", "x_v"), (NAMES,)),
        (("q", "p_A", "x_v"), (NAMES,)),
        (("p_A", "p_B", "x_v"), (NAMES,)),
    ],
)
def test_the_cylinder_separates_where_motion_and_pressures_are_measured(outputs: Any, blocks: Any) -> None:
    assert cylinder_measuring(*outputs).blocks == blocks


def test_measured_tanks_separate_and_an_unmeasured_one_joins() -> None:
    f = ["-k1*sqrt(a) + k4*u", "k2*sqrt(a) - k3*sqrt(b)"]
    assert model(f, ["a", "b"], "k1 k2 k3 k4").blocks == (("k1", "k4"), ("k2", "k3"))
    assert model(f, ["b"], "k1 k2 k3 k4").blocks == (("k1", "k2", "k3", "k4"),)
    upper = model(f, ["a"], "k1 k2 k3 k4")
    assert upper.blocks == (("k1", "k4"),) and upper.idle == ("k2", "k3")
    assert upper.reaches["k1"] == ("y",) and upper.reaches["k2"] == ()


SHOWN = [
    "2*a + 273.15",
    "scale*a - offset",
    "-a",
    "a + u",
    "a - exp(b)",
    "a**2",
    "sin(a)",
    "u/a",
    "sqrt(a)*b",
    "where(u > 1, a, -2*a)",
]
OTHERS = ["abs(a)", "max(a, 1)", "where(a > 1, 2*a, a)", "k*a", "sin(a)**2 + cos(a)**2 + b", "where(u > 1, a, 0)"]


@pytest.mark.parametrize("g", SHOWN + OTHERS)
def test_a_sensor_measures_its_state_where_it_has_a_slope_that_is_known(g: str) -> None:
    """Locally: a**2 shows a but for its sign. A branch on what is not known shows nothing."""
    found = model(["-k*a", "-m*b + a"], [g, "b"], "k m", scale=1e-5, offset=3.0)
    assert found.blocks == ((("k",), ("m",)) if g in SHOWN else (("k", "m"),))


def test_a_state_that_is_the_derivative_of_another_is_known() -> None:
    """Position measured, velocity and acceleration are its derivatives; a load without parameters is told by a sum."""
    f = ["b", "c", "-j*c - k*a + d", "-m*d"]
    assert model(f, ["a", "a + d"], "j k m").blocks == (("j", "k"), ("m",))
    assert model(f, ["a"], "j k m").blocks == (("j", "k", "m"),)
    assert model(["b**2", *f[1:]], ["a", "a + d"], "j k m").blocks == (("j", "k"), ("m",))
    assert model(["b**2", "c", "-j*c - k*a", "-m*d*b"], ["a", "d"], "j k m").blocks == (("j", "k"), ("m",))  # b but for its sign
    assert model(["abs(b)", "c", "-j*c - k*a", "-m*d*b"], ["a", "d"], "j k m").blocks == (("j", "k", "m"),)
    assert model(["b", "c", "-j*c - k*a", "-m*d*b"], ["a", "d"], "j k m").blocks == (("j", "k"), ("m",))


def test_a_state_that_no_parameter_moves_is_known() -> None:
    """An unmeasured drive, and the integral of a measured signal, start at a known value and follow from what is known."""
    assert model(["-k*a + c", "-m*b + c", "u - c"], ["a", "b"], "k m").blocks == (("k",), ("m",))
    assert model(["-k*a + c", "-m*b + c", "w*u - c"], ["a", "b"], "k m w").blocks == (("k", "m", "w"),)
    assert model(["-k*a + c", "-m*b + c", "a"], ["a", "b"], "k m").blocks == (("k",), ("m",))
    assert model(["-k*a + c", "-m*b + c", "d", "-k*d"], ["a", "b"], "k m").blocks == (("k", "m"),)


def test_a_shared_parameter_joins_equations_unless_one_gives_it_at_every_instant() -> None:
    assert model(["-k*a + m", "-k*b + n"], ["a", "b"], "k m n").blocks == (("k", "m", "n"),)
    assert model(["-k*a", "-k*b + n*u"], ["a", "b"], "k n").blocks == (("k",), ("n",))
    assert model(["-k*max(a, 1)", "-k*b + n*u"], ["a", "b"], "k n").blocks == (("k",), ("n",))
    assert model(["-k*max(a - 1, 0)", "-k*b + n*u"], ["a", "b"], "k n").blocks == (("k", "n"),)  # below 1 it does not


def test_what_no_output_hears_of_joins_nothing() -> None:
    """c is driven by a and b, with parameters of both, but reaches no output."""
    found = model(["-k*a", "-m*b", "k*a + m*b + w*c"], ["a", "b"], "k m w")
    assert found.blocks == (("k",), ("m",)) and found.idle == ("w",)


def test_a_condition_is_read() -> None:
    """The level at which the overflow sets in stands in a branch alone."""
    found = model(["u - where(a > level, k*(a - level), 0)"], ["a"], "k level")
    assert found.blocks == (("k", "level"),) and found.reaches["level"] == ("y",)
    assert model(["where(b > 0, k, m)*u", "-w*b"], ["a"], "k m w").blocks == (("k", "m", "w"),)


def test_a_dead_time_reaches_an_output_that_reads_the_input() -> None:
    """No sensitivity shows it, as the output jumps where the input does: it is not known whether it can be identified."""
    late = fp.SymbolicModel(["-k*a"], ["a", "m*delay(u, tau)"], {"a": "1"}, {"u": "1"}, {"k": "1/s", "m": "1", "tau": "s"})
    assert late.reaches["tau"] == ("y_2",) and late.blocks == (("k",), ("m", "tau"))
    found = fp.identifiability(late, fp.GaussianPrior({"k": 1.0, "m": 1.0, "tau": 0.3}, {"k": 0.1, "m": 0.1, "tau": 0.03}))
    assert found.identifiable is None and found.not_known[0].startswith("tau") and not found.null_directions and not found.idle


def test_a_static_model_separates_by_outputs() -> None:
    static = fp.SymbolicModel([], ["a*u", "b*u + c", "exp(u)"], {}, {"u": "1"}, dict.fromkeys("abcd", "1"))
    assert static.blocks == (("a",), ("b", "c")) and static.idle == ("d",)
    assert static.reaches["c"] == ("y_2",)


def test_reaching_is_having_a_sensitivity() -> None:
    """Structure against numbers: where a parameter does not reach, the sensitivity is exactly zero, and elsewhere it is not."""
    points = random_points(np.random.default_rng(0), 200)
    s = fp.sensitivities(MODEL, points, MODEL.nominal).dy_dtheta
    outputs = [quantity.name for quantity in MODEL.outputs]
    for j, name in enumerate(NAMES):
        assert [outputs[m] for m in np.flatnonzero(np.abs(s[:, :, j]).max(axis=0))] == list(MODEL.reaches[name])


def test_a_null_direction_is_named_with_its_block() -> None:
    found = fp.identifiability(
        model(["-k*a", "-m*n*b"], ["a", "b"], "k m n"), fp.GaussianPrior(*[dict.fromkeys("kmn", v) for v in (1.0, 0.1)])
    )
    assert found.blocks == (("k",), ("m", "n")) and len(found.null_directions) == 1
    text = str(found)
    assert "(block 2)" in text and "block 1   k\n" in text and "block 2   m, n" in text


def test_many_blocks_are_printed_one_in_a_line() -> None:
    names = [f"time_constant_{i}" for i in range(9)]
    states = [f"x{i}" for i in range(9)]
    lines = str(
        fp.SymbolicModel(
            [f"-{x}/{k}" for x, k in zip(states, names, strict=True)],
            states,
            dict.fromkeys(states, "1"),
            {},
            dict.fromkeys(names, "s"),
        )
    )
    assert "\nblocks      {time_constant_0}\n            {time_constant_1}\n" in lines


def test_blocks_are_printed() -> None:
    text = str(MODEL.symbolic())
    assert "blocks      {a_tau, b_tau, m_q}, {E_oil, p_t, B_v, c_L, V_0A, V_0B}" in text and "idle" not in text
    assert "idle        w" in str(model(["-k*a"], ["a"], "k w"))
