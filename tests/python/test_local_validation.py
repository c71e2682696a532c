"""`fp.validate` beside local parameters: what is promised of the common ones is achieved, whosever the others are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.validation.fits import VirtualFits, together
from fisherpoint.validation.parts import PartWork
from fisherpoint.validation.validate import Estimator, Rig, VirtualExperiments, local_scatter
from local_cases import NOISE, START, cart, measured

mpl.use("Agg")
RUNS = measured(5, 8).points
PRIOR = fp.GaussianPrior(mean=START, std={"d": 0.3, "c": 0.1, "m_load": 0.3})
LINE = fp.SymbolicModel(
    [], ["a * u + b * w + off"], {}, {"u": "1", "w": "1"}, {name: "1" for name in ("a", "b", "off")}, {"y": "1"}, name="line"
)
OF_LINE = fp.GaussianPrior({"a": 1.0, "b": 0.0, "off": 2.0}, {"a": 0.5, "b": 0.5, "off": 0.4})


def problem(**options: Any) -> fp.DesignProblem:
    return fp.DesignProblem(cart(), PRIOR, None, noise={"y": NOISE}, **options)


def line(**options: Any) -> fp.DesignProblem:
    return fp.DesignProblem(LINE, OF_LINE, None, noise={"y": 0.1}, **options)


def of_line(seed: int = 0, count: int = 4, samples: int = 5) -> fp.Runs:
    inputs = np.random.default_rng(seed).integers(-2, 3, (count, samples, 2)).astype(float)
    return fp.Runs(np.zeros((count, 0)), inputs, np.ones((count, samples)))


def sigmas(figure: Any, expected: float) -> float:
    return float(abs(figure.value - expected) / figure.error)


def line_errors(runs: fp.Runs, groups: np.ndarray, spread: float | None) -> np.ndarray:
    """Standard errors of a, b and all offsets, of the whole matrix."""
    u = runs.u.reshape(-1, 2)
    columns = np.concatenate([u, np.repeat(np.eye(groups.max() + 1)[groups], runs.dt.shape[1], axis=0)], axis=1) / 0.1
    information = columns.T @ columns
    if spread is not None:
        information[2:, 2:] += np.eye(groups.max() + 1) / spread**2
    return np.sqrt(np.diag(np.linalg.inv(information)))


@pytest.mark.parametrize("theta", ["mean", "prior"])
@pytest.mark.parametrize("spread", [None, 0.05])
@pytest.mark.parametrize("by", ["run", "record", "plant"])
def test_a_linear_model_keeps_its_promise_exactly(by: str, spread: float | None, theta: str) -> None:
    runs, of = of_line(), fp.Local(by, spread=spread)
    found = fp.validate(line(local={"off": of}), runs, runs=400, theta=theta, seed=3)
    design, groups = found.designs["design"], np.arange(4) if by != "plant" else np.zeros(4, dtype=int)
    expected = line_errors(runs, groups, spread)
    assert design.fits == 400 and tuple(design.parameters) == ("a", "b") and design.values == {"off": groups.max() + 1}
    for name, error in zip("ab", expected, strict=False):
        of_name = design.parameters[name]
        assert of_name.promised == pytest.approx(error, rel=1e-9) and of_name.claimed.value == pytest.approx(error, rel=1e-9)
        assert sigmas(of_name.ratio, 1) < 4 and sigmas(of_name.coverage, 0.95) < 4
    own = design.local["off"]
    assert own.promised == pytest.approx(np.sqrt(np.mean(expected[2:] ** 2)), rel=1e-9)
    assert sigmas(own.ratio, 1) < 4 and sigmas(own.coverage, 0.95) < 4


@pytest.mark.parametrize("spread", [None, 0.3])
@pytest.mark.parametrize("by", ["run", "plant"])
def test_a_nonlinear_model_keeps_its_promise(by: str, spread: float | None) -> None:
    given = problem(local={"m_load": fp.Local(by, spread=spread)})
    design = fp.validate(given, RUNS, runs=400).designs["design"]
    promised = fp.evaluate(given, RUNS).standard_errors
    assert design.fits == 400 and promised is not None
    for name, of in design.parameters.items():
        assert of.promised == pytest.approx(promised[name], rel=1e-6) and of.claimed.value == pytest.approx(of.promised, rel=0.05)
        assert sigmas(of.ratio, 1) < 4 and sigmas(of.coverage, 0.95) < 4
    assert sigmas(design.local["m_load"].coverage, 0.95) < 4


def test_a_wrong_spread_is_noticed() -> None:
    given, runs = line(local={"off": fp.Local("run", spread=0.02)}), of_line(7)
    wide = {"off": fp.Local("run", spread=0.4)}
    right, wrong = (fp.validate(given, runs, runs=600, truth=truth) for truth in (None, wide))
    assert not any(one.outcome == "broken" for one in right.verdicts["design"].values())
    assert any(one.outcome == "broken" and one.ratio == "high" for one in wrong.verdicts["design"].values())
    assert "off of each run, with a spread of 0.4" in str(wrong) and "spread otherwise than the problem says" in str(wrong)
    # Without a spread in the fits it is nothing to the common parameters.
    none = fp.validate(line(local={"off": "run"}), runs, runs=600, truth=wide)
    assert not any(one.outcome == "broken" for one in none.verdicts["design"].values())
    # A spread that is smaller than the problem's makes estimates better than promised.
    less = fp.validate(
        line(local={"off": fp.Local("run", spread=1.0)}), runs, runs=600, truth={"off": fp.Local("run", spread=1e-3)}
    )
    assert less.designs["design"].local["off"].coverage.value > 0.9
    # So is a mean that the values do not have.
    off = fp.validate(given, runs, runs=600, theta={"off": 2.5})
    assert any(one.outcome == "broken" for one in off.verdicts["design"].values())


def test_a_known_spread_is_what_varies() -> None:
    local = fp.validate(problem(local={"m_load": fp.Local("run", spread=0.3)}), RUNS, runs=50, theta="mean").designs["design"]
    varies = fp.validate(problem(parameters=["d", "c"], varies={"m_load": 0.3}), RUNS, runs=50, theta="mean").designs["design"]
    for name, of in local.parameters.items():
        assert of.promised == pytest.approx(varies.parameters[name].promised, rel=1e-6)


def test_a_fleet_and_labels() -> None:
    given, runs = line(local={"off": "plant"}), of_line(1)
    of_plants = fp.Measurements(runs, np.zeros((4, 5)), labels={"plant": ["A", "A", "B", "C"]})
    found = fp.validate(given, {"plants": of_plants, "one": runs}, runs=300)
    assert [dict(of.values) for of in found.designs.values()] == [{"off": 3}, {"off": 1}]
    for design, groups in zip(found.designs.values(), ([0, 0, 1, 2], [0] * 4), strict=True):
        for (name, of), error in zip(design.parameters.items(), line_errors(runs, np.array(groups), None), strict=False):
            assert of.promised == pytest.approx(error, rel=1e-9), name
            assert sigmas(of.ratio, 1) < 4
    region = fp.ExperimentRegion({"u": (-1.0, 1.0), "w": (-1.0, 1.0)})
    fleet = fp.design_fleet(given.replace(region=region), plants=["A", "B"], size=3, starts=1, rounds=1, max_iterations=2)
    design = fp.validate(given, fleet, runs=20).designs["design"]
    assert design.values == {"off": 2} and len(design.points) == 6
    promised = fleet.evaluation.standard_errors
    assert promised is not None
    assert {name: of.promised for name, of in design.parameters.items()} == pytest.approx(dict(promised), rel=1e-6)


def test_parts_are_cut_anywhere() -> None:
    """Each part has the random numbers that are its own, of local parameters too."""
    given = line(local={"off": fp.Local("run", spread=0.3)}, uncertain=None)
    estimator = Estimator.of(given, of_line(), {"y": 0.1}, True, False, 1e-9, 1)
    rig = Rig.of(given, None, {"y": 0.1}, local_scatter(given, {}, True))
    work, thetas = PartWork({"d": VirtualExperiments(estimator, rig, of_line(), 1)}), np.tile([1.0, 0.0, 2.0], (12, 1))

    def fits(sizes: list[int]) -> VirtualFits:
        parts = work.parts(thetas, 5, sizes)
        return together([work.whole(work(part), part.theta)["d"] for part in parts])

    whole, cut = fits([12]), fits([1, 4, 7])
    np.testing.assert_allclose(cut.estimate, whole.estimate, rtol=1e-9)
    np.testing.assert_allclose(cut.local_error, whole.local_error, rtol=1e-6, atol=1e-9)
    assert whole.local_error.shape == (12, 4) and np.unique(whole.local_error).size == 48


def test_wrong_spreads_are_named() -> None:
    for given, message in (
        (
            fp.Local("plant", spread=1),
            "truth\\['off'\\]: expected a spread between values of each run, given of each plant, spread 1",
        ),
        ("run", "truth\\['off'\\]: expected a spread between values of each run, given of each run"),
    ):
        with pytest.raises(ValueError, match=message):
            fp.validate(line(local={"off": "run"}), of_line(), runs=5, truth={"off": given})
    with pytest.raises(ValueError, match="local: expected names of off; given unknown 'a'"):
        fp.validate(line(local={"off": "run"}), of_line(), runs=5, truth={"a": "run"})


@pytest.mark.parametrize("seed", range(12))
def test_nice_numbers(seed: int) -> None:
    """Zeros, equal runs, one run, runs that say nothing of what is local: counts and promises as of the whole matrix."""
    rng = np.random.default_rng(seed)
    count, samples = int(rng.integers(1, 4)), int(rng.integers(1, 5))
    runs = of_line(seed, count, samples)
    if seed % 3 == 0:
        runs = fp.Runs(runs.x0, np.tile(runs.u[:1], (count, 1, 1)), runs.dt)
    spread = (None, 1.0)[seed % 2]
    given = line(local={"off": fp.Local(("run", "plant")[seed % 4 // 2], spread=spread)})
    found = fp.validate(given, runs, runs=30, seed=seed)
    design, evaluated = found.designs["design"], fp.evaluate(given, runs)
    if evaluated.standard_errors is None:
        assert any(np.isnan(of.promised) for of in design.parameters.values())
    else:
        assert design.fits == 30
        assert {name: of.promised for name, of in design.parameters.items()} == pytest.approx(dict(evaluated.standard_errors))
    assert "nan" not in str(found) and found.plot() is not None


def test_a_load_that_nothing_notices_costs_nothing() -> None:
    force = np.concatenate([RUNS.u, np.zeros((1, *RUNS.u.shape[1:]))])  # a cart at rest has any mass
    runs = fp.Runs(np.zeros((6, 1)), force, np.full(force.shape[:2], 0.2))
    given = problem(local={"m_load": "run"})
    design = fp.validate(given, {"still": runs, "moving": RUNS}, runs=40, theta="mean").designs
    assert design["still"].fits == 40 and any("m_load[6]" in words for words in design["still"].null_directions)
    for name, of in design["still"].parameters.items():
        assert of.promised == pytest.approx(design["moving"].parameters[name].promised, rel=1e-6)
    assert np.isnan(design["still"].local["m_load"].promised)


def test_noise_that_is_estimated() -> None:
    given = line(local={"off": "run"})
    found = fp.validate(given, of_line(2, 4, 8), runs=400, noise_known=False).designs["design"]
    for of in found.parameters.values():
        assert sigmas(of.coverage, 0.95) < 4 and sigmas(of.ratio, 1) < 4
    with pytest.raises(ValueError, match="noise_known: expected True beside the spread of local parameters, off; given False"):
        fp.validate(line(local={"off": fp.Local("run", spread=0.1)}), of_line(), runs=5, noise_known=False)


def test_a_log_normal_prior_without_a_spread_is_drawn() -> None:
    prior = fp.GaussianPrior({"a": 1.0, "b": 0.0, "off": 2.0}, {"a": 0.5, "b": 0.5, "off": 0.4}, log=["off"])
    given = fp.DesignProblem(LINE, prior, None, noise={"y": 0.1}, local={"off": "run"})
    scatter = local_scatter(given, {}, True)["off"]
    values = scatter.about(np.full((1, 1), 2.0), np.random.default_rng(0).standard_normal((1, 40_000)))
    assert values.min() > 0 and values.mean() == pytest.approx(2.0, rel=0.01) and values.std() == pytest.approx(0.4, rel=0.03)
    assert fp.validate(given, of_line(), runs=50).designs["design"].fits == 50


def test_it_is_saved_and_shown(tmp_path: Path) -> None:
    truth = {"m_load": fp.Local("run", spread=0.1)}
    found = fp.validate(problem(local={"m_load": "run"}), {"a": RUNS, "b": RUNS[:3]}, runs=20, truth=truth)
    found.save(tmp_path / "found")
    again = fp.Validation.load(tmp_path / "found")
    assert str(again) == str(found) and again.spread == {"m_load": 0.1}
    table = found.to_pandas()
    assert list(table.loc["a"].index) == ["d", "c", "m_load"] and table.loc[("a", "m_load"), "verdict"] == "local"
    assert "m_load: all 5 values together" in str(found) and "m_load: all 3 values together" in str(found)
    labels = [text.get_text() for text in found.plot().axes[0].get_yticklabels()]
    assert labels == ["d", "c", "m_load (local)"]
