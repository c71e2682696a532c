"""Every result shows itself everywhere in one way, is a table where it is one, pickles, and comes back from its file."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp

pd = pytest.importorskip("pandas")
sympy = pytest.importorskip("sympy")

MODEL = fp.SymbolicModel(
    ["-k * x + b * u"], ["x"], {"x": "m"}, {"u": "V"}, {"k": "1/s", "b": "m/(s V)"}, {"x": "m"}, name="decay_of_level"
)
PRIOR = fp.GaussianPrior({"k": 1.0, "b": 0.5}, {"k": 0.2, "b": 0.1})
REGION = fp.ExperimentRegion({"x": (0.0, 2.0), "u": (0.0, 1.0), "dt": (0.1, 2.0)})
PROBLEM = fp.DesignProblem(MODEL, PRIOR, REGION, noise={"x": 0.01})
RECORD = fp.Record(np.arange(40.0), np.sin(np.arange(40.0)) ** 2, 0.5 + 0.4 * np.cos(np.arange(40.0)))


@pytest.fixture(scope="module")
def results() -> dict[str, Any]:
    design = fp.exchange(PROBLEM, n_experiments=4, max_iterations=5)
    data = fp.VirtualRig(MODEL, PRIOR.mean, {"x": 0.01}, seed=3).measure(design.points)
    campaign = fp.Campaign(PROBLEM, batch=3, targets=0.05, max_iterations=3)
    campaign.tell(fp.VirtualRig(MODEL, PRIOR.mean, {"x": 0.01}, seed=4).measure(campaign.next()))
    return {
        "Design": design,
        "Evaluation": design.evaluation,
        "Fit": fp.estimate(MODEL, data, prior=PRIOR, noise={"x": 0.01}),
        "Validation": fp.validate(PROBLEM, {"four": design.points}, runs=20),
        "Campaign": campaign,
        "Identifiability": fp.identifiability(MODEL, PRIOR, REGION),
        "ApproximateDesign": fp.approximate_design(PROBLEM, n_candidates=200, starts=50),
        "ExactDesign": fp.exact_design(PROBLEM, design.points, 5),
        "PieceDesign": fp.design_pieces(PROBLEM, fp.pieces(RECORD, MODEL, length=5), 4),
        "DesignComparison": fp.compare(PROBLEM, {"four": design, "two": design.points[:2]}, draws=50),
        "Sweep": fp.sweep(PROBLEM, range(2, 5), n_candidates=5, max_iterations=8, cost=fp.Cost(per_experiment=1.0)),
        "RuleComparison": fp.compare_rules(PROBLEM, design.points, [fp.LinearizedRule(), fp.SparseGaussHermite(2)]),
    }


MORE = ("ApproximateDesign", "ExactDesign", "PieceDesign", "DesignComparison", "Sweep", "RuleComparison")
KINDS = ("Design", "Evaluation", "Fit", "Validation", "Campaign", "Identifiability", *MORE)
TABLES = ("Design", "Evaluation", "Fit", "Validation", "Campaign", *MORE)


def same(a: Any, b: Any) -> None:
    assert type(a) is type(b) and str(a) == str(b)


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_shows_itself(kind: str, results: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    result = results[kind]
    report, text, html, markdown = result.report(), str(result), result._repr_html_(), result.to_markdown()
    assert text.splitlines()[0] == report.headline and len(repr(result)) < 200
    for section in report.sections:
        for shown in (text, html.replace("&#x27;", "'").replace("&quot;", '"').replace("&gt;", ">").replace("&lt;", "<")):
            assert all(cell in shown for row in section.rows for cell in row) and all(note in shown for note in section.notes)
    for tag in ("p", "table", "tr", "td", "th", "caption"):
        assert html.count(f"<{tag}>") + html.count(f"<{tag} ") == html.count(f"</{tag}>")
    assert markdown.count("\n| :--") + markdown.count("\n| --:") == sum(bool(s.columns or s.rows) for s in report.sections)
    result.print()
    printed = capsys.readouterr().out
    assert report.headline.split()[0] in printed and all(name in printed for name in getattr(result, "parameters", ()))


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_pickles(kind: str, results: dict[str, Any]) -> None:
    same(pickle.loads(pickle.dumps(results[kind])), results[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_comes_back_from_its_file(kind: str, results: dict[str, Any], tmp_path: Path) -> None:
    result, path = pickle.loads(pickle.dumps(results[kind])), tmp_path / "kept"
    result.save(path)
    same(type(result).load(path), result)


@pytest.mark.parametrize(
    "kind", ["Evaluation", "Validation", "Identifiability", "PieceDesign", "DesignComparison", "Sweep", "RuleComparison"]
)
def test_a_file_of_a_result_is_as_it_was_written_or_refused(kind: str, results: dict[str, Any], tmp_path: Path) -> None:
    result, path = results[kind], tmp_path / "kept.json"
    result.save(path)
    written = path.read_bytes()
    again = tmp_path / "again.json"
    type(result).load(path).save(again)
    assert again.read_bytes() == written
    changed: list[Callable[[bytes], bytes]] = [
        lambda text: text[: len(text) // 2],
        lambda text: text.replace(b"0.", b"1.", 1),
        lambda text: text.replace(kind.encode(), b"Fit", 1),
        lambda text: b"[]",
    ]
    for change in changed:
        path.write_bytes(change(written))
        with pytest.raises(ValueError, match="expected"):
            type(result).load(path)


@pytest.mark.parametrize("kind", TABLES)
def test_a_result_is_a_table(kind: str, results: dict[str, Any]) -> None:
    frame = results[kind].to_pandas()
    assert (
        isinstance(frame, pd.DataFrame)
        and len(frame) >= 2
        and frame.index.names[-1] in ("parameter", "point", "rule", "window", "n_experiments")
    )
    assert frame.select_dtypes("number").notna().all(axis=None)


PICTURES = {
    "Design": ("points", "criterion", "standard_errors", "correlation", "trajectories"),
    "Evaluation": ("standard_errors", "correlation"),
    "Fit": ("parity", "residuals", "time", "autocorrelation", "correlation", "ellipses", "profiles"),
    "Validation": (),
    "Campaign": (),
    "DesignComparison": (),
    "Sweep": (),
}


@pytest.mark.parametrize("kind", PICTURES)
def test_a_result_draws_itself(kind: str, results: dict[str, Any], tmp_path: Path) -> None:
    figures = pytest.importorskip("matplotlib.figure")
    result, path = results[kind], tmp_path / "picture.png"
    for of in [(), *((one,) for one in PICTURES[kind])]:
        assert isinstance(result.plot(*of), figures.Figure) and not path.exists()
        assert isinstance(result.plot(*of, path=path), figures.Figure)
        assert path.read_bytes().startswith(b"\x89PNG")
        path.unlink()
    if PICTURES[kind]:
        with pytest.raises(ValueError, match=r"^kind: expected '.*' or '.*', given 'pie'"):
            result.plot("pie")


def test_what_cannot_be_drawn_is_told(results: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    with pytest.raises(ValueError, match="path: expected the ending of a picture"):
        results["Design"].plot(path=tmp_path / "points.txt")
    results["Fit"].profile("k").plot(path=tmp_path / "k")
    assert (tmp_path / "k.png").exists()
    static = fp.SymbolicModel([], ["a*u"], {}, {"u": "1"}, {"a": "1"}, {"y": "1"})
    prior, region = fp.GaussianPrior({"a": 1.0}, {"a": 0.1}), fp.ExperimentRegion({"u": (1.0, 2.0)})
    design = fp.exchange(fp.DesignProblem(static, prior, region), 2, max_iterations=2, method=fp.ExchangeMethod(references=False))
    with pytest.raises(ValueError, match="kind: expected a model with states for 'trajectories'"):
        design.plot("trajectories")
    with pytest.raises(ValueError, match="noise: expected the sensor noise"):
        design.plot("standard_errors")


def test_a_campaign_is_saved_only_once(results: dict[str, Any], tmp_path: Path) -> None:
    campaign = pickle.loads(pickle.dumps(results["Campaign"]))
    campaign.save(tmp_path / "one")
    with pytest.raises(ValueError, match="without one, given one that is saved in"):
        campaign.save(tmp_path / "two")
