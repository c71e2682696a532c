"""Everything that a user is handed shows itself in a notebook, and by names where there are numbers for them."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp

pytest.importorskip("sympy", reason="needs the extras")
pytest.importorskip("matplotlib", reason="needs the extras")

MODEL = fp.SymbolicModel(["-k*h + u"], ["h"], {"h": "m"}, {"u": "m/s"}, {"k": "1/s"}, {"y": "m"})
JUMPS = fp.SymbolicModel(["-k*heaviside(h - 1)*h - k"], ["h"], {"h": "m"}, {}, {"k": "m/s"}, {"y": "m"}, check_units=False)
THETA = {"k": 0.5}


def test_a_report_shows_itself() -> None:
    report = fp.exchange(problem(), 2, n_candidates=5, max_iterations=2).report()
    assert str(report).startswith(report.headline) and "\n" in str(report) and "Section(" not in str(report)
    assert repr(report) == f"<Report: {report.headline}>" and report.headline in report._repr_html_()


def test_a_picture_shows_itself_where_a_notebook_knows_nothing_of_figures() -> None:
    picture = fp.exchange(problem(), 2, n_candidates=5, max_iterations=2).plot("standard_errors")
    assert picture._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]


@cache
def points(count: int = 12) -> fp.Experiments:
    return fp.Experiments(np.linspace(0.5, 1.0, count)[:, None], np.full((count, 1), 0.1), np.full(count, 2.0), columns=("h", "u"))


@cache
def runs() -> fp.Runs:
    return fp.Runs([[1.0], [0.5]], [[0.0, 0.1], [0.1, 0.0]], [1.0, 2.0], [False, True])


@cache
def problem() -> fp.DesignProblem:
    prior = fp.GaussianPrior(THETA, relative_std={"k": 0.1})
    region = fp.ExperimentRegion({"h": (0.5, 1.0), "u": (0.0, 0.1), "dt": (0.1, 5.0)})
    return fp.DesignProblem(MODEL, prior, region, noise={"y": 0.01})


@cache
def rig() -> fp.VirtualRig:
    return fp.VirtualRig(MODEL, THETA, {"y": 0.01})


@cache
def fit() -> fp.Fit:
    return fp.estimate(MODEL, rig().measure(points()), noise={"y": 0.01}, start=THETA)


SHOWN: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "simulate": (lambda: fp.simulate(MODEL, points(), THETA), ("12 points", "12 ok", "x[0]", "y[0]", "status", "and 2 more")),
    "sensitivities": (lambda: fp.sensitivities(MODEL, points(), THETA), ("by 1 parameter", "12 ok", "status")),
    "simulate runs": (lambda: fp.simulate(MODEL, runs(), THETA), ("2 runs", "2 ok", "completed segments", "segment")),
    "sensitivities of runs": (lambda: fp.sensitivities(MODEL, runs(), THETA), ("2 runs", "by 1 parameter", "status")),
    "points": (points, ("12 points", "<th>u</th>", "<th>dt</th>", "and 2 more")),
    "points without names": (lambda: fp.Experiments([[1.0]], [[0.0]], [1.0]), ("x0[0]", "u[0]")),
    "runs": (runs, ("Starts", "Segments", "measured", "yes")),
    "measurements": (lambda: rig().measure(points()), ("12 points", "<th>h</th>", "y[0]")),
    "measured runs": (lambda: rig().measure(runs()), ("2 runs", "segment", "<th>t</th>", "y[0]")),
    "record": (lambda: fp.Record([0.0, 1.0], [0.0, 0.1], [1.0, np.nan]), ("2 samples", "<th>t</th>", "u[0]", "<td>-</td>")),
    "stability": (lambda: fit().stability(), ("Estimates of parts of the data", "first half", "chi-square", "Parts")),
    "profile": (
        lambda: fit().profile("k"),
        ("k [1/s] = 0.", "95 % interval", "by profile likelihood", "by standard error", "converged"),
    ),
    "validation of a design": (
        lambda: fp.validate(problem(), points(), runs=30).designs["design"],
        ("12 points, 30 fits", "<th>k</th>", "coverage", "ratio"),
    ),
    "criterion": (lambda: fp.criterion(problem(), "A"), ("Criterion A", "sum of the variances")),
    "problem": (problem, ("Design problem for", "parameters to estimate", "h [m]", "Prior", "Region", "5")),
}


@pytest.mark.parametrize("name", SHOWN)
def test_it_shows_itself(name: str) -> None:
    make, says = SHOWN[name]
    html = make()._repr_html_()
    for part in says:
        assert part in re.sub(r' style="[^"]*"', "", html), html
    assert html.count("<table>") == html.count("</table>") >= 1
    assert html.count("<tr>") <= 30


def test_statuses_are_named() -> None:
    start = fp.Experiments([[1.5], [0.5], [3.0]], np.empty((3, 0)), [1.0, 0.1, 2.0])
    found = fp.simulate(JUMPS, start, {"k": 1.0}, jumps="exclude")
    assert repr(found) == "Trajectories(3 points, 1 state, 1 output; status: 1 ok, 2 met_jump)"
    assert "met_jump" in found._repr_html_()
    assert (
        repr(fp.sensitivities(MODEL, points(2), THETA)) == "Sensitivities(2 points, 1 state, 1 output by 1 parameter; status: 2 ok)"
    )
    assert repr(fp.simulate(MODEL, runs(), THETA)) == "Trajectories(2 runs, 1 state, 1 output; status: 2 ok)"


def test_other_results_name_their_statuses_too() -> None:
    rule = fp.predictive_covariance(MODEL, points(2), problem().prior, fp.Unscented())
    assert repr(rule) == "PredictiveCovariance(2 points, 1 output; status: 2 ok)"
    record = fp.simulate_record(MODEL, np.arange(20.0), np.zeros(20), THETA, [1.0])
    assert repr(record) == "RecordTrajectory(20 samples, 1 state, 1 output; status: ok, 19 reached)"
    assert "and 10 more" in record._repr_html_()


def test_trajectories_are_tuples_still() -> None:
    found = fp.simulate(MODEL, points(), THETA)
    x, y, status, reached = found
    assert x is found.x and y is found.y and status is found.status and reached.tolist() == [1] * len(points())
    assert repr(pickle.loads(pickle.dumps(found))) == repr(found)


def test_a_criterion_tells_what_it_is() -> None:
    assert repr(fp.criterion(problem(), fp.Goal("c", of="k"))) == "<Criterion c: the variance of one function of the parameters>"


RECORD = fp.Record(np.arange(40.0), 0.1 * np.sin(np.arange(40.0)) ** 2, 0.5 + 0.1 * np.cos(np.arange(40.0)))
JUMPING = fp.DesignProblem(
    JUMPS,
    fp.GaussianPrior({"k": 1.0}, relative_std={"k": 0.3}),
    fp.ExperimentRegion({"h": (0.1, 3.0), "dt": (0.01, 1.0)}),
    noise={"y": 0.01},
    jumps="exclude",
)
DRAWN: dict[str, Callable[[], Any]] = {
    "windows": lambda: fp.design_pieces(problem(), fp.pieces(RECORD, MODEL, length=5), 4),
    "feasibility": lambda: fp.feasibility(
        JUMPING, fp.Experiments([[1.5], [0.9], [2.0]], np.empty((3, 0)), [0.3, 0.1, 0.4]), draws=200
    ),
    "all can run it": lambda: fp.feasibility(problem(), points(), draws=50),
    "identifiability": lambda: fp.identifiability(MODEL, problem().prior, problem().region),
    "rules": lambda: fp.compare_rules(problem(), points(3), [fp.LinearizedRule(), fp.Unscented(), fp.SparseGaussHermite(2)]),
}


@pytest.mark.parametrize("name", DRAWN)
def test_it_has_a_picture(name: str, tmp_path: Path) -> None:
    found = DRAWN[name]()
    figure = found.plot(path=tmp_path / name)
    assert (tmp_path / f"{name}.png").stat().st_size > 5000
    assert all(axes.has_data() for axes in figure.axes) or name == "all can run it"
    found.to_html(tmp_path / "page.html")
    assert ("<figure>" in (tmp_path / "page.html").read_text()) == (name != "all can run it")


def test_the_picture_of_feasibility_is_that_of_its_numbers() -> None:
    found = DRAWN["feasibility"]()
    (axes,) = found.plot().axes
    heights = np.sum([[bar.get_height() for bar in bars] for bars in axes.containers], axis=0)
    assert 0 < found.share < 1 and heights == pytest.approx(1 - found.shares)
