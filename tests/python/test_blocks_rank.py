"""Blocks of random models against ranks of sensitivities, and against every other way to part the parameters."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
import pytest
import sympy

import fisherpoint as fp
from fisherpoint.models.eliminated import eliminated
from fisherpoint.models.tape.defined import value_of

NAMES = ["k1", "k2", "k3", "k4", "k5", "k6"]
FACTORS = [
    "{0}",
    "{0}*{1}",
    "({0} + {1})",
    "{0}*{1}*{2}",
    "({0} + {1}*{2})",
    "{0}**2",
    "exp({0}*{x})",
    "1/({0} + {x}**2)",
    "1",
    "2",
]
SIGNALS = ["{x}", "{z}", "{x}*{z}", "u", "1", "sin({x})", "{x}**2", "{x}*u"]
BRANCHES = ["max({x}, 0)", "where(u > 0, {x}, {z})", "sign({x})"]


def random_model(seed: int, smooth: bool = False) -> fp.SymbolicModel:
    """One to four states; terms are drawn anew or taken again, so that equations share parameters and sums of terms.

    A smooth one has no branches, and measures all states.
    """
    rng = np.random.default_rng(seed)
    states = list("abcd"[: rng.integers(1, 5)])
    atoms = NAMES if rng.random() < 0.4 else ["(k1*k2)", "(k3 + k4)", "k5", "k6"]  # of the others no experiment parts all
    signals = SIGNALS + ([] if smooth else BRANCHES)

    def one_of(values: list[str]) -> str:
        return values[rng.integers(len(values))]

    def term() -> str:
        x, z = one_of(states), one_of(states)
        factor = one_of(FACTORS).format(*rng.choice(atoms, 3, replace=False), x=x)
        return f"{factor}*{one_of(signals).format(x=x, z=z)}"

    common = [" + ".join(term() for _ in range(rng.integers(1, 3))) for _ in range(len(states))]

    def rate() -> str:
        if rng.random() < 0.5:  # of shared quantities, each with a known lever
            levers = [one_of(["1", "2", "-1", "u", "(1 + a**2)", "0"]) for _ in common]
            return " + ".join(f"{lever}*({of})" for lever, of in zip(levers, common, strict=True)) + f" - {states[0]}"
        return " + ".join([f"-{one_of(states)}", *(term() for _ in range(rng.integers(0, 3)))])

    def output() -> str:
        return one_of(["{x}", "{x}", "{x} + {z}", "2*{x} - {z}", "{x}**2 + {z}", "{x}*{z}", "{x}*(2 + u)"]).format(
            x=one_of(states), z=one_of(states)
        )

    g = states if smooth or rng.random() < 0.4 else [output() for _ in range(rng.integers(1, len(states) + 2))]
    return fp.SymbolicModel([rate() for _ in states], g, dict.fromkeys(states, "1"), {"u": "1"}, dict.fromkeys(NAMES, "1"))


def rank(rows: Any) -> int:
    """Of a matrix whose columns are brought to length 1."""
    length = np.linalg.norm(rows, axis=0)
    alive = length > 1e-9 * length.max(initial=1e-300)
    values = np.linalg.svd(rows[:, alive] / length[alive], compute_uv=False)
    return int((values > 1e-7 * values.max(initial=0.0)).sum())


def sensitivities(model: fp.SymbolicModel, seed: int) -> Any:
    """Rows of all outputs at many points at one theta, as those of a dense experiment."""
    rng, count = np.random.default_rng(seed), 100
    points = fp.Experiments(
        rng.uniform(-1.5, 1.5, (count, len(model.states))), rng.uniform(-2, 2, (count, 1)), rng.uniform(0.02, 0.3, count)
    )
    theta = dict(zip(NAMES, rng.uniform(0.4, 1.6, len(NAMES)), strict=True))
    found = fp.sensitivities(model, points, theta, rtol=1e-10)
    rows = found.dy_dtheta[
        (found.status == 0) & (np.abs(found.dy_dtheta).max(axis=(1, 2)) < 100)
    ]  # some models grow without bounds
    return rows.reshape(-1, len(NAMES)) if len(rows) >= 50 else None


@pytest.mark.long
def test_what_outputs_leave_open_is_open_within_blocks() -> None:
    """The rank of the sensitivities is the sum of those of the blocks, also where parameters cannot be identified."""
    open_ones = parted = 0
    for seed in range(150):
        model = random_model(seed)
        rows = sensitivities(model, seed)
        if rows is None:
            continue
        columns = [[NAMES.index(name) for name in block] for block in model.blocks]
        assert sorted((*(name for block in model.blocks for name in block), *model.idle)) == NAMES
        whole = rank(rows)
        assert whole == sum(rank(rows[:, block]) for block in columns), (seed, model.blocks)
        open_ones += whole < sum(map(len, columns)) and len(columns) > 1
        parted += len(columns) > 1
    assert open_ones > 20 and parted > 30


def jacobians(model: fp.SymbolicModel, seed: int) -> Iterator[Any]:
    """Of all rates by all parameters at random states, by SymPy."""
    symbols = [*model.equations.states, *model.equations.inputs, *model.equations.parameters]
    rates = sympy.Matrix([value_of(rate) for rate in model.equations.rates])
    slopes = sympy.lambdify(symbols, rates.jacobian(list(model.equations.parameters)), "numpy")
    rng = np.random.default_rng(seed)
    for _ in range(6):
        yield np.array(slopes(*rng.uniform(0.4, 1.6, len(symbols))), dtype=float)


def test_where_all_states_are_measured_blocks_are_the_finest_that_hold_at_every_instant() -> None:
    """At each instant ranks add up over blocks; over the two parts of a block, however it is cut, they do not at some instant."""
    cut = 0
    for seed in range(1000, 1080):
        measured = random_model(seed, smooth=True)
        at = list(jacobians(measured, seed))
        blocks = [[NAMES.index(name) for name in block] for block in measured.blocks]
        everything = [column for block in blocks for column in block]
        assert all(rank(j[:, everything]) == sum(rank(j[:, block]) for block in blocks) for j in at), (seed, measured.blocks)
        for block in blocks:
            for size in range(1, len(block)):
                for part in map(list, combinations(block, size)):
                    rest = [column for column in block if column not in part]
                    assert any(rank(j[:, part]) + rank(j[:, rest]) > rank(j[:, block]) for j in at), (seed, part, rest)
                    cut += 1
    assert cut > 100


def test_rates_of_a_body_part_what_acts_through_single_forces() -> None:
    """Two springs with forces of their own: two equations of full rank part them, one cannot, nor two that are the same."""
    x, parameters = {"q": "1", "v": "1", "phi": "1", "w": "1"}, dict.fromkeys(["k", "d", "m", "n"], "1")

    def body(rates: list[str], g: list[str]) -> tuple[tuple[str, ...], ...]:
        return fp.SymbolicModel(
            rates, g, x, {"u": "1"}, parameters, definitions={"left": "k*q + d*v", "right": "m*sin(phi) + n*u*w"}
        ).blocks

    both = ["v", "-left - right + u", "w", "0.3*left - 0.2*right"]
    assert body(both, ["q", "phi"]) == (("k", "d"), ("m", "n"))
    assert body(both, ["q + phi", "q - 2*phi"]) == (("k", "d"), ("m", "n"))
    assert body(both, ["q*phi", "q + phi**2"]) == (("k", "d"), ("m", "n"))
    assert body(both, ["q + phi", "2*q + 2*phi"]) == (("k", "d", "m", "n"),)
    assert body(both, ["q + phi", "(q + phi)**2"]) == (("k", "d", "m", "n"),)
    same = ["v", "-left - right + u", "w", "0.3*left + 0.3*right"]
    assert body(same, ["q", "phi"]) == (("k", "d", "m", "n"),)
    one = ["v", "-left - right + u", "w", "-phi"]
    assert body(one, ["q", "phi"]) == (("k", "d", "m", "n"),)


def platform(arms: list[tuple[float, float, float, float]], *unknown: str) -> fp.SymbolicModel:
    """A plate on three legs in a plane, whose lengths are measured; each leg has friction and viscous drag of its own."""
    m_ = fp.math
    constants = {"m": (2.0, "1"), "J": (0.5, "1")}
    parameters = {f"{kind}_{i}": "1" for i in range(3) for kind in "fd"}
    states = dict.fromkeys(["x", "y", "phi", "v_x", "v_y", "w"], "1")

    @fp.model(
        states=states,
        inputs={"u0": "1", "u1": "1", "u2": "1"},
        parameters=parameters,
        outputs={f"q{i}": "1" for i in range(3)},
        constants=constants,
    )
    def plate(s: Any, u: Any, p: Any) -> Any:
        force_x = force_y = moment = 0.0
        lengths = []
        for i, (base_x, base_y, a, b) in enumerate(arms):
            arm_x, arm_y = a * m_.cos(s.phi) - b * m_.sin(s.phi), a * m_.sin(s.phi) + b * m_.cos(s.phi)
            leg_x, leg_y = s.x + arm_x - base_x, s.y + arm_y - base_y
            length = m_.sqrt(leg_x**2 + leg_y**2)
            rate = (leg_x * (s.v_x - s.w * arm_y) + leg_y * (s.v_y + s.w * arm_x)) / length
            pull = getattr(u, f"u{i}") - getattr(p, f"f_{i}") * m_.sign(rate) - getattr(p, f"d_{i}") * rate
            force_x, force_y = force_x + pull * leg_x / length, force_y + pull * leg_y / length
            moment = moment + pull * (arm_x * leg_y - arm_y * leg_x) / length
            lengths.append(length)
        return [s.v_x, s.v_y, s.w, force_x / p.m, force_y / p.m - 9.81, moment / p.J], lengths

    return plate.estimate(*unknown) if unknown else plate


LEGS = ("f_0", "d_0"), ("f_1", "d_1"), ("f_2", "d_2")


def test_lengths_of_legs_give_the_pose_and_part_the_legs() -> None:
    """Nothing is measured but three lengths: they fix the pose, their rates the velocities, accelerations the three pulls."""
    arms = [(-1.0, 0.0, -0.5, 0.1), (0.2, -0.1, 0.0, -0.2), (1.0, 0.1, 0.5, 0.0)]
    assert platform(arms).blocks == LEGS
    assert platform(arms, "m").blocks == ((*LEGS[0], *LEGS[1], *LEGS[2], "m"),)
    point = [(-1.0, 0.0, 0.0, 0.0), (0.2, -0.1, 0.0, 0.0), (1.0, 0.1, 0.0, 0.0)]  # all legs on one joint: it may turn unseen
    assert platform(point).blocks == ((*LEGS[0], *LEGS[1], *LEGS[2]),)


def test_sums_of_measured_flows_part_tanks() -> None:
    """Flows out of two tanks, whose sums are measured beside the levels, and a level that shows in their sum alone."""
    f = ["u - k*sqrt(a) - m*a", "k*sqrt(a) - n*sqrt(b)"]
    states, parameters = {"a": "1", "b": "1"}, dict.fromkeys(["k", "m", "n"], "1")

    def tanks(*g: str) -> tuple[tuple[str, ...], ...]:
        return fp.SymbolicModel(f, list(g), states, {"u": "1"}, parameters).blocks

    assert tanks("a", "b") == (("k", "m", "n"),)
    assert tanks("a", "b", "k*sqrt(a) + n*sqrt(b)") == (("k",), ("m",), ("n",))
    assert tanks("a + b", "a - b", "k*sqrt(a) + n*sqrt(b)") == (("k",), ("m",), ("n",))
    assert tanks("a + b", "k*sqrt(a) + n*sqrt(b)") == (("k", "m", "n"),)


def test_conversion_and_temperature_of_a_reactor_part_kinetics_from_cooling() -> None:
    rate = "k*exp(-e/T)*c"
    f, states = [f"u - {rate}", f"h*{rate} - l*(T - s)"], {"c": "1", "T": ("1", 300.0)}
    parameters = dict.fromkeys(["k", "e", "h", "l", "s"], "1")

    def reactor(f: list[str]) -> tuple[tuple[str, ...], ...]:
        return fp.SymbolicModel(f, ["c", "T"], states, {"u": "1"}, parameters).blocks

    assert reactor(f) == (("k", "e"), ("h", "l", "s"))  # conversion gives the rate of reaction at every instant
    assert reactor([f"u - {rate} - s*c", f[1]]) == (("k", "e", "h", "l", "s"),)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e7])
def test_blocks_do_not_hang_on_units(scale: float) -> None:
    """The same equations with states and parameters in other units."""
    f = [f"{scale}*(u - k*a/{scale} - m*b)", "k*a/7e7 - n*b + b*j", "j*b"]
    states = {"a": ("1", scale), "b": "1", "c": "1"}
    found = fp.SymbolicModel(f, ["a + c", f"a*3 - {scale}*b", "c"], states, {"u": "1"}, dict.fromkeys(["k", "m", "n", "j"], "1"))
    assert found.blocks == (("k", "m", "n"), ("j",))


def test_what_saturates_or_underflows_is_not_taken_for_nothing() -> None:
    """Far out a tanh has no slope that doubles show, and an exponential none at all; the parameters stay connected."""
    nominal = {"f": 400.0, "d": 1500.0, "v_s": 1e-3}
    parameters = dict.fromkeys(nominal, "1")
    slip = fp.SymbolicModel(["u - f*tanh(v/v_s) - d*v"], ["v"], {"v": "1"}, {"u": "1"}, parameters, nominal=nominal)
    assert slip.blocks == (("f", "d", "v_s"),)
    f = ["u - f*tanh(v/v_s)", "-d*w"]
    assert fp.SymbolicModel(f, ["v", "w"], {"v": "1", "w": "1"}, {"u": "1"}, parameters, nominal=nominal).blocks == (
        ("f", "v_s"),
        ("d",),
    )
    for scale in (1.0, 1e3, 1e7):
        rate = fp.SymbolicModel(["-k*exp(-e*a)", "-m*b"], ["a", "b"], {"a": ("1", scale), "b": "1"}, {}, dict.fromkeys("kem", "1"))
        assert rate.blocks == (("k", "e"), ("m",))
        gate = fp.SymbolicModel(["-k/(1 + exp(e*(a - h)))"], ["a"], {"a": ("1", scale)}, {}, dict.fromkeys("keh", "1"))
        assert gate.blocks == (("k", "e", "h"),)


def test_numbers_of_which_no_sum_is_exact_count_as_they_are_meant() -> None:
    """0.1 and 0.3 beside 0.2 and 0.6 are one equation twice, though 0.3/0.1 is not 3."""
    matrix = np.array([[0.1, 0.3], [0.2, 0.6]], complex)
    off = matrix * (1 + 1e-12 * np.array([[0.3, -1.2], [0.7, 0.4]]))
    found = eliminated(matrix[None], off[None])
    assert found is not None and not found.determined.any() and found.connected[0, 1]
    assert eliminated(np.full((3, 1, 1), np.nan, complex), np.ones((3, 1, 1), complex)) is None


def test_a_matrix_that_is_no_more_than_rounding_away_from_singular_has_no_answer() -> None:
    """Where zero cannot be distinguished from rounding, an equation connects all that it reads."""
    h = 1.0 / (np.arange(14)[:, None] + np.arange(14) + 1.0)
    off = h * (1 + 1e-12 * np.random.default_rng(0).standard_normal(h.shape))
    assert eliminated(np.array([h], complex), np.array([off], complex)) is None
    f = [" + ".join(f"{float(h[i, j])!r}*p{j}" for j in range(14)) for i in range(14)]
    names = [f"x{i}" for i in range(14)]
    found = fp.SymbolicModel(f, names, dict.fromkeys(names, "1"), {}, {f"p{j}": "1" for j in range(14)})
    assert len(found.blocks) == 1
