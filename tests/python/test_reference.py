"""The product against an independent program's values, and against the oracle for constants that file does not have."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
import oracle
from conftest import experiments, random_points
from oracle import OUTPUT_ROWS, PARAMETERS, STATE_SCALES, Cylinder, Floats

pytestmark = pytest.mark.kernels

RTOL = 1e-9
STATE_ERROR, SENSITIVITY_ERROR = 1e-8, 1e-7  # relative to the states' scales; sensitivities times the prior's std
RHS_ERROR, PROBABILITY_ERROR, COVARIANCE_ERROR, LOG_DET_ERROR = 1e-12, 1e-13, 1e-6, 1e-6


def relative_frobenius(actual: Floats, expected: Floats) -> float:
    """Error of a predictive covariance with the outputs scaled by their std; x_v does not vary and is left out."""
    std = np.sqrt(np.diag(expected))[:3]
    return float(
        np.linalg.norm((actual - expected)[:3, :3] / np.outer(std, std)) / np.linalg.norm(expected[:3, :3] / np.outer(std, std))
    )


# --- against cylinder.json ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def model(reference: Any) -> fp.HydraulicCylinder:
    return fp.HydraulicCylinder(**reference["constants"])


@pytest.fixture(scope="module")
def theta(reference: Any) -> Floats:
    return oracle.named(reference["theta"])


@pytest.fixture(scope="module")
def prior(reference: Any) -> fp.GaussianPrior:
    return fp.GaussianPrior(mean=reference["theta"], relative_std=reference["relative_std"])


@pytest.fixture(scope="module")
def rule(reference: Any) -> fp.TensorGrid:
    grid = reference["covariance"]
    return fp.TensorGrid(levels=dict(zip(PARAMETERS, grid["levels"], strict=True)), span=grid["span"])


def test_default_cylinder_is_the_reference_cylinder(reference: Any) -> None:
    assert dict(fp.HydraulicCylinder().constants) == reference["constants"]
    assert dict(fp.HydraulicCylinder().nominal) == reference["theta"]


def test_rhs(reference: Any, model: fp.HydraulicCylinder, theta: Floats) -> None:
    for case in reference["points"]:
        np.testing.assert_allclose(model.rhs(case["x0"], [case["u"]], theta), case["rhs_at_x0"], rtol=RHS_ERROR, atol=0.0)


def test_states(reference: Any, model: fp.HydraulicCylinder, theta: Floats) -> None:
    result = fp.simulate(model, experiments(reference["points"]), theta, rtol=RTOL)
    expected = np.array([case["x_end"] for case in reference["points"]])
    assert np.all(result.status == fp.Status.ok)
    assert np.max(np.abs(result.x - expected) / STATE_SCALES) < STATE_ERROR
    np.testing.assert_array_equal(result.y, result.x[:, OUTPUT_ROWS])


def test_sensitivities(reference: Any, model: fp.HydraulicCylinder, theta: Floats, prior: fp.GaussianPrior) -> None:
    result = fp.sensitivities(model, experiments(reference["points"]), theta, rtol=RTOL)
    expected = np.array([case["dx_dtheta"] for case in reference["points"]])
    error = np.abs(result.dx_dtheta - expected) * oracle.named(prior.std) / STATE_SCALES[:, None]
    assert np.all(result.status == fp.Status.ok)
    assert np.max(error) < SENSITIVITY_ERROR
    assert np.max(np.abs(result.x - [case["x_end"] for case in reference["points"]]) / STATE_SCALES) < STATE_ERROR
    by_rows = np.abs(result.dy_dtheta - expected[:, OUTPUT_ROWS]) * oracle.named(prior.std) / STATE_SCALES[OUTPUT_ROWS, None]
    assert np.max(by_rows) < SENSITIVITY_ERROR


def test_cell_probabilities(reference: Any, theta: Floats) -> None:
    case = reference["cell_probabilities"]
    means = dict(zip(PARAMETERS, theta, strict=True)) | {"E_oil": case["mean"]}
    prior = fp.GaussianPrior(mean=means, std={name: case["std"] / 1e10 for name in PARAMETERS} | {"E_oil": case["std"]})
    levels = {name: 1 for name in PARAMETERS} | {"E_oil": case["levels"]}
    nodes, weights = fp.TensorGrid(levels=levels, span=case["span"]).nodes(prior)
    np.testing.assert_allclose(nodes[:, PARAMETERS.index("E_oil")], case["points"], rtol=1e-15)
    np.testing.assert_allclose(weights, case["probabilities"], rtol=PROBABILITY_ERROR, atol=0.0)


def test_predictive_covariances(reference: Any, model: fp.HydraulicCylinder, prior: fp.GaussianPrior, rule: fp.TensorGrid) -> None:
    grid = reference["covariance"]
    points = experiments(reference["points"][: grid["first_points"]])
    result = fp.predictive_covariance(model, points, prior, rule, rtol=RTOL)
    assert np.all(result.status == fp.Status.ok)
    for actual, expected in zip(result.covariance, np.array(grid["sigma2"]), strict=True):
        assert relative_frobenius(actual, expected) < COVARIANCE_ERROR
        assert np.all(np.abs(actual[3]) < 1e-9 * np.sqrt(np.diag(expected) + 1e-18))  # x_v does not depend on theta


def test_fisher(reference: Any, model: fp.HydraulicCylinder, prior: fp.GaussianPrior, rule: fp.TensorGrid) -> None:
    expected = reference["fisher"]
    problem = fp.DesignProblem(
        model,
        prior,
        None,
        noise=dict(zip(("q", "p_A", "p_B", "x_v"), reference["noise_std"], strict=True)),
        rule=rule,
        output_covariance="pooled",
        rtol=RTOL,
    )
    evaluation = fp.evaluate(problem, experiments(reference["points"][: expected["first_points"]]))
    noise = np.array(reference["noise_std"])
    D_error = (evaluation.output_covariance - expected["pooled_D"]) / np.outer(noise, noise)
    assert np.max(np.abs(D_error)) < 1e-6 * np.max(np.diag(expected["pooled_D"]) / noise**2)
    np.testing.assert_allclose(evaluation.fisher, expected["standardised_F"], atol=1e-6 * np.max(expected["standardised_F"]))
    assert abs(evaluation.log_det - expected["log_det_standardised"]) < LOG_DET_ERROR


# --- against the oracle, for other constants ------------------------------------------------------------------------


@dataclass
class Case:
    """A random cylinder with a random prior and points that survive on the whole grid."""

    cylinder: Cylinder
    mean: Floats
    std: Floats
    points: fp.Experiments
    levels: tuple[int, ...]
    span: float

    @property
    def model(self) -> fp.HydraulicCylinder:
        return fp.HydraulicCylinder(**asdict(self.cylinder))

    @property
    def prior(self) -> fp.GaussianPrior:
        return fp.GaussianPrior(
            mean=dict(zip(PARAMETERS, self.mean, strict=True)), std=dict(zip(PARAMETERS, self.std, strict=True))
        )

    @property
    def rule(self) -> fp.TensorGrid:
        return fp.TensorGrid(levels=dict(zip(PARAMETERS, self.levels, strict=True)), span=self.span)


@cache  # the search for points takes longer than the tests
def random_case(seed: int) -> Case:
    """Constants and prior about the default cylinder, far enough to see each of them in the results."""
    rng = np.random.default_rng(seed)
    cylinder, mean, std = oracle.random_cylinder(rng)
    levels, span = ((1, 2, 3, 2, 3, 2, 1, 2, 3), 1.2) if seed % 2 else ((3, 1, 1, 3, 2, 3, 2, 1, 2), 1.7)
    box = {
        "q": cylinder.inner_stroke,
        "v": (-0.4, 0.4),
        "p_A": (3e6, cylinder.p_s - 3e6),
        "p_B": (3e6, cylinder.p_s - 3e6),
        "x_v": (-0.8, 0.8),
        "u": (-1.0, 1.0),
        "dt": (1e-3, 8e-3),
    }
    corners, _ = oracle.tensor_grid(mean, std, [2] * 9, span)  # they stand for the grid
    survivors: list[int] = []
    drawn = random_points(rng, 200, box)
    for k in range(len(drawn)):
        try:
            for theta in (mean, corners):  # most points that fail do so early
                cylinder.simulate(drawn.x0[k], drawn.u[k, 0], drawn.dt[k], theta)
        except oracle.NotAPoint:
            continue
        survivors.append(k)
        if len(survivors) == 4:
            break
    return Case(cylinder, mean, std, drawn[survivors], levels, span)


@pytest.fixture(scope="module", params=range(6), ids=lambda seed: f"cylinder{seed}")
def case(request: pytest.FixtureRequest) -> Case:
    return random_case(request.param)


@pytest.mark.long
def test_random_cylinder_rhs(case: Case) -> None:
    for x0, u in zip(case.points.x0, case.points.u, strict=True):
        expected = case.cylinder.rhs(x0, u[0], case.mean)
        np.testing.assert_allclose(case.model.rhs(x0, u, case.mean), expected, rtol=RHS_ERROR, atol=0.0)


def test_random_cylinder_states_and_sensitivities(case: Case) -> None:
    rng = np.random.default_rng(1)
    theta = case.mean + case.std * rng.uniform(-1, 1, (len(case.points), 9))
    states = fp.simulate(case.model, case.points, theta, rtol=RTOL)
    result = fp.sensitivities(case.model, case.points, theta, rtol=RTOL)
    assert np.all(states.status == fp.Status.ok)
    assert np.all(result.status == fp.Status.ok)
    for k in range(len(case.points)):
        point = case.points.x0[k], case.points.u[k, 0], case.points.dt[k]
        x, dx_dtheta = case.cylinder.sensitivities(*point, theta[k])
        for actual in (states.x[k], result.x[k]):
            assert np.max(np.abs(actual - x) / STATE_SCALES) < STATE_ERROR
        error = np.abs(result.dx_dtheta[k] - dx_dtheta) * case.std / STATE_SCALES[:, None]
        assert np.max(error) < SENSITIVITY_ERROR


def test_random_cylinder_predictive_covariances_and_fisher(case: Case) -> None:
    noise = np.array([5e-6, 2e4, 2e4, 1e-3])
    covariances, sensitivities = [], []
    for x0, u, dt in zip(case.points.x0, case.points.u[:, 0], case.points.dt, strict=True):
        covariances.append(oracle.predictive_covariance(case.cylinder, x0, u, dt, case.mean, case.std, case.levels, case.span))
        sensitivities.append(case.cylinder.sensitivities(x0, u, dt, case.mean)[1][OUTPUT_ROWS])
    D = np.diag(noise**2) + np.mean(covariances, axis=0)
    F = oracle.standardised_fisher(np.array(sensitivities), case.std, D)

    result = fp.predictive_covariance(case.model, case.points, case.prior, case.rule, rtol=RTOL)
    problem = fp.DesignProblem(
        case.model,
        case.prior,
        None,
        noise=dict(zip(("q", "p_A", "p_B", "x_v"), noise, strict=True)),
        rule=case.rule,
        output_covariance="pooled",
        rtol=RTOL,
    )
    evaluation = fp.evaluate(problem, case.points)

    assert np.all(result.status == fp.Status.ok)
    for actual, expected in zip(result.covariance, covariances, strict=True):
        assert relative_frobenius(actual, expected) < COVARIANCE_ERROR
    assert abs(evaluation.log_det - np.linalg.slogdet(F)[1]) < LOG_DET_ERROR


@pytest.mark.parametrize(("levels", "span"), [(2, 1.0), (3, 1.5), (5, 2.0), (9, 7.0), (4, 12.0)])
def test_cell_probabilities_hold_their_digits_in_the_tails(levels: int, span: float) -> None:
    mean = dict.fromkeys(PARAMETERS, 100.0)
    std = dict.fromkeys(PARAMETERS, 3.0)
    per_name = {name: 1 for name in PARAMETERS} | {"m_q": levels}
    nodes, weights = fp.TensorGrid(levels=per_name, span=span).nodes(fp.GaussianPrior(mean=mean, std=std))
    points, probabilities = oracle.cell_probabilities(100.0, 3.0, levels, span)
    np.testing.assert_allclose(nodes[:, PARAMETERS.index("m_q")], points, rtol=1e-14)
    np.testing.assert_allclose(weights, probabilities, rtol=PROBABILITY_ERROR, atol=0.0)


def test_oracle_cell_probabilities() -> None:
    """The oracle's own second route: 50 digits of the complementary error function, rounded."""
    _, probabilities = oracle.cell_probabilities(100.0, 3.0, 4, 12.0)
    expected = [6.2209605742717841e-16, 0.4999999999999993779]
    np.testing.assert_allclose(probabilities, expected + expected[::-1], rtol=2e-14, atol=0.0)
    _, probabilities = oracle.cell_probabilities(0.0, 1.0, 3, 1.5)
    np.testing.assert_allclose(probabilities, [0.21440287972182349617, 0.54674529524626360135, 0.21440287972182349617], rtol=1e-15)
    _, probabilities = oracle.cell_probabilities(0.0, 1.0, 9, 7.0)
    assert probabilities[-1] == pytest.approx(4.5341632895523681602e-10, rel=1e-14)


