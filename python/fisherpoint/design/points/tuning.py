"""The numbers that steer the searches for points. Counts of candidates "in units of M" are multiples of `n_candidates`."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..runs.tuning import AscentTuning


@dataclass(frozen=True)
class ExchangeTuning:
    """The exchange of a design's points for those of a pool (pool_exchange.py)."""

    least_gain: float = 1e-6
    """Relative gain of det F, or of another criterion's phi, that an exchange must exceed; with less it would go on for ever."""

    most_passes: int = 30
    """Maximum number of passes over all points of a design."""

    exact_at_once: int = 32
    """Number of candidates whose exact values are computed at once, where there are bounds for all."""


@dataclass(frozen=True)
class ClimbTuning:
    """Candidates that climb, each to what is near it (random_climbs.py)."""

    rounds: int
    """Number of rounds of a climb."""

    shortened_per_point: int
    """Number of the best candidates near each point that are sampled earlier where some plants cannot run them to their end."""

    near_per_point: int = 16
    """Number of candidates near each point in a round."""

    least_gain: float = 1e-6
    """Relative gain that a candidate must exceed to replace a point."""

    generations: int = 6
    """Number of ancestors of a point in whose directions candidates go on."""

    least_distance: float = 0.2
    """Least distance of two candidates that begin to climb, in one of their numbers, as a share of the region's width."""


@dataclass(frozen=True)
class RegionClimbTuning:
    """Climbs of any function over the region (random_climbs.py)."""

    climb: ClimbTuning = field(default_factory=lambda: ClimbTuning(rounds=30, shortened_per_point=4))

    edge_candidates: int = 5000
    """Number of candidates at the edges of the region."""

    most_climbing: int = 200
    """Maximum number of candidates that climb."""

    going_on: int = 60
    """Number of the highest points of the last climbs that go on in the next."""


@dataclass(frozen=True)
class PlantTuning:
    """Points that a share of the plants has to run (point_margins.py). Shares are of what may be lost."""

    plants: int = 256
    """Number of plants on which every point has to be ok."""

    counted_plants: int = 4000
    """Number of other plants on which the share is counted."""

    most_lost: float = 0.6
    """Share above which a design does not qualify, as it fits the plants that were counted better than others."""

    least_lost: float = 0.3
    """Share below which points may come nearer to limits."""

    most_changes: int = 5
    """Maximum number of changes of w, the factor on the deviations of the plants."""

    change_factors: tuple[float, float] = (0.85, 1.2)
    """Factors between which one change of w lies."""

    least_change: float = 1.03
    """Ratio of the bounds of w below which no further w is tried."""


@dataclass(frozen=True)
class ArchiveTuning:
    """The candidates that a search keeps, and the bound of all designs of these (candidate_archive.py, bound_over_prior.py)."""

    most_numbers: int = 20_000_000
    """Maximum number of sensitivities that are kept, of 8 bytes each; candidates after these are not kept."""

    tolerance: float = 5e-4
    """Share of its level by which the sensitivity function may exceed it over the candidates, at the prior mean."""

    tolerance_over_prior: float = 2e-3
    """That share for a criterion over the prior."""

    most_batches: int = 60
    """Maximum number of batches of candidates that are checked on all nodes."""


@dataclass(frozen=True)
class PaperSearchTuning:
    """Algorithm 1 with moves of points, method "paper" (exchange_search.py)."""

    shortlist: int = 10
    """Number of candidates that screening leaves for the rule; the best is nearly always among them (`bench/screening.py`)."""

    move_every: int = 4
    """Number of iterations after which candidates are drawn near the points: many at once cost less than a few each time."""

    move_least_gain: float = 1e-6
    """Gain of log det F that a move must exceed; with less, points would move for ever."""


@dataclass(frozen=True)
class TimeTuning:
    """What a search for points does with a limit of time; shares are of the limit, unless they are of the time left."""

    tried_per_point: int = 20
    """Number of candidates that are tried on all nodes for each point of a design, about."""

    evaluation_share: float = 0.1
    """Largest share that is kept for the evaluation of the design away from the prior mean."""

    references_share: float = 0.15
    """Largest share that is kept for what the design is compared with."""

    references: int = 2000
    """Number of points of random designs that time is kept for."""

    bound_seconds: float = 3.0
    """Seconds that are kept for bounds, where the shares allow it."""

    least_share: float = 0.03
    """Share that is kept in any case."""

    kept_for_references: float = 0.6
    """Share of what is kept that the evaluation leaves for what the design is compared with."""

    other_share: float = 0.6
    """Share of the time left then that another search may take where D is another than R."""

    random_share: float = 0.6
    """Share of the time left then that random designs may take."""

    space_share: float = 0.02
    """Share for the random points that show whether another design would determine more parameters."""

    bounds_of_sweep: float = 0.1
    """Share that a sweep keeps for its bounds."""


