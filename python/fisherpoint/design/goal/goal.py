"""The goal of a design: the criterion with what it needs, over which parameters, beside what, and what to do where it is singular.

Each search takes a `Goal`, or the name of a criterion. What an option of the goal needs stands here: its field with default, words
and key in the TOML file, its check, and which searches cannot have it. What it changes in the criterion, and in the information
that counts, stands in `goal_criterion.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any

from ...basics.checks import as_float, as_sequence, as_std, by_name, check_choice, check_flag, check_name, check_type
from ...basics.options import Key, Options, option, options_of
from ...points.experiments import Experiments
from ...prior.rules import Sobol
from .criterion_table import CRITERIA, CriterionRow
from .over_prior import KINDS, OverPrior

SINGULAR = ("estimable", "error")
"""What is done where not all parameters can be determined: a design for those that can, or an error."""

NO_BOUND = "no bound holds for the condition number, which has no concave form"
NO_PLANTS = "only fisherpoint.exchange and fisherpoint.design_runs look at the plants of the prior"

UNABLE: Mapping[str, Mapping[str, str]] = {
    "sweep": {"confidence": NO_PLANTS},
    "approximate_design": {
        "criterion 'ME'": NO_BOUND,
        "criterion 'E' with over": "the smallest eigenvalue has kinks of its own",
        "confidence": NO_PLANTS,
    },
    "exact_design": {"criterion 'ME'": NO_BOUND, "over": "its bounds are of the prior mean", "confidence": NO_PLANTS},
    "design_pieces": {"confidence": "windows were measured, and can be run"},
}
"""What searches cannot have in a goal, and why; what `exchange` cannot have depends on the problem."""

BY_LOG_DET = {"design_pieces": "windows are picked by log det F of their own information, at the prior mean"}
"""Searches that can have no criterion but log det F, and why."""


@dataclass(frozen=True)
class Goal(Options):
    """What a design is to be good for.

    Parameters
    ----------
    criterion : {"D", "A", "E", "ME", "c", "Ds", "I"}
        log det F; the trace of F^-1; the smallest eigenvalue of F; the ratio of the largest to the smallest; the variance of a
        function of the parameters; log det of the information about some parameters, with the others unknown too; the mean
        variance of a predicted output.
    of : str or sequence of str, optional
        For "c" the function as text, such as ``"a / b"``; for "Ds" names of parameters; for "I" the name of an output.
    conditions : Experiments, optional
        For "I", where the output is predicted.
    scale : mapping of parameter name to float, optional
        For "A", "E" and "ME", what errors of the parameters are compared with, SI units. Default: the prior std.
    over : OverPrior, optional
        An average of the criterion over parameters of the prior instead of its value at the prior mean. Points and runs must be
        valid in every scenario; the time is that of one scenario times their number, and less for more than four.
    prior_information : bool
        Whether the inverse of the prior's covariance counts beside the data. The criterion, the bounds and the standard errors are
        then those of an estimate in which the prior takes part, and fewer points than parameters are enough. A prior that is the
        posterior of previous data counts these once more: give one of the two.
    singular : {"estimable", "error"}
        Where the points, or any points of the region, do not determine all parameters: "estimable" designs for what can be
        determined, by "D", "A", "E" and "ME" of that, and the report names the rest (docs/how_to/singular.md); "error" raises.
    confidence : float, optional
        The share of the plants of the prior that must be able to run the whole design, such as 0.99. Default: 0.99 for runs; for
        points none, where one plant in ten may not be able to run one. 0 requires it of none but the prior mean.

    Raises
    ------
    TypeError, ValueError
        For another criterion, and what it needs and is not given, or is given and not used.
    """

    criterion: str = option(
        "D",
        "criterion",
        Key(
            str,
            "[What the design is to be good for](../how_to/criteria.md): log det F, or another criterion.",
            choices=tuple(CRITERIA),
        ),
    )
    _: KW_ONLY
    of: str | tuple[str, ...] | None = option(
        None,
        "criterion of",
        Key(
            str | list[str],
            'For `"c"` a function of the parameters; for `"Ds"` names of parameters; for `"I"` the name of an output.',
        ),
    )
    conditions: Experiments | None = option(
        None,
        "points at which the criterion predicts",
        Key(str, 'For `"I"`, a CSV file beside this one with the points at which the output is predicted.'),
    )
    scale: Mapping[str, float] | None = option(
        None,
        "scale of the parameters",
        Key(
            dict[str, float],
            'For `"A"`, `"E"` and `"ME"`, what errors of the parameters are compared with, by name.',
            above=0,
        ),
    )
    over: OverPrior | None = option(
        None,
        "over the prior",
        Key(
            str,
            "What is maximised [over the prior](../how_to/over_prior.md), not at its mean alone: the mean of the criterion over"
            " scenarios, the smallest, or the mean of the worst `share` of them.",
            choices=KINDS,
        ),
        shown=lambda over: f"{over.described_with('criterion')}, {over.named_scenarios}",
        scenarios=Key(int, "Number of these scenarios, a power of two; nodes of a Sobol rule.", least=1, default="`8`"),
        share=Key(float, 'Share of the scenarios of `"cvar"`.', above=0, most=1, default="`0.25`"),
    )
    prior_information: bool = option(
        False,
        "prior information",
        Key(
            bool,
            "Whether the [prior's information](../how_to/criteria.md#what-the-prior-knows) counts beside that of the measurements.",
        ),
        shown=lambda _: "counts once beside the data, in the criterion, its bounds and the standard errors",
    )
    singular: str = option(
        "estimable",
        "where parameters are left open",
        Key(
            str,
            "Where points leave some parameters open: a design for [what can be estimated](../how_to/singular.md), or an error.",
            choices=SINGULAR,
        ),
    )
    confidence: float | None = option(
        None,
        "plants that must be able to run it",
        Key(
            float,
            "Share of the plants that the prior allows which must be able to run"
            " [the whole design](../how_to/limits.md#points-that-most-plants-can-run); 0 for the prior mean alone.",
            least=0,
            below=1,
            default="none; of runs `0.99`",
        ),
    )

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        check_choice(self.criterion, tuple(CRITERIA), "criterion")
        if self.of is not None and not isinstance(self.of, str):
            set_field(self, "of", tuple(check_name(one, "of") for one in as_sequence(self.of, "of", "names")))
        if self.conditions is not None:
            check_type(self.conditions, Experiments, "conditions")
        if self.scale is not None:
            set_field(self, "scale", by_name(self.scale, None, "scale", as_std))
        if self.over is not None and not isinstance(self.over, OverPrior):
            raise TypeError(f"over: expected an OverPrior or None, given {type(self.over).__name__}")
        set_field(self, "prior_information", check_flag(self.prior_information, "prior_information"))
        check_choice(self.singular, SINGULAR, "singular")
        if self.confidence is not None:
            set_field(self, "confidence", as_float(self.confidence, "confidence"))
            if not 0 <= self.confidence < 1:
                raise ValueError(f"confidence: expected a share of at least 0 and below 1, given {self.confidence:g}")
        self._check_used()

    def _check_used(self) -> None:
        """Raise where the criterion lacks what it needs, or is given what it does not use."""
        name, row = self.criterion, self.row
        if row.needs and self.of is None:
            raise ValueError(f"of: expected {row.needs} for criterion {name!r}, given none")
        if name == "I" and self.conditions is None:
            raise ValueError("conditions: expected the points at which criterion 'I' predicts, given none")
        for label, used in (("of", row.needs), ("conditions", name == "I"), ("scale", row.scaled)):
            if getattr(self, label) is not None and not used:
                raise ValueError(f"{label}: expected none for criterion {name!r}, given one")

    @classmethod
    def from_table(cls, table: Mapping[str, Any], points: Callable[[str], Experiments]) -> Goal:
        """Return the goal that a table of the TOML file states.

        Parameters
        ----------
        table : mapping of key to value
            What the fields of this class allow.
        points : callable
            Reads the file that `conditions` names.
        """
        given = dict(table)
        scenarios, share, kind = given.pop("scenarios", None), given.pop("share", None), given.pop("over", None)
        if scenarios is not None and kind is None:
            raise ValueError(f"scenarios: expected only with over, given {scenarios}")
        if share is not None and kind != "cvar":
            raise ValueError(f'share: expected only with over = "cvar", given {share:g}')
        if kind is not None:
            options: dict[str, Any] = {} if share is None else {"share": share}
            if scenarios is not None:
                try:
                    options["scenarios"] = Sobol(scenarios)
                except ValueError as error:
                    raise ValueError(str(error).replace("n:", "scenarios:", 1)) from error
            given["over"] = OverPrior(kind, **options)
        if "conditions" in given:
            given["conditions"] = points(given["conditions"])
        return cls(**given)

    @property
    def row(self) -> CriterionRow:
        """Words and kind of the criterion."""
        return CRITERIA[self.criterion]

    @property
    def of_all(self) -> bool:
        """Whether the criterion is of all parameters."""
        return self.row.of_all

    @property
    def requires_all(self) -> bool:
        """Whether it is an error to leave parameters open."""
        return self.singular == "error" and self.of_all

    @property
    def beyond_log_det(self) -> tuple[str, ...]:
        """Names of what it has beside log det F at the prior mean, for searches that can have no more; an option is among them."""
        given = [one.name for one in options_of(Goal) if getattr(self, one.name) != one.default]
        of_all = (name for name in given if name not in ("singular", "confidence"))
        return tuple(f"criterion {self.criterion!r}" if name == "criterion" else name for name in of_all)

    @property
    def share_of_plants(self) -> float | None:
        """The share of the plants that must be able to run the design; None where the prior mean is enough."""
        return self.confidence or None

    # --- Words -----------------------------------------------------------------------------------------------------------

    @property
    def named(self) -> str:
        """The criterion as part of a sentence."""
        return self.row.words if self.of is None else self.row.named.format(of=self._of)

    @property
    def short(self) -> str:
        """The criterion by its letters, and of what it is."""
        return self.criterion if self.of is None else f"{self.criterion} of {self._of}"

    @property
    def _of(self) -> str:
        return self.of if isinstance(self.of, str) else ", ".join(self.of or ())

    @property
    def units(self) -> str:
        """What errors are compared with, as the end of a sentence about the criterion's value; empty where that is no matter."""
        if self.scale is not None:
            return f", with errors in units of {', '.join(f'{size:g} ({name})' for name, size in self.scale.items())}"
        return ", parameters in units of their prior std" if self.row.scaled else ""

    @property
    def objective(self) -> str:
        """What is maximised at one place of the parameters, as part of a sentence."""
        if self.row.log_det:
            return self.named
        return f"{'-' if self.row.minimised else ''}log({self.named})"

    @property
    def maximised(self) -> str:
        """What is maximised, as part of a sentence."""
        return self.objective if self.over is None else self.over.described_with(self.objective)

    @property
    def headline(self) -> str:
        """The end of a headline; nothing for log det F, which is the usual one."""
        return "" if self.criterion == "D" else f"; chosen by criterion {self.criterion}, {self.named}"


