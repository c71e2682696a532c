"""design.json with rules and priors of every kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import fisherpoint as fp
from defaults import NAMES, PRIOR, problem
from saved_places import edit

QUICK: dict[str, Any] = {"n_experiments": 4, "n_candidates": 3, "max_iterations": 2, "method": fp.ExchangeMethod(references=False)}

COVARIANCE = PRIOR.covariance
COVARIANCE[7, 8] = COVARIANCE[8, 7] = 0.5 * PRIOR.std["V_0A"] * PRIOR.std["V_0B"]


@pytest.mark.parametrize(
    "changes",
    [
        {"rule": fp.GaussHermite({name: 2 if name == "E_oil" else 1 for name in NAMES})},
        {"rule": fp.SparseGaussHermite(1)},
        {"rule": fp.Sobol(32, seed=7)},
        {"rule": fp.TensorGrid(edges={name: [-1.0, 1.0] if name != "E_oil" else [-2.0, 0.0, 1.0] for name in NAMES})},
        {"rule": fp.Unscented(), "prior": fp.GaussianPrior(dict(PRIOR.mean), covariance=COVARIANCE, log=["c_L"])},
        {"rule": fp.LinearizedRule(), "prior": fp.GaussianPrior(dict(PRIOR.mean), dict(PRIOR.std), log=NAMES)},
    ],
    ids=lambda changes: type(changes["rule"]).__name__,
)
def test_rules_and_priors_come_back(tmp_path: Path, changes: dict[str, Any]) -> None:
    made = problem(output_covariance="pooled", **changes)
    design = fp.exchange(made, **QUICK)
    design.save(tmp_path)
    loaded = fp.Design.load(tmp_path)
    assert loaded.problem.rule == made.rule and loaded.problem.prior == made.prior
    assert fp.exchange(loaded.problem, **QUICK).evaluation.log_det == design.evaluation.log_det


@pytest.mark.parametrize(
    ("table", "key", "value", "message"),
    [
        ("rule", "levels", "many", "rule: levels: expected"),
        ("prior", "covariance", [[1.0]], r"covariance: expected"),
        ("prior", "log", ["mass"], "log: expected names of a_tau, .*; given unknown 'mass'"),
    ],
)
def test_wrong_rules_and_priors_in_a_file_are_named(tmp_path: Path, table: str, key: str, value: Any, message: str) -> None:
    path = saved(tmp_path)
    edit(path, f"problem.{table}.{key}", value)
    with pytest.raises(ValueError, match=message):
        fp.Design.load(tmp_path)


def saved(directory: Path) -> Path:
    """The file of a quick design."""
    fp.exchange(problem(), **QUICK).save(directory)
    return directory / "design.json"
