"""Models compiled while the program runs: the same results as interpreted ones, built once."""

import pickle

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.estimation.response import RecordResponse
from fisherpoint.models import compiled as building
from tests.bits.digest import parts as digests

pytestmark = pytest.mark.skipif(building.find_compiler() is None, reason="no C++ compiler")


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        directory = tmp_path_factory.mktemp("cache")
        patch.setenv("FISHERPOINT_CACHE", str(directory))
        yield directory


@fp.model(
    states={"s": "m", "v": "m/s"},
    inputs={"u": "N"},
    parameters={"c": "N", "k": "N/m", "d": "N s/m", "a": "1"},
    outputs={"s": "m", "w": "1"},
    constants={"m": (2.0, "kg")},
    name="slider",
    check_units=False,
)
def slider(x, u, p):
    """A mass on a one-sided spring under friction: a jump, a kink, a pole, a limit, and a function of every kind."""
    spring = p.k * fp.math.max(x.s, 0)
    drive = u.u * (1 + 0.1 * fp.math.sin(p.a * x.s) + 0.1 * fp.math.tanh(x.v) ** 2) + fp.math.exp(-(x.v**2)) * 0.05
    rate = (drive - p.c * fp.math.sign(x.v) - spring - p.d * x.v) / p.m + 0.01 / (x.s - 3) + 0.02 * fp.math.sqrt(x.s + 2) ** p.a
    return [x.v, rate], [x.s, fp.math.where(x.s > 0.1, fp.math.log(2 + x.s), fp.math.atan(x.v))]


THETA = {"c": 0.3, "k": 4.0, "d": 0.5, "a": 1.3}


@pytest.fixture(scope="module")
def compiled(cache):
    model = slider.compile()
    assert model.compiled
    return model


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(3)
    k = 300
    x0 = np.column_stack([rng.uniform(-2.2, 4, k), rng.uniform(-1, 3, k)])
    return fp.Experiments(x0, rng.uniform(-1, 3, (k, 1)), rng.uniform(0.05, 2, k))


@pytest.mark.long
@pytest.mark.parametrize("jumps", ["cross", "exclude"])
def test_trajectories_sensitivities_and_statuses_are_the_interpreted_ones(compiled, points, jumps):
    one, other = (fp.sensitivities(model, points, THETA, jumps=jumps) for model in (slider, compiled))
    assert np.array_equal(one.status, other.status)
    assert {fp.Status.ok, fp.Status.left_domain} <= {fp.Status(s) for s in one.status}
    assert (fp.Status.met_jump in one.status) == (jumps == "exclude")
    ok = one.status == fp.Status.ok
    finer = fp.sensitivities(slider, points, THETA, rtol=1e-8, jumps=jumps)
    for name in ("x", "y", "dx_dtheta", "dy_dtheta"):
        a, b = getattr(one, name)[ok], getattr(other, name)[ok]
        scale = np.abs(a).max(axis=0)
        # A trajectory that nearly grazes the jump magnifies roundings, as it does the tolerance.
        near = 1e-2 * np.abs(a - getattr(finer, name)[ok]) if jumps == "cross" else 0.0
        assert (np.abs(a - b) <= 1e-9 * scale + 1e-12 + near).all(), name
    simulated = fp.simulate(compiled, points, THETA, jumps=jumps)
    assert np.array_equal(simulated.status, fp.simulate(slider, points, THETA, jumps=jumps).status)


