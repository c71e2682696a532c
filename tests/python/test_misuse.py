"""Clumsy and hostile values: each is refused in our words, or may be taken. ``tests/fuzz/fuzz_misuse.py`` tries many more."""

from __future__ import annotations

import sys
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.basics.messages import listed, printable, shortened, shown
from fisherpoint_command import cli
from misuse_cases import SWAPPED, cases
from misuse_examples import NOISE, THETA, data, model, points, prior, problem
from misuse_outcomes import Misuse, outcome
from misuse_values import CLUMSY, Rude

ESCAPE = "\x1b[31m\x9b1m"


def test_good_arguments_are_taken() -> None:
    """Or else the calls below would show nothing."""
    for name, case in cases().items():
        good = {key: value for key, (value, *_) in case.arguments.items()}
        assert outcome(lambda case=case, good=good: case.call(**good), True).kind == "taken", name  # type: ignore[misc]


def test_every_argument_refuses_what_it_cannot_be() -> None:
    random, misuse = Random(7), Misuse()
    for name, case in cases().items():
        for argument in case.arguments:
            for value in random.sample(list(CLUMSY), 2):
                misuse.try_one(name, argument, value)
    assert not misuse.faults, "\n".join(misuse.faults)
    assert misuse.counts["refused"] > 20 * misuse.counts["taken"]


@pytest.mark.parametrize("call", SWAPPED.values(), ids=SWAPPED)
def test_arguments_in_each_others_place(call: Callable[[], Any]) -> None:
    found = outcome(call, False)
    assert found.kind == "refused", found.text


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fp.simulate(model(), points(), THETA, rtol="1.0"), "rtol: expected numbers, given '1.0'"),
        (lambda: fp.simulate(model(), points(), THETA, rtol=True), "rtol: expected numbers, given True"),
        (lambda: fp.simulate(model(), points(), THETA, rtol=10**400), "rtol: expected numbers, given 10000"),
        (
            lambda: fp.simulate(model(), points(), THETA, threads=10**5000),
            "threads: expected a whole number of at most 4096, given",
        ),
        (lambda: fp.simulate(points(), model(), THETA), "model: expected Model, given Experiments"),
        (lambda: points()["a"], "points: expected an index, a slice, or a sequence of indices or flags, given 'a'"),
        (lambda: points()[1.5], "points: expected an index, a slice, or a sequence of indices or flags, given 1.5"),
        (lambda: points()[[True]], r"points: expected indices below 3, or as many flags; given \[True\]"),
        (lambda: points()[[0, 7]], r"points: expected indices below 3, or as many flags; given \[0, 7\]"),
        (lambda: points()[None], "points: expected an index"),
        (lambda: prior().marginal(["b"]), "names: expected names of k, a; given unknown 'b'"),
        (lambda: prior().marginal(["k", "k"]), "names: expected each name once, at least one, given k, k"),
        (lambda: prior().marginal("k"), "names: expected a sequence of names, given 'k'"),
        (lambda: fp.GaussianPrior({"k": 1.0}, covariance=[[1e-320]]), "covariance of 'k': expected a standard deviation between"),
        (lambda: fp.GaussianPrior({"k": 1.0}, covariance=[[1e305]]), "covariance of 'k': expected a standard deviation between"),
        (
            lambda: fp.GaussianPrior({"k": 1e-200}, relative_std={"k": 1e-200}),
            r"relative_std\['k'\] .*: expected a positive",
        ),
        (
            lambda: fp.GaussianPrior({"k": 1e-100}, std={"k": 1e100}, log=["k"]),
            "log: expected a standard deviation of 'k' of at most",
        ),
        (lambda: fp.exchange(problem(), n_experiments=True), "n_experiments: expected a whole number of at least 1, given True"),
        (lambda: fp.exchange(problem(), n_candidates=10**9), "n_candidates: expected a whole number of at most 1000000, given"),
        (lambda: fp.exchange(problem(), method=fp.ExchangeMethod(references=0)), "references: expected True or False, given 0"),
        (lambda: fp.Measurements(points(), [1 + 1j, 2, 3]), "y: expected numbers, given"),
        (lambda: fp.Measurements(points(), ["1", "2", "3"]), "y: expected numbers, given"),
        (lambda: fp.Measurements(points(), {1.0, 2.0, 3.0}), "y: expected numbers, given"),
        (lambda: fp.validate(problem(), {"one": points()}, use_prior="no"), "use_prior: expected True or False, given 'no'"),
        (
            lambda: fp.VirtualRig(model(), THETA, NOISE).measure(points(), repeats=10**9),
            "repeats: expected a whole number of at most",
        ),
        (lambda: fp.SymbolicModel({"-a", "-b"}, ["a"], {"a": "m", "b": "m"}, {}, {"k": "1"}), "f: expected equations in an order"),
        (lambda: fp.identifiability(model(), prior(), parameters=Rude()), "parameters: expected a sequence of names, given a Rude"),
    ],
)
def test_what_is_wrong_is_told(call: Callable[[], Any], message: str) -> None:
    with pytest.raises((ValueError, TypeError, IndexError), match=f"^{message}") as caught:
        call()
    assert str(caught.value).isprintable() and len(str(caught.value)) < 300


