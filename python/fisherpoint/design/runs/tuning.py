"""The numbers that steer the search for runs, and the ascent of all numbers together, which the search for points has too."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class AscentTuning:
    """An ascent of all free numbers together, by the criterion to first order (run_ascent.py, linear_rows.py).

    A reach is the change that each number may make in one iteration, as a share of its range.
    """

    first_reach: float = 0.1
    """Reach of the first iteration."""

    least_reach: float = 1e-5
    """Reach below which an ascent has ended."""

    most_reach: float = 1.0
    """Largest reach."""

    reach_factors: tuple[float, ...] = (4.0, 1.0, 1 / 4, 1 / 16)
    """Factors on the reach, for the distances within which the best step is computed."""

    step_shares: tuple[float, ...] = (1.0, 0.7, 0.4, 0.2)
    """Shares of these steps that are tried."""

    reach_growth: float = 1.5
    """Reach of the next iteration over the length of the step that was best."""

    small_gain: float = 1e-4
    """Gain of an iteration, in log det F, that counts as small."""

    most_small_gains: int = 4
    """Number of small gains in a row that end an ascent."""

    distance_cost: float = 4.0
    """Cost of a run, in log det F, at a sample that is one standard deviation too near to a limit; it grows with the square."""

    linear_iterations: int = 50
    """Maximum number of quasi-Newton iterations to first order, each of which costs little."""

    linear_pairs: int = 20
    """Number of changes of place and slope that the quasi-Newton method remembers."""

    linear_halvings: int = 8
    """Number of step lengths, each a quarter of the one before, of a line search to first order."""

    linear_slope_share: float = 1e-4
    """Share of the gain that the slope promises that a step to first order must have (Armijo)."""

    linear_least_gain: float = 3e-3
    """Share of the gain so far below which an iteration ends the quasi-Newton method."""


@dataclass(frozen=True)
class RunSearchTuning:
    """The search for runs, in the order of its stages; distances to limits are in standard deviations that the prior makes."""

    # The pool of random runs.
    most_pool_segments: int = 400_000
    """Maximum number of segments of the pool's runs, over all plants."""

    most_drawn_per_wanted: int = 4
    """Maximum number of runs drawn for each one that is wanted; then those that leave a limit are brought back within it."""

    first_batch: int = 4
    """Number of runs that are computed at once at first: few, so that there are some before any limit of time."""

    batch_growth: int = 4
    """Factor from one batch to the next."""

    most_batch: int = 256
    """Maximum number of runs that are computed at once."""

    most_start_cost: float = 1.0
    """Cost of a run near limits, in log det F, above which it is brought further inside."""

    most_tightened: int = 128
    """Maximum number of the pool's best runs that are brought further inside."""

    tightened_share: float = 0.2
    """Largest share of the time left for that, and for a look at whether limits matter, where the time is limited."""

    # Runs that leave a limit, brought back within it.
    halvings_within: int = 9
    """Number of halvings of the share of a run that is kept."""

    least_share_within: float = 0.002
    """Share below which a run is dropped: it is too much like the one that it is drawn to."""

    held_runs: int = 128
    """Number of runs of held inputs that are tried."""

    held_levels: int = 9
    """Number of values of each held input."""

    prolonged_runs: int = 16
    """Number of the longest runs that are prolonged at a time."""

    prolonged_children: int = 16
    """Number of changes by which each of them is prolonged."""

    prolonged_rounds: int = 40
    """Maximum number of rounds of prolonging."""

    # Classical runs, which the search begins from too.
    classical_runs: int = 100
    """Number of random runs of each classical profile."""

    most_classical_segments: int = 100_000
    """Maximum number of their segments, over all plants."""

    # Starts: runs from the pool by exchange.
    pool_part: int = 4
    """Each start draws from a random one in so many of the pool, so that starts differ."""

    start_least_gain: float = 1e-4
    """Gain of log det F below which no further round of exchange follows."""

    most_start_rounds: int = 40
    """Maximum number of rounds of exchange."""

    # The samples that count, where not all do.
    sample_weight_rounds: int = 100
    """Number of multiplicative steps of the weights of samples."""

    most_sample_exchanges: int = 200
    """Maximum number of exchanges of samples."""

    # One climb: ascents, single changes, and a look at the plants in turns.
    ascent: AscentTuning = field(default_factory=AscentTuning)

    most_lanes: int = 64
    """Runs times plants above which only whole steps of an ascent are tried, as no lanes are free."""

    central_reach: float = 0.01
    """Reach below which slopes are central differences."""

    difference_step: float = 1e-3
    """Step of a free number for difference quotients, as a share of its range."""

    most_slopes: int = 20_000_000
    """Maximum number of slopes at once, so that memory stays bounded."""

    many_samples: float = 2.0
    """Number of rows over what they and their slopes can span, from which on they are replaced by as many as that."""

    slopes_share: float = 0.1
    """Largest share of a limit of time that the slopes of one iteration take; where all take more, some numbers stay."""

    least_slopes: int = 8
    """Number of numbers whose slopes are taken in any case."""

    trajectory_rtol: float = 1e-6
    """Largest relative tolerance of the trajectories that differences are taken of."""

    ascent_iterations: int = 8
    """Number of iterations of an ascent between two looks at the plants."""

    hurried_iterations: int = 3
    """That number where a limit of time leaves room for few iterations: so the distance from limits is adapted all the same."""

    stretch_gain: float = 0.05
    """Gain of an ascent, in log det F, from which on another ascent follows before single changes are tried."""

    climb_least_gain: float = 1e-4
    """Gain of an ascent and of single changes, in log det F, below which a climb has ended."""

    rough_gain_per_parameter: float = 5e-3
    """That gain for each parameter where the work is much: half a percent of D-efficiency."""

    much_work: int = 500_000
    """Number of computed segments from which on the work is much."""

    explored_steps: int = 4
    """Number of first steps near the limits, whether enough plants can run what they lead to or not."""

    most_lost_steps: int = 2
    """Number of steps in a row that too few plants can run, after enough could, above which a climb ends."""

    most_steps: int = 60
    """Maximum number of steps of a climb."""

    most_vain_hops: int = 2
    """Number of hops in a row without a gain that end the search."""

    most_last_ascents: int = 5
    """Maximum number of ascents at the very end."""

    # Single changes of a run.
    grid_values: int = 7
    """Number of values that a number is set to, from bound to bound."""

    grid_values_of_profiles: int = 25
    """That of a number of a profile, such as a frequency or a phase."""

    most_single_changes: int = 800
    """Maximum number of changes of one number; a random choice where there were more."""

    most_swaps: int = 300
    """Maximum number of swaps of two segments."""

    most_blocks: int = 200
    """Number of blocks of segments that get one value, and of blocks that are copied from another run."""

    changes_at_once: int = 256
    """Number of changes that are tried before the best of them is made."""

    changes_share: float = 0.02
    """Largest share of a limit of time that they take."""

    least_changes_at_once: int = 32
    """Number of them in any case."""

    most_changes_made: int = 12
    """Maximum number of changes that are made of each run."""

    hop_candidates: int = 48
    """Number of changes among which a hop takes the best, whether it gains or not."""

    hop_changes: int = 2
    """Number of changes that a hop makes of each run."""

    copied_from: int = 50
    """Number of the pool's best runs that single changes copy blocks of."""

    # The race of starts.
    rung_segments: int = 600_000
    """Number of computed segments that all climbs of a rung share equally."""

    rung_survivors: int = 3
    """One climb in so many goes on to the next rung."""

    race_share: float = 0.3
    """Share of a limit of time in which all starts that race make a first step: where there are more, the worst are left out."""

    left_for_last_trial: float = 2.0
    """Seconds that are left, over those of the longest trial on plants, for one more behind the end of the search."""

    approach_share: float = 0.2
    """Share of the time left that is taken, behind such a race, to go towards better runs that too few plants can run."""

    same_value: float = 1e-2
    """Distance from the best log det F within which a start counts as having found the same."""

    time_shares: tuple[float, float, float] = (0.2, 0.3, 0.6)
    """Shares of the time limit at which the pool, the classical runs, and the race have to end."""

    # The distance from limits, so that enough plants can run a design.
    least_spread: float = 1e-3
    """Least spread of a limit's value that counts, as a share of its largest value on the way."""

    most_distance: float = 100.0
    """Largest distance that is reported, in standard deviations."""

    states_at_once: int = 4000
    """Number of states whose distances are computed at once: more would not stay in the cache."""

    looks_per_segment: int = 2
    """Number of times in every segment at which distances are taken."""

    more_looks_per_segment: int = 4
    """That number where it was not enough."""

    least_rows_at_once: int = 16
    """Minimum number of runs times plants that one thread computes at once: enough for its lanes."""

    most_rows_at_once: int = 64
    """Maximum number of them: few enough for its cache."""

    least_runs_at_once: int = 16
    """Number of runs that are computed at once under a limit of time, however long they take: fewer take as long."""

    most_parts_at_once: int = 200_000
    """Maximum number of parts between samples that one thread computes at once, so that memory stays bounded."""

    plants: int = 4000
    """Number of plants that runs are tried on during the search."""

    plants_at_once: int = 250
    """Number of them that are tried at once."""

    most_guard_segments: int = 100_000
    """Maximum number of segments that are tried at once, so that memory stays bounded."""

    share_sigmas: float = 3.0
    """Safety margin of a design that qualifies, in standard deviations of a share that is estimated from unseen plants."""

    hopeless: tuple[tuple[int, float], ...] = ((250, 3.0), (1000, 1.5))
    """Numbers of plants after which a run is given up, and the factors on the most that may fail at each."""

    reserved_share: float = 0.1
    """Least share of a limit of time that is kept for what follows the search."""

    costly_runs: int = 10
    """Number of runs that take more than a block of the time from which on one is tried on the plants before anything else."""

    reserved_time: float = 8.0
    """Factor on the measured time of the plants that judge a design in the end: classical runs are judged too."""

    guard_share: float = 0.03
    """Largest share of a limit of time that one look at the plants takes."""

    runs_looked_at: int = 5
    """Number of the pool's best runs that are tried on the plants, to see whether limits matter."""

    value_per_sigma: float = 1.0
    """Loss of log det F for each standard deviation that a run lacks of the distance that enough plants need."""

    most_kappa: float = 20.0
    """Largest distance from limits that runs pay for, in standard deviations."""

    most_kappa_changes: int = 20
    """Maximum number of changes of that distance for one start."""

    excess_sigmas: float = -0.2
    """Lack of distance, in standard deviations, below which a design that enough plants can run comes nearer to limits."""

    kappa_least_gain: float = 0.01
    """Gain of log det F by a smaller distance, below which no even smaller one is tried."""

    least_kappa_change: float = 0.1
    """Least increase of the distance, in standard deviations."""

    most_kappa_change: float = 1.0
    """Largest change of the distance, in standard deviations."""

    small_kappa_change: float = 0.3
    """Largest change once enough plants could run what was found."""

    # Round numbers at the end.
    most_lost_by_rounding: float = 1e-3
    """Largest loss of log det F by all rounding."""

    coarsest_step: float = 1 / 10
    """Coarsest step to which numbers are rounded, as a share of their range."""

    finest_step: float = 1 / 2000
    """Finest step."""

    merge_distance: float = 0.1
    """Difference of neighbouring segments, as a share of the range, up to which they may become equal."""

    merge_prefixes: int = 8
    """Number of shares of the best merges that are tried together."""

    merge_rounds: int = 3
    """Number of rounds of merging."""
