"""Sensitivities of large models, whose steps are divided where S needs it: accuracy, and no word of what shares a pack."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp

pytestmark = pytest.mark.kernels

COUNT = 12
"""Masses: 24 states, 24 parameters, and so some 500 entries of S."""


def chain(friction: str = "tanh({})", pull: str = "u") -> Any:
    """Masses between springs on a rough ground, the first one held, the last one pulled."""
    rates = [f"v{i}" for i in range(COUNT)]
    for i in range(COUNT):
        before = f"k{i}*(x{i - 1} - x{i})" if i else "-k0*x0"
        behind = f"k{i + 1}*(x{i + 1} - x{i})" if i < COUNT - 1 else pull
        rates.append(f"{before} + {behind} - f{i}*{friction.format(f'20*v{i}')}")
    names = [f"{area}{i}" for area in ("x", "v") for i in range(COUNT)]
    theta = [f"{area}{i}" for area in ("k", "f") for i in range(COUNT)]
    outputs = [f"x{COUNT - 1}", "x0", "v3"]
    return fp.SymbolicModel(
        rates, outputs, dict.fromkeys(names, ("1", 1.0)), {"u": "1"}, dict.fromkeys(theta, "1"), check_units=False
    )


SMOOTH, KINKED = "tanh({})", "min(1, max(-1, {}))"


def theta_of(rng: Any) -> dict[str, float]:
    return {f"k{i}": rng.uniform(20, 60) for i in range(COUNT)} | {f"f{i}": rng.uniform(0.1, 0.3) for i in range(COUNT)}


def runs_of(count: int, segments: int, rng: Any) -> Any:
    starts = rng.normal(0.0, 0.1, (count, 2 * COUNT)) * (rng.random((count, 2 * COUNT)) > 0.3)
    return starts, rng.choice([-2.0, 0.0, 1.0, 3.0], (count, segments, 1))


@pytest.mark.parametrize("method", [None, "Radau"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
@pytest.mark.parametrize("n", [20, 40])
def test_no_result_of_a_stiff_model_depends_on_what_shares_its_pack(n: int, rtol: float, method: str | None) -> None:
    """Cells in which something diffuses, with a reaction at the end: stiffness is noticed, and steps become implicit.

    Where few lanes of a pack are in use, the others are left out.
    """
    rates = [f"D*{n**2}*(({f'c{i - 1} - c{i}' if i else '0'}) + ({f'c{i + 1} - c{i}' if i < n - 1 else '0'}))" for i in range(n)]
    rates[-1] += f" - {n}*k*sinh(c{n - 1} - 0.5)"
    states = {f"c{i}": ("1", 1.0) for i in range(n)}
    model = fp.SymbolicModel(rates, ["c0", f"c{n - 1}"], states, {}, {"D": "1", "k": "1"}, check_units=False)
    rng = np.random.default_rng(4)
    for count in (1, 2, 4, 5, 17, 33):
        theta = np.array([1.0, 0.7]) * rng.choice([0.9, 1.0, 1.1, 3.0], (count, 2))
        starts, dt = rng.choice([0.0, 1.0, 0.7], (count, n)), rng.choice([1e-4, 0.01, 0.1], count)
        for function, names in (
            (fp.simulate, ("x", "y", "status")),
            (fp.sensitivities, ("x", "y", "dx_dtheta", "dy_dtheta", "status")),
        ):
            together = function(model, fp.Experiments(starts, np.empty((count, 0)), dt), theta, rtol=rtol, method=method)
            assert not together.status.any()
            for k in {0, count // 2, count - 1}:
                one = fp.Experiments(starts[k : k + 1], np.empty((1, 0)), dt[k : k + 1])
                alone = function(model, one, theta[k], rtol=rtol, method=method)
                for name in names:
                    assert np.array_equal(getattr(alone, name)[0], getattr(together, name)[k]), (count, k, name)


@pytest.mark.parametrize("friction", [SMOOTH, KINKED])
def test_no_result_depends_on_what_shares_its_pack(friction: str) -> None:
    rng = np.random.default_rng(1)
    model, theta = chain(friction), theta_of(rng)
    starts, inputs = runs_of(37, 6, rng)
    together = fp.sensitivities(model, fp.Runs(starts, inputs, 0.2), theta, threads=1)
    assert (together.status == 0).mean() > 0.9
    for k in (0, 3, 20, 36):
        alone = fp.sensitivities(model, fp.Runs(starts[k : k + 1], inputs[k : k + 1], 0.2), theta, threads=2)
        for name in ("x", "y", "dy_dtheta", "status", "reached"):
            assert np.array_equal(getattr(alone, name)[0], getattr(together, name)[k]), (k, name)

    points = fp.Experiments(starts, inputs[:, 0], rng.choice([0.05, 0.1, 0.3, 1.0], 37))
    together = fp.sensitivities(model, points, theta, threads=1)
    for k in (0, 3, 20, 36):
        alone = fp.sensitivities(model, fp.Experiments(starts[k : k + 1], inputs[k : k + 1, 0], points.dt[k : k + 1]), theta)
        assert np.array_equal(alone.dy_dtheta[0], together.dy_dtheta[k])


@pytest.mark.parametrize("friction", [SMOOTH, KINKED])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_sensitivities_are_as_accurate_as_asked_for(friction: str, rtol: float) -> None:
    rng = np.random.default_rng(2)
    model, theta = chain(friction), theta_of(rng)
    starts, inputs = runs_of(16, 5, rng)
    runs = fp.Runs(starts, inputs, 0.2)
    found, exact = (fp.sensitivities(model, runs, theta, rtol=tolerance) for tolerance in (rtol, 1e-11))
    both = (found.status == 0) & (exact.status == 0)
    assert both.mean() > 0.9
    size = np.abs(exact.dy_dtheta[both]).max(axis=(1, 2), keepdims=True)
    error = np.abs(found.dy_dtheta - exact.dy_dtheta)[both] / size
    assert np.median(error.max(axis=(1, 2, 3))) < 3 * rtol
    assert error.max() < 30 * rtol


@pytest.mark.parametrize("friction", [SMOOTH, KINKED])
def test_sensitivities_are_those_of_differences(friction: str) -> None:
    rng = np.random.default_rng(3)
    model, theta = chain(friction), theta_of(rng)
    starts, inputs = runs_of(4, 4, rng)
    runs = fp.Runs(starts, inputs, 0.25)
    exact = fp.sensitivities(model, runs, theta, rtol=1e-10)
    for j, name in enumerate(theta):
        step = 1e-4 * theta[name]
        above, below = (fp.simulate(model, runs, theta | {name: theta[name] + s}, rtol=1e-12).y for s in (step, -step))
        differences = (above - below) / (2 * step)
        size = np.abs(exact.dy_dtheta[..., j]).max()
        assert np.abs(differences - exact.dy_dtheta[..., j]).max() < 2e-5 * size


def test_a_pole_is_met_with_a_status() -> None:
    """A step that comes to no number is not divided for ever."""
    rng = np.random.default_rng(4)
    model, theta = chain(SMOOTH, "u + 1/(1.2 - x11)"), theta_of(rng)
    starts, inputs = runs_of(8, 10, rng)
    found = fp.sensitivities(model, fp.Runs(starts, np.full_like(inputs, 30.0), 0.5), theta)
    assert (found.status != 0).any()
    assert np.isfinite(found.dy_dtheta).all()