def test_numbers_of_other_kinds_are_numbers() -> None:
    expected = fp.simulate(model(), points(), {"k": 0.25, "a": 0.5}, rtol=0.0001).y
    for kind in (Fraction, Decimal, np.float32, np.float64):
        theta = {"k": kind(1) / kind(4), "a": kind(1) / kind(2)}
        assert np.array_equal(fp.simulate(model(), points(), theta, rtol=Fraction(1, 10_000)).y, expected)  # type: ignore[arg-type]
    hidden = np.ma.masked_array([0.1, 0.2, 0.3], [False, True, False])
    assert np.array_equal(fp.Measurements(points(), hidden).y, [[0.1], [np.nan], [0.3]], equal_nan=True)  # type: ignore[arg-type]
    assert np.array_equal(fp.Measurements(points(), [0.1, None, 0.3]).y, [[0.1], [np.nan], [0.3]], equal_nan=True)


def test_indices_of_every_kind_choose_the_same_points() -> None:
    for index in ([0, 2], (0, 2), np.array([0, 2]), slice(0, 3, 2), [True, False, True], np.array([-3, -1], dtype=np.int8)):
        assert points()[index] == fp.Experiments.join([points()[0], points()[2]])
        assert data()[:3][index].points == points()[index]
    assert len(points()[[]]) == len(points()[np.array([], dtype=int)]) == 0


def test_values_in_messages_are_cut_and_without_control_characters() -> None:
    assert printable("a b é \x1b[0m\r\x9b\u202e") == r"a b é \x1b[0m\r\x9b\u202e"
    assert shown("x" * 1000) == "'" + "x" * 56 + "..."
    assert shown("\x1b") == r"'\x1b'" and shown(Rude()) == "a Rude that cannot be shown"
    assert shown(np.arange(10**6)).startswith("array([ 0, 1, 2, ..., 999997, 999998, 999999]")
    assert len(shown(10**5000)) <= 60 and len(shown(dict.fromkeys(range(10**5)))) == 60
    assert listed(["a", "b"]) == "a, b" and listed([]) == "none" and shortened("ab", 5) == "ab"
    assert listed(f"n{k}" for k in range(10**6)).endswith(", n19 and 999,980 more")


FILES: dict[str, str] = {
    "name of a column": f"h,u,dt,{ESCAPE}\n1,1,1,1\n",
    "entry": f"h,u,dt\n{ESCAPE},1,1\n",
    "unit": f"h [{ESCAPE}],u,dt\n1,1,1\n",
    "many columns": ",".join(f"c{k}" for k in range(10**5)) + "\n" + ",".join("1" * 10**5) + "\n",
    "long name": "h,u,dt," + "x" * 10**5 + "\n1,1,1,1\n",
    "long entry": "h,u,dt\n" + "y" * 10**5 + ",1,1\n",
    "NUL": "h,u,dt\n1\0,1,1\n",
}