def test_tensor_grid_is_the_product_of_its_axes() -> None:
    case = random_case(0)
    nodes, weights = case.rule.nodes(case.prior)
    expected_nodes, expected_weights = oracle.tensor_grid(case.mean, case.std, case.levels, case.span)
    order, expected_order = np.lexsort(nodes.T), np.lexsort(expected_nodes.T)
    np.testing.assert_allclose(nodes[order], expected_nodes[expected_order], rtol=1e-14)
    np.testing.assert_allclose(weights[order], expected_weights[expected_order], rtol=1e-12, atol=0.0)


def test_oracle_sensitivities_agree_with_central_differences() -> None:
    """The oracle's own second route: eq. (9) against differences of its trajectories."""
    case = random_case(2)
    x0, u, dt = case.points.x0[0], case.points.u[0, 0], case.points.dt[0]
    _, dx_dtheta = case.cylinder.sensitivities(x0, u, dt, case.mean)
    for j, step in enumerate(case.mean * 1e-4):
        shift = step * (np.arange(9) == j)
        above, below = (case.cylinder.simulate(x0, u, dt, case.mean + s) for s in (shift, -shift))
        error = ((above - below) / (2 * step) - dx_dtheta[:, j]) * case.std[j] / STATE_SCALES
        assert np.max(np.abs(error)) < 1e-7
