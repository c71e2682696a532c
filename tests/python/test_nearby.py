"""Whether a promise survives within what it promises: figures against brute force, and what the reports say."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import problem as cylinder
from fisherpoint.basics.result_files import encoded
from fisherpoint.design.results.evaluated_points import evaluate_points
from fisherpoint.design.results.report import design_report, evaluation_report
from fisherpoint.information.local_robustness import DISTANCE, LARGEST_GROWTH, _shortened
from fisherpoint.show.section import to_text
from saved_places import edit

SLIDER = fp.SymbolicModel(
    ["(f - F*sign(v))/m"], ["v"], {"v": "m/s"}, {"f": "N"}, {"m": "kg", "F": "N"}, {"v": "m/s"}, nominal={"m": 1.0, "F": 1.0}
)
"""A mass with Coulomb friction. At rest it stays where the force is less than the friction."""

BRAKING, PUSHED, BALANCED = [1.0, 0.0, 0.2], [0.0, 5.0, 1.0], [0.0, 1.01, 1.0]  # v, f, dt; the last is 1 % above the friction


def slider(**changes: Any) -> fp.DesignProblem:
    prior = fp.GaussianPrior(mean=SLIDER.nominal, relative_std={"m": 0.3, "F": 0.3})
    region = fp.ExperimentRegion({"v": (0.0, 0.0), "f": (0.5, 5.0), "dt": (0.5, 1.0)})
    return fp.DesignProblem(SLIDER, prior, **({"region": region, "noise": {"v": 0.02}} | changes))


def points(*rows: list[float]) -> fp.Experiments:
    return fp.Experiments.of_table(SLIDER, np.array(rows))


def errors_by_hand(problem: fp.DesignProblem, given: fp.Experiments, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Standard errors, and the whitened sensitivities in SI units."""
    result = fp.sensitivities(problem.model, given, theta, rtol=problem.rtol)
    assert not result.status.any()
    noise = np.array(list((problem.noise or {}).values()))
    white = (result.dy_dtheta / noise[:, None]).reshape(-1, len(theta))
    scale = np.linalg.norm(white, axis=0)
    return np.sqrt(np.diag(np.linalg.inv(white.T @ white / np.outer(scale, scale)))) / scale, white


@pytest.mark.parametrize("which", ["slider", "cylinder"])
def test_growth_is_what_evaluation_at_the_moved_parameters_gives(which: str) -> None:
    problem, given = slider(), points(BRAKING, PUSHED, BALANCED)
    if which == "cylinder":
        problem = cylinder()
        given = fp.exchange(problem, method=fp.ExchangeMethod("paper", references=False), n_candidates=20, max_iterations=20).points
    evaluation = fp.evaluate(problem, given, output_covariance="noise")
    assert evaluation is not None and evaluation.nearby is not None and evaluation.covariance is not None
    promised, white = errors_by_hand(problem, given, problem.theta)
    np.testing.assert_allclose(promised, list((evaluation.standard_errors or {}).values()), rtol=1e-5)
    moves = [evaluation.covariance[:, j] / promised[j] for j in range(len(promised))]
    scale = np.linalg.norm(white, axis=0)
    values, vectors = np.linalg.eigh((white / scale).T @ (white / scale))
    moves += list((vectors / np.sqrt(values)).T / scale)
    growth, places = np.ones(len(promised)), []
    for move in (sign * DISTANCE * move for move in moves for sign in (1, -1)):
        theta = problem.theta + move / max(1.0, np.abs(move / problem.std).max())
        ratio = errors_by_hand(problem, given, theta)[0] / promised
        growth = np.maximum(growth, ratio)
        places.append((ratio.max(), theta))
    np.testing.assert_allclose(list(evaluation.nearby.growth.values()), growth, rtol=1e-3)
    worst = max(places, key=lambda place: place[0])[1]
    np.testing.assert_allclose(list(evaluation.nearby.parameters.values()), worst, rtol=1e-3)


