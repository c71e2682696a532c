"""What overflows is a status with a count, or an error in words: no inf, no NaN and no words of a library's."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from defaults import KINDS

SLOPE, STD = 1e100, 1e100
"""Of an output by a parameter, and of that: the square of their product overflows, the squares of both do not."""

POINTS = fp.Experiments(np.empty((2, 0)), [[0.0], [1.0]])
"""The second overflows."""


def model(kind: str) -> fp.Model:
    """Two outputs, the first of which is far too steep where u is not zero."""
    if kind == "equations":
        return fp.SymbolicModel([], [f"{SLOPE!r}*p*u**9", "q + u"], {}, {"u": "1"}, {"p": "1", "q": "1"}, {"y": "1", "z": "1"})
    g = lambda x, u, p: [SLOPE * p.p * u.u**9, p.q + u.u]  # noqa: E731
    return fp.CallableModel(None, g, {}, {"u": "1"}, {"p": "1", "q": "1"}, {"y": "1", "z": "1"})


PRIOR = fp.GaussianPrior({"p": 1.0, "q": 1.0}, std={"p": STD, "q": 0.1})
RULES = (fp.LinearizedRule(), fp.SparseGaussHermite(2), fp.TensorGrid())


def problem(**changes: Any) -> fp.DesignProblem:
    arguments: dict[str, Any] = {
        "model": model("equations"),
        "prior": PRIOR,
        "region": fp.ExperimentRegion({"u": (0.0, 1.0)}),
        "noise": {"y": 0.1, "z": 0.1},
        "rule": fp.LinearizedRule(),
    }
    return fp.DesignProblem(**arguments | changes)


@pytest.mark.filterwarnings("ignore:CallableModel")
@pytest.mark.parametrize("kind", ["equations", "functions"])
@pytest.mark.parametrize("rule", RULES, ids=lambda rule: type(rule).__name__)
def test_a_predictive_covariance_that_overflows_is_not_finite(kind: str, rule: fp.Rule) -> None:
    result = fp.predictive_covariance(model(kind), POINTS, PRIOR, rule)
    assert result.status.tolist() == [fp.Status.ok, fp.Status.not_finite]
    assert np.isfinite(result.covariance).all() and result.covariance[0, 1, 1] > 0 and not result.covariance[1].any()


def test_an_assumed_covariance_that_overflows_is_not_finite() -> None:
    result = fp.assumed_covariance(model("equations"), POINTS, {"p": 1.0, "q": 1.0}, varies={"p": STD})
    assert result.status.tolist() == [fp.Status.ok, fp.Status.not_finite]
    assert not result.covariance.any()


def worded(call: Callable[[], Any]) -> Any:
    """The result, or None for an error of the project's own words."""
    try:
        return call()
    except ValueError as error:  # which numpy's LinAlgError is too
        own = not isinstance(error, np.linalg.LinAlgError)
        assert own and re.search("expected .*given ", str(error)), repr(error)
        return None


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("rule", RULES, ids=lambda rule: type(rule).__name__)
def test_points_that_overflow_are_counted_and_are_in_no_design(kind: str, rule: fp.Rule) -> None:
    """With every u but the smallest, an output overflows."""
    given = problem(rule=rule, output_covariance=kind)
    design = worded(lambda: fp.exchange(given, 4, n_candidates=10, max_iterations=8, method=fp.ExchangeMethod(local=1.0)))
    evaluated = worded(lambda: fp.evaluate(given, POINTS))
    if kind in ("pooled", "pointwise"):
        assert evaluated is None  # a point without a covariance is none
    for evaluation in [design and design.evaluation, evaluated]:
        if evaluation is not None:
            assert np.isfinite(evaluation.fisher).all() and np.isfinite(evaluation.output_covariance).all()
            assert evaluation.covariance is None or np.isfinite(evaluation.covariance).all()
    if design is not None:
        assert design.rejected["not_finite"] > 0
        assert design.drawn == design.accepted + sum(design.rejected.values())


def test_a_region_of_which_all_points_overflow_says_why() -> None:
    with pytest.raises(ValueError, match=r"expected valid points, given 0 of \d+ drawn \(\d+ not_finite\)"):
        fp.exchange(problem(region=fp.ExperimentRegion({"u": (1.0, 2.0)})), 4)
    growth = fp.SymbolicModel([], ["exp(p*u)"], {}, {"u": "1"}, {"p": "1"})
    prior = fp.GaussianPrior({"p": 1.0}, std={"p": 1.0})
    given = fp.DesignProblem(growth, prior, fp.ExperimentRegion({"u": (280.0, 300.0)}), noise={"y": 1.0})
    with pytest.raises(ValueError, match=r"expected points that are valid over the prior, given 0 of \d+ tried \(\d+ not_finite\)"):
        fp.exchange(given, 4)


