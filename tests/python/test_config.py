"""The TOML file: the examples, and what a file means."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from config_text import EXAMPLES, RECOMMENDED, TEXT, rule_of, without, write

config = pytest.importorskip("fisherpoint.design.file.configuration", reason="needs the extras", exc_type=ImportError)


def test_examples_describe_the_default_cylinder() -> None:
    model = fp.HydraulicCylinder()
    for name, covariance, nodes in (("paper.toml", "pooled", 3**9), ("cylinder.toml", "noise", 199)):
        example = config.load_config(EXAMPLES / name)
        problem = example.problem()
        assert dict(problem.model.constants) == dict(model.constants)
        assert dict(problem.prior.mean) == dict(model.nominal)
        assert problem.prior.std["c_L"] == pytest.approx(0.30 * 2.5e-9)
        assert dict(problem.noise) == {"q": 5e-6, "p_A": 2e4, "p_B": 2e4, "x_v": 1e-3}
        assert tuple(problem.region.bounds["dt"]) == (1e-3, 1e-2)
        assert problem.output_covariance == covariance
        assert problem.rule.size(problem.prior) == nodes
        assert example.exchange_settings() == {
            "method": fp.ExchangeMethod("paper" if name == "paper.toml" else "auto"),
            "goal": fp.Goal(),
            "n_experiments": 12,
            "n_candidates": 50,
            "max_iterations": 200 if name == "paper.toml" else 400,
            "seed": 0,
        }


def test_a_criterion_over_the_prior(tmp_path: Path) -> None:
    text = TEXT.replace("[design]", '[goal]\nover = "cvar"\nscenarios = 16\nshare = 0.5\n\n[design]', 1)
    settings = config.load_config(write(tmp_path / "run.toml", text)).exchange_settings()
    assert settings["goal"] == fp.Goal(over=fp.OverPrior("cvar", scenarios=fp.Sobol(16), share=0.5))
    assert not {"scenarios", "share"} & set(settings)
    short = TEXT.replace("[design]", '[goal]\nover = "log"\n\n[design]', 1)
    assert config.load_config(write(tmp_path / "run.toml", short)).exchange_settings()["goal"].over == fp.OverPrior("log")
    with pytest.raises(config.ConfigError, match=r"goal\.scenarios: expected a power of two"):
        config.load_config(
            write(tmp_path / "run.toml", TEXT.replace("[design]", '[goal]\nover = "log"\nscenarios = 6\n\n[design]', 1))
        )


def test_without_noise_the_region_covariance_is_the_default(tmp_path: Path) -> None:
    problem = config.load_config(write(tmp_path / "run.toml", without("noise"))).problem()
    assert problem.noise is None
    assert problem.output_covariance == "region"


def test_without_a_region_the_problem_can_be_evaluated(tmp_path: Path) -> None:
    problem = config.load_config(write(tmp_path / "run.toml", without("region"))).problem()
    assert problem.region is None


def test_short_and_long_forms_mean_the_same(tmp_path: Path) -> None:
    levels = ", ".join(f"{quantity.name} = {2 if quantity.name == 'c_L' else 1}" for quantity in fp.HydraulicCylinder().parameters)
    text = (
        TEXT.replace('relative_std = 0.30, unit = "N"', "std = 120.0")
        .replace('{ bounds = [0.03, 0.27], unit = "m" }', "[0.03, 0.27]")
        .replace('{ value = 21e6, unit = "Pa" }', "21e6")
        .replace("levels = 3", f"levels = {{ {levels} }}")
        .replace("x_v = [-1.0, 1.0]", 'x_v = { bounds = [0.5, 0.5], unit = "1" }')
    )
    problem = config.load_config(write(tmp_path / "run.toml", text)).problem()
    assert problem.prior.std["a_tau"] == pytest.approx(120.0)
    assert tuple(problem.region.bounds["q"]) == (0.03, 0.27)
    assert tuple(problem.region.bounds["x_v"]) == (0.5, 0.5)
    assert problem.model.constants["p_s"] == 21e6
    assert problem.rule.size(problem.prior) == 2


@pytest.mark.parametrize(
    ("table", "rule"),
    [
        ("", fp.SparseGaussHermite(2)),
        ("[rule]", fp.SparseGaussHermite(2)),
        ("[rule]\nlevels = 2", fp.TensorGrid(2)),
        ('[rule]\nkind = "tensor_grid"\nedges = [-2, -0.5, 0.5, 2.0]', fp.TensorGrid(edges=[-2, -0.5, 0.5, 2])),
        ('[rule]\nkind = "gauss_hermite"\nlevels = 2', fp.GaussHermite(2)),
        ('[rule]\nkind = "sparse_gauss_hermite"', fp.SparseGaussHermite(2)),
        ('[rule]\nkind = "sparse_gauss_hermite"\nlevel = 3', fp.SparseGaussHermite(3)),
        ('[rule]\nkind = "sobol"\nn = 512\nseed = 4', fp.Sobol(512, seed=4)),
        ('[rule]\nkind = "unscented"', fp.Unscented()),
        ('[rule]\nkind = "linearized"', fp.LinearizedRule()),
    ],
)
def test_rules_of_every_kind(tmp_path: Path, table: str, rule: fp.Rule) -> None:
    text = TEXT.replace(rule_of(TEXT), table + "\n\n")
    assert config.load_config(write(tmp_path / "run.toml", text)).problem().rule == rule


def test_correlations_and_log_normal_parameters(tmp_path: Path) -> None:
    text = TEXT.replace("\n[noise]", '\n[prior_correlation]\n"V_0A, V_0B" = 0.5\n"c_L,E_oil" = -0.2\n[noise]')
    text = text.replace(
        "c_L   = { mean = 2.5e-9,   relative_std = 0.30", "c_L   = { mean = 2.5e-9,   log = true, relative_std = 0.30"
    )
    prior = config.load_config(write(tmp_path / "run.toml", text)).build_prior()
    assert prior.log == ("c_L",) and prior.std["c_L"] == pytest.approx(0.3 * 2.5e-9)
    expected = np.eye(9)
    expected[7, 8] = expected[8, 7] = 0.5
    expected[3, 6] = expected[6, 3] = -0.2
    np.testing.assert_allclose(prior.correlation, expected, rtol=1e-14, atol=1e-15)


def test_a_problem_is_read_without_the_command() -> None:
    path = EXAMPLES / "cylinder.toml"
    assert str(fp.load_problem(path)) == str(config.load_config(path).problem())
    with pytest.raises(config.ConfigError, match=r"nowhere\.toml: "):
        fp.load_problem(path.with_name("nowhere.toml"))


def test_a_number_in_the_region_fixes_a_value(tmp_path: Path) -> None:
    """As a number alone, in a table with a unit, and for runs."""
    path = tmp_path / "cylinder.toml"
    text = RECOMMENDED.replace("x_v = [-1.0, 1.0]", "x_v = 0.0")
    path.write_text(re.sub(r"p_A = { bounds = .*", 'p_A = { bounds = 50, unit = "bar" }', text))
    region = config.load_config(path).problem().region
    assert region is not None
    assert region.bounds["x_v"] == (0.0, 0.0) and region.bounds["p_A"] == (5e6, 5e6)


def test_runs_from_rest(tmp_path: Path) -> None:
    path = tmp_path / "runs.toml"
    text = (EXAMPLES / "cylinder_runs.toml").read_text()

    def written(rest: str) -> Path:
        path.write_text(text.replace("[runs]\n", f"[runs]\nrest = {rest}\n"))
        return path

    region = config.load_config(written('{ u = { u = 0.1 }, states = ["v", "p_A"] }')).problem().region
    assert isinstance(region, fp.RunRegion) and region.rest == fp.Rest({"u": 0.1}, states=["v", "p_A"])
    for rest, message in (
        ("{ u = { w = 0.1 } }", "unknown key runs.rest.u.w; expected one of u"),
        ("{ }", "runs.rest.u.u: missing; expected the input that is held"),
        ('{ u = { u = 0.1 }, states = ["w"] }', "runs.rest.states"),
        ("{ held = 1 }", "unknown key runs.rest.held; expected one of u, states"),
    ):
        with pytest.raises(config.ConfigError, match=message):
            config.load_config(written(rest))
