"""Pictures of fits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, f

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint.estimation.picture_list import plots_of
from fisherpoint.show.numbers import number
from fit_cases import EXAMPLES, cylinder, decay


def test_an_ellipse_has_the_roots_of_the_eigenvalues_as_half_axes() -> None:
    from fisherpoint.estimation.pictures import ellipse

    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    curve = ellipse(covariance, 5.99, count=100_001)
    radius = np.linalg.norm(curve, axis=1)
    values = np.linalg.eigvalsh(covariance)
    assert radius.max() == pytest.approx(np.sqrt(5.99 * values[1]), rel=1e-6)
    assert radius.min() == pytest.approx(np.sqrt(5.99 * values[0]), rel=1e-6)
    small = ellipse(covariance * np.outer([1e-9, 1e9], [1e-9, 1e9]), 5.99)
    assert small / [1e-9, 1e9] == pytest.approx(ellipse(covariance, 5.99))


@pytest.mark.long
@pytest.mark.parametrize("known", [True, False])
def test_every_picture_is_drawn(known: bool) -> None:
    from fisherpoint.show.style import encoded

    problem, data = cylinder()
    fit = fp.estimate(problem.model, data, problem.prior, noise=problem.noise if known else None)
    plots = plots_of(fit, [fit.profile("c_L")] if known else [])
    assert list(plots) == ["parity", "residuals", "correlation", "ellipses", *(["profiles"] if known else [])]
    figures = {name: plot() for name, plot in plots.items()}
    assert all(len(encoded(figure, "png")) > 10_000 for figure in figures.values())
    figure = figures["ellipses"]
    assert len(figure.axes) == 6
    degrees = min(fit.quantile_degrees_of_freedom.values())
    expected = chi2.ppf(0.95, 2) if known else 2 * f.ppf(0.95, 2, degrees)
    assert known or expected > chi2.ppf(0.95, 2)


def test_pictures_of_a_single_parameter() -> None:
    model, data = decay()
    fit = fp.estimate(model, data, parameters=["k"], noise={"c": 0.2})
    assert list(plots_of(fit)) == ["parity", "residuals"]


def test_samples_tell_what_was_measured() -> None:
    from fisherpoint.show.page_pictures import for_page

    problem, data = cylinder()
    fit = fp.estimate(problem.model, data, problem.prior, noise=problem.noise)
    for kind in ("parity", "residuals"):
        markup = for_page(kind, fit.plot(kind)).markup
        for sample in range(1, len(data.points) + 1):
            assert f">sample {sample}: q measured " in markup, kind
    q = np.asarray(data.y)[0, 0]
    assert f">sample 1: q measured {number(q)} m, predicted" in markup


def test_a_record_is_drawn_over_time() -> None:
    model = load_config(EXAMPLES / "cascaded_tanks.toml").build_model()
    t = 4.0 * np.arange(100)
    u = 2.0 + np.where((np.arange(100) // 15) % 2, 1.0, -1.0)
    theta = dict(model.nominal)
    y = fp.simulate_record(model, t, u, theta, {"h1": 5.0, "h2": 4.0}).y + np.random.default_rng(1).normal(0, 0.05, (100, 1))
    fit = fp.estimate(model, fp.Record(t, u, y, x0={"h1": 5.0}), parameters=["k1", "k3", "k4"], noise={"level": 0.05})
    assert fit.parameters == ("k1", "k3", "k4", "x0_h2")
    assert fit.units["x0_h2"] == "V"
    assert "x0_h2" in str(fit)
    assert abs(fit.estimate["x0_h2"] - 4.0) < 4 * fit.standard_errors["x0_h2"]
    assert fit.profile("x0_h2").interval == pytest.approx(fit.intervals()["x0_h2"], rel=0.01)
    assert plots_of(fit)["time"]().axes
