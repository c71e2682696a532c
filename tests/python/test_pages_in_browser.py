"""Pages of results in a browser: no complaint, nothing wider than a telephone, tables that sort."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("matplotlib")

from browser import CHROMIUM, printed_pages, seen
from fisherpoint.show.page import to_page
from fisherpoint.show.page_pictures import for_page
from page_cases import PICTURES, results

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium")

WIDTHS = (1280, 400)

LOOK = """
const root = page.documentElement;
const told = { inner: view.innerWidth, wide: root.scrollWidth - view.innerWidth, whole: page.querySelector("footer") !== null };
const heads = Array.from(page.querySelectorAll("thead th"));
told.right = Object.fromEntries(heads.map(one => [one.textContent, one.getBoundingClientRect().right]));
told.unnamed = heads.filter(one => !one.textContent).length;
const boxes = Array.from(page.querySelectorAll(".picture, .scroll")).filter(one => !one.closest("details:not([open])"));
told.scrolling = boxes.filter(one => one.clientWidth < one.scrollWidth - 2).length;
told.cues = page.querySelectorAll(".more:not(pre)").length;
const table = Array.from(page.querySelectorAll("table.sorted")).find(one => one.textContent.includes("q [m]"));
if (table) {
  const order = () => Array.from(table.tBodies[0].rows, row => row.cells[0].textContent);
  const click = column => { table.tHead.rows[0].cells[column].querySelector("button").click(); return order(); };
  Object.assign(told, { start: order(), up: click(1), down: click(1), back: click(0) });
  told.sort = table.tHead.rows[0].cells[0].ariaSort;
}
return told;
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, int], Any]:
    """What is seen of every page at every width, of one browser."""
    directory = tmp_path_factory.mktemp("browser")
    pages = {}
    for kind, result in results().items():
        result.to_html(directory / "report.html")
        pages[kind] = (directory / "report.html").read_text(encoding="utf-8")
    told, complaints = seen(pages, WIDTHS, LOOK, directory)
    assert complaints == ""
    return told


@pytest.mark.long
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", PICTURES)
def test_a_page_is_whole_and_nothing_is_wider_than_it(kind: str, width: int, told: dict[tuple[str, int], Any]) -> None:
    of = told[kind, width]
    assert of["inner"] == width and of["wide"] <= 0 and of["whole"]


@pytest.mark.parametrize("width", WIDTHS)
def test_a_verdict_is_seen_without_scrolling(width: int, told: dict[tuple[str, int], Any]) -> None:
    right = told["Validation", width]["right"]
    assert right["promise"] < width and (width > 400 or right["coverage"] > width)


def test_what_scrolls_has_a_cue_and_columns_have_names(told: dict[tuple[str, int], Any]) -> None:
    assert {key: of["cues"] for key, of in told.items()} == {key: of["scrolling"] for key, of in told.items()}
    assert not any(of["unnamed"] for of in told.values())
    assert told["Fit", 400]["cues"] > 3 and told["Fit", 1280]["cues"] == 0


@pytest.mark.parametrize("width", WIDTHS)
def test_tables_sort(width: int, told: dict[tuple[str, int], Any]) -> None:
    table = next(section for section in results()["Design"].report().sections if "q [m]" in section.columns)
    q, of = {row[0]: float(row[1]) for row in table.rows}, told["Design", width]
    assert of["start"] == of["back"] == [str(k) for k in range(1, 13)]
    assert [q[k] for k in of["up"]] == sorted(q.values()) != list(q.values())
    assert [q[k] for k in of["down"]] == sorted(q.values(), reverse=True)
    assert of["sort"] == "ascending"


def test_neither_a_long_file_nor_the_footer_takes_a_sheet_of_its_own(tmp_path: Path) -> None:
    """Whatever the height of the last picture is."""
    design, long = results()["Design"], "\n".join(f"key_{k} = {k}" for k in range(400))
    for kind in ("points", "trajectories"):
        page = to_page(design.report(), pictures=[for_page(kind, design.plot(kind))], command="x", sources={"x.toml": long})
        without = re.sub("<footer>.*?</footer>", "", page.replace(long, ""), flags=re.DOTALL)
        assert "key_7" in page and "key_7" not in without
        assert printed_pages(page, tmp_path) == printed_pages(without, tmp_path) > 1
