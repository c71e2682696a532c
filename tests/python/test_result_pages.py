"""The page of a result: all of its report, nothing from elsewhere, nobody's text as markup, tables that sort in a browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.show.page import to_page
from fisherpoint.show.page_pictures import for_page
from fisherpoint.show.section import Report, Section
from fisherpoint.show.style import telling

pytest.importorskip("matplotlib")

HOSTILE = '<script>alert("1")</script>&amp;'
VOID = {"meta", "br", "img", "link", "input", "hr"}
STD = dict(a_tau=0.3, b_tau=0.2, m_q=0.05, E_oil=0.2, p_t=0.2, B_v=0.1, c_L=0.3, V_0A=0.1, V_0B=0.1)
BOUNDS = dict(q=(0.03, 0.27), v=(-0.25, 0.25), p_A=(2e6, 19e6), p_B=(2e6, 19e6), x_v=(-1, 1), u=(-1, 1), dt=(1e-3, 1e-2))


class Page(HTMLParser):
    """A page taken apart: its texts by element, its tables, the addresses that it names."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[tuple[tuple[str, ...], str]] = []
        self.tables: list[list[list[str]]] = []
        self.addresses: list[str] = []
        self.classes: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == [], f"elements that are not closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for name, value in attrs if name.rpartition(":")[2] in ("src", "href", "srcset", "data")]
        self.classes += [value or "" for name, value in attrs if name == "class"]
        assert not [name for name, _ in attrs if name.startswith("on")]
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        if "td" in self.open or "th" in self.open:
            self.tables[-1][-1][-1] += data
        self.texts.append((tuple(self.open), data))

    def within(self, tag: str) -> str:
        return "".join(text for path, text in self.texts if tag in path)


def problem() -> fp.DesignProblem:
    model = fp.HydraulicCylinder()
    prior = fp.GaussianPrior(mean=model.nominal, relative_std=STD)
    noise = {"q": 5e-6, "p_A": 2e4, "p_B": 2e4, "x_v": 1e-3}
    return fp.DesignProblem(model, prior, fp.ExperimentRegion(BOUNDS), noise_std=noise, rule=fp.Linearized())


@pytest.fixture(scope="module")
def results() -> dict[str, Any]:
    design = fp.exchange(problem(), n_experiments=12, n_candidates=5, max_iterations=4)
    rig = fp.VirtualRig(design.problem.model, design.problem.prior.mean, design.problem.noise_std or {}, seed=1)
    fit = fp.estimate(design.problem.model, rig.measure(design.points), design.problem.prior, noise_std=design.problem.noise_std)
    from_rest = fp.RunRegion(dict(q=(0.03, 0.27), v=0.0, p_A=5e6, p_B=10.382e6, x_v=0.0, u=(-1, 1), dt=5e-3), segments=8)
    runs = fp.design_runs(design.problem.replace(region=from_rest), n_runs=2, n_starts=1, n_candidates=20)
    campaign = fp.Campaign(problem(), batch=6, targets=0.05, n_candidates=5, max_iterations=2)
    campaign.tell(rig.measure(campaign.next()))
    campaign.next()
    return {
        "Design": design,
        "RunDesign": runs,
        "Fit": fit,
        "Validation": fp.validate(design.problem, {"<b>": design.points}, runs=20),
        "DesignComparison": fp.compare(design.problem, {"points": design, HOSTILE: runs}, draws=50),
        "Campaign": campaign,
        "Evaluation": design.evaluation,
        "Feasibility": design.feasibility,
    }


PICTURES = {
    "Design": ["Search: the criterion over the iterations", "Points", "Standard errors", "Correlation", "Trajectories"],
    "RunDesign": ["Runs", "Information", "Standard errors", "Correlation"],
    "Fit": ["Measured against predicted outputs", "Residuals", "Correlation", "Ellipses"],
    "Validation": ["Validation"],
    "DesignComparison": ["Comparison"],
    "Campaign": ["Campaign"],
    "Evaluation": ["Standard errors", "Correlation"],
    "Feasibility": [],
}


def shown(report: Report) -> Iterator[str]:
    yield report.headline
    yield from report.warnings
    for section in report.sections:
        yield section.title
        yield from section.notes


@pytest.mark.parametrize("kind", PICTURES)
def test_a_page_has_all_of_the_report_and_nothing_from_elsewhere(kind: str, results: dict[str, Any], tmp_path: Path) -> None:
    result = results[kind]
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


def test_a_page_says_what_was_asked_and_with_which_versions(results: dict[str, Any], tmp_path: Path) -> None:
    results["Design"].to_html(tmp_path / "report.html", pictures=False)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    asked = page.within("details")
    for part in ("What was asked", "sensor noise", "Prior", "Region", "n_candidates", "Linearized"):
        assert part in asked
    assert ["E_oil", "Pa", "1.2e9", "2.4e8", "normal"] in [row for table in page.tables for row in table]
    assert ["v", "m/s", "-0.25", "0.25"] in [row for table in page.tables for row in table]
    assert f"numpy {np.__version__}" in page.within("footer")


