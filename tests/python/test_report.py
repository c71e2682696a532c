"""Reports and pictures: what must be said, in which cases, and that every picture can be drawn."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import fisherpoint as fp
from fisherpoint.design.results import pictures as plots
from fisherpoint.design.results import report
from fisherpoint.design.results.evaluated_points import evaluate_points
from fisherpoint.design.results.frames import parameter_frame, simulation_frame
from fisherpoint.design.results.picture_list import plots_of
from fisherpoint.show import numbers
from fisherpoint.show.section import to_text

NOISE_STD = {"q": 5e-6, "p_A": 2e4, "p_B": 2e4, "x_v": 1e-3}
RELATIVE_STD = dict(a_tau=0.3, b_tau=0.2, m_q=0.05, E_oil=0.2, p_t=0.2, B_v=0.1, c_L=0.3, V_0A=0.1, V_0B=0.1)
BOUNDS = dict(q=(0.03, 0.27), v=(-0.25, 0.25), p_A=(2e6, 19e6), p_B=(2e6, 19e6), x_v=(-1, 1), u=(-1, 1), dt=(1e-3, 1e-2))


def problem(noise: dict[str, float] | None, output_covariance: str | None = None) -> fp.DesignProblem:
    model = fp.HydraulicCylinder()
    prior = fp.GaussianPrior(mean=model.nominal, relative_std=RELATIVE_STD)
    rule = fp.TensorGrid(levels={name: 2 if name in ("E_oil", "B_v") else 1 for name in prior.names})
    region = fp.ExperimentRegion(BOUNDS)
    return fp.DesignProblem(model, prior, region, noise=noise, rule=rule, output_covariance=output_covariance)


@pytest.fixture(scope="module")
def design() -> fp.Design:
    """A quick design by the paper's criterion, the noise known."""
    return fp.exchange(problem(NOISE_STD, "pooled"), n_candidates=5, max_iterations=4)


def with_changes(design: fp.Design, **changes: Any) -> fp.Design:
    """A design in which some fields, or what is computed of them and kept, have other values."""
    names = {one.name for one in fields(design)}
    changed = replace(design, **{name: value for name, value in changes.items() if name in names})
    vars(changed).update({name: value for name, value in changes.items() if name not in names})
    return changed


def efficiency(**values: Any) -> Any:
    names = "under_noise at_most at_least n_candidates best_found vs_best random_median vs_random below_random bound vs_bound"
    return SimpleNamespace(**dict.fromkeys(names.split(), None) | values)


def words(text: str) -> str:
    """The text in one line, as tables break lines where they need to."""
    return " ".join(text.split())


def test_design_report_says_all_that_matters(design: fp.Design) -> None:
    text = to_text(report.design_report(design), 100)
    for part in (
        "Points: start in this state",
        "m3/(s sqrt(Pa))",
        "under the sensor noise (D = R)",
        "R + mean predictive covariance of the points, (17)",
        "of the best that another search with D = R found",
        "of the median random design",
        "Plants that can run the design",
        "The search has not seen these plants.",
        "all iterations done",
        "rule over the prior TensorGrid(levels=",
        "distinct points",
        "Rejected candidates",
    ):
        assert part in words(text), part
    for reason, count in design.rejected.items():
        assert f"{reason} {count}" in words(text)
    assert max(map(len, text.splitlines())) <= 100


def test_standard_errors_are_those_under_the_noise_whatever_the_criterion(design: fp.Design) -> None:
    assert design.under_noise is not None and design.under_noise.standard_errors and design.evaluation.standard_errors
    text = to_text(report.design_report(design))
    assert text.split("\n\nWarning: ")[0].count("standard error ") == 1
    assert "under the D of the criterion" not in text
    for name, error in design.under_noise.standard_errors.items():
        row = next(line for line in text.splitlines() if line.split()[:1] == [name])
        assert numbers.computed(error) in row
        assert numbers.computed(design.evaluation.standard_errors[name]) not in row
    drawn = plots.plot_standard_errors(design).axes[0].lines[-1].get_xdata()
    expected = [design.under_noise.standard_errors[name] / design.under_noise.prior_std[name] for name in design.problem.estimated]
    np.testing.assert_allclose(np.asarray(drawn), expected, rtol=1e-12)


