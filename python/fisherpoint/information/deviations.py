"""By how much what is neither known exactly nor estimated deviates, for an estimate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..basics.checks import as_std_or_zero, by_name, names_among
from ..basics.options import Options
from ..prior.rules import Rule
from .local import Local, checked_local


@dataclass(frozen=True, kw_only=True)
class Deviations(Options):
    """Standard deviations of what is neither known exactly nor estimated; those of a problem are `DesignProblem.deviations`.

    Parameters
    ----------
    uncertain : mapping of name to float, optional
        Standard deviations, SI units, of constants, and of parameters that are not estimated, each with one value in all data. They
        are estimated too, with that as what is known beforehand, and stand behind the parameters in the fit.
    varies, initial_state_std : mapping of name to float, optional
        Standard deviations, SI units, of what is drawn anew in each point or run, and of their starts. What they add to the
        covariance of the outputs is taken at the estimate; the samples of a run share the error. Not for records: estimate them
        there.
    shared : sequence of str
        States of `initial_state_std` whose start deviates once, in all points and runs alike; these are estimated too.
    local : mapping of name to str or Local, optional
        Parameters with one value for each run, record, plant or day, instead of one for all data: ``{"m_load": "run"}``, or
        ``{"m_load": fp.Local("run", spread=0.1)}``. They are estimated together with the others, and reported by themselves.
    rule : Rule, optional
        Takes the share of what is drawn anew as a predictive covariance (16), where it is not linear; the default is by tangents,
        which runs need.

    Raises
    ------
    TypeError, ValueError
        For what is no mapping of names to standard deviations, and shared starts that have none.
    """

    uncertain: Mapping[str, float] | None = None
    varies: Mapping[str, float] | None = None
    initial_state_std: Mapping[str, float] | None = None
    shared: Sequence[str] = ()
    local: Mapping[str, str | Local] | None = None
    rule: Rule | None = None

    def __post_init__(self) -> None:
        for label in ("uncertain", "varies", "initial_state_std"):
            given = by_name(getattr(self, label), None, label, as_std_or_zero)
            object.__setattr__(self, label, given or None)
        object.__setattr__(self, "shared", names_among(self.shared, tuple(self.initial_state_std or ()), "shared"))
        object.__setattr__(self, "local", checked_local(self.local) or None)
        if self.rule is not None and not isinstance(self.rule, Rule):
            raise TypeError(f"rule: expected a Rule or None, given {type(self.rule).__name__}")

    @property
    def local_parameters(self) -> Mapping[str, Local]:
        """The local parameters by name; none where there are none."""
        return checked_local(self.local)


EXACT = Deviations()
"""Nothing deviates."""