def warnings_of(problem: fp.DesignProblem, given: fp.Experiments) -> list[str]:
    return list(evaluation_report(evaluate_points(problem, given)).warnings)


def test_a_force_that_friction_just_balances_is_warned_of() -> None:
    problem, given = slider(region=None), points(BRAKING, PUSHED, BALANCED)
    nearby = evaluate_points(problem, given).evaluation.nearby
    assert nearby is not None and nearby.broken[0] == nearby.worst == "F" and nearby.growth["F"] > 3
    assert nearby.parameters["F"] > 1.01 and nearby.points == (2,) and not nearby.lost
    (text,) = warnings_of(problem, given)
    for part in (
        "that of F is up to",
        "worst at F = 1.0",
        "where point 3 has much less information",
        'jumps = "exclude"',
        "fisherpoint validate",
    ):
        assert part in text, text
    sentence = f"they are at most {nearby.growth['F']:#.3g} times (F) as large: validate before measuring."
    for report in (evaluation_report(evaluate_points(problem, given)), fp.evaluate(problem, given).report()):
        assert sentence in " ".join(to_text(report).split())


def test_it_is_not_warned_of_forces_that_are_well_above_friction() -> None:
    problem, given = slider(region=None), points(BRAKING, PUSHED, [0.0, 1.5, 1.0])
    nearby = evaluate_points(problem, given).evaluation.nearby
    assert nearby is not None and not nearby.broken and max(nearby.growth.values()) < 1.2
    assert warnings_of(problem, given) == []


def test_what_is_not_determined_there_grows_infinitely_and_is_kept(tmp_path: Path) -> None:
    evaluation = fp.evaluate(slider(), points(PUSHED, BALANCED))
    assert evaluation.nearby is not None and evaluation.nearby.growth["F"] == math.inf
    evaluation.save(tmp_path / "evaluation.json")
    assert fp.Evaluation.load(tmp_path / "evaluation.json").nearby == evaluation.nearby
    assert "infinitely" in warnings_of(slider(), points(PUSHED, BALANCED))[0]


def test_designs_have_it_and_keep_it(tmp_path: Path) -> None:
    design = fp.exchange(slider(), 3, n_candidates=200, max_iterations=20, method=fp.ExchangeMethod(references=False))
    assert design.evaluation.nearby is not None and design.under_noise is not None
    assert design.under_noise.nearby == design.evaluation.nearby
    assert design.evaluation.nearby.growth[design.evaluation.nearby.worst] > LARGEST_GROWTH  # the search likes the edge
    design.save(tmp_path)
    loaded = fp.Design.load(tmp_path)
    assert loaded.under_noise is not None and loaded.under_noise.nearby == design.under_noise.nearby
    assert to_text(design_report(loaded)) == to_text(design_report(design))
    assert "not 2 of them away from it" in " ".join(to_text(design_report(loaded)).split())


@pytest.mark.parametrize(
    "change",
    [
        {"points": [3]},
        {"points": [-1]},
        {"points": [0.5]},
        {"growth": {"m": 1.0}},
        {"growth": {"m": 1.0, "F": "much"}},
        {"lost": {"vanished": 1}},
        {"lost": {"left_domain": 0}},
        {"parameters": {"m": 1.0, "F": None}},
    ],
)
def test_a_file_with_something_else_is_refused(change: dict[str, Any], tmp_path: Path) -> None:
    fp.exchange(slider(), 3, n_candidates=5, max_iterations=2, method=fp.ExchangeMethod(references=False)).save(tmp_path)
    for name, value in change.items():
        edit(tmp_path / "design.json", f"under_noise.nearby.{name}", encoded(value))
    with pytest.raises(ValueError, match=r"design\.json"):
        fp.Design.load(tmp_path)


