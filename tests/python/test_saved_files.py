"""Files that were damaged and sealed again: what is wrong is told when they are read, and what is read can be shown."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.field_checks import check_declared
from fisherpoint.basics.files import _sha256
from saved_cases import Saved, damaged, damages, nested, outcome, places, problem, saved_cases

DAMAGES = 25
"""Of each result; tests/fuzz/fuzz_files.py tries all."""

NAMES = (
    "design",
    "design over the prior",
    "singular design",
    "design of what is assumed",
    "design of a function",
    "design of predictions",
    "design of scaled errors",
    "design under other noise",
    "robust design",
    "fit",
    "fit of a record",
    "fit of runs",
    "fit of local parameters",
    "design beside local parameters",
    "fleet",
    "pieces",
    "runs",
    "signals",
    "sweep",
    "approximate",
    "approximate over the prior",
    "exact",
    "comparison",
    "rules",
    "evaluation",
    "feasibility",
    "validation",
    "validation beside local parameters",
    "validation of runs",
    "identifiability",
    "campaign",
    "campaign of days",
    "campaign of runs",
)

cases = cache(saved_cases)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")  # tables beside a design that was damaged are of another one
@pytest.mark.parametrize("name", NAMES)
def test_damaged_files_are_refused_in_our_words_or_can_be_shown(name: str, tmp_path: Path) -> None:
    assert set(NAMES) == set(cases())
    case, random, kinds = cases()[name], Random(name), set()
    case.save(tmp_path)
    path = tmp_path / case.name
    data = json.loads(path.read_text())
    del data["sha256"]
    assert outcome(case, tmp_path).kind == "fine"
    everywhere = list(places(data))
    for place in random.choices(everywhere, k=DAMAGES):
        damage = random.choice([name for name, _ in damages(data, place)])
        path.write_text(damaged(data, place, damage))
        found = outcome(case, tmp_path)
        assert found.kind != "fault", (place, damage, found.words)
        kinds.add(found.kind)
    assert "refused" in kinds


def changed(case: Saved, directory: Path, change: Callable[[Any], None]) -> None:
    """Save a result, change its content, and seal it again."""
    case.save(directory)
    path = directory / case.name
    data = json.loads(path.read_text())
    del data["sha256"]
    change(data)
    path.write_text(json.dumps(data | {"sha256": _sha256(data)}))


def put(*place: str | int, value: Any) -> Callable[[Any], None]:
    def change(data: Any) -> None:
        for name in place[:-1]:
            data = data[name]
        data[place[-1]] = value

    return change


EVALUATION = ("content", "Evaluation")
DESIGN, FIT, CAMPAIGN = ("content", "Design"), ("content", "FitState"), ("content", "CampaignState")


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("evaluation", put(*EVALUATION, value={}), r"parameters: expected an entry, given none"),
        ("evaluation", put("content", value={}), r": expected an entry of one kind, given \[\]"),
        ("evaluation", put(*EVALUATION, "rank", value={}), r"rank: expected an entry of one kind"),
        ("evaluation", put(*EVALUATION, "rank", value="2"), r"rank: expected a whole number, given '2'"),
        ("evaluation", put(*EVALUATION, "rank", value=True), r"rank: expected a whole number, given True"),
        ("evaluation", put(*EVALUATION, "rank", value=-1), r"rank: expected a whole number of at least 0"),
        ("evaluation", put(*EVALUATION, "log_det", value="x"), r"log_det: expected a number, given 'x'"),
        ("evaluation", put(*EVALUATION, "log_det", value={"float": "1e5"}), r"log_det: expected 'nan', 'inf' or '-inf'"),
        ("evaluation", put(*EVALUATION, "log_det", value=nested(200)), r"log_det: expected a number"),
        ("evaluation", put(*EVALUATION, "log_det", value=nested(450)), r"nested too deep|expected a number"),
        ("evaluation", put(*EVALUATION, "fisher", "dtype", value="|O"), r"fisher: expected an array of f, i, b, U, given '|O'"),
        ("evaluation", put(*EVALUATION, "fisher", "dtype", value="<i8"), r"fisher: expected an array of int, given"),
        ("evaluation", put(*EVALUATION, "fisher", "shape", value=[4]), r"fisher: expected 2 axes, given shape \(4,\)"),
        ("evaluation", put(*EVALUATION, "fisher", "shape", value=[1, 4]), r"fisher: expected 2 along axis 0"),
        (
            "evaluation",
            put(*EVALUATION, "output_covariance_kind", value="x"),
            r"output_covariance_kind: expected one of noise",
        ),
        ("evaluation", put(*EVALUATION, "parameters", value=["k1", "k3"]), r"standard_errors: expected the names k1, k3, given"),
        ("feasibility", put("content", "Feasibility", "draws", value=0), r"draws: expected a positive number, given 0"),
        ("design", put(*DESIGN, "stop_reason", "StopReason", value="tired"), r"stop_reason: expected one of converged"),
        (
            "design",
            put(*DESIGN, "efficiency", "Efficiency", "at_most", value=None),
            r"efficiency.at_most: expected a value together with at_least",
        ),
        (
            "design",
            put(*DESIGN, "problem", "DesignProblem", "prior", "GaussianPrior", "mean", "mapping", 0, 1, value=[]),
            r"mean\['?k1'?\]: expected",
        ),
        ("fit", put(*FIT, "noise_covariance", value=None), r"noise_covariance: expected an array of float64"),
        ("fit", put(*FIT, "noise_known", value=0), r"noise_known: expected a bool, given 0"),
        ("fit", put(*FIT, "weights", "array", 0, value=-1.0), r"wrong value: Matrix is not positive definite"),
        (
            "campaign",
            put(*CAMPAIGN, "batches", 0, "Batch", "estimate", "mapping", 0, 1, value=None),
            r"batches\[0\].estimate\['k1'\]: expected a number",
        ),
        ("validation", put("content", "Validation", "theta", value="past"), r"theta: expected 'prior', 'mean' or"),
    ],
)
def test_the_message_names_the_file_and_the_entry(name: str, change: Callable[[Any], None], message: str, tmp_path: Path) -> None:
    case = cases()[name]
    changed(case, tmp_path, change)
    with pytest.raises(ValueError, match=message) as caught:
        case.load(tmp_path)
    assert str(caught.value).startswith(f"{tmp_path / case.name}: ")


@pytest.mark.parametrize(
    "array",
    [
        {"array": ["x"], "shape": [1], "dtype": "<U250000000"},
        {"array": [], "shape": [10**12, 0], "dtype": "<f8"},
        {"array": [1.0], "shape": [1], "dtype": "V1000000000"},
    ],
)
def test_a_small_file_takes_little_memory(array: dict[str, Any], tmp_path: Path) -> None:
    case = cases()["validation"]
    design = ("content", "Validation", "designs", "mapping", 0, 1, "DesignValidation", "per_run", "VirtualFits")
    changed(case, tmp_path, put(*design, "failure", value=array))
    tracemalloc.start()
    with pytest.raises(ValueError, match="expected"):
        case.load(tmp_path)
    assert tracemalloc.get_traced_memory()[1] < 1e8
    tracemalloc.stop()


@pytest.mark.parametrize("name", NAMES)
def test_what_was_read_is_written_as_it_was(name: str, tmp_path: Path) -> None:
    case = cases()[name]
    if case.result is None:
        pytest.skip("a campaign writes its file as it goes on")
    case.save(tmp_path)
    first, loaded = json.loads((tmp_path / case.name).read_text()), case.load(tmp_path)
    for result in (loaded, case.result):
        check_declared(result)
    again = tmp_path / "again"
    loaded.save(again / case.name if case.name == "saved.json" else again)
    second = json.loads((again / case.name).read_text())
    if name.startswith("validation"):  # its figures are taken anew
        return
    assert second == first


def test_a_declaration_says_what_is_wrong() -> None:
    evaluation = fp.evaluate(problem(), problem().region.draw(problem().model, 4))
    check_declared(evaluation)
    object.__setattr__(evaluation, "fisher", np.zeros((2, 3)))
    with pytest.raises(ValueError, match=r"fisher: expected 2 along axis 1, given shape \(2, 3\)"):
        check_declared(evaluation)
    object.__setattr__(evaluation, "fisher", np.zeros((2, 2), dtype=int))
    with pytest.raises(ValueError, match=r"fisher: expected an array of float64"):
        check_declared(evaluation)