@dataclass(frozen=True)
class PointSearchTuning:
    """The search for points of method "auto", in the order of its stages."""

    # The pool.
    pool_share: float = 0.2
    """Largest share of the time left that drawing candidates at the edges for one group takes, where the time is limited."""

    pilot_share: float = 0.05
    """Largest share of the time left for the pilot candidates."""

    edge_candidates: int = 400
    """Candidates at the edges of the region for each group, in units of M; half as many random ones."""

    most_edge_candidates: int = 50_000
    """Maximum number of candidates at the edges."""

    pilot_candidates: int = 1000
    """Number of candidates that are tried on all nodes at first, to learn which nodes reject most."""

    scenarios_in_full: int = 4
    """Number of scenarios up to which as many candidates are drawn as for one; with more they are fewer, for the same work."""

    least_scenario_share: float = 0.1
    """Least share of the usual number of candidates, however many scenarios there are."""

    # The start of a group.
    start_share: float = 0.3
    """Share of the pool from which a group begins, so that groups differ."""

    least_start_candidates: int = 300
    """Number of random candidates from which a design begins whose points are half random; others have no fewer."""

    most_start_work: int = 200_000
    """Maximum number of points times candidates of the first exchange."""

    random_starts: int = 6
    """Number of random choices of half of the points, in every second group; the best goes on."""

    # The exchange.
    exchange: ExchangeTuning = field(default_factory=ExchangeTuning)

    checked_per_point: int = 4
    """Number of candidates to replace each point that are tried on all nodes."""

    checks_per_exchange: int = 2
    """Number of times that such candidates are tried in each exchange."""

    # Rounds: candidates near the points.
    near_candidates: int = 8
    """Candidates near all points in each round, in units of M: few in many rounds, each from where the last has come to."""

    least_near_per_point: int = 4
    """Least number of candidates near each point in a round."""

    near_share_in_groups: float = 0.5
    """Share of the candidates near points that is drawn in the rounds of groups."""

    # Groups.
    groups: int = 4
    """Number of groups: what one has missed another one has, and merging takes it over."""

    group_times_left: float = 2.0
    """Multiple of what the last group took that has to be left for another one, where the time is limited."""

    first_rounds: int = 4
    """Number of rounds of a group before candidates climb."""

    climbing_candidates: int = 2
    """Candidates that climb in each group, in units of M."""

    climb: ClimbTuning = field(default_factory=lambda: ClimbTuning(rounds=18, shortened_per_point=6))

    climb_share: float = 0.1
    """Largest share of a limit of time that one climb takes, of as many candidates as that allows."""

    climb_least_share: float = 0.25
    """Share of the candidates that are wanted below which none climb."""

    climbing_survivors: float = 0.5
    """Share of the climbing candidates, the best, that goes on after half of the rounds."""

    unchecked_rounds: int = 3
    """Number of rounds of a climb between checks on all nodes; in between a few nodes reject invalid candidates."""

    last_rounds: int = 5
    """Number of rounds of a group after candidates have climbed."""

    agreeing_groups: int = 3
    """Number of groups as good as the best with which the problem counts as easy, and no more groups follow."""

    agreement_per_parameter: float = 3e-4
    """Difference of log det F per parameter up to which groups count as equally good."""

    group_budget: int = 28
    """Number of iterations for each group and each later climb; a smaller `max_iterations` allows fewer of them."""

    plant_budget_factor: int = 2
    """Factor on that where a share of the plants is required: the design is followed to its end for several sets of plants."""

    # The merged design.
    merged_climbs: int = 2
    """Number of climbs beside the design that is merged of all groups."""

    merged_rounds: int = 8
    """Number of rounds before each of them."""

    ascent: AscentTuning = field(default_factory=AscentTuning)

    ascent_iterations: int = 20
    """Maximum number of iterations of an ascent of all numbers together."""

    ascent_share: float = 0.03
    """Largest share of a limit of time that one iteration of an ascent takes; with more there is no ascent."""

    ascent_difference_step: float = 1e-4
    """Step of a number for difference quotients, as a share of the region's width."""

    cycle_rounds: int = 16
    """Number of rounds between two ascents of the merged design."""

    cycle_least_gain: float = 1e-3
    """Gain of log det F per parameter below which a cycle counts as idle."""

    most_idle_cycles: int = 2
    """Number of idle cycles in a row that end the search."""

    # What follows.
    plants: PlantTuning = field(default_factory=PlantTuning)

    shortened_for_plants: int = 200
    """Number of candidates that are sampled earlier where more plants have to run them."""

    copy_distance: float = 0.02
    """Share of the region's width in every number within which points may become copies of one."""

    most_points_for_copies: int = 300
    """Number of distinct points above which no copies are made; pairs of more take long."""

    archive: ArchiveTuning = field(default_factory=ArchiveTuning)

    limit: TimeTuning = field(default_factory=TimeTuning)

    space_candidates: int = 200
    """Number of random points used to check whether another design would determine more parameters."""

    # A sweep of sizes.
    sweep_candidates: int = 3000
    """Number of former candidates, those with the largest sensitivity, over which the next size is exchanged."""

    sweep_rounds: int = 3
    """Number of rounds between two ascents of the next size."""

    paper: PaperSearchTuning = field(default_factory=PaperSearchTuning)