def test_misuse_is_told(results: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="path: expected"):
        results["Feasibility"].to_html(3)
    with pytest.raises(TypeError, match="pictures: expected"):
        results["Feasibility"].to_html(tmp_path / "report.html", pictures="none")
    assert not list(tmp_path.iterdir())


def test_the_page_of_a_campaign_has_the_next_batch(results: dict[str, Any], tmp_path: Path) -> None:
    results["Campaign"].to_html(tmp_path / "report.html", pictures=False)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "Next batch" in page.within("h2")
    assert any(len(table) == 7 and table[0][:2] == ["#", "q [m]"] for table in page.tables)


def test_tables_of_many_points_are_whole_in_a_page(tmp_path: Path) -> None:
    design = fp.exchange(problem(), n_experiments=60, n_candidates=2, max_iterations=1, references=False)
    design.to_html(tmp_path / "report.html", pictures=False)
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert any(len(table) == 61 for table in page.tables) and "... and 20 more" in str(design)


def test_nobodys_text_is_taken_for_markup(tmp_path: Path) -> None:
    section = Section(HOSTILE, (HOSTILE, "value"), [(HOSTILE, "1"), ("\x1b[31m</table>", "2")], marked=[1], notes=[HOSTILE])
    report = Report(HOSTILE, [section], [HOSTILE])
    text = to_page(report, asked=[section], command=f"fisherpoint design {HOSTILE}", sources={HOSTILE: f"a\n{HOSTILE}\n</pre>"})
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
    telling(axes.plot([0, 1], [1, 2]), HOSTILE, "one")
    axes.set_title(HOSTILE)
    picture = for_page("a_picture", figure)
    page = Page(picture.markup)
    assert picture.title == "A picture" and page.open == []
    assert HOSTILE in [text for path, text in page.texts if path[-1] == "title"]
    assert "hover" in page.classes and "<script" not in picture.markup
    assert "<style" not in picture.markup


def test_a_picture_is_embedded_in_the_smaller_format() -> None:
    from matplotlib.figure import Figure

    random = np.random.default_rng(0)
    few, many = Figure(), Figure()
    few.subplots().plot([0, 1])
    many.subplots().scatter(*random.normal(size=(2, 20000)), s=1)
    assert 'src="data:image/svg+xml;base64,' in for_page("few", few).markup
    picture = for_page("many", many)
    assert 'src="data:image/png;base64,' in picture.markup and len(picture.markup) < 300_000


# --- in a browser -------------------------------------------------------------------------------------------------------

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
in_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no chromium")

ACTIONS = """
<script>
const table = Array.from(document.querySelectorAll("table.sorted")).find(one => one.textContent.includes("q [m]"));
const order = () => Array.from(table.tBodies[0].rows, row => row.cells[0].textContent).join(" ");
const click = column => { table.tHead.rows[0].cells[column].querySelector("button").click(); return order(); };
const told = { start: order(), up: click(1), down: click(1), back: click(0), sort: table.tHead.rows[0].cells[0].ariaSort };
told.wide = document.documentElement.scrollWidth - innerWidth;
const out = document.body.appendChild(document.createElement("output"));
out.textContent = JSON.stringify(told);
</script>
"""


def dumped(page: Path, tmp_path: Path, *options: str) -> tuple[str, str]:
    """The elements of a page after its scripts, and what the browser complained of."""
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--virtual-time-budget=2000",
        f"--user-data-dir={tmp_path / 'chromium'}", *options, "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout, "\n".join(line for line in done.stderr.splitlines() if ":CONSOLE" in line)


@in_chromium
@pytest.mark.parametrize("width", [1280, 400])
def test_tables_sort_in_a_browser_and_nothing_is_wider_than_it(width: int, results: dict[str, Any], tmp_path: Path) -> None:
    design, page = results["Design"], tmp_path / "report.html"
    design.to_html(page)
    page.write_text(page.read_text(encoding="utf-8").replace("</body>", f"{ACTIONS}</body>"), encoding="utf-8")
    elements, complaints = dumped(page, tmp_path, f"--window-size={width},900")
    assert complaints == ""
    told: Any = json.loads(Page(elements).within("output"))
    table = next(section for section in design.report().sections if "q [m]" in section.columns)
    q = {row[0]: float(row[1]) for row in table.rows}
    assert told["start"] == told["back"] == " ".join(map(str, range(1, 13)))
    assert [q[k] for k in told["up"].split()] == sorted(q.values()) != list(q.values())
    assert [q[k] for k in told["down"].split()] == sorted(q.values(), reverse=True)
    assert told["sort"] == "ascending" and told["wide"] <= 0


@in_chromium
@pytest.mark.parametrize("kind", PICTURES)
def test_a_browser_does_not_complain(kind: str, results: dict[str, Any], tmp_path: Path) -> None:
    results[kind].to_html(tmp_path / "report.html")
    elements, complaints = dumped(tmp_path / "report.html", tmp_path)
    assert complaints == "" and "</footer>" in elements
