"""Fits of parts of the data against each other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

import fisherpoint as fp
from test_residual_checks import LAG, LINE, THETA, of_line, of_runs, record


def test_halves_of_a_line_differ_as_two_fits_by_hand() -> None:
    rng, s = np.random.default_rng(0), np.random.default_rng(1).uniform(-1, 1, 40)
    y = 1 + 2 * s + 0.1 * rng.standard_normal(40)
    found = fp.estimate(LINE, of_line(s, y), start={"p": 1.0, "q": 2.0}, noise={"y": 0.1}).stability()
    estimates, covariances = [], []
    for half in (slice(0, 20), slice(20, 40)):
        jacobian = np.stack([np.ones(20), s[half]], axis=1)
        covariances.append(0.01 * np.linalg.inv(jacobian.T @ jacobian))
        estimates.append(np.linalg.lstsq(jacobian, y[half], rcond=None)[0])
    off, covariance = estimates[1] - estimates[0], covariances[0] + covariances[1]
    assert [part.estimate["q"] for part in found.parts] == pytest.approx([estimate[1] for estimate in estimates])
    assert found.differences["q"].chi_square == pytest.approx(off[1] ** 2 / covariance[1, 1])
    together = found.together
    assert together is not None and together.degrees_of_freedom == 2
    assert together.chi_square == pytest.approx(off @ np.linalg.solve(covariance, off))
    assert together.p_value == pytest.approx(chi2.sf(together.chi_square, 2))
    assert "p = " in found.report().headline and not found.report().warnings


@pytest.mark.long
def test_a_prior_that_all_parts_share_is_no_difference() -> None:
    rng, s, found = np.random.default_rng(2), np.linspace(-1, 1, 12), []
    prior = fp.GaussianPrior({"p": 1.0, "q": 2.0}, std={"p": 0.05, "q": 0.05})
    for _ in range(150):
        p, q = 1 + 0.05 * rng.standard_normal(), 2 + 0.05 * rng.standard_normal()
        data = of_line(s, p + q * s + 0.1 * rng.standard_normal(12))
        together = fp.estimate(LINE, data, prior, noise={"y": 0.1}, starts=1).stability().together
        assert together is not None
        found.append(together.chi_square)
    assert np.mean(found) == pytest.approx(2.0, abs=4 * 2 / np.sqrt(150))
    assert np.mean(np.array(found) > chi2.ppf(0.9, 2)) == pytest.approx(0.1, abs=0.08)


def test_a_plant_that_changed_is_found() -> None:
    first, second = record(0.0, 300, seed=1), record(0.0, 300, seed=2)
    changed = fp.Record(second.t, second.u, second.y * [1.0, 1.05], x0={"x": 0.0})
    noise = {"x": 0.02, "y": 0.05}
    same = fp.estimate(LAG, [first, second], start=THETA, noise=noise).stability()
    assert [part.name for part in same.parts] == ["data 1", "data 2"]
    assert not same.report().warnings
    with pytest.warns(RuntimeWarning, match="expected white noise"):
        other = fp.estimate(LAG, [first, changed], start=THETA, noise=noise).stability()
    assert other.differences["g"].p_value < 1e-6 < other.differences["tau"].p_value
    assert "differ by more than their standard errors in g:" in other.report().warnings[0]


def test_runs_are_split_in_groups_and_pieces_of_records_keep_its_start() -> None:
    noise = {"x": 0.05, "y": 0.05}
    fit = fp.estimate(LAG, of_runs(np.arange(12), 0.0), start=THETA, noise=noise)
    assert [part.count for part in fit.stability(3).parts] == [64, 64, 64]
    whole = record(0.0)
    of_record = fp.estimate(LAG, fp.Record(whole.t, whole.u, whole.y), start={**THETA, "x0_x": 0.1}, noise=noise)
    assert of_record.parameters == ("tau", "g", "x0_x")
    found = of_record.stability()
    assert list(found.differences) == ["tau", "g"]  # the second half does not have its start
    assert "x0_x" in found.parts[0].estimate
    assert found.together is not None and found.together.p_value > 0.01


def test_parts_without_a_fit_are_said() -> None:
    s = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    data = of_line(s, 1 + 2 * s + 0.1 * np.array([1.0, -1.0, 0.5, -0.5, 1.0, -1.0]))
    found = fp.estimate(LINE, data, start={"p": 1.0, "q": 2.0}, noise={"y": 0.1}).stability()
    first, second = found.parts
    assert "q" not in first.estimate and not first.reason  # at zero the slope has no effect
    assert second.reason == "no fit: it determines no unknown"
    assert found.together is None and not found.differences
    assert "cannot be compared" in str(found)
    one = fp.estimate(LINE, of_line(s[3:4], s[3:4]), start={"p": 1.0, "q": 2.0}, noise={"y": 0.1}).stability()
    assert {part.reason for part in one.parts} == {"no fit: it determines no unknown", "nothing was measured in it"}


@pytest.mark.parametrize("parts", [1, 0, 2.5, "halves"])
def test_misuse_is_one_line(parts: object) -> None:
    fit = fp.estimate(LAG, of_runs(np.arange(12), 0.0), start=THETA, noise={"x": 0.05, "y": 0.05})
    with pytest.raises((TypeError, ValueError), match=r"^parts: expected"):
        fit.stability(parts)  # type: ignore[arg-type]
