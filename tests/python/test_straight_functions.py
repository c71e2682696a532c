"""Models compiled as straight functions: what the interpreted programs compute, to the last bit."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.models import compiled as building
from fisherpoint.models import straight_source
from fisherpoint.models.tape.program import OPERATIONS, TABLE, Program
from tests.bits.digest import parts as digests

pytestmark = [pytest.mark.kernels, pytest.mark.skipif(building.find_compiler() is None, reason="no C++ compiler")]

Case = tuple[fp.SymbolicModel, Any, Any]


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with pytest.MonkeyPatch.context() as patch:
        directory = tmp_path_factory.mktemp("cache")
        patch.setenv("FISHERPOINT_CACHE", str(directory))
        yield directory


@pytest.fixture
def straight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small models as large ones are built: in several parts and files, with values that pass between them."""
    monkeypatch.setattr(building, "MOST_OF_KERNELS", -1)
    monkeypatch.setattr(straight_source, "PART", 5)
    monkeypatch.setattr(straight_source, "FILE", 40)


def same(model: fp.SymbolicModel, compute: Callable[[fp.SymbolicModel], Any]) -> Any:
    """The result of the model compiled, whose bits are those of the model interpreted."""
    compiled = model.compile()
    assert compiled.compiled and type(compiled.core).__name__ in ("StraightModel", "HiddenCore")
    expected, found = compute(model), compute(compiled)
    assert dict(digests(found)) == dict(digests(expected))
    return found


