"""The parts of a report for a design that does not determine all parameters."""

from __future__ import annotations

from collections.abc import Iterator

from ...information.combinations import combinations
from ...show.numbers import counted, number
from .evaluated_points import EvaluatedPoints
from .found_design import FoundDesign

GUIDE = "docs/how_to/singular.md"


def singular_warning(evaluated: EvaluatedPoints) -> str:
    """What is left open, why, and what would help."""
    evaluation = evaluated.evaluation
    p, rank = len(evaluation.parameters), evaluation.rank
    if not isinstance(evaluated, FoundDesign):
        return (
            f"F is singular: the points determine {rank} of {counted(p, 'parameter')}; what is left open is named above. Add "
            "points, widen the region, or leave parameters out (parameters = [...])."
        )
    sentences = [f"F is singular: the points determine {rank} of {counted(p, 'parameter')}."]
    if evaluated.not_estimable:
        left = combinations(evaluated.not_estimable)
        sentences.append(
            f"No point of the region was found with information on {left} (in prior std): measure other outputs, widen the region, "
            "or leave parameters out (parameters = [...])."
        )
    goal = evaluated.settings.goal
    criterion = goal.criterion
    if evaluated.too_few and goal.of_all:
        numbers = evaluation.n_points * len(evaluation.outputs)
        could = p - len(evaluated.not_estimable)
        if numbers < could:
            sentences.append(
                f"{counted(evaluation.n_points, 'point')} with {counted(len(evaluation.outputs), 'output')} are too few for the "
                f"{could} that points of the region can determine, so that no efficiency is claimed."
            )
        else:
            sentences.append(f"Other points would determine {could}, so that no efficiency is claimed.")
        if criterion != "D":
            sentences.append(f"Until there are enough for criterion {criterion}, points are chosen by log det F.")
    elif goal.of_all:
        sentences.append("The design, its criterion and its efficiency are of the rest.")
    else:
        sentences.append(f"Criterion {criterion} is determined all the same.")
    return f"{' '.join(sentences)} See {GUIDE}."


def ridge_facts(ridge: float, exchanged: bool = True) -> Iterator[tuple[str, str]]:
    """What was added to F while designs of the search were singular; `exchanged` where exchanges add more."""
    if ridge:
        more = ", and in exchanges up to 1e-4 of the candidates' average information" if exchanged else ""
        what = f"{number(ridge)} of the prior's information, to compare designs{more}; no figure here contains it"
        yield "added to F while singular", what
