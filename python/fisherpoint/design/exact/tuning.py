"""The numbers that steer the search for counts."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ExactTuning:
    """The best counts of candidates (exact_search.py, branch_and_bound.py, relaxation.py, symmetries.py)."""

    # Weights and exchange.
    weights_tolerance: float = 1e-6
    """Tolerance of the best weights, where the bounds begin."""

    exchanged_candidates: int = 2000
    """Number of candidates with the largest sensitivity that points are exchanged over."""

    starts: int = 6
    """Number of designs, with a random half, from which the exchange begins."""

    most_left: int = 50_000
    """Number of candidates above which there is no branch and bound."""

    # Branch and bound.
    most_grouped: int = 1000
    """Number of candidates up to which groups of similar ones are formed from all distances; their table grows with the square."""

    tight_share: float = 0.6
    """Size of a group as a share of the distance to the next one, up to which it is parted as one."""

    relaxed_tolerance: float = 0.02
    """Tolerance of the relaxed problem, as a share of the distance from the best design."""

    nodes_per_report: int = 50
    """Number of nodes between reports of progress."""

    # Symmetries.
    most_symmetric_candidates: int = 300
    """Number of candidates up to which symmetries are looked for."""

    most_permutations: int = 2000
    """Maximum number of symmetries."""

    most_symmetry_tries: int = 100_000
    """Maximum number of tries."""

    # The relaxed problem.
    working_candidates: int = 120
    """Number of candidates that the interior point method is given at first, and that follow in each round."""

    working_rounds: int = 4
    """Maximum number of rounds; the bound is over all candidates."""

    relaxed_steps: int = 40
    """Maximum number of Newton steps of a round."""

    boundary_share: float = 0.99
    """Share of the way to the boundary that a step may go."""

    shrinking: float = 0.1
    """Factor of mu in each step."""

    middle_share: float = 0.3
    """Share of the way from the previous node's solution to the middle, so that the first point is well inside the bounds."""

    smoothing: tuple[float, float] = (1e-6, 1e-2)
    """Least and largest smoothing of kinks, as a share."""

    ridges: tuple[float, ...] = (0.0, 1e-12, 1e-9, 1e-6)
    """Shares of the mean eigenvalue that are added to a singular matrix for a derivative."""

    group_widening: float = 1e-7
    """Amount by which the bounds of groups are widened, as the least and the most may be equal."""