def goal_of(given: str | Goal, search: str = "") -> Goal:
    """Return the goal that a search is given: a text is the name of a criterion.

    Raises
    ------
    TypeError
        For something else.
    ValueError
        For a goal that this search cannot have; the message says what it cannot, and why.
    """
    if isinstance(given, str):
        given = Goal(given)
    if not isinstance(given, Goal):
        raise TypeError(f"goal: expected the name of a criterion or a Goal, given {type(given).__name__}")
    unable = {name: why for name, why in UNABLE.get(search, {}).items() if _has(given, name)}
    if search in BY_LOG_DET:
        unable = dict.fromkeys(given.beyond_log_det, BY_LOG_DET[search]) | unable
    for name, why in unable.items():
        raise ValueError(f"goal: expected one without {name} for fisherpoint.{search}, given one with it: {why}")
    return given


def _has(goal: Goal, name: str) -> bool:
    """Whether a goal has what `UNABLE` names."""
    criterion, _, with_over = name.partition(" with ")
    if criterion.startswith("criterion "):
        return criterion == f"criterion {goal.criterion!r}" and (not with_over or goal.over is not None)
    return bool(getattr(goal, name))


def with_default_confidence(goal: Goal, confidence: float) -> Goal:
    """Return the goal with this confidence where it has none."""
    return goal if goal.confidence is not None else replace(goal, confidence=confidence)
