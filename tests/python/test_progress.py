"""Progress: a function that is told, a bar, or nothing; and what says that a work lives."""

from __future__ import annotations

import re
import sys
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
    return fp.DesignProblem(MODEL, prior, region, noise_std={"y": 0.01}).replace(**changes)


@cache
def points() -> fp.Experiments:
    return fp.Experiments([[1.0], [0.8], [0.5]], [[0.0], [0.1], [0.05]], [1.0, 2.0, 3.0])


@cache
def data() -> fp.Measurements:
    return fp.VirtualRig(MODEL, THETA, {"y": 0.01}).measure(points())


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
    "approximate": (lambda progress: fp.approximate(problem(), n_candidates=50, starts=20, progress=progress), "approximate"),
    "approximate among points": (lambda progress: fp.approximate(problem(), points(), progress=progress), "approximate"),
    "compare": (lambda progress: fp.compare(problem(), [points(), points()], draws=20, progress=progress), "comparing designs"),
    "Fit.profile": (lambda progress: fit().profile("k", progress=progress), "profile of k"),
    "best_pieces": (lambda progress: fp.best_pieces(problem(), log(), 2, progress=progress), "picking pieces"),
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


@pytest.mark.parametrize("name", WORKS)
def test_nothing_is_shown_otherwise(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    work, _ = WORKS[name]
    assert shown(monkeypatch, lambda: (work(False), work(None))) == [""]
    monkeypatch.undo()
    work(True)  # where nothing is a terminal
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", "")


@pytest.mark.parametrize("name", WORKS)
def test_a_function_is_told(name: str) -> None:
    told: list[tuple[Any, ...]] = []
    WORKS[name][0](lambda *now: told.append(now))
    assert told and all(now[-1].seconds >= 0 for now in told if hasattr(now[-1], "seconds"))


def test_an_estimate_counts_its_evaluations() -> None:
    told: list[fp.EstimateProgress] = []
    fit = fp.estimate(MODEL, data(), problem().prior, progress=told.append)
    evaluations = [now.evaluations for now in told]
    assert evaluations == sorted(evaluations) and evaluations[-1] >= fit.evaluations
    assert told[0].searches > 1 and (np.diff([now.seconds for now in told]) >= 0).all()
    count = len(told)
    fit.profile("k")
    assert len(told) == count  # it is not told of what comes later
    assert fit.estimate == fp.estimate(MODEL, data(), problem().prior).estimate


def test_a_comparison_tells_at_which_design_it_is() -> None:
    told: list[fp.CompareProgress] = []
    fp.compare(problem(), {"one": points(), "other": points()}, draws=20, progress=told.append)
    assert [now[:3] for now in told] == [(0, 2, "one"), (1, 2, "other"), (2, 2, "")]


def test_a_profile_counts_its_values() -> None:
    told: list[fp.ProfileProgress] = []
    profile = fit().profile("k", progress=told.append)
    values = [now.values for now in told]
    assert values == sorted(set(values)) and values[-1] >= len(profile.values) - 1  # not at the estimate itself
    assert profile.interval == fit().profile("k").interval
    drawn: list[fp.ProfileProgress] = []
    fit().plot("profiles", progress=drawn.append)
    assert (np.diff([now.values for now in drawn]) < 0).sum() == len(fit().parameters) - 1  # each begins anew


def test_pieces_tell_their_exchanges() -> None:
    told: list[fp.PieceProgress] = []
    found = fp.best_pieces(problem(), log(), 2, progress=told.append)
    assert [now.exchanges for now in told] == list(range(found.exchanges + 1))
    assert told[-1].gap == pytest.approx(found.bound - found.log_det, abs=1e-6)


def test_an_approximate_design_tells_what_it_does() -> None:
    told: list[fp.ApproximateProgress] = []
    found = fp.approximate(problem(), n_candidates=50, starts=20, progress=told.append)
    assert {now.doing for now in told} == {"searching", "weighing"} and all(now.candidates > 0 for now in told)
    assert found.value == fp.approximate(problem(), n_candidates=50, starts=20).value


def test_without_rich_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "rich"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rich", None)
    for work, _ in WORKS.values():
        with pytest.raises(ImportError, match="progress: expected the package rich, given none: pip install"):
            work(True)
        work(None)


def test_a_notebook_without_widgets_has_a_line_of_text(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("rich.console.Console", lambda **_: Console(force_jupyter=True))
    monkeypatch.setattr("fisherpoint.show.progress.find_spec", lambda name: None)
    design = fp.exchange(problem(), 2, **SEARCH, progress=True)
    assert design.points == fp.exchange(problem(), 2, **SEARCH).points
    told = capsys.readouterr()
    assert told.out == "" and told.err.startswith("\riteration ") and told.err.endswith(" \r")


class Broken(StringIO):
    """A stream that is gone."""

    def write(self, _: str) -> int:
        raise BrokenPipeError


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
def test_misuse_is_told(name: str, wrong: Any) -> None:
    given = type(wrong).__name__
    with pytest.raises(TypeError, match=f"progress: expected True, False or a function, given {given}"):
        WORKS[name][0](wrong)
