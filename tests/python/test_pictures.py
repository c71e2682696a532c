"""Pictures show what was stored of them, and so what was looked at; `picture_data` says how to record them anew."""

from __future__ import annotations

import json
import re
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib")

import fisherpoint as fp
from fisherpoint.design.results.pictures_trajectories import _percentile
from picture_cases import PICTURES
from picture_data import STORED, data_of, differences

RECORD = "python tests/python/picture_data.py"

TRIED = {
    "plot_points", "plot_responses", "plot_trajectories", "plot_standard_errors", "plot_correlation", "plot_criterion", "plot_of",
    "plot_runs", "plot_information", "plot_parity", "plot_residuals", "plot_time", "plot_autocorrelation", "plot_ellipses",
    "plot_profiles", "plot_local",
    "plot_validation", "plot_comparison", "plot_campaign", "plot_sweep", "plot_shares",
    "plot_windows", "plot_failures", "plot_singular_values", "plot_rules",
    "sensitivity_figure", "standard_error_figure", "correlation_figure", "save_figure",
}  # fmt: skip
"""Functions that draw, each in a picture of `PICTURES`."""


@pytest.fixture(scope="module")
def stored() -> dict[str, Any]:
    return dict(json.loads(STORED.read_text(encoding="utf-8")))


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_shows_what_was_stored(name: str, stored: dict[str, Any]) -> None:
    found = list(differences(data_of(PICTURES[name]()), stored.get(name)))
    assert not found, "\n".join([*found[:20], f"Look at the picture; if it is right, run {RECORD}"])


def test_nothing_else_is_stored(stored: dict[str, Any]) -> None:
    assert sorted(stored) == sorted(PICTURES)


def test_every_function_that_draws_is_tried() -> None:
    sources = Path(fp.__file__).parent.rglob("*.py")
    drawing = {name for path in sources for name in re.findall(r"^def (plot_\w+|\w+_figure)\(", path.read_text(), re.MULTILINE)}
    assert drawing == TRIED, "of a new one a picture belongs into picture_cases.py"


def test_a_difference_is_named() -> None:
    shown = data_of(PICTURES["comparison"]())
    assert list(differences(shown, json.loads(json.dumps(shown)))) == []
    other = json.loads(json.dumps(shown))
    other["panels"][0]["labels"][0] = "share"
    other["panels"][0]["lines"][0]["at_0"][0] *= 1.01
    assert [text.partition(":")[0] for text in differences(shown, other)] == ["panels[0].labels[0]", "panels[0].lines[0].at_0"]


@pytest.mark.parametrize("share", [0.0, 5.0, 50.0, 95.0, 100.0])
def test_the_shade_is_of_the_plants_that_are_still_there(share: float) -> None:
    paths = np.random.default_rng(0).standard_normal((3, 40, 5, 2))
    paths[0, 3, 2:], paths[0, 7:19, 4], paths[1, :, 3:], paths[2, 1:, 1] = np.nan, np.nan, np.nan, np.nan
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of those of which none is there
        expected = np.nanpercentile(paths, share, axis=1)
    assert np.isnan(expected[1, 3:]).all() and np.isfinite(expected[0]).all()
    np.testing.assert_allclose(_percentile(paths, share), expected, rtol=1e-14)


def test_a_correlation_of_many_parameters_has_the_width_of_a_page_and_no_numbers() -> None:
    from fisherpoint.show.parameter_pictures import MOST_WITH_NUMBERS, correlation_figure

    for count in (MOST_WITH_NUMBERS, MOST_WITH_NUMBERS + 1, 54, 300):
        names = [f"p_{i}" for i in range(count)]
        figure = correlation_figure(np.eye(count), names, "Correlation", "none")
        axes = figure.axes[0]
        assert figure.get_size_inches()[0] < 13.0
        assert len(axes.texts) == (count**2 if count <= MOST_WITH_NUMBERS else 0)
        shown = [label.get_text() for label in axes.get_yticklabels()]
        assert shown == names[:: round(count / len(shown))] and axes.get_yticklabels()[0].get_fontsize() >= 7.0


def test_trajectories_of_many_outputs_stand_in_bands_below_each_other() -> None:
    from fisherpoint.design.results.evaluated_points import evaluate_points
    from fisherpoint.design.results.pictures_trajectories import plot_trajectories
    from fisherpoint.show.panels import COLUMNS, MOST_PANELS

    model = fp.SymbolicModel(["-k*x"], [f"x + {i}" for i in range(20)], {"x": "1"}, {}, {"k": "1/s"}, check_units=False)
    prior = fp.GaussianPrior({"k": 1.0}, relative_std={"k": 0.1})
    problem = fp.DesignProblem(model, prior, None, noise=dict.fromkeys([q.name for q in model.outputs], 0.1))
    points = fp.Experiments(np.arange(1.0, 11.0)[:, None], np.zeros((10, 0)), np.linspace(0.5, 1.0, 10))
    figure = plot_trajectories(evaluate_points(problem, points))
    panels = [axes for axes in figure.axes if axes.lines]
    assert len(panels) == len(figure.axes) == 20 * (MOST_PANELS // 20)
    lefts = {round(axes.get_position().x0, 6) for axes in panels}
    assert len(lefts) == 5 <= COLUMNS and figure.get_size_inches()[0] < 16.0
    titles = {axes.get_title(): axes.get_position() for axes in panels if axes.get_title()}
    assert len(titles) == 20
    boxes = sorted((axes.get_position() for axes in panels), key=lambda box: (round(box.x0, 6), -box.y0))
    assert all(below.y1 < above.y0 for above, below in pairwise(boxes) if round(above.x0, 6) == round(below.x0, 6))
    assert min(box.y0 for box in boxes) > 0 and max(box.y1 for box in boxes) < 1
