"""Local parameters: with one value for each run, record, plant or day, where others have one for all data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..basics.checks import as_std, by_name, check_name
from ..basics.options import Options
from ..basics.values import FrozenMapping
from ..show.numbers import number

RUN, RECORD = "run", "record"
"""What each point or run and each record, or each record alone, has its own value of; other words are names of labels."""

ESTIMATED = "estimated"


@dataclass(frozen=True)
class Local(Options):
    """Whose a local parameter is, and how far its values spread.

    Parameters
    ----------
    by : str
        "run": each point, run and record has its own value. "record": each record has. Another word names labels of the data, as
        "plant" or "day": all that have the same label share a value.
    spread : float or "estimated", optional
        Standard deviation between the values, SI units, about the parameter's mean: that of the prior, or its start. It is
        information, of which runs that say little take more. With "estimated" the mean and the spread are estimated, too. Default:
        nothing is known of how far they spread, and each value is estimated by itself.

    Raises
    ------
    TypeError, ValueError
        For what is no word, and a spread that is not positive.
    """

    by: str
    spread: float | str | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        check_name(self.by, "by")
        if isinstance(self.spread, str):
            if self.spread != ESTIMATED:
                raise ValueError(f"spread: expected a standard deviation, 'estimated' or None, given {self.spread!r}")
        elif self.spread is not None:
            object.__setattr__(self, "spread", as_std(self.spread, "spread"))

    @property
    def std(self) -> float | None:
        """The spread where it is a number."""
        return None if self.spread is None or isinstance(self.spread, str) else self.spread

    @property
    def words(self) -> str:
        """Whose it is, and how far it spreads: "of each run, spread 0.1"."""
        spread = "" if self.spread is None else ", spread estimated" if self.std is None else f", spread {number(self.std)}"
        return f"of each {self.by}{spread}"

    @property
    def estimated(self) -> bool:
        """Whether the spread is to be estimated."""
        return self.spread == ESTIMATED


class LocalStds(NamedTuple):
    """Standard deviations of local parameters in a design, which is of one plant and one day, and of runs that are each new.

    Attributes
    ----------
    anew, free : mapping of name to float
        Of what each point or run has its own value of: spreads, and, where there is none, those of the prior, which do not count as
        information.
    whole, open : mapping of name to float
        Of what all of the design shares, in the same way.
    """

    anew: Mapping[str, float]
    free: Mapping[str, float]
    whole: Mapping[str, float]
    open: Mapping[str, float]

    @classmethod
    def of(cls, local: Mapping[str, Local], prior_std: Mapping[str, float]) -> LocalStds:
        found = [dict[str, float]() for _ in range(4)]
        for name, one in local.items():
            kind = (0 if one.by in (RUN, RECORD) else 2) + (one.std is None)
            found[kind][name] = prior_std[name] if one.std is None else one.std
        return cls(*map(FrozenMapping, found))


def checked_local(given: Any, known: Iterable[str] | None = None) -> FrozenMapping[Local]:
    """Local parameters by name; a word stands for `Local` without a spread."""

    def one(value: Any, name: str) -> Local:
        if isinstance(value, Local):
            return value
        if not isinstance(value, str):
            raise TypeError(f'{name}: expected "run", "record", a name of labels, or a Local, given {type(value).__name__}')
        return Local(value)

    return by_name(given, known, "local", one)


def check_local(
    local: Mapping[str, Local],
    known: tuple[str, ...],
    common: tuple[str, ...],
    others: Mapping[str, Mapping[str, Any] | None],
) -> None:
    """Raise for local parameters that the model does not have, or that are something else too.

    Parameters
    ----------
    local : mapping of name to Local
    known, common : tuple of str
        The model's parameters, and those of them that all data share and that are estimated.
    others : mapping of label to mapping, or None
        What else names parameters.
    """
    checked_local(local, known)
    for label, given in others.items():
        for name in (name for name in given or () if name in local):
            raise ValueError(f"local: expected parameters that are not in {label}, given {name!r}, which is")
    for name in (name for name in common if name in local):
        raise ValueError(f"parameters: expected those that all data share, given {name!r}, which is local")
    if local and not common:
        raise ValueError(f"local: expected a parameter that all data share beside local ones, given none but {', '.join(local)}")
