"""The example of a whole machine: a platform on six hydraulic legs from standstill, and what its runs say of 54 parameters."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import fisherpoint as fp
from examples.hexapod import LEGS, NOISE, POSE, STAND, VALVES, VARIANTS, hexapod, parameters, prior, problem, standing
from test_hexapod import FOLDER, independent, numbers

SIZE = np.array([*[1.0] * 12, *[1e7, 1e7, 1.0] * 6])
GUESS = [*STAND.values(), *[0.0] * 6, *[7e6, 14e6, 0.0] * 6]
RUN = 0.2 * np.sin(np.arange(4)[:, None] + np.arange(6))
MEAN = np.array(list(prior(54).mean.values()))
STD = np.array(list(prior(54).std.values()))

pytestmark = pytest.mark.filterwarnings("ignore:.*expected (its|their) natural size")


@cache
def machine(friction: str) -> Any:
    return hexapod(54, friction)


def runs(friction: str) -> fp.Runs:
    """A run of four segments from standstill."""
    return fp.Runs([GUESS], [RUN], 0.01, rest=standing(machine(friction)))


def test_numbers_are_those_of_the_independent_implementation() -> None:
    if not FOLDER.is_dir():
        pytest.skip("the independent implementation of the platform is not there")
    for variant in VARIANTS:
        assert dict(prior(variant).mean) == numbers().nominal(variant)
        assert parameters(variant).keys() == numbers().std(variant).keys()
    assert NOISE == numbers().NOISE


@pytest.mark.long
@pytest.mark.parametrize("friction", ["tanh", "coulomb"])
def test_it_stands_where_all_rates_vanish(friction: str) -> None:
    """Pressures and spools by SciPy too, from what the independent implementation says of rates, where it is there."""
    start = fp.simulate(machine(friction), runs(friction), MEAN).x[0, 0]
    np.testing.assert_array_equal(start[:12], GUESS[:12])
    held = -start[14::3]  # spools follow their inputs, of the other sign
    assert np.abs(machine(friction).rhs(start, held, MEAN) / SIZE).max() < 1e-9
    assert (np.abs(held) < 0.01).all() and (np.diff(start[12::3]) != 0).all()
    if not FOLDER.is_dir():
        return
    theta = independent(54, friction).values(dict(prior(54).mean))

    def rates(z: np.ndarray) -> np.ndarray:
        x = np.array(GUESS)
        x[12:] = z * SIZE[12:]
        return np.asarray(independent(54, friction).rhs(x, -x[14::3], theta)[6:] / np.r_[np.ones(6), np.tile([1e9, 1e9, 1.0], 6)])

    keep = np.delete(np.arange(24), np.arange(8, 24, 3))  # spools are at rest by their inputs
    found = least_squares(lambda z: rates(z)[keep], np.array(GUESS[12:]) / SIZE[12:], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(start[12:] / SIZE[12:], found.x, atol=1e-9)


@pytest.mark.parametrize("friction", ["tanh", "coulomb"])
def test_a_run_from_there_has_its_derivatives(friction: str) -> None:
    """By differences, of which each has a start of its own; two parameters of each kind, of different legs."""
    model, names = machine(friction), list(prior(54).mean)
    done = fp.sensitivities(model, runs(friction), MEAN, rtol=1e-8)
    assert done.status.tolist() == [0]
    size = np.abs(done.dy_dtheta * STD).max(axis=(0, 1))  # of each output and parameter
    chosen = [names.index(f"{kind}_{1 + (k + more) % 6}") for k, kind in enumerate(kinds()) for more in (0, 3)]
    moved = np.repeat(MEAN[None], 2 * len(chosen), axis=0)
    step = 1e-3 * STD[chosen]
    for row, j in enumerate(chosen):
        moved[row, j] += step[row]
        moved[row + len(chosen), j] -= step[row]
    each = fp.Runs(np.tile(GUESS, (len(moved), 1)), np.tile(RUN, (len(moved), 1, 1)), 0.01, rest=standing(model))
    y = fp.simulate(model, each, moved, rtol=1e-10).y
    slope = (y[: len(chosen)] - y[len(chosen) :]) / (2 * step[:, None, None])
    found = np.moveaxis(done.dy_dtheta[0][:, :, chosen], 2, 0)
    off = np.abs(found - slope) * STD[chosen][:, None, None] / size.max(axis=1)
    assert off.max() < (2e-5 if friction == "tanh" else 2e-3), names[chosen[int(off.max(axis=(1, 2)).argmax())]]
    by_start = fp.sensitivities(model, fp.Runs([GUESS], [RUN[:1]], 1e-7, rest=standing(model)), MEAN).dy_dtheta[0, 0]
    moves = np.abs(by_start[18:] * STD).max(axis=0) > 1e-5
    assert {name.rsplit("_", 1)[0] for name, of in zip(names, moves, strict=True) if of} == {"p_t", "B_v", "c_L"}, "of spools"


def kinds() -> list[str]:
    return [name.rsplit("_", 1)[0] for name in prior(54).mean if name.endswith("_1")]


def test_its_problem_is_one_of_runs_from_standstill() -> None:
    of = problem(0.1)
    assert of.run_region is not None and of.run_region.segments == 5
    assert len(of.along) == 24 and of.n_unknowns == 54
    assert set(of.run_region.bounds) >= {*POSE, *VALVES, "dt"} and len(LEGS) == 6
    region = of.run_region
    middle = fp.Runs([GUESS], np.zeros((1, 5, 6)), 0.02, rest=region.rest)
    assert fp.broken_limits(of.limited, middle, of.theta) == (None,), "it stands within its limits"
    far = fp.Runs([GUESS], np.tile([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0], (1, 60, 1)), 0.02, rest=region.rest)
    assert fp.broken_limits(of.limited, far, of.theta) != (None,), "and cannot go on for ever"
