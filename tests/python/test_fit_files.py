"""A fit in files and pickles: all of it comes back."""

from __future__ import annotations

import csv
import json
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.files import sealed_json
from fisherpoint.basics.result_files import encoded
from fisherpoint.design.file.configuration import load_config
from fit_cases import EXAMPLES, decay
from saved_places import DELETE, edited


def test_files_hold_the_fit_and_are_whole(tmp_path: Path) -> None:
    model, data = decay()
    fit = fp.estimate(model, data, noise={"c": 0.2}, start=None)
    paths = fit.save(tmp_path / "new" / "directory")
    assert sorted(path.name for path in paths) == ["estimate.csv", "fit.json", "residuals.csv"]
    assert sorted(path.name for path in (tmp_path / "new" / "directory").iterdir()) == ["estimate.csv", "fit.json", "residuals.csv"]
    told = json.loads((tmp_path / "new" / "directory" / "fit.json").read_text())
    assert {name: told[name] for name in fit.to_dict()} == fit.to_dict()
    assert told["parameters"]["k"]["estimate"] == fit.estimate["k"]
    assert np.array(told["covariance"]) == pytest.approx(fit.covariance)
    with (tmp_path / "new" / "directory" / "estimate.csv").open() as file:
        rows = {row["parameter"]: row for row in csv.DictReader(file)}
    assert float(rows["c_0"]["standard_error"]) == fit.standard_errors["c_0"]
    assert rows["c_0"]["prior_mean"] == ""
    with (tmp_path / "new" / "directory" / "residuals.csv").open() as file:
        residuals = list(csv.DictReader(file))
    assert [float(row["residual"]) for row in residuals] == pytest.approx(fit.residuals[:, 0])
    assert float(residuals[3]["measured"]) - float(residuals[3]["predicted"]) == pytest.approx(float(residuals[3]["residual"]))


def tanks_fit() -> fp.Fit:
    """Of a record of which a start is not known, with a noise that is estimated."""
    model = load_config(EXAMPLES / "cascaded_tanks.toml").build_model()
    t, u = 4.0 * np.arange(60), 2.0 + np.where((np.arange(60) // 15) % 2, 1.0, -1.0)
    y = fp.simulate_record(model, t, u, dict(model.nominal), {"h1": 5.0, "h2": 4.0}).y
    y = y + np.random.default_rng(1).normal(0, 0.05, y.shape)
    y[7] = np.nan
    return fp.estimate(model, fp.Record(t, u, y, x0={"h1": 5.0}), parameters=["k1", "k3"])


def assert_same(again: fp.Fit, fit: fp.Fit) -> None:
    assert again.to_dict() == fit.to_dict()
    assert str(again) == str(fit) and again.model == fit.model
    for name in ("theta", "values", "residuals", "covariance", "information", "noise_covariance", "z", "whitened"):
        np.testing.assert_array_equal(getattr(again, name), getattr(fit, name), strict=True)
    name = fit.parameters[0]
    assert again.intervals(0.9) == fit.intervals(0.9) and again.profile(name).interval == fit.profile(name).interval


@pytest.mark.parametrize("kind", ["points", "bound", "prior", "record"])
def test_a_fit_comes_back_from_its_file_and_from_a_pickle(kind: str, tmp_path: Path) -> None:
    model, data = decay()
    log = fp.GaussianPrior({"c_0": 18.0, "k": 6e-4}, relative_std={"c_0": 0.3, "k": 0.3}, log=["k"])
    fit = {
        "points": lambda: fp.estimate(model, [data[:5], data[5:]], noise={"c": 0.2}),
        "bound": lambda: fp.estimate(model, data, bounds={"k": (None, 4e-4)}),
        "prior": lambda: fp.estimate(
            model, data, log, noise={"c": 0.2}, deviations=fp.Deviations(initial_state_std={"share": 0.01})
        ),
        "record": tanks_fit,
    }[kind]()
    fit.save(tmp_path)
    for again in (fp.Fit.load(tmp_path), pickle.loads(pickle.dumps(fit))):
        assert_same(again, fit)
    if kind == "prior":
        assert again.posterior() == fit.posterior()


def test_a_file_that_is_no_fit_is_told(tmp_path: Path) -> None:
    model, data = decay()
    fit = fp.estimate(model, data, noise={"c": 0.2})
    fit.save(tmp_path)
    path = tmp_path / "fit.json"
    text, whole = path.read_text(), json.loads(path.read_text())
    older = {name: value for name, value in whole.items() if name not in ("format", "format_version", "content")}
    del whole["sha256"]
    short, without = json.loads(json.dumps(whole)), json.loads(json.dumps(whole))
    edited(short, "values", encoded(np.ones(1)))
    edited(without, "data", DELETE)
    for broken, message in (
        (text[: len(text) // 2], "expected a whole JSON file"),
        (json.dumps(older), "expected a file of format 'fisherpoint FitState'"),
        (text.replace('"reached": 1', '"reached": 2'), "expected the file as it was written"),
        (json.dumps(short), "expected the file as it was written"),
        (sealed_json(short), "values: expected 2 along axis 0"),
        (sealed_json(without), "fit.json: data: expected an entry, given none"),
    ):
        path.write_text(broken)
        with pytest.raises(ValueError, match=re.escape(message)):
            fp.Fit.load(tmp_path)


def falling(x: Any, u: Any, theta: Any) -> Any:
    return np.stack([-theta[..., 0] * x[..., 0]], axis=-1)


def as_it_is(x: Any, u: Any, theta: Any) -> Any:
    return x


@pytest.mark.filterwarnings("ignore:CallableModel")
def test_a_fit_of_python_functions_is_pickled_and_not_loaded(tmp_path: Path) -> None:
    data = decay()[1]
    model = fp.CallableModel(falling, as_it_is, {"c": "1"}, {}, {"k": "1/s"}, {"c": "1"}, nominal={"k": 1e-3})
    fit = fp.estimate(model, fp.Measurements(data.points, data.y / 20), noise={"c": 0.02})
    fit.save(tmp_path)
    assert json.loads((tmp_path / "fit.json").read_text())["parameters"]["k"]["estimate"] == fit.estimate["k"]
    with pytest.raises(ValueError, match=r"expected a fit with its model, given one without: .*given CallableModel"):
        fp.Fit.load(tmp_path)
    assert pickle.loads(pickle.dumps(fit)).to_dict() == fit.to_dict()


def test_what_is_not_finite_is_null_in_the_file(tmp_path: Path) -> None:
    model, data = decay(n=1)
    fit = fp.estimate(model, data, noise={"c": 0.2})
    assert fit.to_dict()["parameters"]["k"]["standard_error"] is None
    fit.save(tmp_path)
    json.loads((tmp_path / "fit.json").read_text(), parse_constant=lambda name: pytest.fail(name))
