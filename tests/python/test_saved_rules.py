"""design.json with rules and priors of every kind, and from before there were others than the paper's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import fisherpoint as fp
from defaults import NAMES, PRIOR, problem, without_checksum

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
        {"rule": fp.Linearized(), "prior": fp.GaussianPrior(dict(PRIOR.mean), dict(PRIOR.std), log=NAMES)},
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


def test_files_from_before_there_were_other_rules_and_priors(tmp_path: Path) -> None:
    path = saved(tmp_path)
    data = without_checksum(json.loads(path.read_text()))
    for table, key in (("rule", "kind"), ("rule", "edges"), ("prior", "covariance"), ("prior", "log")):
        del data["problem"][table][key]
    path.write_text(json.dumps(data))
    loaded = fp.Design.load(tmp_path).problem
    assert loaded.rule == problem().rule and loaded.prior == PRIOR


@pytest.mark.parametrize(
    ("table", "key", "value", "message"),
    [
        ("rule", "kind", "grid", "rule: expected one of tensor_grid, gauss_hermite, .*, given 'grid'"),
        ("prior", "covariance", [[1.0]], r"covariance: expected shape \(9, 9\), given \(1, 1\)"),
        ("prior", "log", ["mass"], "log: expected names of a_tau, .*; given unknown 'mass'"),
    ],
)
def test_wrong_rules_and_priors_in_a_file_are_named(tmp_path: Path, table: str, key: str, value: Any, message: str) -> None:
    path = saved(tmp_path)
    data = without_checksum(json.loads(path.read_text()))
    data["problem"][table][key] = value
    path.write_text(json.dumps(data))
    with pytest.raises(ValueError, match=message):
        fp.Design.load(tmp_path)


def saved(directory: Path) -> Path:
    """The file of a quick design."""
    fp.exchange(problem(), **QUICK).save(directory)
    return directory / "design.json"
