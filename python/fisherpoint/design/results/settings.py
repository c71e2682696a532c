"""What decides the result of the searches for points and for runs: the goal and the options, with defaults and limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import ClassVar, TypedDict, Unpack

import numpy as np

from ...basics.checks import (
    as_float,
    as_positive,
    check_choice,
    check_flag,
    check_positive_int,
    check_type,
)
from ...basics.options import Key, Options, option
from ...information.output_covariance import needs_covariances
from ...information.problem import DesignProblem
from ...show.numbers import number
from ..goal.goal import Goal, with_default_confidence

METHODS = ("paper", "auto")

MOST_ITERATIONS = {"paper": 200, "auto": 800}
"""Iterations of a search by its method, where no other number is given; "auto" ends earlier where nothing gains any more."""
MOST = {
    "starts": 10**6,
    "n_experiments": 10**6,
    "n_candidates": 10**6,
    "max_iterations": 10**9,
    "patience": 10**9,
    "max_redraws": 10**6,
}
MOST_OF_RUNS = {"n_runs": 1000, "n_starts": 10_000, "n_candidates": 10**6}

SEED = Key(int, "Seed of the search; the same seed gives the same design, whatever the number of threads.", least=0)
TIME_LIMIT = Key(
    float, "Stop after this many seconds: a safety net, that makes designs differ. Not allowed in a campaign.", above=0
)


def in_seconds(value: float) -> str:
    return f"{number(value)} s"


def _check_time(settings: ExchangeMethod | RunSettings) -> None:
    if settings.time_limit is not None:
        object.__setattr__(settings, "time_limit", as_positive(settings.time_limit, "time_limit", "number of seconds"))


@dataclass(frozen=True)
class ExchangeMethod(Options):
    """How `exchange` searches for points.

    Parameters
    ----------
    name : {"auto", "paper"}
        "auto" exchanges points from several starts over pools of candidates, at first 200 n_candidates random ones, then in each
        iteration 12 or 24 n_candidates near the points, and moves all numbers together. It ends as "converged" where nothing gains
        any more. "paper" is Algorithm 1 with local candidates: a fraction of the time, and designs that are not as good. Where D is
        "pooled" or "pointwise", and for models of Python functions that cannot be translated, "auto" is "paper".
    starts : int
        Whole searches, the first with the given seed and the others with seeds that follow from it. The best counts; the candidates
        of all bound it, and the report says how many came to one as good. More starts repeat those of fewer.
    patience : int, optional
        Stop after so many iterations in a row without an exchange.
    time_limit : float, optional
        Return within so many seconds what is found by then, a tenth more at most (docs/how_to/time_limits.md); each start. Of a
        sweep, for all sizes.
    references : bool
        Also find what the design is compared with (`Efficiency`).
    max_redraws : int
        For "paper": how often candidates are drawn again where none improves Phi (lines 6 to 12); then the best of them is tried
        all the same.
    screen : bool
        For "paper", where the output covariance is "pooled" or "pointwise": order candidates by their linearized covariances and
        take the rule for the best few only. False takes it for all, as Algorithm 1 is written.
    local : float
        For "paper": candidates near the points of the design that are drawn beside the n_candidates, as a share of these over all
        iterations. They come every fourth time, at least one for each point. 0 for none: Algorithm 1 alone.
    """

    name: str = option("auto", "method of the search")
    _: KW_ONLY
    starts: int = option(
        1,
        "starts",
        Key(
            int,
            "Number of [whole searches](../how_to/workers.md#many-starts); the best one counts.",
            least=1,
            most=MOST["starts"],
        ),
    )
    patience: int | None = option(
        None,
        "ends after iterations without an exchange",
        Key(int, "Stop after this many iterations without an exchange.", least=1, most=MOST["patience"]),
    )
    time_limit: float | None = option(None, "time limit", TIME_LIMIT, shown=in_seconds)
    references: bool = option(True, "compared with random designs and bounds")
    max_redraws: int = option(1, "further draws where no candidate helps, at most")
    screen: bool = option(True, "candidates are ordered by a cheaper rule first")
    local: float = option(
        0.5,
        "candidates near the points, as a share of the others",
        Key(
            float,
            "Number of candidates close to points of the design, as a share of the random ones; 0 for none.",
            least=0,
            most=1,
        ),
    )

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        check_choice(self.name, METHODS, "method")
        if self.patience is not None:
            set_field(self, "patience", check_positive_int(self.patience, "patience", most=MOST["patience"]))
        set_field(self, "starts", check_positive_int(self.starts, "starts", most=MOST["starts"]))
        _check_time(self)
        set_field(self, "references", check_flag(self.references, "references"))
        set_field(self, "max_redraws", check_positive_int(self.max_redraws, "max_redraws", 0, MOST["max_redraws"]))
        set_field(self, "screen", check_flag(self.screen, "screen"))
        set_field(self, "local", as_float(self.local, "local"))
        if not 0 <= self.local <= 1:
            raise ValueError(f"local: expected a share between 0 and 1, given {self.local:g}")


class SearchLimits(TypedDict, total=False):
    """Options of a method that a search takes as its own arguments too."""

    starts: int
    time_limit: float | None


def method_of(given: str | ExchangeMethod, **limits: Unpack[SearchLimits]) -> ExchangeMethod:
    """Return the method that a search is given, with its limits: a text is its name."""
    if isinstance(given, str):
        return ExchangeMethod(given, **limits)
    if not isinstance(given, ExchangeMethod):
        raise TypeError(f"method: expected 'paper', 'auto' or an ExchangeMethod, given {type(given).__name__}")
    return replace(given, **limits)


@dataclass(frozen=True, kw_only=True)
class ExchangeSettings:
    """The arguments of `exchange` that decide its result, and their defaults; without `max_iterations` it is that of the method."""

    n_experiments: int = option(
        12, "points", Key(int, "Number of points of the design.", least=1, most=MOST["n_experiments"]), always=True
    )
    goal: Goal = Goal()
    method: ExchangeMethod = option(
        ExchangeMethod(),
        "",
        Key(
            str,
            'The [search](../explanation/search.md): `"auto"`, or the faster `"paper"`, which is Algorithm 1 with moves of points'
            " and gets less close to the best design.",
            choices=METHODS,
            default='`"auto"`',
        ),
    )
    n_candidates: int = option(
        50,
        "candidates of a draw",
        Key(
            int,
            'Random candidates per iteration; `"auto"` has 200 times as many in its pool. Of runs, random runs to begin with.',
            least=1,
            most=MOST["n_candidates"],
            default="`50`, of runs `500`",
        ),
    )
    max_iterations: int = option(
        None,  # a number once there is a method
        "iterations, at most",
        Key(
            int,
            "Largest number of iterations.",
            least=1,
            most=MOST["max_iterations"],
            default=f'`{MOST_ITERATIONS["auto"]}`, with the search `"paper"` `{MOST_ITERATIONS["paper"]}`',
        ),
    )
    seed: int = option(0, "seed", SEED, always=True)

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        check_type(self.goal, Goal, "goal")
        check_type(self.method, ExchangeMethod, "method")
        if self.max_iterations is None:
            set_field(self, "max_iterations", MOST_ITERATIONS[self.method.name])
        for name, least in (("n_experiments", 1), ("n_candidates", 1), ("max_iterations", 0)):
            set_field(self, name, check_positive_int(getattr(self, name), name, least, MOST[name]))
        set_field(self, "seed", check_positive_int(self.seed, "seed", 0))


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """The arguments of `design_runs` that decide its result, and their defaults; keys that `exchange` has not are in [runs]."""

    n_runs: int = option(1, "runs", Key(int, "Number of runs of a design.", least=1, most=MOST_OF_RUNS["n_runs"]), always=True)
    goal: Goal = Goal()
    n_starts: int = option(
        8,
        "starts of the search",
        Key(
            int,
            "How often the search begins anew, from random runs or classical ones. Sets its work.",
            least=1,
            most=MOST_OF_RUNS["n_starts"],
        ),
        always=True,
    )
    n_candidates: int = option(500, "random runs to begin with")
    seed: int = option(0, "seed", SEED, always=True)
    time_limit: float | None = option(None, "time limit", TIME_LIMIT, shown=in_seconds)

    CONFIDENCE: ClassVar[float] = 0.99
    """Confidence where a goal has none."""

    RACING: ClassVar[int] = 12
    """Starts that race with each other; more are several searches."""

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        check_type(self.goal, Goal, "goal")
        set_field(self, "goal", with_default_confidence(self.goal, self.CONFIDENCE))
        for name, most in MOST_OF_RUNS.items():
            set_field(self, name, check_positive_int(getattr(self, name), name, most=most))
        set_field(self, "seed", check_positive_int(self.seed, "seed", 0))
        _check_time(self)


def seeds_of(seed: int, starts: int) -> Sequence[int]:
    """The seeds of so many searches: the given one, and those that follow from it; they differ from each other by spawning."""
    others = np.random.SeedSequence(seed).spawn(starts - 1)
    return [seed, *(int.from_bytes(other.generate_state(4).tobytes(), "little") for other in others)]


def searched_by(method: str, problem: DesignProblem) -> str:
    """The method of a search: "auto" is that of the paper where D needs every point's covariance, or trajectories cost much."""
    costly = needs_covariances(str(problem.output_covariance)) or not problem.model.in_core
    return "paper" if costly else method


def most_iterations(given: int | None, method: ExchangeMethod, problem: DesignProblem) -> int:
    """The largest number of iterations that is given, or that of the method."""
    return MOST_ITERATIONS[searched_by(method.name, problem)] if given is None else given


def check_goal(settings: ExchangeSettings, problem: DesignProblem) -> None:
    """Raise where the search for a problem cannot have the goal: "paper", and other D than R, maximise log det F at the mean."""
    goal, kind, method = settings.goal, str(problem.output_covariance), settings.method.name
    by_auto = searched_by(method, problem) == "auto"
    unable = () if by_auto and kind == "noise" else goal.beyond_log_det
    if goal.share_of_plants is not None and not by_auto:
        unable = ("confidence", *unable)
    if unable:
        name, covariances = unable[0], '"noise" or "region"' if unable[0] == "confidence" else '"noise"'
        raise ValueError(
            f'{name}: expected method = "auto", output_covariance = {covariances} and a model of equations, '
            f"given method {method!r}, output_covariance {kind!r} and a {type(problem.model).__name__}"
        )
