"""The numbers that steer the search for the weights of given candidates."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WeightsTuning:
    """The best weights of candidates (weights.py, interior.py).

    The gap is what the largest sensitivity of a candidate exceeds 1 by.
    """

    # The working set.
    first_candidates: int = 96
    """Number of candidates of the first working set."""

    most_added: int = 48
    """Maximum number of candidates that a round adds."""

    least_added: int = 6
    """Number of candidates below which a round looks for more to add."""

    looks_for_more: int = 3
    """Maximum number of such looks."""

    most_checked: int = 768
    """Batch size of the validity check when most candidates fail it."""

    alike_share_of_gap: float = 0.1
    """Relative difference of information matrices up to which one stands for the other, as a share of the gap, for "D"."""

    most_alike: float = 0.01
    """Largest such difference. Weights of many copies are not unique, and the interior point method ends far from the optimum."""

    same: float = 1e-9
    """Least such difference; for other criteria than "D", whose optimum may be singular, the only one."""

    large_working_set: int = 128
    """Number of candidates above which those that hardly count leave the working set."""

    regular: float = 1e-6
    """Smallest eigenvalue that the mean of a working set must have, where the mean of all candidates is the identity."""

    # Rounds.
    near_candidates: int = 4096
    """Number of candidates with the largest sensitivity that are evaluated alone."""

    much_closer: float = 0.3
    """Share of the gap of all candidates that these may leave before all are evaluated again."""

    compact_share: float = 0.3
    """Share of the candidates below which the array is compacted; scanning all is cheaper than copying oftener."""

    searched_share: float = 0.8
    """Share of the tolerance to which the weights are searched."""

    most_rounds: int = 300
    """Maximum number of rounds."""

    most_idle_rounds: int = 12
    """Number of rounds in a row in which the gap does not fall by a tenth, after which double precision has no more."""

    # Few weights at the end.
    dropped_share: float = 0.1
    """Share of the tolerance that may be lost where candidates that hardly count are dropped."""

    least_weights: tuple[float, ...] = (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-11)
    """Weights below which a candidate is dropped, where that costs no more than so."""

    # The interior point method for a working set.
    most_steps: int = 200
    """Maximum number of Newton steps."""

    most_idle_steps: int = 20
    """Number of steps in a row in which the gap does not fall by a tenth, after which double precision has no more."""

    multiplications: int = 30
    """Maximum number of multiplications of the weights before the first step: Newton steps are short from equal weights."""

    even_sensitivity: float = 1.5
    """Largest sensitivity below which weights are even enough for Newton steps."""

    least_multiplier: float = 1e-4
    """Square of the least factor of a weight: steps from weights that are next to nothing are short too."""

    spread_share: float = 1e-3
    """Share of the weights that stays spread over all."""

    boundary_share: float = 0.99
    """Share of the way to the boundary that a step may go."""

    shrinking: float = 0.1
    """Factor of mu in each step."""
