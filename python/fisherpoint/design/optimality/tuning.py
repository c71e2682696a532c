"""The numbers that steer the searches for weights of candidates, for places in the region, and for counts."""

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


@dataclass(frozen=True)
class RegionTuning:
    """Weights of places in the region (approximate.py, continuous.py, ascents.py). Lengths are shares of the region's width.

    The level is 1, the sensitivity at an optimum.
    """

    # Candidates of searches for exact designs.
    searches: int = 3
    """Maximum number of searches for exact designs, as each misses points that another one has."""

    points_beyond_parameters: int = 3
    """Number of points of these designs beyond the number of parameters."""

    search_iterations: int = 600
    """Maximum number of iterations of each."""

    search_candidates: int = 2000
    """Number of candidates of each that get weights."""

    agreement_per_parameter: float = 1e-4
    """Difference of log det F per parameter up to which another search has found as good a design, and none follows."""

    # Rounds: maxima of the sensitivity function join the candidates.
    most_rounds: int = 15
    """Maximum number of rounds before the support is merged."""

    ascents_per_round: int = 40
    """Number of candidates with a large sensitivity from which ascents start in each round."""

    round_iterations: int = 25
    """Maximum number of iterations of these ascents."""

    close: float = 1e-6
    """Excess of a maximum over the level that counts."""

    same_place: float = 1e-6
    """Distance up to which two places are one."""

    latest_candidates: int = 64
    """Number of candidates that came last, from which new weights begin."""

    # The support.
    merge_radii: tuple[float, ...] = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
    """Distances within which points of the support are merged, the largest that costs nothing."""

    worth_polishing: float = 0.05
    """Loss of log phi by merging up to which the points are moved."""

    merging_loss: float = 1e-6
    """Loss of log phi by merging and moving that counts as nothing."""

    newton_steps: int = 6
    """Maximum number of Newton steps of the support's points."""

    longest_newton: float = 0.02
    """Longest Newton step."""

    program_candidates: int = 20_000
    """Number of candidates with the largest sensitivity in the linear program for one function of the parameters."""

    least_held: float = 1e-3
    """Share of the program's sum below which a point may only make up for others that are not quite in place."""

    # The proof.
    most_searches: int = 30
    """Maximum number of searches for places above the level."""

    above: float = 1e-3
    """Excess over the level that climbs and ascents from many starts must meet to count."""

    quiet_climbs: int = 2
    """Number of climbs in a row without a find, before ascents from many starts are to prove that."""

    climbing_beside: int = 100
    """Number of candidates with a large sensitivity that may climb beside new ones."""

    proof_iterations: int = 60
    """Maximum number of iterations of the ascents from many starts."""

    back_shares: tuple[float, ...] = (0.98, 0.95, 0.9, 0.8, 0.6, 0.4, 0.2)
    """Shares of the way of an ascent that ends where some plants have no trajectory, which are tried instead."""

    # Ascents.
    ascent_lengths: tuple[float, ...] = (2.0, 1.0, 1 / 4, 1 / 16, 1 / 256, 1 / 4096)
    """Shares of the step that are tried."""

    first_step: float = 0.1
    """Longest first step of an ascent."""

    later_step: float = 0.5
    """Longest later step."""

    ascent_least_gain: float = 1e-9
    """Relative gain below which an ascent has ended."""


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
