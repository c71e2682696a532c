"""Progress: a function that is called, a bar, or nothing."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from io import StringIO
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp

pytest.importorskip("rich", reason="needs the extras")

from rich.console import Console

MODEL = fp.SymbolicModel(["-k*h + u"], ["h"], {"h": "m"}, {"u": "m/s"}, {"k": "1/s"}, {"y": "m"})
THETA = {"k": 0.5}


def problem(**changes: Any) -> fp.DesignProblem:
    prior = fp.GaussianPrior(THETA, relative_std={"k": 0.1})
    region = fp.ExperimentRegion({"h": (0.5, 1.0), "u": (0.0, 0.1), "dt": (0.1, 5.0)})
    return fp.DesignProblem(MODEL, prior, region, noise={"y": 0.01}).replace(**changes)


@cache
def points() -> fp.Experiments:
    return fp.Experiments([[1.0], [0.8], [0.5]], [[0.0], [0.1], [0.05]], [1.0, 2.0, 3.0])


@cache
def data() -> fp.Measurements:
    return fp.VirtualRig(MODEL, THETA, {"y": 0.01}).measure(points())


def candidates() -> fp.Experiments:
    return fp.Experiments.join([points(), fp.Experiments([[0.9], [0.7], [0.6]], [[0.0], [0.1], [0.1]], [2.0, 4.0, 1.5])])


def runs_problem() -> fp.DesignProblem:
    return problem(region=fp.RunRegion({"h": 1.0, "u": (0.0, 0.1), "dt": 1.0}, segments=3))


@cache
def log() -> fp.Pieces:
    n = np.arange(40.0)
    return fp.pieces(fp.Record(0.5 * n, 0.1 + 0.2 * np.sin(n) ** 2, 1.0 + 0.1 * np.cos(n)), MODEL, length=5)


@cache
def fit() -> fp.Fit:
    return fp.estimate(MODEL, data(), problem().prior)


def campaign() -> fp.Campaign:
    return fp.Campaign(problem(), batch=2, n_candidates=5, max_iterations=2)


SEARCH = {"n_candidates": 5, "max_iterations": 2}
WORKS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "exchange": (lambda progress: fp.exchange(problem(), 2, **SEARCH, progress=progress), "iteration"),
    "design_runs": (lambda progress: fp.design_runs(runs_problem(), n_starts=2, n_candidates=5, progress=progress), "start"),
    "sweep": (lambda progress: fp.sweep(problem(), [2, 3], **SEARCH, progress=progress), "sizes"),
    "validate": (lambda progress: fp.validate(problem(), points(), runs=30, progress=progress), "virtual experiments"),
    "estimate": (lambda progress: fp.estimate(MODEL, data(), problem().prior, progress=progress), "estimating"),
    "estimate the noise": (lambda progress: fp.estimate(MODEL, data(), start=THETA, progress=progress), "estimating"),
    "approximate": (
        lambda progress: fp.approximate_design(problem(), n_candidates=50, starts=20, progress=progress),
        "approximate",
    ),
    "approximate among points": (lambda progress: fp.approximate_design(problem(), points(), progress=progress), "approximate"),
    "exact": (lambda progress: fp.exact_design(problem(), candidates(), 7, goal="A", progress=progress), "nodes"),
    "compare": (lambda progress: fp.compare(problem(), [points(), points()], draws=20, progress=progress), "comparing designs"),
    "Fit.profile": (lambda progress: fit().profile("k", progress=progress), "profile of k"),
    "design_pieces": (lambda progress: fp.design_pieces(problem(), log(), 2, progress=progress), "picking pieces"),
    "Campaign.next": (lambda progress: campaign().next(progress=progress), "iteration"),
    "Campaign.tell": (lambda progress: campaign().tell(data(), progress=progress), "estimating"),
}


def shown(monkeypatch: pytest.MonkeyPatch, work: Callable[[], Any]) -> list[str]:
    """The lines that a terminal of 80 columns is sent."""
    written = StringIO()
    monkeypatch.setattr("rich.console.Console", lambda **_: Console(file=written, force_terminal=True, width=80))
    work()
    return re.split(r"[\r\n]", re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", written.getvalue()))


@pytest.mark.parametrize("name", WORKS)
def test_true_shows_a_bar_of_80_columns(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    work, what = WORKS[name]
    lines = [line for line in shown(monkeypatch, lambda: work(True)) if what in line]
    assert lines and max(map(len, lines)) <= 80 and "0:00:0" in lines[-1]


@pytest.mark.long
@pytest.mark.parametrize("name", WORKS)
def test_nothing_is_shown_otherwise(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    work, _ = WORKS[name]
    assert shown(monkeypatch, lambda: (work(False), work(None))) == [""]
    monkeypatch.undo()
    work(True)  # where nothing is a terminal
    heard = capsys.readouterr()
    assert (heard.out, heard.err) == ("", "")


@pytest.mark.parametrize("name", WORKS)
def test_a_function_is_called_with_the_same_of_every_work(name: str) -> None:
    heard: list[fp.Progress] = []
    WORKS[name][0](heard.append)
    assert heard and all(type(now) is fp.Progress and isinstance(now.message, str) and now.seconds >= 0 for now in heard)
    assert len({now.total for now in heard}) == 1 and all(0 <= now.step <= (now.total or now.step) for now in heard)


def test_an_estimate_counts_its_evaluations() -> None:
    heard: list[fp.Progress] = []
    fit = fp.estimate(MODEL, data(), problem().prior, progress=heard.append)
    evaluations = [now.step for now in heard]
    assert evaluations == sorted(evaluations) and evaluations[-1] >= fit.evaluations
    assert heard[0].message.endswith(" starts") and (np.diff([now.seconds for now in heard]) >= 0).all()
    count = len(heard)
    fit.profile("k")
    assert len(heard) == count  # it is not heard of what comes later
    assert fit.estimate == fp.estimate(MODEL, data(), problem().prior).estimate


def test_a_comparison_names_the_design_that_it_is_at() -> None:
    heard: list[fp.Progress] = []
    fp.compare(problem(), {"one": points(), "other": points()}, draws=20, progress=heard.append)
    assert [(now.step, now.total, now.message) for now in heard] == [(0, 2, "one"), (1, 2, "other"), (2, 2, "")]


def test_a_profile_counts_its_values() -> None:
    heard: list[fp.Progress] = []
    profile = fit().profile("k", progress=heard.append)
    values = [now.step for now in heard]
    assert values == sorted(set(values)) and values[-1] >= len(profile.values) - 1  # not at the estimate itself
    assert profile.interval == fit().profile("k").interval
    drawn: list[fp.Progress] = []
    fit().plot("profiles", progress=drawn.append)
    assert (np.diff([now.step for now in drawn]) < 0).sum() == len(fit().parameters) - 1  # each begins anew


def test_pieces_count_their_exchanges() -> None:
    heard: list[fp.Progress] = []
    found = fp.design_pieces(problem(), log(), 2, progress=heard.append)
    assert [now.step for now in heard] == list(range(found.exchanges + 1))
    assert heard[-1].value == pytest.approx(found.log_det - found.bound, abs=1e-6)


def test_an_approximate_design_says_what_it_does() -> None:
    heard: list[fp.Progress] = []
    found = fp.approximate_design(problem(), n_candidates=50, starts=20, progress=heard.append)
    assert {now.message.split(",")[0] for now in heard} == {"searching", "weighing"} and all(now.step > 0 for now in heard)
    assert found.value == fp.approximate_design(problem(), n_candidates=50, starts=20).value


def test_a_notebook_without_widgets_has_a_line_of_text(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("rich.console.Console", lambda **_: Console(force_jupyter=True))
    monkeypatch.setattr("fisherpoint.show.progress.find_spec", lambda name: None)
    design = fp.exchange(problem(), 2, **SEARCH, progress=True)
    assert design.points == fp.exchange(problem(), 2, **SEARCH).points
    heard = capsys.readouterr()
    assert heard.out == "" and heard.err.startswith("\riteration ") and heard.err.endswith(" \r")


class Broken(StringIO):
    """A stream that is gone."""

    def write(self, _: str) -> int:
        raise BrokenPipeError


@pytest.mark.long
@pytest.mark.parametrize("name", WORKS)
@pytest.mark.parametrize("where", ["start", "update", "stop", "stream", "no console"])
def test_a_bar_that_fails_ends_no_work(name: str, where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise RuntimeError("of the display")

    terminal = {"force_terminal": True, "force_jupyter": False}
    if where == "stream":
        monkeypatch.setattr("rich.console.Console", lambda **_: Console(file=Broken(), **terminal))
    elif where == "no console":
        monkeypatch.setattr("rich.console.Console", fail)
    else:
        monkeypatch.setattr("rich.console.Console", lambda **_: Console(file=StringIO(), **terminal))
        monkeypatch.setattr(f"rich.progress.Progress.{where}", fail)
    work, _ = WORKS[name]
    assert work(True) is not None


def test_what_a_function_raises_is_passed_on() -> None:
    def fail(_: Any) -> None:
        raise ZeroDivisionError("of the user")

    with pytest.raises(ZeroDivisionError, match="of the user"):
        fp.exchange(problem(), 2, **SEARCH, progress=fail)


@pytest.mark.parametrize("name", WORKS)
@pytest.mark.parametrize("wrong", [1, "yes", 0.5])
def test_misuse_raises(name: str, wrong: Any) -> None:
    given = type(wrong).__name__
    with pytest.raises(TypeError, match=f"progress: expected True, False or a function, given {given}"):
        WORKS[name][0](wrong)
