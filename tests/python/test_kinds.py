"""Kinds of everyday equations (tests/fuzz/kinds.py), each through all that is public, beside an integration mode by mode."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from automaton import NoAnswer, PilesUp, slopes
from kinds import KINDS
from random_kinds import DRIVERS, NONE, READERS, Drawn, built
from table_of_kinds import row_of

pytestmark = pytest.mark.filterwarnings("ignore:.* expected its natural size")

Array = np.ndarray[Any, Any]

NOISE = 0.02
LEFT_OUT = {"tank runs dry", "tank filled again", "cylinder"}
"""Two that come to rest on a root's surface, of which sensitivities are no business of this, and a slow one."""


class Chain:
    """A kind in its first form, with ranges in which nearly all is ok."""

    def __init__(self, name: str) -> None:
        kind = KINDS[name]()
        self.one: Drawn = built(name, kind, kind.forms[0], DRIVERS[1] if kind.driven else NONE, READERS[0])
        self.model = self.one.model()
        self.theta = np.array([(low + high) / 2 for low, high in self.one.parameters.values()])

    @cached_property
    def std(self) -> Array:
        return 0.03 * np.where(self.theta, np.abs(self.theta), 1.0)

    @cached_property
    def problem(self) -> fp.DesignProblem:
        mean = dict(zip(self.one.parameters, self.theta.tolist(), strict=True))
        prior = fp.GaussianPrior(mean, std=dict(zip(mean, self.std.tolist(), strict=True)))
        bounds: dict[str, Any] = {
            name: (low, max(high, low + 1e-3)) for name, (low, high) in {**self.one.states, **self.one.inputs}.items()
        }
        region = fp.ExperimentRegion({**bounds, "dt": (0.5, 3.0)})
        noise = {output.name: NOISE for output in self.model.outputs}
        return fp.DesignProblem(self.model, prior, region, noise=noise, rule=fp.Unscented(), output_covariance="noise", rtol=1e-8)

    def outputs(self, x0: Array, u: Array, dt: float, theta: Array) -> Array:
        x = self.one.automaton.course(x0.tolist(), u.tolist(), theta.tolist(), dt).x
        return np.array(self.one.automaton.function(self.one.outputs)(x.tolist(), u.tolist(), theta.tolist()))


def same(given: Array, fisher: Array, std: Array) -> bool:
    """To 1e-4 of what the parameters themselves are known to; F is in units of the prior's standard deviations."""
    expected = fisher * np.outer(std, std)
    size = np.sqrt(np.maximum(np.diag(expected), 1e-2))
    return bool((np.abs(given - expected) <= 1e-4 * np.outer(size, size)).all())


@pytest.fixture(scope="module", params=[name for name in KINDS if name not in LEFT_OUT])
def chain(request: pytest.FixtureRequest) -> Chain:
    return Chain(request.param)


@pytest.fixture(scope="module")
def design(chain: Chain) -> fp.Design:
    return fp.exchange(
        chain.problem, n_experiments=4, n_candidates=12, max_iterations=3, method=fp.ExchangeMethod(references=False)
    )


def differences(chain: Chain, x0: Array, u: Array, times: Array) -> Array | None:
    """F of outputs at these times; None where an event is next to one, of which neighbours are on another side."""
    fisher = np.zeros((len(chain.theta),) * 2)
    for t in times:
        beside = slopes(lambda theta, t=t: chain.outputs(x0, u, t, theta), chain.theta)
        if beside.bent.any() or (beside.error > 1e-5 * (1 + np.abs(beside.value))).any():
            return None
        fisher += beside.value.T @ beside.value / NOISE**2
    return fisher


@pytest.mark.long
def test_what_a_search_finds_is_worth_what_differences_say(chain: Chain, design: fp.Design) -> None:
    """The Fisher matrix under the noise is that of differences of outputs by the other integration."""
    rng, rows, compared = np.random.default_rng(0), list(design.points), 0
    assert len(rows) == 4 and design.evaluation.rank >= min(len(chain.theta) - 1, 3)
    rows += [chain.one.experiments(*chain.one.numbers(rng, nice=False)[:3]) for _ in range(3)]
    for point in rows:
        fisher = differences(chain, point.x0[0], point.u[0], point.dt)
        if fisher is not None:
            found = fp.evaluate(chain.problem, point)
            assert same(found.information, fisher, chain.std), (found.information, fisher)
            compared += 1
    assert compared


@pytest.mark.long
def test_covariances_over_the_nodes_are_their_sums(chain: Chain, design: fp.Design) -> None:
    prior, rule = chain.problem.prior, fp.Unscented()
    done = fp.predictive_covariance(chain.model, design.points, prior, rule, rtol=1e-9)
    nodes, weights = rule.nodes(prior)
    compared = 0
    for k, (x0, u, dt) in enumerate(zip(design.points.x0, design.points.u, design.points.dt, strict=True)):
        try:
            middle = chain.outputs(x0, u, dt, chain.theta)
            off = np.array([chain.outputs(x0, u, dt, node) - middle for node in nodes])
        except (NoAnswer, PilesUp, ValueError):  # of a node that a search has not looked at
            continue
        assert done.status[k] == fp.Status.ok
        np.testing.assert_allclose(done.covariance[k], (off.T * weights) @ off / weights.sum(), atol=1e-6 * np.abs(off).max())
        compared += 1
    assert compared


@pytest.mark.long
def test_data_give_the_parameters_back(chain: Chain, design: fp.Design) -> None:
    noise = {output.name: NOISE for output in chain.model.outputs}
    data = fp.VirtualRig(chain.model, chain.theta, noise, seed=3).measure(design.points, repeats=3)
    fit = fp.estimate(chain.model, data, chain.problem.prior, noise=noise, starts=1, rtol=1e-8)
    off = (fit.theta - chain.theta) / chain.std
    assert np.abs(off).max() < 5
    checked = fp.validate(chain.problem, {"designed": design.points}, runs=5, use_prior=True)
    found = checked.designs["designed"]
    assert found.fits + sum(found.failures.values()) == 5 and found.fits >= 1
    assert found.per_run is not None and np.isfinite(found.per_run.estimate).all()


@pytest.mark.long
@pytest.mark.parametrize("name", ["orifice", "dead zone", "relay", "bouncing mass", "frictions", "clamped integrator"])
def test_runs_are_searched_and_worth_what_differences_say(name: str) -> None:
    chain = Chain(name)
    one, mean = chain.one, {of: (low + high) / 2 for of, (low, high) in chain.one.states.items()}
    region = fp.RunRegion({**mean, **one.inputs, "dt": (0.3, 0.6)}, segments=3)
    found = fp.design_runs(chain.problem.replace(region=region), n_runs=1, n_starts=1, n_candidates=8)
    runs = found.runs
    fisher = differences(chain, runs.x0[0], runs.u[0, 0], np.cumsum(runs.dt[0])[runs.measured[0]])
    assert np.isfinite(found.log_det)
    assert fisher is None or same(found.evaluation.information, fisher, chain.std), (found.evaluation.information, fisher)


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in KINDS if name not in LEFT_OUT] + ["cylinder"])
def test_random_points_are_right(name: str) -> None:
    row = row_of(name, 4 if name != "cylinder" else 2, seed=1)
    assert not row.wrong, row.scripts