def test_the_cylinder_is_silent() -> None:
    for seed in range(2):
        design = fp.exchange(cylinder(), method=fp.ExchangeMethod("paper", references=False), seed=seed, max_iterations=100)
        assert design.under_noise is not None and design.under_noise.nearby is not None
        assert max(design.under_noise.nearby.growth.values()) < 1.3
        assert not design.under_noise.nearby.without_trajectory
        assert "away from it" not in " ".join(to_text(design_report(design)).split())


def test_only_the_sensor_noise_promises() -> None:
    assert fp.evaluate(cylinder(output_covariance="pooled"), points_of_cylinder()).nearby is None
    assert fp.evaluate(slider(), points(PUSHED)).nearby is None  # singular


def points_of_cylinder() -> fp.Experiments:
    return fp.exchange(cylinder(), n_candidates=5, max_iterations=2, method=fp.ExchangeMethod(references=False)).points


def test_points_without_a_trajectory_there_are_counted_and_told() -> None:
    tank = fp.SymbolicModel(["-k*sqrt(h)"], ["h"], {"h": "m"}, {}, {"k": "sqrt(m)/s"}, {"h": "m"})
    prior = fp.GaussianPrior(mean={"k": 1.0}, relative_std={"k": 0.3})
    problem = fp.DesignProblem(tank, prior, None, noise={"h": 0.05})
    given = fp.Experiments.of_table(tank, np.array([[1.0, 1.0], [1.0, 1.95]]))  # empty after 2/k
    evaluated = evaluate_points(problem, given)
    assert evaluated.evaluation.nearby is not None
    assert evaluated.evaluation.nearby.without_trajectory == evaluated.evaluation.nearby.lost == {"left_domain": 1}
    text = " ".join(warnings_of(problem, given))
    assert "Points have no trajectory where the parameters are 2 standard errors off: 1 left_domain." in text


def test_previous_points_count_and_are_told_apart() -> None:
    problem, previous = slider(), points(BALANCED)
    evaluation = fp.evaluate(problem, points(BRAKING, PUSHED), previous=previous)
    assert evaluation.nearby is not None and evaluation.nearby.points == (0,) and evaluation.nearby.broken
    far = slider(region=fp.ExperimentRegion({"v": (0.0, 0.0), "f": (4.0, 5.0), "dt": (0.1, 0.2)}))
    design = fp.exchange(far, 2, n_candidates=5, max_iterations=2, method=fp.ExchangeMethod(references=False), previous=previous)
    assert "where previous points have much less information" in " ".join(to_text(design_report(design)).split())


def test_jumps_that_candidates_may_not_meet_are_crossed_there_as_fits_cross_them() -> None:
    problem = slider(jumps="exclude", region=None)
    stopping = [1.0, 0.0, 0.99]  # comes to rest at 1 s
    nearby = evaluate_points(problem, points(stopping, [1.0, 5.0, 0.2])).evaluation.nearby
    assert nearby is not None and not nearby.without_trajectory and nearby.broken
    assert "exclude" not in warnings_of(problem, points(stopping, [1.0, 5.0, 0.2]))[0]


def test_log_normal_parameters_stay_positive() -> None:
    prior = fp.GaussianPrior(mean={"m": 1.0, "F": 1.0}, std={"m": 0.3, "F": 2.0}, log=["F"])
    problem = fp.DesignProblem(SLIDER, prior, None, noise={"v": 5.0})
    nearby = evaluate_points(problem, points(BRAKING, PUSHED, [0.0, 1.5, 1.0])).evaluation.nearby
    assert nearby is not None and all(value > 0 for value in nearby.parameters.values())


@pytest.mark.parametrize("rows", [1, 24, 25, 1000])
def test_long_matrices_are_made_short_without_a_loss(rows: int) -> None:
    matrix = np.random.default_rng(rows).standard_normal((rows, 3)) * [1.0, 1e6, 1e-6]
    short = _shortened(matrix)
    assert len(short) <= 24
    np.testing.assert_allclose(short.T @ short, matrix.T @ matrix, rtol=1e-10, atol=1e-12)
