"""The windows of a record that determine the parameters best: the design of an experiment that has already happened."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ...basics.checks import check_positive_int, check_type
from ...basics.messages import with_counts
from ...basics.options import with_options
from ...basics.stop_reason import StopReason
from ...basics.values import Array, FrozenMapping
from ...data.pieces import Pieces
from ...information.combinations import combinations
from ...information.evaluation import RANK_TOLERANCE, evaluate_information
from ...information.null_space import column_scaled_svd, null_directions, without_rounding
from ...information.output_covariance import output_covariance
from ...information.piece_information import PieceInformation, picked_information, piece_information, piece_problem
from ...information.problem import DesignProblem
from ...show.progress import Progress, check_progress, following
from ..goal.goal import Goal, goal_of
from .disjoint import Windows
from .piece_design import PieceDesign
from .piece_search import Packed, PieceSearch

RANDOM_CHOICES = 200
"""Number of random choices of windows; the report shows their median."""


@with_options
def design_pieces(
    problem: DesignProblem,
    pieces: Pieces,
    n_pieces: int,
    *,
    goal: str | Goal = "D",
    seed: int = 0,
    threads: int | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> PieceDesign:
    """Find the windows of a record that share no sample and have the largest det F together.

    F of a window is that of a run which starts at what was measured: the noise of the sensors there moves all of its samples, and
    R_k = R + G P G^T takes it into account. All windows are weighed first, which also bounds what any choice can reach; then
    windows are exchanged, one for another, until none gains.

    Parameters
    ----------
    problem : DesignProblem
        Of the model of the pieces; the region may be None. Starts have the standard deviations `initial_state_std`; those of states
        that are not named there are the `noise` of the outputs that measure them. As candidates of a search do, windows start
        three of them away from jumps and limits of the model; limits along the way do not count.
    pieces : Pieces
    n_pieces : int
        How many windows are picked.
    goal : str or Goal
        Criterion "D" at the prior mean, and by its `singular` what to do where so few windows leave parameters open: pick those
        with the most information on the others, and name in the report what is open; or raise.
    seed : int
        For the random choices that the windows are compared with. What is picked does not depend on it.
    threads : int, optional
        Default: every core.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` when all windows are
        weighed, and after each exchange; its value is log det less the bound of all choices, -inf while F is singular.

    Returns
    -------
    PieceDesign
        Ctrl-C during the exchanges returns the best windows so far, with stop_reason "interrupted".

    Raises
    ------
    TypeError, ValueError
        For misuse, more windows than there are without a common sample, starts of unknown precision, and a record that does not
        determine all parameters: the message says which combinations of them are left open.
    """
    started = time.perf_counter()
    check_type(problem, DesignProblem, "problem")
    check_type(pieces, Pieces, "pieces")
    check_progress(progress)
    goal = goal_of(goal, "design_pieces")
    count, seed = check_positive_int(n_pieces, "n_pieces"), check_positive_int(seed, "seed", 0)
    problem = piece_problem(problem, pieces)
    _refuse_more(count, Windows(pieces.first, pieces.length))
    with following(progress, "picking pieces", "weighing all windows", counted=False) as heard:
        information = piece_information(problem, pieces, threads)
        if not len(information.rows):
            reasons = with_counts(information.left_out)
            raise ValueError(f"pieces: expected windows with trajectories that are ok, given none: {reasons}")
        windows = Windows(pieces.first[information.rows], pieces.length)
        _refuse_more(count, windows)
        _refuse_open_directions(problem, information.factor)
        packing = Packed(len(problem.estimated), problem.n_nuisance)
        packing.in_coordinates(information.packed, information.factor)
        known = information.known[None].copy()
        packing.in_coordinates(known, information.factor)
        search = PieceSearch(information.packed, packing, windows, count, known[0])
        stop_reason = search.run(heard, started)
        design = _found(problem, pieces, information, search, stop_reason, seed, threads, started)
    if goal.requires_all and design.evaluation.null_directions and stop_reason != StopReason.interrupted:
        open_text = combinations(design.evaluation.null_directions)
        raise ValueError(
            f"n_pieces: expected enough windows to determine all parameters, as singular = 'error' requires, given {count}, which "
            f"leave open {open_text}, in prior std: pick more, or longer ones"
        )
    return design


def _refuse_more(count: int, windows: Windows) -> None:
    most = len(windows.most())
    if count > most:
        raise ValueError(f"n_pieces: expected at most the {most} windows that share no sample, given {count}")


def _refuse_open_directions(problem: DesignProblem, factor: Array) -> None:
    names, q = problem.estimated, problem.n_nuisance
    values, directions, length = column_scaled_svd(without_rounding(factor))
    rank = int((values > RANK_TOLERANCE * max(values.max(), 1e-300)).sum()) - q
    if rank < len(names):
        open_text = combinations(null_directions(directions[rank + q :, q:], length[q:], names))
        raise ValueError(
            f"pieces: expected windows that together determine all parameters, given {rank} of {len(names)}; not determined, in"
            f" prior std: {open_text}. Estimate fewer parameters, or take longer windows"
        )


def _found(
    problem: DesignProblem,
    pieces: Pieces,
    information: PieceInformation,
    search: PieceSearch,
    stop_reason: StopReason,
    seed: int,
    threads: int | None,
    started: float,
) -> PieceDesign:
    rows = information.rows[search.chosen]
    runs, y = pieces.cut(rows)
    picked = picked_information(problem, pieces, rows, threads)
    evaluation = evaluate_information(problem, picked, output_covariance(problem, picked, threads), threads)
    p = len(problem.estimated)
    offset = 2 * float(np.log(np.abs(np.diag(information.factor)))[problem.n_nuisance :].sum())
    singular = evaluation.covariance is None
    return PieceDesign(
        problem=problem,
        length=pieces.length,
        every=pieces.every,
        windows=rows,
        first=pieces.first[rows],
        t=pieces.record.t[pieces.first[rows]],
        runs=runs,
        y=y,
        shares=np.full(len(rows), np.nan) if singular or search.singular else search.shares,
        evaluation=evaluation,
        log_det=-np.inf if singular else evaluation.log_det + p * float(np.log(evaluation.n_points / 2)),
        bound=search.bound + offset,
        references=FrozenMapping({name: value + offset for name, value in _references(search, seed).items()}),
        n_windows=len(pieces),
        n_disjoint=len(search.windows.most()),
        n_samples=len(pieces.record),
        left_out=FrozenMapping({**pieces.left_out, **information.left_out}),
        exchanges=search.exchanges,
        ridge=search.ridge,
        stop_reason=stop_reason,
        seconds=time.perf_counter() - started,
    )


def _references(search: PieceSearch, seed: int) -> dict[str, float]:
    """log det of windows that are chosen without a look at what they say, from as many disjoint ones as there are."""
    disjoint, count = search.windows.most(), search.count
    rng = np.random.default_rng(seed)
    random = [search.log_det(disjoint[rng.choice(len(disjoint), count, replace=False)]) for _ in range(RANDOM_CHOICES)]
    return {
        "all": search.log_det(disjoint),
        "first": search.log_det(disjoint[:count]),
        "spread": search.log_det(disjoint[np.linspace(0, len(disjoint) - 1, count).round().astype(int)]),
        "random": float(np.median(random)),
    }