def test_records_are_the_interpreted_ones(compiled):
    """Through the kink; the last row comes to rest on the jump."""
    t = np.linspace(0, 1.5, 16)
    record = fp.Record(t, 2 + np.sin(np.arange(16)), np.ones((16, 2)), x0={"v": 0.5})
    theta, x0 = np.tile(list(THETA.values()), (3, 1)), np.array([[-1.0, 0.5], [-0.5, 0.8], [1.5, 0.01]])
    one, other = (RecordResponse(model, record, [0, 3])(theta, x0) for model in (slider, compiled))
    assert one.status.tolist() == other.status.tolist() == [fp.Status.ok] * 3
    np.testing.assert_allclose(other.y, one.y, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(other.dy, one.dy, rtol=1e-9, atol=1e-9)


def test_predictive_covariances_are_the_interpreted_ones(compiled, points):
    prior = fp.GaussianPrior(THETA, relative_std=dict.fromkeys(THETA, 0.1))
    for rule in (fp.TensorGrid(levels=3), fp.SparseGaussHermite(2)):
        one, other = (fp.predictive_covariance(model, points[:40], prior, rule, threads=2) for model in (slider, compiled))
        assert np.array_equal(one.status, other.status)
        assert (one.status == fp.Status.ok).sum() > 5
        scale = np.abs(one.covariance).max(axis=0)
        assert (np.abs(one.covariance - other.covariance) <= 1e-6 * scale).all()


def test_the_cache_serves_an_equal_model(compiled, cache, monkeypatch):
    assert len(list(cache.glob("*.so"))) == 1
    monkeypatch.setattr(building, "_build", lambda *_: pytest.fail("built again"))
    assert slider.compile().compiled


def test_a_compiled_model_is_equal_to_the_interpreted_one_and_is_compiled_after_pickling(compiled, points, monkeypatch):
    assert compiled == slider and compiled.compile() is compiled
    monkeypatch.setattr(building, "_build", lambda *_: pytest.fail("built again"))
    again = pickle.loads(pickle.dumps(compiled))
    assert again == slider and again.compiled
    one, other = (fp.sensitivities(model, points, THETA).dy_dtheta for model in (compiled, again))
    assert one.tobytes() == other.tobytes()


def test_a_pickled_copy_that_would_compute_otherwise_is_refused(compiled, monkeypatch):
    pickled = pickle.dumps(compiled)
    with monkeypatch.context() as patch:
        patch.setattr(building, "find_compiler", lambda: None)
        with pytest.raises(RuntimeError, match=r"compiled as where it was pickled, given .*found none.*without compile"):
            pickle.loads(pickled)
    monkeypatch.setattr(building, "_key", lambda *_: "0" * 32)
    monkeypatch.setattr(building, "_loaded", lambda tape, *_: tape)
    with pytest.raises(RuntimeError, match="given another compiler"):
        pickle.loads(pickled)


@pytest.fixture(scope="module")
def validated(points):
    """A validation of the slider's first points, as a function of the model and of who computes it."""
    prior = fp.GaussianPrior(THETA, relative_std=dict.fromkeys(THETA, 0.05))
    region = fp.ExperimentRegion({"s": (-2, 2), "v": (-1, 3), "u": (-1, 3), "dt": (0.05, 2)})

    def found(model, workers=None):
        problem = fp.DesignProblem(model, prior, region, noise={"s": 1e-3, "w": 1e-3})
        return dict(digests(fp.validate(problem, points[:12], runs=20, threads=1, workers=workers)))

    return found


def test_processes_compute_with_the_compiled_kernels(compiled, validated):
    here = validated(compiled)
    assert here != validated(slider)  # so that last bits show who was interpreted
    assert validated(compiled, workers=2) == here


def test_processes_that_cannot_have_the_compiled_kernels_are_refused(compiled, validated, monkeypatch):
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(RuntimeError, match=r"slider compiled as where it was pickled, given .*found none.*without compile"):
        validated(compiled, workers=1)


def test_a_smooth_cylinder_is_sent_with_its_kernels(monkeypatch):
    monkeypatch.setattr("fisherpoint.models.symbolic.compiled_model", lambda *given: building.CompiledCore(given[-1], "key"))
    model = fp.HydraulicCylinder(smooth={"v": 1e-3})
    assert pickle.loads(pickle.dumps(model.compile())).compiled and not pickle.loads(pickle.dumps(model)).compiled
    monkeypatch.setattr("fisherpoint.models.symbolic.compiled_model", lambda *given: building.CompiledCore(given[-1], "other"))
    with pytest.raises(RuntimeError, match="given another compiler"):
        pickle.loads(pickle.dumps(model.compile()).replace(b"other", b"there"))


def test_without_a_compiler_it_says_so_and_stays_interpreted(monkeypatch):
    monkeypatch.setattr(building, "find_compiler", lambda: None)
    with pytest.warns(UserWarning, match="found none; the model stays interpreted"):
        model = slider.compile()
    assert not model.compiled
    assert model == slider


def test_a_compiler_that_fails_is_told_with_its_complaint(monkeypatch, tmp_path):
    broken = tmp_path / "broken"
    broken.write_text("#!/bin/sh\n[ \"$1\" = --version ] || { echo 'x.hpp:1: error: no such thing' >&2; exit 1; }\n")
    broken.chmod(0o755)
    monkeypatch.setenv("FISHERPOINT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(building, "find_compiler", lambda: str(broken))
    with pytest.warns(UserWarning, match="no such thing; the model stays interpreted"):
        assert not slider.compile().compiled
    assert not (tmp_path / "cache").exists()


def test_the_builtin_cylinder_is_compiled_already():
    model = fp.HydraulicCylinder()
    assert model.compile() is model


@pytest.mark.long
def test_a_static_model_is_compiled_too():
    growth = fp.SymbolicModel([], ["k*(exp(n*u) - 1)"], {}, {"u": "V"}, {"k": "A", "n": "1/V"}, {"y": "A"})
    model, points = growth.compile(), fp.Experiments(np.empty((3, 0)), [[1.0], [2.0], [800.0]])
    assert model.compiled
    one, other = (fp.sensitivities(m, points, [2.0, 0.9]) for m in (growth, model))
    assert other.status.tolist() == one.status.tolist() == [fp.Status.ok, fp.Status.ok, fp.Status.not_finite]
    np.testing.assert_allclose(other.dy_dtheta, one.dy_dtheta, rtol=1e-14)


@pytest.mark.long
def test_branches_over_a_prior_are_the_interpreted_ones():
    growth = fp.SymbolicModel(["heaviside(p - 1)*u"], ["x", "sign(x - 0.5)"], {"x": "1"}, {"u": "1"}, {"p": "1"})
    model, points = growth.compile(), fp.Experiments([[0.0]], [[1.0]], [1.0])
    assert model.compiled
    prior = fp.GaussianPrior({"p": 1.05}, std={"p": 0.5})
    one, other = (fp.predictive_covariance(m, points, prior, fp.Sobol(64)).covariance[0] for m in (growth, model))
    np.testing.assert_allclose(other, one, rtol=1e-12)
    assert np.diag(one).min() > 0.1


@pytest.mark.long
def test_time_in_equations_is_that_of_the_interpreted_model():
    model = fp.SymbolicModel(["where(t < b, r, 0)*u - k*c"], ["c + t"], {"c": "1"}, {"u": "1"}, {"r": "1/s", "k": "1/s", "b": "s"})
    compiled = model.compile()
    assert compiled.compiled and [q.name for q in compiled.states] == ["c"]
    runs = fp.Runs([[0.0]], np.ones((1, 4, 1)), [[0.3, 0.5, 0.13, 1.1]])
    one, other = (fp.sensitivities(m, runs, [1.2, 0.3, 0.77]) for m in (model, compiled))
    assert one.statuses == other.statuses == (fp.Status.ok,) and one.x.shape == other.x.shape == (1, 5, 1)
    np.testing.assert_allclose(other.dy_dtheta, one.dy_dtheta, rtol=1e-12)


@pytest.mark.long
def test_a_dead_time_is_the_interpreted_one(cache):
    model = fp.SymbolicModel(
        ["k*delay(u, tau) - c*sign(x)"], ["x"], {"x": "m"}, {"u": "m/s"}, {"k": "1", "c": "m/s", "tau": "s"}, {"x": "m"}
    )
    rng, theta = np.random.default_rng(0), [1.0, 0.6, 0.07]
    runs = fp.Runs(np.zeros((5, 1)), rng.normal(0, 1.5, (5, 12)), 0.05, before=[0.4])
    compiled = model.compile()
    assert compiled.compiled and compiled.delays == {"u": "tau"}
    interpreted, one, two = (fp.sensitivities(of, runs, theta, threads=n) for of, n in ((model, 1), (compiled, 1), (compiled, 2)))
    assert not one.status.any() and abs(one.dy_dtheta[..., 2]).max() > 1
    np.testing.assert_allclose(one.dy_dtheta, interpreted.dy_dtheta, rtol=1e-9, atol=1e-12)
    assert (one.dy_dtheta == two.dy_dtheta).all()
    record = fp.Record(np.arange(40) * 0.05, rng.normal(0, 1.5, 40), np.ones(40), x0={"x": 0.0})
    responses = [RecordResponse(of, record, [0, 1, 2])(np.array([theta]), np.zeros((1, 1))) for of in (model, compiled)]
    np.testing.assert_allclose(responses[1].dy, responses[0].dy, rtol=1e-9, atol=1e-12)
