"""The page of a result: all of its report, nothing from elsewhere, nobody's text as markup."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.show.page import to_page
from fisherpoint.show.page_pictures import for_page
from fisherpoint.show.section import Report, Section
from fisherpoint.show.style import show_each_under_mouse, show_under_mouse
from page_cases import HOSTILE, PICTURES, Page, problem, results

pytest.importorskip("matplotlib")


def shown(report: Report) -> Iterator[str]:
    yield from report.lines or [report.headline]
    yield from report.warnings
    for section in report.sections:
        yield section.title
        yield from section.notes


@pytest.mark.long
@pytest.mark.parametrize("kind", PICTURES)
def test_a_page_has_all_of_the_report_and_nothing_from_elsewhere(kind: str, tmp_path: Path) -> None:
    result = results()[kind]
    result.to_html(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert len(text.encode()) < 2_000_000
    page = Page(text)
    for sentence in shown(result.report()):
        assert sentence in page.within("body")
    for section in (section for section in result.report().sections if section.rows):
        wanted = [list(row) for row in ([section.columns, *section.rows] if section.columns else section.rows)]
        assert wanted in page.tables
    for address in page.addresses:
        assert address.startswith(("data:image/png;base64,", "data:image/svg+xml;base64,", "#")), address[:60]
    assert not re.search(r"@import|url\((?!#)", page.within("style"))
    assert re.findall(r"<figcaption>(.*?)</figcaption>", text) == PICTURES[kind]
    result.to_html(tmp_path / "plain.html", pictures=False)
    plain = Page((tmp_path / "plain.html").read_text(encoding="utf-8"))
    assert not plain.addresses and plain.tables == page.tables
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["plain.html", "report.html"]


def test_a_page_says_what_was_asked_and_with_which_versions(tmp_path: Path) -> None:
    results()["Design"].to_html(tmp_path / "report.html", pictures=False)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    asked = page.within("details")
    for part in ("Problem and settings", "sensor noise", "Prior", "Region", "candidates of a draw", "LinearizedRule"):
        assert part in asked
    assert ["E_oil", "Pa", "1.2e9", "2.4e8", "normal"] in [row for table in page.tables for row in table]
    assert ["v", "m/s", "-0.25", "0.25"] in [row for table in page.tables for row in table]
    assert f"numpy {np.__version__}" in page.within("footer")


def test_what_was_asked_is_said_in_words_and_what_goes_without_saying_is_not() -> None:
    from fisherpoint.design.results.settings_section import settings_section

    rows = dict(settings_section(results()["Design"].settings).rows)
    assert rows == {"points": "12", "candidates of a draw": "5", "iterations, at most": "4", "seed": "0"}
    assert dict(settings_section(results()["RunDesign"].settings).rows)["random runs to begin with"] == "20"


def test_the_page_of_a_validation_says_first_whether_promises_hold(tmp_path: Path) -> None:
    results()["Validation"].to_html(tmp_path / "report.html", pictures=False)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert page.within("h1") == "Validation of hydraulic_cylinder: 1 design, 20 virtual experiments"
    report = results()["Validation"].report()
    assert report.headline == report.lines[0] == page.within("p").partition("20 virtual experiments each")[0]
    (table,) = (table for table in page.tables if "coverage" in table[0])
    assert table[0][:2] == ["parameter", "promise"]


def test_misuse_is_told(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="path: expected"):
        results()["Feasibility"].to_html(3)
    with pytest.raises(TypeError, match="pictures: expected"):
        results()["Feasibility"].to_html(tmp_path / "report.html", pictures="none")
    assert not list(tmp_path.iterdir())


def test_the_page_of_a_campaign_has_the_next_batch(tmp_path: Path) -> None:
    results()["Campaign"].to_html(tmp_path / "report.html", pictures=False)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "Next batch" in page.within("h2")
    assert any(len(table) == 7 and table[0][:2] == ["#", "q [m]"] for table in page.tables)


def test_tables_of_many_points_are_whole_in_a_page(tmp_path: Path) -> None:
    design = fp.exchange(problem(), n_experiments=60, n_candidates=2, max_iterations=1, method=fp.ExchangeMethod(references=False))
    design.to_html(tmp_path / "report.html", pictures=False)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert any(len(table) == 61 for table in page.tables) and "... and 20 more" in str(design)


def test_nobodys_text_is_taken_for_markup(tmp_path: Path) -> None:
    section = Section(HOSTILE, (HOSTILE, "value"), [(HOSTILE, "1"), ("\x1b[31m</table>", "2")], marked=[1], notes=[HOSTILE])
    report = Report(HOSTILE, [section], [HOSTILE])
    text = to_page(report, problem=[section], command=f"fisherpoint design {HOSTILE}", sources={HOSTILE: f"a\n{HOSTILE}\n</pre>"})
    page = Page(text)
    assert text.count("<script>") == text.count("</script>") == 1 and "\x1b" not in text
    for tag in ("title", "h1", "h2", "h3", "pre", "summary", "p"):
        assert HOSTILE in page.within(tag), tag
    assert page.tables[0] == page.tables[1] == [[HOSTILE, "value"], [HOSTILE, "1"], [r"\x1b[31m</table>", "2"]]
    assert "marked" in page.classes


def test_curves_tell_their_names() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.subplots()
    show_under_mouse(axes.plot([0, 1], [1, 2]), HOSTILE, "one")
    axes.set_title(HOSTILE)
    picture = for_page("a_picture", figure)
    page = Page(picture.markup)
    assert picture.title == "A picture" and page.open == []
    assert HOSTILE in [text for path, text in page.texts if path[-1] == "title"]
    assert "hover" in page.classes and "<script" not in picture.markup
    assert "<style" not in picture.markup


def test_dots_tell_their_own_texts() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    show_each_under_mouse(figure.subplots().plot([0, 1, 2], [1, 2, 0], "o")[0], ["first", HOSTILE, "last"], "dots")
    page = Page(for_page("a_picture", figure).markup)
    assert [text for path, text in page.texts if path[-2:] == ("use", "title")] == ["first", HOSTILE, "last"]


def test_a_picture_is_embedded_in_the_smaller_format() -> None:
    from matplotlib.figure import Figure

    random = np.random.default_rng(0)
    few, many = Figure(), Figure()
    few.subplots().plot([0, 1])
    many.subplots().scatter(*random.normal(size=(2, 20000)), s=1)
    assert 'src="data:image/svg+xml;base64,' in for_page("few", few).markup
    picture = for_page("many", many)
    assert 'src="data:image/png;base64,' in picture.markup and len(picture.markup) < 300_000


def test_outlined_texts_are_no_paths_of_a_page() -> None:
    from matplotlib.figure import Figure
    from matplotlib.patheffects import withStroke

    figure = Figure()
    text = figure.text(0.5, 0.5, "12")
    assert 'src="data:image/svg+xml;base64,' in for_page("a_picture", figure).markup
    text.set_path_effects([withStroke(linewidth=3, foreground="white")])
    assert 'src="data:image/png;base64,' in for_page("a_picture", figure).markup
