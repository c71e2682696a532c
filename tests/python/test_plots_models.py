"""Pictures of designs for models other than the cylinder: which kind is drawn, with which axes and labels."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import fisherpoint as fp
from fisherpoint.design.results import pictures_points
from fisherpoint.design.results.evaluated_points import evaluate_points
from fisherpoint.design.results.pictures import plot_points, plot_trajectories
from fisherpoint.design.results.pictures_responses import free_axis, plot_responses
from fisherpoint.show.parameter_pictures import standard_error_figure
from fisherpoint.show.style import said, scale
from fisherpoint.show.time_axes import make_logarithmic


@fp.model(states={"c": "kg/m3"}, parameters={"k": "1/s"}, outputs={"c": "kg/m3", "rate": "kg/(m3 s)"})
def decay(x, u, p):  # type: ignore[no-untyped-def]
    return [-p.k * x.c], [x.c, p.k * x.c]


@fp.model(inputs={"s": "1", "t": "1"}, parameters={"a": "1", "b": "1"}, outputs={"y": "1"})
def plane(x, u, p):  # type: ignore[no-untyped-def]
    return None, [p.a * u.s + p.b * u.t]


def design(model: fp.SymbolicModel, bounds: dict[str, tuple[float, float]], n: int = 4, noise: bool = True) -> fp.Design:
    mean = {quantity.name: 1e-4 for quantity in model.parameters}
    prior = fp.GaussianPrior(mean=mean, relative_std=dict.fromkeys(mean, 0.1))
    known = {quantity.name: 0.1 for quantity in model.outputs} if noise else None
    given = fp.DesignProblem(model, prior, fp.ExperimentRegion(bounds), noise=known)
    return fp.exchange(given, n, n_candidates=10, max_iterations=20, method=fp.ExchangeMethod(references=False))


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


@pytest.mark.parametrize("noise", [True, False])
def test_a_design_in_one_variable_is_shown_on_its_outputs(noise: bool) -> None:
    found = design(decay, {"c": (1.0, 1.0), "dt": (1.0, 40_000.0)}, noise=noise)
    assert free_axis(found) is not None
    figure = plot_points(found)
    assert [axes.get_ylabel() for axes in figure.axes] == ["c [kg/m3]", "rate [kg/(m3 s)]" if noise else "rate [1e-6 kg/(m3 s)]"]
    assert (figure.axes[-1].get_xlabel(), figure.axes[0].get_xscale()) == ("dt, logarithmic", "log")
    curve = figure.axes[0].lines[0].get_xydata()
    np.testing.assert_allclose(curve[:, 1], np.exp(-1e-4 * curve[:, 0]), atol=1e-5)  # type: ignore[index,call-overload]
    numbers = sorted(int(n) for text in figure.axes[0].texts for n in text.get_text().split(", "))
    assert numbers == [1, 2, 3, 4]


def test_numbers_of_samples_are_off_the_curve_and_the_bars() -> None:
    problem = design(decay, {"c": (1.0, 1.0), "dt": (1.0, 40_000.0)}).problem.replace(noise={"c": 0.1, "rate": 1e-5})
    figure = plot_points(evaluate_points(problem, fp.Experiments([[1.0]] * 8, np.empty((8, 0)), [8000.0] * 8)))
    figure.draw_without_rendering()
    for axes in figure.axes:
        (label,) = axes.texts
        assert label.get_text() == "1, 2, 3, 4, 5, 6, 7, 8"
        box = label.get_window_extent()
        curve = axes.transData.transform(axes.lines[0].get_xydata())
        bars = axes.transData.transform(np.vstack([bar for lines in axes.collections for bar in lines.get_segments()]))  # type: ignore[attr-defined]
        assert box.count_contains(curve) == 0 and box.count_contains(bars) == 0


def test_a_static_design_in_two_variables_is_shown_over_these() -> None:
    found = design(plane, {"s": (-1.0, 1.0), "t": (-1.0, 1.0)})
    assert free_axis(found) is None
    axes = plot_points(found).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("s", "t")
    with pytest.raises(ValueError, match=r"^design: expected a region that leaves a single coordinate free"):
        plot_responses(found)


def test_starts_that_lie_on_each_other_share_a_label() -> None:
    bounds = {"x": (0.0, 1.0), "v": (1.0, 1.0), "dt": (0.1, 1.0)}

    @fp.model(states={"x": "m", "v": "m/s"}, parameters={"d": "1/s"}, outputs={"x": "m"})
    def sliding(x: Any, u: Any, p: Any) -> Any:
        return [x.v, -p.d * x.v], [x.x]

    found = design(sliding, bounds, n=6)
    labels = [text for text in texts(plot_points(found)) if text]
    by_panel = [int(n) for text in labels for n in re.findall(r"\d+", text)]
    assert sorted(by_panel) == sorted([1, 2, 3, 4, 5, 6] * 2)


def test_numbers_of_points_lie_within_the_axes() -> None:
    """Where they would run into the labels of the axes, of these or of the panel beside."""
    found = design(plane, {"s": (-1.0, 1.0), "t": (-1.0, 1.0)}, n=24)
    figure = plot_points(found)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    numbers = [text.get_window_extent() for text in axes.texts]
    assert max(len(text.get_text()) for text in axes.texts) > 10  # several numbers at one corner
    for box in numbers:
        assert axes.bbox.x0 <= box.x0 and box.x1 <= axes.bbox.x1


def test_the_legend_of_a_single_output_fits_its_picture() -> None:
    found = design(plane, {"s": (-1.0, 1.0), "t": (-1.0, 1.0)})
    figure = plot_points(found)
    figure.draw_without_rendering()
    moving = design(decay, {"c": (0.5, 1.0), "dt": (1.0, 100.0)})
    figure = plot_trajectories(moving)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert box.x0 >= 0 and box.x1 <= figure.bbox.x1


def test_shares_along_a_logarithmic_axis_have_their_digits() -> None:
    errors, std = {"a": 5e-4, "b": 0.5}, {"a": 1.0, "b": 1.0}
    figure = standard_error_figure(errors, std, "under the sensor noise", {"a": "N", "b": "1"})
    figure.draw_without_rendering()
    axes = figure.axes[0]
    low, high = axes.get_xlim()
    labels = [label.get_text() for label in axes.get_xticklabels() if low <= label.get_position()[0] <= high]
    assert labels == ["0.1%", "1%", "10%", "100%"]
    assert [text.get_text() for text in axes.texts] == ["0.000500 of 1.00 N", "0.500 of 1.00"]


@pytest.mark.parametrize(
    ("largest", "factor", "unit"),
    [
        (2e5, 1 / 3600, "h"),
        (1e3, 1 / 60, "min"),
        (200.0, 1 / 60, "min"),
        (100.0, 1.0, "s"),
        (4e5, 1 / 86400, "d"),
        (0.05, 1e3, "ms"),
    ],
)
def test_times_have_units_that_are_easy_to_read(largest: float, factor: float, unit: str) -> None:
    assert scale(fp.Quantity("dt", "s"), [0.0, largest]) == (pytest.approx(factor), unit)


def test_trajectories_without_some_values_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a sample at which the right-hand side jumps."""
    swing = fp.SymbolicModel(["v", "-k*x"], ["x"], {"x": "m", "v": "m/s"}, {}, {"k": "1/s2"}, {"y": "m"})
    found = design(swing, {"x": (0.0, 1.0), "v": (0.0, 1.0), "dt": (0.1, 1.0)}, n=2)

    def cut(*arguments: Any) -> Any:
        states, outputs = trajectories(*arguments)
        states[0, :, -6], outputs[0, :, -6] = np.nan, np.nan
        states[1], outputs[1] = np.nan, np.nan
        return states, outputs

    trajectories = pictures_points.paths_of
    monkeypatch.setattr(pictures_points, "paths_of", cut)
    plot_points(found).savefig(tmp_path / "points.png")


