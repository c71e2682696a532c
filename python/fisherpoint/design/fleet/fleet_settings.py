"""What decides the design of a fleet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...basics.checks import as_sequence, check_flag, check_name, check_positive_int, check_type
from ...basics.messages import listed
from ...basics.options import Key, option
from ..goal.goal import Goal
from ..results.settings import MOST

MOST_OF_FLEETS = {"size": 1000, "starts": MOST["starts"], "rounds": 10**4, "n_candidates": MOST["n_candidates"]}


@dataclass(frozen=True, kw_only=True)
class FleetSettings:
    """The arguments of `design_fleet` that decide its result, and their defaults; `n_candidates` is None for the search's own."""

    size: int = option(1, "points, or runs, of each plant", always=True)
    goal: Goal = Goal()
    alike: bool = option(
        False,
        "one design for all",
        Key(bool, "One design for all plants, the best of a single one, which must determine all parameters."),
    )
    starts: int = option(
        2,
        "starts of the search",
        Key(int, "From how many random points of the other plants the search begins.", least=1, most=MOST_OF_FLEETS["starts"]),
        always=True,
    )
    rounds: int = option(
        3, "rounds", Key(int, "How often each plant is designed.", least=1, most=MOST_OF_FLEETS["rounds"]), always=True
    )
    max_iterations: int = option(5, "iterations for a plant, at most", always=True)
    n_candidates: int | None = option(None, "candidates of a draw")
    seed: int = option(0, "seed", always=True)

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        check_type(self.goal, Goal, "goal")
        set_field(self, "alike", check_flag(self.alike, "alike"))
        for name, most in MOST_OF_FLEETS.items():
            if getattr(self, name) is not None or name != "n_candidates":
                set_field(self, name, check_positive_int(getattr(self, name), name, most=most))
        set_field(self, "max_iterations", check_positive_int(self.max_iterations, "max_iterations", most=MOST["max_iterations"]))
        set_field(self, "seed", check_positive_int(self.seed, "seed", 0))


def plant_names(plants: int | Sequence[str]) -> list[str]:
    """Labels of the plants: those given, or numbers from 1 on."""
    if isinstance(plants, int):
        return [str(k + 1) for k in range(check_positive_int(plants, "plants", most=1000))]
    names = [check_name(one, "plants") for one in as_sequence(plants, "plants", "labels as text")]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"plants: expected at least one label, and each once; given {listed(names, 'none')}")
    check_positive_int(len(names), "plants", most=1000)
    return names