def test_a_design_below_random_is_warned_of(design: fp.Design) -> None:
    for below in (True, False):
        changed = with_changes(
            design,
            efficiency=efficiency(
                under_noise=1.0, best_found=9.0, random_median=2.0, vs_best=0.4, vs_random=0.9, below_random=below
            ),
        )
        text = words(to_text(report.design_report(changed)))
        assert ("worse than the median random design" in text) is below
        assert ("this design has 40.0 % of what another search with D = R found" in text) is not below
        assert "90.0 %" in text and "the better it is optimised, the worse the estimates may be" in text


def test_any_pooled_design_is_warned_of(design: fp.Design) -> None:
    """Also where nothing is known of what it is worth; a design with another D is not."""
    text = words(to_text(report.design_report(with_changes(design, efficiency=None))))
    assert "the better it is optimised, the worse the estimates may be" in text and "docs/explanation/output_covariance.md" in text
    assert "optimised" not in str(
        fp.exchange(problem(NOISE_STD, "noise"), 9, n_candidates=4, max_iterations=1, method=fp.ExchangeMethod(references=False))
    )


@pytest.mark.parametrize(
    ("reason", "settings", "expected"),
    [
        ("patience", {"method": fp.ExchangeMethod(patience=7)}, "no exchange for too long: 7 iterations"),
        ("time_limit", {"method": fp.ExchangeMethod(time_limit=2.5)}, "the time limit of 2.5 s"),
        ("interrupted", {}, "interrupted"),
    ],
)
def test_the_stop_reason_is_a_sentence(design: fp.Design, reason: str, settings: dict[str, Any], expected: str) -> None:
    changed = with_changes(design, stop_reason=fp.StopReason(reason), settings=replace(design.settings, **settings))
    assert expected in words(to_text(report.design_report(changed)))


def test_plants_that_cannot_run_a_design_are_told_first(design: fp.Design) -> None:
    found = design.feasibility
    assert found is not None and found.draws == 1000
    assert found.able == fp.feasibility(design.problem, design.points, seed=design.settings.seed + 1_000_003).able
    assert ("can run all points" in str(design)) == (found.share < 0.99)
    half = with_changes(design, feasibility=replace(found, able=900))
    assert report.design_report(half).warnings[0].startswith("Only 90.0 % of the plants that the prior allows can run all points")
    text = to_text(report.design_report(with_changes(design, feasibility=None)))
    assert "Plants that can run the design" not in text


def test_under_the_noise_there_is_one_table(design: fp.Design) -> None:
    evaluated = evaluate_points(problem(NOISE_STD), design.points)
    assert evaluated.under_noise is evaluated.evaluation
    text = to_text(report.evaluation_report(evaluated))
    assert text.count("prior std  standard error") == 1
    assert "No standard errors" not in text and "log det F under the noise" not in text


def test_without_noise_nothing_is_promised_and_left_out_outputs_are_named(design: fp.Design) -> None:
    evaluated = evaluate_points(problem(None), design.points)
    text = words(to_text(report.evaluation_report(evaluated)))
    assert evaluated.under_noise is None
    assert "\nThe D of the\n" not in to_text(report.evaluation_report(evaluated))
    assert "No standard errors" in text and "Give [noise]" in text
    assert "RSE" not in text and "stays above half the prior std" not in text
    assert "x_v: no noise is given and no parameter" in text
    frame = parameter_frame(evaluated.problem, evaluated.under_noise)
    assert frame.standard_error.isna().all() and frame.rse.isna().all() and frame.prior_std.notna().all()
    with pytest.raises(ValueError, match="noise: expected the sensor noise"):
        plots.plot_standard_errors(evaluated)
    assert "standard_errors" not in plots_of(evaluated)