def test_points_alike_share_a_row_of_trajectories() -> None:
    relaxing = fp.SymbolicModel(["-k*x"], ["x"], {"x": "m"}, {}, {"k": "1/s"}, {"y": "m"})
    prior = fp.GaussianPrior({"k": 1.0}, relative_std={"k": 0.1})
    table = [[1.0, 2.0], [1.0, 2.001], [1.0, 500.0], [1.0, 1.99]]
    points = fp.Experiments.of_table(relaxing, np.array(table))
    problem = fp.DesignProblem(relaxing, prior, None, noise={"y": 0.01})
    figure = plot_trajectories(evaluate_points(problem, points))
    assert [text.get_text() for text in figure.texts] == ["1\n2\n4", "3"]
    short, long = figure.axes
    assert (short.get_xlabel(), long.get_xlabel()) == ("t [s]", "t, logarithmic")
    # Of 500 s, those in which something happens are drawn, too.
    line = long.lines[0]
    t, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
    assert y == pytest.approx(np.exp(-t), abs=1e-5) and ((y > 0.05) & (y < 0.95)).sum() >= 15


def two_times() -> tuple[fp.DesignProblem, fp.Experiments]:
    """A transient of 1 s and one of 1000 s, in points of half a second to two hours."""
    model = fp.SymbolicModel(
        ["(u - a)/tau", "(u - b)/T"], ["a", "b"], {"a": "V", "b": "V"}, {"u": "V"}, {"tau": "s", "T": "s"}, {"y": "V", "z": "V"}
    )
    prior = fp.GaussianPrior({"tau": 1.0, "T": 1000.0}, relative_std={"tau": 0.2, "T": 0.2})
    region = fp.ExperimentRegion({"a": (0.0, 1.0), "b": (0.0, 1.0), "u": (0.0, 1.0), "dt": (0.1, 1e4)})
    table = [[0.2, 0.1, 1.0, dt] for dt in (0.5, 5.0, 8000.0)]
    return fp.DesignProblem(model, prior, region, noise={"y": 0.01, "z": 0.01}), fp.Experiments.of_table(model, np.array(table))