def every_operation() -> Case:
    """A static model: outputs that together take every operation, at nice and at other numbers."""
    names = ["exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "sqrt", "abs", "sign"]
    outputs = [f"a*{name}(u*a + b/3) + {name}(v)*u" for name in names]
    outputs += [
        "(u**2 + 0.1)**(a*v)",
        "min(u, a*v)*b",
        "max(u*b, v)",
        "where(u > v, a*u, b*v*u)",
        "u*v - a*b",
        "a*b - u*v",
        "-u",
        "u/(b*v)",
    ]
    outputs += ["a", "v", "u*(v*a - b)"]
    model = fp.SymbolicModel(
        [], outputs, {}, {"u": "1", "v": "1"}, {"a": "1", "b": "1"}, {f"y{i}": "1" for i in range(len(outputs))}, check_units=False
    )
    nice = np.array([0.0, 0.25, 0.5, 1.0, -0.25, -1.0, 1e-300])
    drawn = np.random.default_rng(0).uniform(0.05, 0.6, (64, 2))
    u = np.concatenate([np.stack(np.meshgrid(nice, nice), axis=-1).reshape(-1, 2), drawn])
    return model, fp.Experiments(np.empty((len(u), 0)), u, np.ones(len(u))), [0.9, 0.3]


def slider() -> Case:
    """A jump, a kink, a pole, a limit, functions; from starts on all of them too."""
    model = fp.SymbolicModel(
        ["v", "(u - c*sign(v) - k*max(s, 0) - d*v)/2 + 0.01/(s - 3) + 0.02*sqrt(s + 2)**a + exp(-v**2)*sin(a*s)"],
        ["s", "where(s > 0.1, log(2 + s), atan(v))"],
        {"s": "m", "v": "m/s"},
        {"u": "N"},
        {"c": "N", "k": "N/m", "d": "N s/m", "a": "1"},
        {"s": "m", "w": "1"},
        check_units=False,
    )
    rng = np.random.default_rng(3)
    x0 = np.concatenate(
        [np.column_stack([rng.uniform(-2.2, 4, 90), rng.uniform(-1, 3, 90)]), np.array([[0.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])]
    )
    return model, fp.Experiments(x0, rng.uniform(-1, 3, (93, 1)), rng.uniform(0.05, 2, 93)), [0.3, 4.0, 0.5, 1.3]


def ball() -> Case:
    """Bounces."""
    model = fp.SymbolicModel(
        ["v", "-g"], ["x"], {"x": "m", "v": "m/s"}, {}, {"g": "m/s2", "e": "1"}, {"x": "m"}, resets={"x < 0": {"v": "-e*v"}}
    )
    return model, fp.Experiments([[1.0, 0.0], [0.0, 1.0], [0.5, -2.0]], np.empty((3, 0)), [0.8, 0.7, 0.9]), [9.81, 0.8]


def thermostat() -> Case:
    """Latches, with a time in its equations."""
    model = fp.SymbolicModel(
        ["k*(T_a - T) + P*latch(T < low, T > high) + where(t < 5, 0.1, 0)"],
        ["T"],
        {"T": "K"},
        {"T_a": "K"},
        {"k": "1/s", "P": "K/s", "low": "K", "high": "K"},
        {"T": "K"},
        check_units=False,
    )
    return model, fp.Experiments([[19.0], [23.0], [20.0]], [[10.0]] * 3, [30.0, 40.0, 1.0]), [0.05, 1.5, 20.0, 22.0]


def doses() -> Case:
    """Updates at known times, and a dead time."""
    model = fp.SymbolicModel(
        ["-ka*d", "ka*d - ke*c + delay(u, tau)"],
        ["c"],
        {"d": "mg", "c": "mg"},
        {"dose": "mg", "u": "mg/h"},
        {"ka": "1/h", "ke": "1/h", "tau": "h"},
        {"c": "mg"},
        resets={"each segment": {"d": "d + dose"}},
        check_units=False,
    )
    u = np.random.default_rng(0).uniform(0, 2, (4, 6, 2))
    return model, fp.Runs(np.zeros((4, 2)), u, 1.0, before=[0.0, 0.0]), [1.0, 0.3, 0.4]


def chain() -> Case:
    """A model too large for kernels of its own: masses between springs."""
    n = 20
    rates = [f"v{i}" for i in range(n)]
    rates += [
        f"k{i}*({f'x{i - 1} - ' if i else '-'}x{i}) - d{i}*v{i}" + (f" + k{i + 1}*(x{i + 1} - x{i})" if i < n - 1 else " + tanh(u)")
        for i in range(n)
    ]
    states = {f"{of}{i}": ("1", 1.0) for of in "xv" for i in range(n)}
    parameters = {f"{of}{i}": "1" for of in "kd" for i in range(n)}
    model = fp.SymbolicModel(
        rates, ["x0", f"x{n - 1}*k1"], states, {"u": "1"}, parameters, {"first": "1", "last": "1"}, check_units=False
    )
    points = fp.Experiments(np.zeros((20, 2 * n)), np.linspace(0, 2, 20)[:, None], np.linspace(0.1, 2.0, 20))
    return model, points, [*np.linspace(3, 5, n), *np.full(n, 0.1)]


SMALL = {of.__name__: of for of in (every_operation, slider, ball, thermostat, doses)}


@pytest.mark.long
@pytest.mark.usefixtures("straight")
@pytest.mark.parametrize("name", SMALL)
def test_results_are_the_interpreted_ones_to_the_last_bit(name: str) -> None:
    model, points, theta = SMALL[name]()
    found = same(model, lambda of: fp.sensitivities(of, points, theta))
    assert not found.status.all()
    same(model, lambda of: fp.simulate(of, points, theta))
    if name != "every_operation":
        same(model, lambda of: fp.sensitivities(of, points, theta, method="Radau", rtol=1e-5))


def test_every_operation_is_tried() -> None:
    programs = vars(every_operation()[0].structure.programs).values()
    rows = [row for of in programs if isinstance(of, Program) for row in (*of.setup.tolist(), *of.stage.tolist())]
    assert {TABLE[row[0]].name for row in rows} == OPERATIONS.keys()


def test_a_large_model_is_compiled_so() -> None:
    model, points, theta = chain()
    assert len(model.states) > building.MOST_OF_KERNELS
    for method in ("RK45", "DOP853", "Radau"):
        same(model, lambda of, method=method: fp.sensitivities(of, points, theta, method=method))  # type: ignore[misc]
    prior = fp.GaussianPrior(
        dict(zip((q.name for q in model.parameters), theta, strict=True)), relative_std={q.name: 0.1 for q in model.parameters}
    )
    same(model, lambda of: fp.predictive_covariance(of, points[:5], prior, fp.Sobol(64), threads=2))
    again = pickle.loads(pickle.dumps(model.compile()))
    assert again == model and again.compiled


@pytest.mark.usefixtures("straight")
def test_points_do_not_depend_on_their_neighbours() -> None:
    model, points, theta = slider()
    compiled = model.compile()
    everywhere = fp.sensitivities(compiled, points, theta)
    for k in (0, 17, 92):
        alone = fp.sensitivities(compiled, points[k : k + 1], theta)
        for name in ("x", "y", "dy_dtheta"):
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(everywhere, name)[k])


@pytest.mark.parametrize("part", [1, 3, 10**6])
def test_random_programs_are_the_interpreted_ones(part: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(building, "MOST_OF_KERNELS", -1)
    monkeypatch.setattr(straight_source, "PART", part)
    rng = np.random.default_rng(part)
    pool = ["u0", "u1", "u2", "a", "b", "0.5", "2.0", "1"]
    for _ in range(60):
        one, other, third = rng.choice(pool, 3)
        forms = [f"({one})*({other}) + ({third})", f"({one}) - ({other})*({third})", f"({one})*({other}) - ({third})"]
        forms += [
            f"({one})/(2 + ({other})**2)",
            f"where(({one}) > ({other}), ({third}), ({one}))",
            f"sin({one})",
            f"max({one}, {other})",
        ]
        pool.append(str(rng.choice(forms)))
        pool = [text for text in pool if len(text) < 400]
    outputs = [f"u0*({text}) + b" for text in pool]
    model = fp.SymbolicModel(
        [],
        outputs,
        {},
        dict.fromkeys(("u0", "u1", "u2"), "1"),
        {"a": "1", "b": "1"},
        {f"y{i}": "1" for i in range(len(outputs))},
        check_units=False,
    )
    u = np.round(rng.normal(size=(50, 3)), rng.integers(0, 4))
    same(model, lambda of: fp.sensitivities(of, fp.Experiments(np.empty((50, 0)), u, np.ones(50)), [0.7, -1.0]))