@pytest.mark.parametrize("read", [fp.Experiments.from_csv, fp.Measurements.from_table, fp.Record.from_table])
@pytest.mark.parametrize("text", FILES.values(), ids=FILES)
def test_a_hostile_table_is_refused_in_a_short_printable_line(read: Any, text: str, tmp_path: Path) -> None:
    path = tmp_path / f"{ESCAPE}.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match="expected") as caught:
        read(path, model())
    assert str(caught.value).isprintable() and len(str(caught.value)) < 1000


MODEL = """
[model]
name = "m"
[model.states]
{state} = "{unit}"
[model.parameters]
k = "1"
[model.outputs]
x = "m"
[model.equations]
x = "-k*x{more}"
"""
TABLES = {
    "key": '"\\u001b[31m" = 1\n[model]\nname = "hydraulic_cylinder"\n',
    "value": '[model]\nname = "\\u001b[31m\\u009b"\n',
    "unit": MODEL.format(state="x", unit="\\u001b[31m", more=""),
    "state": MODEL.format(state='"x\\u001b[31m"', unit="m", more=""),
    "equation": MODEL.format(state="x", unit="m", more="\\u001b"),
    "number": MODEL.format(state="x", unit="m", more=" + " + "1" * 5000),
    "text": "\x1b[31m",
    "digits": "[model]\nname = " + "1" * 5000,
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_a_hostile_model_file_is_refused_in_a_short_printable_line(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "model.toml"
    path.write_text(text)
    with pytest.raises(SystemExit) as caught:
        cli.main(["simulate", str(path), "points.csv"])
    told = capsys.readouterr()
    assert (caught.value.code, told.out) == (2, "")
    for line in told.err.removesuffix("\n").split("\n"):  # some of these files lack a prior besides
        assert line.startswith("fisherpoint: ") and line.isprintable() and len(line) < 1000


def test_a_description_does_not_reach_the_terminal_raw() -> None:
    told = fp.Quantity("c", "1", f"a concentration {ESCAPE}\nof something")
    assert r"c [1]: a concentration \x1b[31m\x9b1m of something" in str(fp.SymbolicModel(["-k*c"], ["c"], [told], {}, {"k": "1/s"}))


SMALL = (
    MODEL.format(state="x", unit="m", more=" + max(x - 5, 0)")
    + """
[prior]
k = { mean = 1.0, std = 0.1 }
[noise]
x = 0.01
[region]
x = [0.1, 1.0]
dt = [0.1, 1.0]
[design]
n_experiments = 2
n_candidates = 5
max_iterations = 2
"""
)


@pytest.mark.parametrize("terminal", [False, True])
def test_names_of_files_do_not_reach_the_terminal_raw(
    terminal: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run, model_file = tmp_path / ESCAPE, tmp_path / f"{ESCAPE}.toml"
    model_file.write_text(SMALL)

    def told(*arguments: object, code: int = 0) -> str:
        monkeypatch.setattr(sys.stdout, "isatty", lambda: terminal)
        with pytest.raises(SystemExit) as caught:
            cli.main([str(argument) for argument in arguments])
        text = "".join(capsys.readouterr())
        assert caught.value.code == code and ESCAPE not in text and "\x9b" not in text
        return text.replace("\n", "")

    shown_name = r"\x1b[31m\x9b1m"
    assert shown_name in told("design", model_file, "-o", run, "--no-plots")
    told("simulate", model_file, run / "design.csv", "-o", run / f"y{ESCAPE}.csv")
    assert shown_name in told("estimate", model_file, run / f"y{ESCAPE}.csv", "-o", run / ESCAPE, "--no-plots")
    (run / f"{ESCAPE}.csv").write_bytes((run / "design.csv").read_bytes())
    options = ("--runs", 20, "--no-plots", "--force")
    assert told("validate", model_file, run / f"{ESCAPE}.csv", "-o", run / ESCAPE, *options).count(shown_name) >= 2
    assert shown_name in told("campaign", model_file, "-o", run / f"campaign{ESCAPE}", "--no-plots")
    assert shown_name in told("design", run / f"none{ESCAPE}.toml", "-o", run, code=2)
