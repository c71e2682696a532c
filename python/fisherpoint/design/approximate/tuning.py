"""The numbers that steer the search for places in the region and their weights."""

from __future__ import annotations

from dataclasses import dataclass


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
class BlockTuning:
    """Candidates that are not in memory (blocks.py)."""

    candidates: int = 1 << 16
    """Number of candidates of a block; so many are in memory."""

    kept: int = 200_000
    """Maximum number of candidates above the level that all blocks send together."""

    least_kept: int = 20
    """Number of candidates that a block may send in any case."""

    most_looks: int = 30
    """Maximum number of times that all blocks are looked at."""