DIODE = fp.SymbolicModel([], ["I_s*(exp(u/(n*0.0259)) - 1)"], {}, {"u": "V"}, {"I_s": "A", "n": "1"}, {"y": "A"})


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("rule", RULES, ids=lambda rule: type(rule).__name__)
def test_a_diode_past_the_largest_number_is_no_point(kind: str, rule: fp.Rule) -> None:
    prior = fp.GaussianPrior({"I_s": 1e-9, "n": 1.2}, relative_std={"I_s": 0.1, "n": 0.1})
    region = fp.ExperimentRegion({"u": (0.1, 30.0)})
    given = fp.DesignProblem(DIODE, prior, region, noise={"y": 1e-3}, rule=rule, output_covariance=kind)
    spread = fp.predictive_covariance(DIODE, fp.Experiments(np.empty((2, 0)), [[0.5], [24.0]]), prior, rule)
    assert spread.status.tolist() == [fp.Status.ok, fp.Status.not_finite] and np.isfinite(spread.covariance).all()
    design = worded(lambda: fp.exchange(given, 3, n_candidates=10, max_iterations=8))
    assert design is not None and design.rejected["not_finite"] > 0
    assert np.isfinite(design.evaluation.fisher).all() and (design.points.u < 24).all()


@pytest.mark.kernels
def test_what_overflows_is_returned_as_zero() -> None:
    points = fp.Experiments(np.empty((2, 0)), [[0.5], [24.0]])
    for ends in (fp.simulate(DIODE, points, [1e-9, 1.2]), fp.sensitivities(DIODE, points, [1e-9, 1.2])):
        assert ends.status.tolist() == [fp.Status.ok, fp.Status.not_finite]
        assert ends.y[0, 0] > 0 and ends.y[1, 0] == 0


@pytest.mark.kernels
def test_nodes_whose_outputs_overflow_are_lost_and_no_more() -> None:
    """y = exp(p) at three nodes, 1 and 1 -+ 1000: the last is lost, with its share of the weight."""
    growth = fp.SymbolicModel([], ["exp(p*u)"], {}, {"u": "1"}, {"p": "1"})
    rule, prior = fp.TensorGrid(3, span=1.0), fp.GaussianPrior({"p": 1.0}, std={"p": 1000.0})
    _, weights = rule.nodes(prior)
    nodes = rule.core_nodes(prior)
    arguments = (growth.core, np.empty((1, 0)), np.ones((1, 1)), np.ones(1), np.ones(1), nodes, 1e-6, True, False, "fastest", 1)
    for max_lost, status in ((0.5, fp.Status.ok), (0.1, fp.Status.not_finite)):
        covariance, statuses, _, outputs, lost = growth.kernels.predictive_covariance(
            *arguments, max_lost=max_lost, keep_outputs=True
        )
        assert statuses[0] == status and lost[0] == pytest.approx(weights[2] / weights.sum())
        assert outputs[0, :, 0] == pytest.approx([0.0, np.e, np.inf])
        expected = np.average([np.e**2, 0.0], weights=weights[:2]) if status == fp.Status.ok else 0.0
        assert covariance[0, 0, 0] == pytest.approx(expected)


@pytest.mark.parametrize("std", [1e-200, 1e-160, 1e160, 1e308])
def test_noise_whose_square_is_no_number_is_refused(std: float) -> None:
    with pytest.raises(ValueError, match=r"noise\['y'\]: expected a standard deviation between 1e-100 and 1e\+100, given"):
        problem(noise={"y": std, "z": 0.1})
    data = fp.Measurements(POINTS, [[0.0, 1.0], [1.0, 2.0]])
    with pytest.raises(ValueError, match=r"noise\['y'\]: expected a standard deviation between 1e-100 and 1e\+100, given"):
        fp.estimate(model("equations"), data, PRIOR, noise={"y": std, "z": 0.1})


def test_an_information_that_overflows_is_told() -> None:
    line = fp.SymbolicModel([], ["p*u"], {}, {"u": "1"}, {"p": "1"})
    prior = fp.GaussianPrior({"p": 1.0}, std={"p": 1e100})
    flat, steep = (fp.Experiments(np.empty((1, 0)), [[u]]) for u in (1e-60, 1e70))
    # What is so far below the noise is none.
    assert fp.evaluate(fp.DesignProblem(line, prior, None, noise={"y": 1e100}), flat).rank == 0
    with pytest.raises(ValueError, match=r"points: expected trajectories that are ok, given points\[0\] \(not_finite\)"):
        fp.evaluate(fp.DesignProblem(line, prior, None, noise={"y": 1e-100}), steep)


def test_outputs_that_nearly_depend_on_each_other_are_told_in_words() -> None:
    """D is singular to rounding, although its noise is not zero."""
    same = fp.SymbolicModel([], ["p*u", "2*p*u"], {}, {"u": "1"}, {"p": "1"}, {"y": "1", "z": "1"})
    prior = fp.GaussianPrior({"p": 1.0}, std={"p": 1.0})
    points = fp.Experiments(np.empty((2, 0)), [[1.0], [3.0]])
    for kind in KINDS:
        region = fp.ExperimentRegion({"u": (0.5, 4.0)})
        given = fp.DesignProblem(
            same, prior, region, noise={"y": 1e-12, "z": 1e-12}, rule=fp.LinearizedRule(), output_covariance=kind
        )
        worded(lambda given=given: fp.evaluate(given, points))  # type: ignore[misc]
        worded(lambda given=given: fp.exchange(given, 2, n_candidates=5, max_iterations=3))  # type: ignore[misc]
