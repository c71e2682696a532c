"""What candidates can determine of what a criterion asks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...basics.values import Array
from ...information.combinations import combination
from ...information.evaluation import null_direction
from ...information.problem import DesignProblem
from .aims import Aim, LogDet, aim_of
from .candidate_rows import CandidateRows
from .estimable import estimable

NOT_TOLD = 1e-6
"""Share of what is asked that may be outside of what is told, as rounding."""


def told_aims(
    problem: DesignProblem,
    aims: Sequence[Aim],
    rows: Array,
    known: Array,
    count: int,
    named: tuple[str, str] = ("n_experiments", "points"),
) -> tuple[Aim, ...]:
    """What to maximise with `count` points, or runs, of some candidates.

    Criteria of all parameters ask for what these determine alone. log det F is left as it is: singular designs differ in it by what
    they tell, once a little is added to F.

    Parameters
    ----------
    problem : DesignProblem
    aims : sequence of Aim
    rows : ndarray, (S, K, n, p)
        Of candidates in each scenario.
    known : ndarray, (S, p, p)
        Information that is there without them.
    count : int
    named : (str, str)
        What errors call the count, and what is counted.

    Raises
    ------
    ValueError
        Where they do not determine the functions or parameters that are asked for, or so few points cannot.
    """
    (size, kind), result = named, list[Aim]()
    for aim, own, there in zip(aims, rows, known, strict=True):
        if isinstance(aim, LogDet):
            result.append(aim)
            continue
        name, space = aim.criterion.name, estimable(CandidateRows(own, there / count).triangle())
        if not space.rank or aim.criterion.outside(space) > NOT_TOLD:
            left = "; ".join(combination(null_direction(v, space.length, problem.estimated)) for v in space.null)
            raise ValueError(
                f"region: expected {kind} that determine what criterion {name!r} asks, given none that tell about {left}"
            )
        restricted = aim.criterion.restricted(space.span)
        if restricted is aim.criterion:
            result.append(aim)
            continue
        most = count * own.shape[1] + int(np.linalg.matrix_rank(there))
        if most < space.rank:
            raise ValueError(
                f"{size}: expected {kind} enough to determine {space.rank} parameters, all of which criterion {name!r} asks "
                f"for, given {count}, which determine {most} at most"
            )
        result.append(aim_of(restricted) if len(space.null) else aim)
    return tuple(result)
