"""Identifiability where models jump: thresholds, which sensitivities between jumps do not see."""

from __future__ import annotations

import pytest

import fisherpoint as fp
from conftest import REGION
from defaults import MODEL, PRIOR


def thermostat(f: str, **nominal: float) -> fp.SymbolicModel:
    return fp.SymbolicModel([f], ["T"], {"T": "K"}, {"T_a": "K"}, dict.fromkeys(nominal, "1"), {"y": "K"}, nominal=nominal)


ROOM = fp.ExperimentRegion({"T": (15.0, 45.0), "T_a": (5.0, 15.0), "dt": (1.0, 10.0)})
HEATED = {"k": 0.1, "h": 3.0, "T_s": 30.0}
NESTED = "h*where(T - 100*sign(T - T_s) > 0, 1, 0)"
"""The heater's switch by a condition that reads another one."""


def test_a_threshold_shows_where_trajectories_cross_it_or_slide_along_it() -> None:
    model = thermostat("-k*(T - T_a) + h*heaviside(T_s - T)", **HEATED)
    for unknown_start in ([], ["T"]):
        found = fp.identifiability(model, region=ROOM, unknown_start=unknown_start)
        assert found.identifiable and found.rank == 3 and "met_jump" not in found.left_out
    cold = fp.ExperimentRegion({"T": (5.0, 6.0), "T_a": (5.0, 15.0), "dt": (0.1, 1.0)})  # of which no point meets it
    found = fp.identifiability(model, region=cold)
    assert found.identifiable is False and found.null_directions == ("T_s: no output changes with it",)


def test_what_leaves_the_equations_as_they_are_is_null_whatever_meets_a_jump() -> None:
    """Gain and power are one number on both sides of it."""
    found = fp.identifiability(thermostat("-k*(T - T_a) + g*h*heaviside(T_s - T)", g=2.0, **HEATED), region=ROOM)
    assert found.identifiable is False and found.rank == 3 and found.not_known == ()
    assert len(found.null_directions) == 1 and "only g*h can be identified" in found.null_directions[0]
    # The same where one jump is read by the condition of another, and cannot be crossed.
    found = fp.identifiability(thermostat(f"-k*(T - T_a) + g*{NESTED}", g=2.0, **HEATED), region=ROOM)
    assert found.identifiable is False and len(found.null_directions) == 1
    assert "only g*h can be identified" in found.null_directions[0]
    assert len(found.not_known) == 1 and found.not_known[0].startswith("T_s: not known: ")
    assert "locally not identifiable: rank at least 2 of 4 parameters" in str(found)


def test_a_threshold_that_cannot_be_crossed_is_not_known() -> None:
    """Every trajectory that tells it meets the jump, and is left out."""
    model = thermostat(f"-k*(T - T_a) + {NESTED}", **HEATED)
    found = fp.identifiability(model, region=ROOM)
    count = found.left_out["met_jump"]
    assert found.identifiable is None and found.rank == 2 and found.null_directions == () and count > 20
    assert found.not_known == (f"T_s: not known: {count} points that meet a jump were left out (met_jump)",)
    assert "not known whether locally identifiable: rank at least 2 of 3 parameters" in str(found)
    assert found.not_known[0] in str(found)


def test_a_time_at_which_a_jump_is_crossed_tells_what_moves_it() -> None:
    """a moves z alone, which turns y on."""
    model = fp.SymbolicModel(
        ["a", "heaviside(z - 1)"], ["y"], {"z": "1", "y": "1"}, {}, {"a": "1"}, {"seen": "1"}, nominal={"a": 0.5}
    )
    region = fp.ExperimentRegion({"z": (0.0, 2.0), "y": (0.0, 1.0), "dt": (0.1, 4.0)})
    found = fp.identifiability(model, region=region)
    assert found.identifiable and found.rank == 1


@pytest.mark.parametrize("unknown_start", [[], ["p_A"]])
def test_points_may_start_at_rest(unknown_start: list[str]) -> None:
    """On the jump at v = 0 and the kink at x_v = 0; a start v that is not known is on either side of the jump."""
    rest = fp.ExperimentRegion(REGION | {"v": (0.0, 0.0), "x_v": (0.0, 0.0)})
    found = fp.identifiability(MODEL, PRIOR, rest, n_theta=2, unknown_start=unknown_start)
    assert found.identifiable and "starts on a surface" not in found.left_out
    with pytest.raises(ValueError, match=r"region: expected valid points, given \d+ of 2000 drawn \(\d+ on_jump"):
        fp.identifiability(MODEL, PRIOR, rest, unknown_start=["v"])


@pytest.mark.parametrize(
    ("f", "g", "why"),
    [
        (["a", "where(y - 9*sign(z - 1) > 0, 0, 1)"], ["y"], "points that meet a jump were left out"),  # a moves z alone
        (["1", "b"], ["y", "heaviside(z - a)"], "it may change where the model jumps"),
        (["1", "b*heaviside(u - a)"], ["y"], "it may change where the model jumps"),
    ],
)
def test_what_moves_a_jump_alone_is_not_known(f: list[str], g: list[str], why: str) -> None:
    names = {"a": 0.5} | ({"b": 2.0} if "b" in str(f) else {})
    outputs = {"seen": "1", "on": "1"} if len(g) == 2 else {"seen": "1"}
    model = fp.SymbolicModel(f, g, {"z": "1", "y": "1"}, {"u": "1"}, dict.fromkeys(names, "1"), outputs, nominal=names)
    region = fp.ExperimentRegion({"z": (0.0, 2.0), "y": (0.0, 1.0), "u": (0.0, 1.0), "dt": (0.1, 4.0)})
    found = fp.identifiability(model, region=region)
    assert found.identifiable is None and found.rank == len(names) - 1
    assert len(found.not_known) == 1 and found.not_known[0].startswith("a: not known: ") and why in found.not_known[0]


@pytest.mark.filterwarnings("ignore:CallableModel")
def test_functions_that_jump_are_not_known_either() -> None:
    nominal = {"k": 0.1, "s": 30.0}
    model = fp.CallableModel(
        lambda x, u, p: [-p.k * x.T + 4.0 * (p.s > x.T)],
        lambda x, u, p: [x.T],
        {"T": "K"},
        {},
        dict.fromkeys(nominal, "1"),
        jumps={"T - s": lambda x, u, p: x.T - p.s},
        nominal=nominal,
    )
    region = fp.ExperimentRegion({"T": (25.0, 35.0), "dt": (1.0, 2.0)})
    found = fp.identifiability(model, region=region, n_points=6, n_theta=2)
    assert found.identifiable is None and found.not_known[0].startswith("s: not known: ")