def test_durations_over_decades_have_a_logarithmic_axis() -> None:
    problem, points = two_times()
    figure = plot_points(evaluate_points(problem, points))
    figure.draw_without_rendering()
    axes = figure.axes[-2]
    assert (axes.get_xlabel(), axes.get_xscale()) == ("dt, logarithmic", "log")
    assert [label.get_text() for label in axes.get_xticklabels()] == ["100 ms", "1 s", "10 s", "10 min", "6 h"]
    at = axes.transAxes.inverted().transform(axes.transData.transform([[float(dt), 1.0] for dt in points.dt]))[:, 0]
    assert (np.diff(at) > 0.1).all()  # beside each other, not on one another


def test_what_is_fast_at_first_is_drawn_over_a_logarithmic_time() -> None:
    problem, points = two_times()
    figure = plot_trajectories(evaluate_points(problem, points))
    assert [axes.get_xscale() for axes in figure.axes] == ["linear"] * 4 + ["log"] * 2
    fast = figure.axes[4].lines[0]
    t, y = np.asarray(fast.get_xdata(), float), np.asarray(fast.get_ydata(), float)
    assert 0.001 < t[0] < 0.05 and t[-1] == pytest.approx(8000.0)
    assert y == pytest.approx(1 - 0.8 * np.exp(-t), abs=1e-5) and ((y > 0.25) & (y < 0.95)).sum() >= 10


def test_curves_of_points_tell_values_with_their_units() -> None:
    problem, points = two_times()
    line = plot_trajectories(evaluate_points(problem, points)).axes[0].lines[0]
    assert line.get_label() == "point 1: y is 0.2 V at the start, 0.5148 V after 500 ms, at the prior mean"


@pytest.mark.parametrize(
    ("low", "high", "named"),
    [
        (0.1, 1e4, ["100 ms", "1 s", "10 s", "10 min"]),
        (7200.0, 720_000.0, ["6 h", "1 d"]),
        (1e-3, 1.0, ["1 ms", "10 ms", "100 ms", "1 s"]),
    ],
)
def test_a_logarithmic_axis_names_durations(low: float, high: float, named: list[str]) -> None:
    axes = Figure().subplots()
    make_logarithmic(axes, low, high)
    assert [label.get_text() for label in axes.get_xticklabels()] == named


def test_numbers_of_points_are_off_the_paths() -> None:
    problem, _ = two_times()
    many = fp.Experiments.of_table(problem.model, np.array([[0.2, 0.1, 1.0, dt] for dt in np.geomspace(0.1, 1e4, 12)]))
    figure = plot_points(evaluate_points(problem, many))
    figure.draw_without_rendering()
    axes = figure.axes[0]
    (label,) = (text for text in axes.texts if text.get_text())
    ways = np.vstack([axes.transData.transform(line.get_xydata()) for line in axes.lines])
    assert len(re.findall(r"\d+", label.get_text())) == 12 and label.get_window_extent().count_contains(ways) == 0


def test_a_panel_of_fixed_quantities_is_left_out() -> None:
    model = fp.SymbolicModel(
        ["v", "-k*x + u"], ["x"], {"x": "m", "v": "m/s"}, {"u": "N"}, {"k": "1/s2"}, {"y": "m"}, check_units=False
    )
    prior = fp.GaussianPrior({"k": 1.0}, relative_std={"k": 0.1})
    region = fp.ExperimentRegion({"x": (0.0, 0.0), "v": (0.0, 0.0), "u": (-1.0, 1.0), "dt": (0.1, 2.0)})
    points = fp.Experiments.of_table(model, np.array([[0.0, 0.0, 1.0, 2.0], [0.0, 0.0, -1.0, 1.0]]))
    figure = plot_points(evaluate_points(fp.DesignProblem(model, prior, region, noise={"y": 0.1}), points))
    assert [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes[:-1]] == [("dt [s]", "u [N]")]


@pytest.mark.parametrize(
    ("unit", "largest", "shown"),
    [("m3", 4e-6, (1e6, "1e-6 m3")), ("1", 2e7, (1e-6, "1e6")), ("Pa", 2e7, (1e-6, "MPa")), ("1/s", 0.5, (1.0, "1/s"))],
)
def test_powers_of_ten_are_part_of_the_unit(unit: str, largest: float, shown: tuple[float, str]) -> None:
    factor, text = scale(fp.Quantity("q", unit), [0.0, largest])
    assert (factor, text) == (pytest.approx(shown[0]), shown[1])
    assert said(fp.Quantity("q", unit), largest) == {"m3": "4e-6 m3", "1": "2e7", "Pa": "20 MPa", "1/s": "0.5 1/s"}[unit]
