"""Pictures of designs for models other than the cylinder: which kind is drawn, with which axes and labels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import fisherpoint as fp
from fisherpoint.design import pictures_points
from fisherpoint.design.pictures import plot_points, plot_trajectories
from fisherpoint.design.pictures_responses import free_axis, plot_responses
from fisherpoint.show.style import scale


@fp.model(states={"c": "kg/m3"}, parameters={"k": "1/s"}, outputs={"c": "kg/m3", "rate": "kg/(m3 s)"})
def decay(x, u, p):  # type: ignore[no-untyped-def]
    return [-p.k * x.c], [x.c, p.k * x.c]


@fp.model(inputs={"s": "1", "t": "1"}, parameters={"a": "1", "b": "1"}, outputs={"y": "1"})
def plane(x, u, p):  # type: ignore[no-untyped-def]
    return None, [p.a * u.s + p.b * u.t]


def design(model: fp.SymbolicModel, bounds: dict[str, tuple[float, float]], n: int = 4, noise: bool = True) -> fp.Design:
    mean = {quantity.name: 1e-4 for quantity in model.parameters}
    prior = fp.GaussianPrior(mean=mean, relative_std=dict.fromkeys(mean, 0.1))
    noise_std = {quantity.name: 0.1 for quantity in model.outputs}
    given = fp.DesignProblem(model, prior, fp.ExperimentRegion(bounds), noise_std=noise_std if noise else None)
    return fp.exchange(given, n, n_candidates=10, max_iterations=20, references=False)


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


@pytest.mark.parametrize("noise", [True, False])
def test_a_design_in_one_variable_is_shown_on_its_outputs(noise: bool) -> None:
    found = design(decay, {"c": (1.0, 1.0), "dt": (1.0, 40_000.0)}, noise=noise)
    assert free_axis(found) is not None
    figure = plot_points(found)
    assert [axes.get_ylabel() for axes in figure.axes] == ["c [kg/m3]", "rate [kg/(m3 s)]"]
    assert figure.axes[-1].get_xlabel() == "dt [h]"
    curve = figure.axes[0].lines[0].get_xydata()
    np.testing.assert_allclose(curve[:, 1], np.exp(-1e-4 * 3600 * curve[:, 0]), atol=1e-5)  # type: ignore[index,call-overload]
    numbers = sorted(int(n) for text in figure.axes[0].texts for n in text.get_text().split(", "))
    assert numbers == [1, 2, 3, 4]


def test_a_static_design_in_two_variables_is_shown_over_these() -> None:
    found = design(plane, {"s": (-1.0, 1.0), "t": (-1.0, 1.0)})
    assert free_axis(found) is None
    axes = plot_points(found).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("s [1]", "t [1]")
    with pytest.raises(ValueError, match=r"^design: expected a region that leaves a single coordinate free"):
        plot_responses(found)


def test_starts_that_lie_on_each_other_share_a_label() -> None:
    bounds = {"x": (0.0, 1.0), "v": (1.0, 1.0), "dt": (0.1, 1.0)}

    @fp.model(states={"x": "m", "v": "m/s"}, parameters={"d": "1/s"}, outputs={"x": "m"})
    def sliding(x: Any, u: Any, p: Any) -> Any:
        return [x.v, -p.d * x.v], [x.x]

    found = design(sliding, bounds, n=6)
    labels = [text for text in texts(plot_points(found)) if text]
    by_panel = [int(n) for text in labels for n in text.split(", ")]
    assert sorted(by_panel) == sorted([1, 2, 3, 4, 5, 6] * 2)


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


@pytest.mark.parametrize(
    ("largest", "factor", "unit"),
    [(2e5, 1 / 3600, "h"), (1e3, 1 / 60, "min"), (200.0, 1.0, "s"), (0.05, 1e3, "ms")],
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

    trajectories = pictures_points._trajectories
    monkeypatch.setattr(pictures_points, "_trajectories", cut)
    plot_points(found).savefig(tmp_path / "points.png")
