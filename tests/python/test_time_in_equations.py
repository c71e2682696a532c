"""t in equations is the time since the start of a point, run or record, without a state for it."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import fisherpoint as fp
from fisherpoint_command.cli import main

THETA = {"r": 1.2, "k": 0.3}
UNITS: dict[str, Any] = {"parameters": {"r": "1/s", "k": "1/s"}, "outputs": {"c": "1"}, "nominal": THETA}
INFUSION = fp.SymbolicModel(["where(t < 0.77, r, 0) - k*c"], ["c"], {"c": "1"}, {}, **UNITS)
CLOCK = fp.SymbolicModel(["where(z < 0.77, r, 0) - k*c", "1"], ["c"], {"c": "1", "z": "s"}, {}, **UNITS)
"""The same with a state of its own."""


def concentration(t: Any) -> Any:
    on = np.minimum(t, 0.77)
    return 4.0 * (1 - np.exp(-0.3 * on)) * np.exp(-0.3 * (t - on))


def without(model: fp.Model, found: Any) -> Any:
    """Results of the model with a state for the time, without it."""
    return found._replace(
        x=found.x[..., :1], **({"dx_dtheta": found.dx_dtheta[..., :1, :]} if "dx_dtheta" in found._fields else {})
    )


def test_points_begin_at_zero_and_switch_exactly() -> None:
    dt = np.array([0.3, 0.77, 0.9, 2.0])
    for function in (fp.simulate, fp.sensitivities):
        found = function(INFUSION, fp.Experiments(np.zeros((4, 1)), np.zeros((4, 0)), dt), THETA)
        other = without(CLOCK, function(CLOCK, fp.Experiments(np.zeros((4, 2)), np.zeros((4, 0)), dt), THETA))
        for one, another in zip(found, other, strict=True):
            np.testing.assert_array_equal(one, another)
        np.testing.assert_allclose(found.y[:, 0], concentration(dt), rtol=1e-6)


def test_runs_go_on_through_their_segments() -> None:
    dt = np.array([[0.3, 0.5, 0.13, 1.1], [1.0, 0.2, 0.2, 0.2]])
    for function in (fp.simulate, fp.sensitivities):
        found = function(INFUSION, fp.Runs(np.zeros((2, 1)), np.zeros((2, 4, 0)), dt), THETA)
        other = without(CLOCK, function(CLOCK, fp.Runs(np.zeros((2, 2)), np.zeros((2, 4, 0)), dt), THETA))
        for one, another in zip(found, other, strict=True):
            np.testing.assert_array_equal(one, another)
        np.testing.assert_allclose(found.y[:, :, 0], concentration(np.cumsum(dt, axis=1)), rtol=1e-5)


def test_outputs_read_it() -> None:
    """y = t + c exp(t) of points, runs and records: dy/dc_0 too."""
    model = fp.SymbolicModel(["-k*c"], ["time + c*exp(t)"], {"c": "1"}, {}, {"k": "1/s"}, {"y": "1"}, check_units=False)
    times = np.array([0.2, 0.5, 0.6, 1.5])
    expected = times + np.exp(times * (1 - 0.3))
    points = fp.sensitivities(model, fp.Experiments(np.ones((4, 1)), np.zeros((4, 0)), times), [0.3], rtol=1e-9)
    runs = fp.sensitivities(
        model, fp.Runs(np.ones((1, 1)), np.zeros((1, 4, 0)), np.diff(times, prepend=0.0)[None]), [0.3], rtol=1e-9
    )
    record = fp.simulate_record(model, [7.0, *(7.0 + times)], np.zeros((5, 0)), [0.3], {"c": 1.0}, rtol=1e-9)
    for y in (points.y[:, 0], runs.y[0, :, 0], record.y[1:, 0]):
        np.testing.assert_allclose(y, expected, rtol=1e-8)
    for slope in (points.dy_dtheta[:, 0, 0], runs.dy_dtheta[0, :, 0, 0]):
        np.testing.assert_allclose(slope, -times * np.exp(times * 0.7), rtol=1e-7)


def test_records_and_their_parts_keep_the_time() -> None:
    """A record that begins at 5 s has t = 0 there, and so has what is cut out of it; `begin` says otherwise."""
    t = 0.1 * np.arange(41)
    record = fp.Record(t + 5.0, np.zeros((41, 0)), concentration(t), x0={"c": 0.0})
    assert record.since[0] == 0 and record[5:].since[0] == pytest.approx(0.5) and record[5:][3:].begin == 5.0
    for parts in ([record], [record[:5], record[5:]], [record[20:], record[:21]]):
        fit = fp.estimate(INFUSION, parts, start={"r": 1.0, "k": 0.4}, noise={"c": 0.01})
        assert (
            fit.converged
            and fit.estimate["k"] == pytest.approx(0.3, rel=1e-5)
            and fit.estimate["r"] == pytest.approx(1.2, rel=1e-5)
        )
    absolute = fp.Record(t + 5.0, np.zeros((41, 0)), np.exp(-0.3 * t), x0={"c": 1.0}, begin=0.0)
    fit = fp.estimate(INFUSION.fix(r=1.2), absolute, start={"k": 0.4}, noise={"c": 0.01})
    assert fit.estimate["k"] == pytest.approx(0.3, rel=1e-5)
    with pytest.raises(ValueError, match="begin: expected"):
        fp.Record(t, np.zeros((41, 0)), concentration(t), begin=np.nan)


def test_a_saved_fit_keeps_the_time(tmp_path: Path) -> None:
    t = 0.1 * np.arange(41)
    record = fp.Record(t, np.zeros((41, 0)), concentration(t), x0={"c": 0.0})
    fit = fp.estimate(INFUSION, record[5:], start={"r": 1.0, "k": 0.4}, noise={"c": 0.01})
    fit.save(tmp_path / "fit")
    again = fp.Fit.load(tmp_path / "fit")
    assert str(again) == str(fit) and again.model == INFUSION


def test_windows_of_a_record_would_begin_anew() -> None:
    t = 0.1 * np.arange(41)
    with pytest.raises(ValueError, match="model: expected one without the time t in its equations"):
        fp.pieces(fp.Record(t, np.zeros((41, 0)), concentration(t)), INFUSION, length=5)


@pytest.mark.parametrize(
    "made",
    [
        fp.SymbolicModel(["where(time < 0.77, r, 0) - k*c"], ["c"], {"c": "1"}, {}, **UNITS),
        fp.SymbolicModel(
            [sympy.Piecewise((sympy.Symbol("r"), sympy.Symbol("t") < 0.77), (0, True)) - sympy.Symbol("k") * sympy.Symbol("c")],
            [sympy.Symbol("c")],
            {"c": "1"},
            {},
            **UNITS,
        ),
        fp.model(states={"c": "1"}, **UNITS, name="model")(
            lambda x, u, p: ([fp.math.where(x.t < 0.77, p.r, 0) - p.k * x.c], [x.c])
        ),
        fp.model(states={"c": "1"}, **UNITS, name="model")(
            lambda x, u, p: ([fp.math.where(x.time < 0.77, p.r, 0) - p.k * x[0]], [*x])
        ),
    ],
    ids=["time", "sympy", "function", "function's time"],
)
def test_every_form_of_a_model_has_it(made: fp.SymbolicModel, tmp_path: Path) -> None:
    assert made == INFUSION and pickle.loads(pickle.dumps(made)) == INFUSION
    (tmp_path / "model.toml").write_text(made.to_toml())
    assert fp.load_model(tmp_path / "model.toml") == INFUSION
    assert [q.name for q in made.states] == ["c"] and made.jumps == ("t - 0.77",) and made.shown_states == {"c": "c"}
    assert [q.name for q in made.axes] == ["c", "dt"]


def test_a_quantity_of_the_name_is_no_time() -> None:
    """Where t is a state, time is time; where both are taken, there is none; a model without states has none."""
    both = fp.SymbolicModel(["-k*t + time"], ["t"], {"t": "1"}, {}, {"k": "1/s"}, {"y": "1"}, check_units=False)
    found = fp.simulate(both, fp.Experiments([[1.0]], np.zeros((1, 0)), [0.5]), [0.0])
    assert found.x[0, 0] == pytest.approx(1 + 0.125)
    neither = fp.SymbolicModel(["-k*t + time"], ["t"], {"t": "1"}, {"time": "1"}, {"k": "1/s"}, {"y": "1"}, check_units=False)
    assert neither.clock is None and fp.simulate(neither, fp.Experiments([[1.0]], [[0.0]], [0.5]), [0.0]).x[0, 0] == 1.0
    with pytest.raises(ValueError, match="expected the names u, k; given 't"):
        fp.SymbolicModel([], ["k*u + t"], {}, {"u": "1"}, {"k": "1"})
    with pytest.raises(ValueError, match="x: expected one of c; given unknown 's'"):
        fp.model(states={"c": "1"}, **UNITS)(lambda x, u, p: ([x.s], [x.c]))


def test_what_depends_on_time_alone_may_be_an_output_and_units_are_checked() -> None:
    model = fp.SymbolicModel(["-k*c"], ["t", "c"], {"c": "1"}, {}, {"k": "1/s"}, {"elapsed": "s", "c": "1"})
    assert model.shown_states == {"c": "c"}
    with pytest.warns(UserWarning, match="cannot be added|cannot be compared"):
        fp.SymbolicModel(["where(t < c, k, 0)"], ["c"], {"c": "m"}, {}, {"k": "m/s"})


def test_starts_constants_limits_and_rests() -> None:
    model = fp.SymbolicModel(
        ["u*exp(-t) - k*c"], ["c"], {"c": "1"}, {"u": "1/s"}, {"k": "1/s"}, constants={"b": 1.0}, check_units=False
    )
    points = fp.Experiments([[0.2]], [[1.0]], [1.0])
    offset = fp.sensitivities(model.free_start("c"), points, [0.5, 0.0], rtol=1e-9)
    assert offset.dy_dtheta[0, 0, 1] == pytest.approx(np.exp(-0.5), rel=1e-7)
    rested = fp.simulate(model, fp.Runs([[0.1]], [[1.0]], 1.0, rest=fp.Rest({"u": 2.0})), [0.5])
    assert rested.x[0, 0, 0] == pytest.approx(4.0)  # u exp(0) = k c
    limited = model.within("c < 0.6")
    runs = fp.Runs([[0.0]], [[1.0, 1.0, 1.0]], 0.5)
    assert fp.simulate(limited, runs, [0.1]).statuses == (fp.Status.left_domain,)
    assert fp.broken_limits(limited, runs, [0.1]) == ("c < 0.6",)
    late = fp.SymbolicModel(
        ["sqrt(1 - t) - k*c", "1"], ["c"], {"c": "1", "z": "1"}, {}, {"k": "1/s"}, {"y": "1"}, check_units=False
    )
    assert fp.broken_limits(late, fp.Runs(np.zeros((1, 2)), np.zeros((1, 4, 0)), 0.4), [0.1]) == ("1 - t > 0",)


def test_designs_do_not_show_it(tmp_path: Path) -> None:
    """Of points and of runs: the same as with a state of its own, without that in region, files and reports."""
    prior = fp.GaussianPrior(THETA, relative_std={"r": 0.3, "k": 0.3})
    designs = []
    for model, start in ((INFUSION, {}), (CLOCK, {"z": (0.0, 0.0)})):
        region = fp.ExperimentRegion({"c": (0.0, 1.0), "dt": (0.2, 3.0), **start})
        problem = fp.DesignProblem(model, prior, region, noise={"c": 0.01})
        designs.append(fp.exchange(problem, n_experiments=4, seed=0, max_iterations=30))
        runs = fp.RunRegion({"c": 0.0, "dt": (0.2, 1.0), **start}, segments=3)
        designs.append(fp.design_runs(problem.replace(region=runs), n_runs=1, n_starts=1, seed=0))
    for one, other in zip(designs[:2], designs[2:], strict=True):
        assert one.evaluation.log_det == pytest.approx(other.evaluation.log_det, abs=0.05)
    designs[0].points.to_csv(tmp_path / "design.csv")
    assert (tmp_path / "design.csv").read_text().splitlines()[0] == "c,dt"
    assert fp.Experiments.from_csv(tmp_path / "design.csv", INFUSION) == designs[0].points
    assert fp.identifiability(INFUSION, prior, fp.ExperimentRegion({"c": (0.0, 1.0), "dt": (0.2, 3.0)})).identifiable


def test_from_the_command_line(tmp_path: Path) -> None:
    (tmp_path / "infusion.toml").write_text(
        INFUSION.to_toml()
        + "\n[prior]\nr = { mean = 1.0, relative_std = 0.5 }\nk = { mean = 0.4, relative_std = 0.5 }\n[noise]\nc = 0.01\n"
    )
    t = 0.1 * np.arange(41)
    record = fp.Record(t, np.zeros((41, 0)), concentration(t), x0={"c": 0.0})
    record.to_csv(tmp_path / "record.csv", INFUSION)
    arguments = [
        "estimate",
        tmp_path / "infusion.toml",
        tmp_path / "record.csv",
        "-o",
        tmp_path / "fit",
        "--no-plots",
        "--no-prior",
    ]
    with pytest.raises(SystemExit) as stopped:
        main(list(map(str, arguments)))
    assert not stopped.value.code
    assert fp.Fit.load(tmp_path / "fit").estimate["k"] == pytest.approx(0.3, rel=1e-4)


def test_a_surface_that_moves_is_slid_along() -> None:
    """x is drawn to a sin(t) from both sides: it comes to it and stays there, and dx/da is sin(t)."""
    model = fp.SymbolicModel(["where(x > a*sin(t), -2, 2)"], ["x"], {"x": "1"}, {}, {"a": "1"}, check_units=False)
    found = fp.sensitivities(model, fp.Runs([[-0.5]], np.zeros((1, 6, 0)), 0.5), [1.0])
    expected = np.sin(0.5 * np.arange(1, 7))
    assert found.statuses == (fp.Status.ok,)
    np.testing.assert_allclose(found.y[0, :, 0], expected, atol=1e-9)
    np.testing.assert_allclose(found.dy_dtheta[0, :, 0, 0], expected, atol=1e-7)


def test_f_itself_is_that_of_the_start() -> None:
    model = fp.SymbolicModel(["exp(t)*u - k*c"], ["c + t"], {"c": "1"}, {"u": "1/s"}, {"k": "1/s"}, {"y": "1"}, check_units=False)
    np.testing.assert_array_equal(model.rhs([[1.0], [2.0]], [[3.0], [3.0]], [0.5]), [[2.5], [2.0]])
    np.testing.assert_array_equal(model.output([1.0], [3.0], [0.5]), [1.0])
