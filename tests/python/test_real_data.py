"""Measured records: the positioning axis against its published estimates, the cascaded tanks against published errors."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"

pytestmark = [
    pytest.mark.skipif(not DATA.is_dir(), reason=f"the measured records are not at {DATA}"),
    pytest.mark.filterwarnings("ignore:residuals. expected white noise"),  # which real data do not have
]


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_positioning_axis_comes_out_as_published() -> None:
    axis = example("positioning_axis_data")
    fit = axis.fp.estimate(axis.inverse_axis, axis.measurements(DATA / "emps" / "emps_estimation.csv"))
    for name, (value, error) in axis.PUBLISHED.items():
        assert abs(fit.estimate[name] - value) < 2 * error
        assert fit.standard_errors[name] == pytest.approx(error, rel=0.1)
    other = axis.measurements(DATA / "emps" / "emps_validation_pulses.csv")
    assert axis.relative_error(fit, other) <= axis.PUBLISHED_ERROR


@pytest.mark.long
def test_the_tanks_are_simulated_as_well_as_published() -> None:
    tanks = example("cascaded_tanks_data")
    limits = [(0.61, 0.68), (0.38, 0.52), (0.25, 0.32)]
    found = list(tanks.results(*tanks.records(DATA / "cascaded_tanks" / "cascaded_tanks.csv")))
    for (fit, estimation, validation), (most_estimation, most_validation) in zip(found, limits, strict=True):
        assert fit.converged
        assert estimation <= most_estimation
        assert validation <= most_validation
    # The start of the upper tank is not known: nothing sets the scale of its level until its rim does.
    assert [len(fit.null_directions) + len(fit.weak_directions) for fit, *_ in found] == [1, 0, 0]


@pytest.mark.long
def test_the_positioning_axis_has_no_dead_time() -> None:
    """The controller is as it is programmed: a late force meets voltages worse, and an estimated dead time ends at 0."""
    axis = example("positioning_axis_record")
    path = DATA / "emps" / "emps_estimation.csv"
    fits = [axis.estimate(model, axis.record(path, model)[:5000]) for model in (axis.loop(), axis.loop(late="0.5 ms"))]
    sizes = [float((fit.residuals**2).mean() ** 0.5) for fit in fits]
    assert sizes[0] < 0.15 and 1.1 * sizes[0] < sizes[1]
    for fit in fits:
        assert fit.converged and "not white" in axis.judged(fit)
    for name, (value, _) in axis.PUBLISHED.items():
        assert abs(fits[0].estimate[name] - value) < fits[0].robust_standard_errors[name]
    without, late = (axis.estimate(axis.axis(voltage), axis.pieces(path)) for voltage in ("u", "delay(u, tau)"))
    assert late.converged and late.estimate["tau"] == pytest.approx(0.0, abs=1e-6) and "not white" in axis.judged(late)
    assert (late.residuals**2).sum() == pytest.approx((without.residuals**2).sum(), rel=1e-6)