def test_singular_designs_name_what_they_do_not_determine(design: fp.Design) -> None:
    evaluated = evaluate_points(problem(NOISE_STD), design.points[:1])
    text = words(to_text(report.evaluation_report(evaluated)))
    assert f"{evaluated.evaluation.rank} of 9: singular" in text
    assert text.count("not determined") == len(evaluated.evaluation.null_directions)
    assert parameter_frame(evaluated.problem, evaluated.evaluation).standard_error.isna().all()
    assert len([plot() for plot in plots_of(evaluated).values()]) == 4


def test_weak_parameters_are_those_above_half_the_prior(design: fp.Design) -> None:
    evaluated = evaluate_points(problem(NOISE_STD, "pooled"), design.points)
    assert evaluated.under_noise is not None
    frame = parameter_frame(evaluated.problem, evaluated.under_noise)
    weak = tuple(frame.index[frame.of_prior > 0.5])
    assert evaluated.under_noise.weak_parameters == weak
    text = words(to_text(report.evaluation_report(evaluated)))
    assert ("stays above half the prior std" in text) == bool(weak)


def test_simulation_report_counts_statuses() -> None:
    model = fp.HydraulicCylinder()
    points = fp.Experiments(
        [
            [
                0.15,
                0.1,
                8e6,
                8e6,
                0.5,
            ]
        ]
        * 50,
        [[-0.5]] * 50,
        np.full(50, 2e-3),
    )
    theta = np.array(list(model.nominal.values()))
    done = fp.simulate(model, points, theta)
    status = np.array(done.status)
    status[3] = fp.Status.left_domain
    text = words(to_text(report.simulation_report(model, points, done.y, status)))
    assert "ok 49" in text
    assert "left_domain 1" in text
    assert "... and 10 more" in text
    frame = simulation_frame(model, points, done.y, status)
    assert list(frame.status[:4]) == ["ok", "ok", "ok", "left_domain"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (numbers.number(1.2e9), "1.2e9"),
        (numbers.number(-2.5e-10), "-2.5e-10"),
        (numbers.number(float("nan")), "-"),
        (numbers.computed(2e-10), "2.00e-10"),
        (numbers.computed(150.0), "150"),
        (numbers.percent(0.0123), "1.23 %"),
        (numbers.percent(1.0), "100 %"),
        (numbers.percent(2e-5), "< 0.01 %"),
        (numbers.percent(12.34), "12.3 times"),
    ],
)
def test_numbers(text: str, expected: str) -> None:
    assert text == expected


def test_a_p_value_that_no_test_is_exact_enough_for_is_a_bound() -> None:
    assert [numbers.probability(p) for p in (0.0, 1e-300, 9e-7, 1e-6, 0.019, 1.0)] == ["< 1e-6"] * 3 + ["1e-6", "0.019", "1"]
    assert (numbers.p_value_text(0.0), numbers.p_value_text(0.25)) == ("p < 1e-6", "p = 0.25")


def test_columns_line_up() -> None:
    assert numbers.column([0.5, -0.0312, float("nan")]) == ["0.5000", "-0.0312", "-"]
    assert numbers.column([2e6, 1.9e7]) == ["2.000e6", "1.900e7"]
    assert numbers.column([0.0, 0.0]) == ["0", "0"]
    assert numbers.column([0.25, 0.0, 0.00004]) == ["0.2500", "0.0000", "4.0e-5"]


def test_every_picture_is_a_figure_of_its_own(design: fp.Design, tmp_path: Path) -> None:
    for plot in (
        plots.plot_criterion,
        plots.plot_points,
        plots.plot_standard_errors,
        plots.plot_correlation,
        plots.plot_trajectories,
    ):
        assert isinstance(plot(design), Figure)
    drawn = design._plots()
    assert list(drawn) == ["criterion", "points", "standard_errors", "correlation", "trajectories"]
    for name, plot in drawn.items():
        design.plot(name, path=tmp_path / name)
        assert isinstance(plot(), Figure) and (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_pictures_do_not_need_pyplot() -> None:
    code = "import sys, fisherpoint.design.results.pictures; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
