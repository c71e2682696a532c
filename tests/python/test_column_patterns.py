"""Columns of sensitivities by what they reach: linear systems of random sparsity, whose derivatives a matrix exponential gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm_frechet

import fisherpoint as fp

pytestmark = pytest.mark.kernels


class Linear:
    """x' = A x, the entries of A that are not zero are the parameters; states of one block read earlier blocks too."""

    def __init__(self, rng: Any, sizes: list[int]) -> None:
        n = sum(sizes)
        block = np.repeat(np.arange(len(sizes)), sizes)
        there = (rng.random((n, n)) < 0.5) & (block[:, None] >= block[None, :])
        there |= block[:, None] == block[None, :]
        self.entries = np.argwhere(there).tolist()
        self.n = n
        rates = ["+".join(f"a{i}_{k}*x{k}" for k in range(n) if there[i, k]) for i in range(n)]
        states, theta = {f"x{i}": ("1", 1.0) for i in range(n)}, {f"a{i}_{k}": "1" for i, k in self.entries}
        self.model = fp.SymbolicModel(rates, list(states), states, {}, theta, check_units=False)

    def theta(self, rng: Any) -> Any:
        a = np.zeros((self.n, self.n))
        for i, k in self.entries:
            a[i, k] = rng.choice([0.0, -1.0, rng.normal()])  # nice numbers too
        return a

    def derivatives(self, a: Any, x0: Any, dt: float) -> Any:
        """dx/dtheta (n, p) by the Frechet derivative of the exponential."""
        columns = []
        for i, k in self.entries:
            unit = np.zeros_like(a)
            unit[i, k] = 1.0
            columns.append(dt * expm_frechet(dt * a, unit, compute_expm=False) @ x0)
        return np.array(columns).T


@pytest.mark.long
@pytest.mark.parametrize("sizes", [[1], [2], [1, 1], [3, 1], [1, 2, 3], [2, 4], [5], [7, 1, 1]])
@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_columns_of_every_pattern_are_those_of_the_matrix_exponential(sizes: list[int], method: str) -> None:
    rng = np.random.default_rng([17, *sizes])
    linear = Linear(rng, sizes)
    x0 = rng.choice([0.0, 1.0, -0.5], (21, linear.n))  # more than a pack, on any machine but by a remainder
    dt = rng.choice([0.1, 0.5, 1.0], 21)
    a = linear.theta(rng)
    theta = [float(a[i, k]) for i, k in linear.entries]
    points = fp.Experiments(x0, np.zeros((21, 0)), dt)
    found = fp.sensitivities(linear.model, points, theta, rtol=1e-10, method=method)
    assert not found.status.any()
    for k in range(21):
        exact = linear.derivatives(a, x0[k], dt[k])
        assert found.dy_dtheta[k] == pytest.approx(exact, rel=1e-7, abs=1e-8 * max(1.0, np.abs(exact).max()))
        none = np.abs(exact).max(axis=1) == 0.0
        assert not found.dy_dtheta[k][none].any()


def test_samples_inside_do_not_change_the_columns_at_the_end() -> None:
    """Samples within a step have the columns of whole packs follow them, and not a part of each."""
    rng = np.random.default_rng(3)
    linear = Linear(rng, [3, 2, 1])
    a = linear.theta(rng)
    theta = [float(a[i, k]) for i, k in linear.entries]
    x0 = rng.normal(size=(5, linear.n))
    ends = fp.sensitivities(linear.model, fp.Runs(x0, np.zeros((5, 1, 0)), 0.4), theta)
    inside = fp.sensitivities(linear.model, fp.Runs(x0, np.zeros((5, 8, 0)), 0.05), theta)
    assert inside.dy_dtheta[:, -1] == pytest.approx(ends.dy_dtheta[:, -1], rel=1e-6, abs=1e-7)
