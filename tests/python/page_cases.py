"""A result of every kind that has a page, and pages taken apart."""

from __future__ import annotations

from functools import cache
from html.parser import HTMLParser
from typing import Any

import fisherpoint as fp

HOSTILE = '<script>alert("1")</script>&amp;'
STD = dict(a_tau=0.3, b_tau=0.2, m_q=0.05, E_oil=0.2, p_t=0.2, B_v=0.1, c_L=0.3, V_0A=0.1, V_0B=0.1)
BOUNDS = dict(q=(0.03, 0.27), v=(-0.25, 0.25), p_A=(2e6, 19e6), p_B=(2e6, 19e6), x_v=(-1, 1), u=(-1, 1), dt=(1e-3, 1e-2))


VOID = {"meta", "br", "img", "link", "input", "hr"}


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
    return fp.DesignProblem(model, prior, fp.ExperimentRegion(BOUNDS), noise=noise, rule=fp.LinearizedRule())


@cache
def results() -> dict[str, Any]:
    """By the names of their classes."""
    design = fp.exchange(problem(), n_experiments=12, n_candidates=5, max_iterations=4)
    rig = fp.VirtualRig(design.problem.model, design.problem.prior.mean, design.problem.noise or {}, seed=1)
    fit = fp.estimate(design.problem.model, rig.measure(design.points), design.problem.prior, noise=design.problem.noise)
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
        "Sweep": fp.sweep(problem(), (9, 10), n_candidates=5, max_iterations=2),
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
    "Sweep": ["Sweep"],
    "Evaluation": ["Standard errors", "Correlation"],
    "Feasibility": ["Feasibility"],
}
