"""What is said where a prior, a tolerance or an output covariance does not suit, and how statuses and shifts are shown."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.estimation.report import shift
from fisherpoint.points.outside_region import outside

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
DIFFUSION = fp.SymbolicModel(["-sqrt(k)*x"], ["c*x"], {"x": "1"}, {}, {"k": "1/s2", "c": "1"}, nominal={"k": 4.0, "c": 1.0})


def reaction(outputs: dict[str, str]) -> fp.SymbolicModel:
    """A -> B -> C."""
    concentrations = dict.fromkeys("ABC", "mol/m3")
    return fp.SymbolicModel(
        ["-k1*A", "k1*A - k2*B", "k2*B"],
        list(outputs.values()),
        concentrations,
        {},
        {"k1": "1/s", "k2": "1/s"},
        dict.fromkeys(outputs, "mol/m3"),
        nominal={"k1": 1.0, "k2": 0.5},
    )


REACTION = reaction({name: name for name in "ABC"})


def test_at_the_mean_of_a_log_normal_prior_an_estimate_is_off_by_nothing() -> None:
    model = fp.SymbolicModel([], ["a*u", "b"], {}, {"u": "1"}, {"a": "1", "b": "1"}, {"y": "1", "z": "1"})
    mean = {"a": 2.0, "b": 3.0}
    prior = fp.GaussianPrior(mean, relative_std={"a": 0.3, "b": 0.3}, log=["a"])
    points = fp.Experiments(np.zeros((4, 0)), [1.0, 2.0, 3.0, 4.0])
    for times in (1.0, 1.5):
        truth = {name: times * value for name, value in mean.items()}
        data = fp.VirtualRig(model, truth, {"y": 0.0, "z": 0.0}).measure(points)
        fit = fp.estimate(model, data, prior, noise={"y": 1e-6, "z": 1e-6})
        expected = {"a": np.log(times) / np.sqrt(np.log(1.09)), "b": (times - 1) / 0.3}
        for name, value in expected.items():
            assert shift(fit, prior, name) == pytest.approx(value, abs=1e-4)
        assert (" +0.00 std" in str(fit) or " -0.00 std" in str(fit)) == (times == 1.0)


@pytest.mark.parametrize("log", [True, False])
@pytest.mark.parametrize("over", [True, False])
def test_a_prior_that_takes_the_other_sign_is_named(log: bool, over: bool) -> None:
    """Where nodes of the prior are negative no region helps."""
    prior = fp.GaussianPrior(DIFFUSION.nominal, {"k": 6.0, "c": 0.2}, log=["k"] if log else [])
    region = fp.ExperimentRegion({"x": (0.5, 1.0), "dt": (0.1, 1.0)})
    problem = fp.DesignProblem(
        DIFFUSION, prior, region, noise={"y": 0.01}, output_covariance="noise" if over else "pooled", rule=fp.TensorGrid(3)
    )
    settings = {"n_experiments": 4, "n_candidates": 5, "max_iterations": 1, "method": fp.ExchangeMethod(references=False)}
    if over:
        settings["goal"] = fp.Goal(over=fp.OverPrior("log", scenarios=fp.GaussHermite(3)))
    if log:
        assert len(fp.exchange(problem, **settings).points) == 4
        return
    said = r"over the prior, k also takes the other sign: make it log-normal \(log\), or its standard deviation smaller; or widen"
    with pytest.raises(ValueError, match=said):
        fp.exchange(problem, **settings)


def test_a_mass_balance_in_the_output_covariance_is_named() -> None:
    prior = fp.GaussianPrior(REACTION.nominal, relative_std={"k1": 0.2, "k2": 0.2})
    region = fp.ExperimentRegion({"A": (1.0, 2.0), "B": (0.0, 0.0), "C": (0.0, 0.0), "dt": (0.1, 1.0)})
    problem = fp.DesignProblem(REACTION, prior, region, output_covariance="pooled")
    with pytest.raises(ValueError, match=r"singular in A, B, C: A \+ B \+ C hardly varies over the prior, as where a mass balance"):
        fp.exchange(problem, n_experiments=4, max_iterations=1)
    doubled = reaction({"y_A": "A", "y_B": "B", "y_C": "-2*C"})
    with pytest.raises(ValueError, match=re.escape(": y_A + y_B - 0.5 y_C hardly varies")):
        fp.exchange(fp.DesignProblem(doubled, prior, region, output_covariance="pooled"), n_experiments=4, max_iterations=1)


def test_statuses_show_their_names() -> None:
    assert f"{fp.Status.met_jump} {fp.Status.ok:>4}" == "met_jump   ok" and str(fp.Status.two_jumps) == "two_jumps"
    assert fp.Status.met_jump == 1 and fp.Status(1) is fp.Status.met_jump
    points = fp.Experiments([[1.0], [-1.0]], np.zeros((2, 0)), [1.0, 1.0])
    model = fp.SymbolicModel(["-k*sqrt(x)"], ["x"], {"x": "m"}, {}, {"k": "m^0.5/s"}, nominal={"k": 1.0})
    expected = (fp.Status.ok, fp.Status.left_domain)
    assert fp.simulate(model, points, [1.0]).statuses == expected
    assert fp.sensitivities(model, points, [1.0]).statuses == expected
    prior = fp.GaussianPrior({"k": 1.0}, {"k": 0.1})
    assert fp.predictive_covariance(model, points, prior, fp.GaussHermite(2)).statuses == expected
    runs = fp.Runs([[1.0], [-1.0]], np.zeros((2, 2, 0)), [[0.5, 0.5]] * 2)
    assert fp.simulate(model, runs, [1.0]).statuses == expected
    assert fp.sensitivities(model, runs, [1.0]).statuses == expected


def test_points_and_runs_outside_are_named_with_the_quantity() -> None:
    region = fp.ExperimentRegion({"A": (1, 2), "B": (0, 1), "C": (0, 0), "dt": (0.1, 1)}, constraints=["A + B < 2"])
    points = fp.Experiments([[1, 0, 0], [3, -1, 0], [1.5, 0.75, 0]], np.zeros((3, 0)), [0.1, 0.5, 2.0])
    assert list(outside(REACTION, region, points)) == [
        "point 2: A = 3 mol/m3, above 2",
        "point 2: B = -1 mol/m3, below 0",
        "point 2: against the constraint 'A + B < 2'",
        "point 3: dt = 2 s, above 1",
        "point 3: against the constraint 'A + B < 2'",
    ]
    near = fp.Experiments([[2 * (1 + 1e-12), 0, 0]], np.zeros((1, 0)), [0.1])
    assert not list(outside(REACTION, fp.ExperimentRegion(dict(region.bounds)), near)) and not list(outside(REACTION, None, points))
    of_runs = fp.RunRegion({"A": (1, 2), "B": 0.0, "C": 0.0, "dt": (0.1, 1)}, segments=2)
    runs = fp.Runs([[1, 0, 0], [3, 0, 0]], np.zeros((2, 2, 0)), [[0.5, 0.5], [0.5, 2.0]])
    assert list(outside(REACTION, of_runs, runs)) == ["run 2: A = 3 mol/m3, above 2", "run 2, segment 2: dt = 2 s, above 1"]


def test_identifiability_sees_one_second_and_a_thousand() -> None:
    model = fp.SymbolicModel(
        ["-x/T_1 + u", "-z/T_2 + u"],
        ["x + z"],
        {"x": "1", "z": "1"},
        {"u": "1/s"},
        {"T_1": "s", "T_2": "s"},
        nominal={"T_1": 1.0, "T_2": 1000.0},
    )
    region = fp.ExperimentRegion({"x": (0, 0), "z": (0, 0), "u": (-1, 1), "dt": (0.1, 1e4)})
    found = fp.identifiability(model, region=region)
    assert found.identifiable is True and not found.weak and not found.left_out


def test_a_tolerance_in_the_file_is_that_of_the_problem(tmp_path: Path) -> None:
    text = (EXAMPLES / "exponential_decay.toml").read_text(encoding="utf-8")
    (tmp_path / "loose.toml").write_text(text.replace("[design]", "[design]\nrtol = 1e-4"), encoding="utf-8")
    assert fp.load_problem(tmp_path / "loose.toml").rtol == 1e-4
    assert "design.rtol" in (Path(__file__).resolve().parents[2] / "docs" / "reference" / "statuses.md").read_text()
