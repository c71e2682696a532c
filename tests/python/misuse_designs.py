"""Problems, designs, criteria and campaigns: with good arguments, and the kinds of clumsy ones."""

from __future__ import annotations

import tempfile
from functools import cache

import fisherpoint as fp
from misuse_case import Case, case, within
from misuse_examples import (
    NOISE,
    campaign,
    comparison,
    data,
    design,
    files,
    log_pieces,
    model,
    points,
    prior,
    problem,
    record,
    region,
    run_data,
    run_problem,
)
from misuse_values import ARRAY, FLAG, FUNCTION, INT, MAP, MODEL, NAMES, NONE, NUMBER, PATH, POINTS, PRIOR, SLICE, TERM, TEXT

NEW = "a new directory"


@cache
def design_cases() -> dict[str, Case]:
    of_model = (model(), MODEL)
    of_points = (points(), POINTS)
    rtol = (1e-6, NUMBER)
    threads = (1, INT, NONE)
    kinks = ("cross",)
    return {
        "design_runs": case(
            fp.design_runs,
            problem=(run_problem(),),
            n_runs=(1, INT),
            n_starts=(1, INT),
            n_candidates=(20, INT),
            confidence=(0.9, NUMBER, NONE),
            over=(None, NONE),
            seed=(0, INT),
            threads=threads,
            time_limit=(1.0, NUMBER, NONE),
            progress=(None, NONE, FLAG, FUNCTION),
            previous=(None, NONE, POINTS, ARRAY, NAMES),
        ),
        "pieces": case(
            fp.pieces,
            record=(record(),),
            model=of_model,
            length=(2, INT),
            every=(1, INT, NONE),
            states=({"h": [1.0, 0.9, 0.8, 0.7]}, MAP, NONE),
            longest_step=(2.0, NUMBER, NONE),
        ),
        "pieces[]": case(lambda index: log_pieces()[index], index=(0, INT, ARRAY, NAMES, SLICE)),
        "best_pieces": case(
            fp.best_pieces, problem=(problem(),), pieces=(log_pieces(),), n_pieces=(1, INT), seed=(0, INT), threads=threads
        ),
        "approximate": case(
            fp.approximate,
            problem=(problem(),),
            candidates=(points(), POINTS, NONE),
            criterion=("D",),
            of=(None, NONE),
            conditions=(None, NONE),
            scale=(None, NONE),
            prior_information=(False, FLAG),
            n_experiments=(None, NONE),
            n_candidates=(20, INT),
            starts=(5, INT),
            tolerance=(1e-4, NUMBER),
            seed=(0, INT),
            threads=threads,
            progress=(None, NONE, FLAG, FUNCTION),
        ),
        "criterion": case(
            fp.criterion,
            problem=(problem(),),
            name=("D",),
            of=(None, NONE),
            conditions=(None, NONE),
            scale=(None, NONE),
            threads=threads,
        ),
        "criterion of a function": case(fp.criterion, problem=(problem(),), name=("c",), of=("a", TEXT, TERM)),
        "criterion of predictions": case(
            fp.criterion, problem=(problem(),), name=("I",), of=("y", TEXT), conditions=(points(), POINTS)
        ),
        "DesignProblem": case(
            fp.DesignProblem,
            model=of_model,
            prior=(prior(), PRIOR),
            region=(region(), NONE),
            noise_std=(NOISE, NONE),
            rule=(fp.SparseGaussHermite(1),),
            output_covariance=("noise", NONE),
            parameters=(["k"], NONE, NAMES),
            kinks=kinks,
            jumps=kinks,
            rtol=rtol,
            uncertain=({"d": 0.1}, MAP, NONE),
            initial_state_std=({"h": 0.1}, MAP, NONE),
            assumed_covariance=("tangents",),
            along=(["h < 9"], NONE, NAMES, ARRAY),
        ),
        "DesignProblem.replace": case(
            lambda **changes: problem().replace(**changes),
            prior=(prior(), PRIOR),
            noise_std=(NOISE, NONE),
            parameters=(["k"], NONE, NAMES),
            rtol=rtol,
        ),
        "evaluate_design": case(
            fp.evaluate_design, problem=(problem(),), points=of_points, threads=threads, previous=(None, NONE, POINTS, ARRAY, NAMES)
        ),
        "evaluate_under_noise": case(
            fp.evaluate_under_noise,
            problem=(problem(),),
            points=of_points,
            threads=threads,
            previous=(None, NONE, POINTS, ARRAY, NAMES),
        ),
        "feasibility": case(
            fp.feasibility,
            problem=(problem(),),
            points=of_points,
            draws=(20, INT),
            seed=(0, INT),
            threads=threads,
        ),
        "Feasibility.holds": case(fp.feasibility(problem(), points(), draws=20).holds, share=(0.5, NUMBER)),
        "compare": case(
            fp.compare,
            problem=(problem(),),
            designs=({"one": points()}, MAP, POINTS, ARRAY),
            draws=(20, INT),
            seed=(0, INT),
            threads=threads,
        ),
        "sweep": case(
            fp.sweep,
            problem=(problem(),),
            n_experiments=([2], ARRAY),
            cost=(fp.Cost(), NONE),
            n_candidates=(2, INT),
            max_iterations=(1, NONE, INT),
            seed=(0, INT),
            threads=threads,
            time_limit=(1.0, NONE, NUMBER),
            method=("paper", TEXT),
            progress=(None, NONE, FLAG, FUNCTION),
            previous=(None, NONE, POINTS, ARRAY, NAMES),
        ),
        "Cost": case(
            fp.Cost,
            fixed=(0.0, NUMBER),
            per_experiment=(1.0, NUMBER),
            per_second=(1.0, NUMBER),
            per_change=({"u": 1.0}, MAP, NONE),
        ),
        "Cost.of": case(lambda points, model: fp.Cost().of(points, model), points=(points(), POINTS), model=(model(), MODEL)),
        "compare_rules": case(
            fp.compare_rules,
            problem=(problem(),),
            points=(points()[:1], POINTS),
            rules=([fp.Linearized()], NONE, ARRAY, NAMES),
            threads=threads,
        ),
        "exchange": case(
            fp.exchange,
            problem=(problem(),),
            n_experiments=(2, INT),
            n_candidates=(2, INT),
            max_iterations=(1, NONE, INT),
            seed=(0, INT),
            threads=threads,
            progress=(None, NONE, FLAG, FUNCTION),
            patience=(None, NONE, INT),
            time_limit=(1.0, NONE, NUMBER),
            max_redraws=(1, INT),
            references=(False, FLAG),
            screen=(True, FLAG),
            local=(0.5, NUMBER),
            method=("paper", TEXT),
            previous=(None, NONE, POINTS, ARRAY, NAMES),
            over=(None, NONE),
            criterion=("D",),
            of=(None, NONE),
            conditions=(None, NONE),
            scale=(None, NONE),
        ),
        "exchange for a function": case(
            lambda criterion, of: fp.exchange(
                problem(), 4, n_candidates=5, max_iterations=1, references=False, criterion=criterion, of=of
            ),
            criterion=("c", TEXT),
            of=("a", TEXT, TERM),
        ),
        "exchange for predictions": case(
            lambda of, conditions: fp.exchange(
                problem(), 4, n_candidates=5, max_iterations=1, references=False, criterion="I", of=of, conditions=conditions
            ),
            of=("y", TEXT),
            conditions=(points(), POINTS),
        ),
        "exchange with scales": case(
            lambda scale: fp.exchange(problem(), 4, n_candidates=5, max_iterations=1, references=False, criterion="A", scale=scale),
            scale=({"k": 0.1, "a": 0.1}, MAP, NONE),
        ),
        "exchange over the prior": case(
            lambda scenarios: fp.exchange(
                problem(), 2, n_candidates=2, max_iterations=1, references=False, over=fp.OverPrior("log", scenarios=scenarios)
            ),
            scenarios=([{"k": 0.1}],),
        ),
        "OverPrior": case(fp.OverPrior, kind=("cvar",), scenarios=([{"k": 0.1}],), share=(0.5, NUMBER)),
        "Design.load": case(fp.Design.load, directory=(files() / "design", TEXT, PATH)),
        "Design.save": case(
            lambda directory: design().save(within(directory)),
            directory=("again", TEXT, PATH),
        ),
        "Campaign": case(
            fp.Campaign,
            problem=(problem(),),
            batch=(2, INT, NONE),
            targets=({"k": 0.1}, MAP, NONE, NUMBER),
            seed=(0, INT),
            threads=threads,
            n_candidates=(2, INT),
            local=(0.5, NUMBER),
        ),
        "Campaign of runs": case(
            fp.Campaign,
            problem=(run_problem(),),
            batch=(2, INT, NONE),
            targets=({"k": 0.1}, MAP, NONE, NUMBER),
            seed=(0, INT),
            threads=threads,
            n_starts=(1, INT),
            n_candidates=(2, INT),
            confidence=(0.9, NUMBER, NONE),
        ),
        "Campaign directory": case(
            lambda directory: fp.Campaign(
                problem(), directory=tempfile.mkdtemp(dir=files()) if directory is NEW else within(directory), batch=2
            ),
            directory=(NEW, PATH, NONE),
        ),
        "Campaign.load": case(fp.Campaign.load, directory=(files() / "campaign", PATH, TEXT)),
        "Campaign.is_in": case(fp.Campaign.is_in, directory=(files(), PATH, TEXT)),
        "Campaign.told": case(lambda data: campaign().told(data), data=(data(),)),
        "RuleComparison.cheapest": case(lambda within: comparison().cheapest(within), within=(0.01, NUMBER)),
        "Campaign.tell": case(
            lambda data, progress: campaign().tell(data, progress=progress),
            data=(data(),),
            progress=(None, NONE, FLAG, FUNCTION),
        ),
        "Campaign.tell runs": case(lambda data: fp.Campaign(run_problem(), n_starts=1).tell(data), data=(run_data(),)),
        "Campaign.next": case(lambda progress: campaign().next(progress=progress), progress=(None, NONE, FLAG, FUNCTION)),
        "Campaign.targets": case(lambda targets: setattr(campaign(), "targets", targets), targets=({"k": 0.1}, MAP, NONE, NUMBER)),
    }
