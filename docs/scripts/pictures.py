"""Draws validation.png, campaign.png and scaling.png of docs/images anew, in a minute or two: after a change of how they look.

``python docs/scripts/pictures.py validation`` draws one of them alone. That of the growth of the cost is drawn from
docs/measured/scaling.json, which ``python -m bench scaling --json docs/measured/scaling.json`` writes.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config
from fisherpoint.show.style import STYLE, save_figure

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"


def cylinder() -> fp.DesignProblem:
    """The problem of the studies."""
    return load_config(ROOT / "examples" / "cylinder.toml").problem().replace(jumps="exclude")


def validation() -> None:
    """A design of 12 points beside random ones, as in docs/studies/validation.md."""
    problem = cylinder()
    designs = {
        "noise": fp.exchange(problem, n_experiments=12).points,
        "random": fp.exchange(problem, n_experiments=12, max_iterations=0, method=fp.ExchangeMethod(references=False)).points,
    }
    fp.validate(problem, designs).plot(path=IMAGES / "validation.png")


def campaign() -> None:
    """Four batches of six points from twice the prior's standard deviations, as in docs/studies/campaigns.md."""
    problem = cylinder()
    mean, names = problem.prior.mean, problem.prior.names
    prior = fp.GaussianPrior({name: mean[name] for name in names}, {name: 2 * problem.prior.std[name] for name in names})
    assert problem.noise is not None
    rig = fp.VirtualRig(problem.model, dict(mean) | {"c_L": 2.6e-9}, problem.noise, seed=1)
    found = fp.Campaign(problem.replace(prior=prior), batch=6, targets=0.02)
    for _ in range(4):
        found.tell(rig.measure(found.next()))
    found.plot(path=IMAGES / "campaign.png")


PANELS = (
    ("256 chains over states", (("n_x", ""),)),
    ("Sensitivities of 256 chains of 40 states", (("p", "sensitivities, "), ("n_y", "sensitivities, "))),
    ("Predictive covariances", (("R", ""), ("M", ""))),
    ("500 candidates in the exchange", (("L", "500 candidates"), ("p", "500 candidates"))),
)
"""Titles, and of each series its quantity and how its name begins."""

NAMES = {"n_x": "states", "p": "parameters", "n_y": "outputs", "R": "nodes", "M": "candidates", "L": "points"}


def scaling() -> None:
    """The processor time of calls over what grows, on both axes by decades, as in docs/studies/performance.md."""
    series = json.loads((ROOT / "docs" / "measured" / "scaling.json").read_text())["scaling"]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 6.4), layout="constrained")
        for axes, (title, shown) in zip(figure.subplots(2, 2).flat, PANELS, strict=True):
            for quantity, begins in shown:
                for one in series:
                    if one["quantity"] == quantity and one["what"].startswith(begins):
                        what = "" if quantity in "RML" or begins.startswith("500") else one["what"].removeprefix(begins) + ": "
                        label = f"{what}{NAMES[quantity]}$^{{{abs(one['exponent']):.2f}}}$"
                        axes.loglog(one["values"], [1e3 * seconds for seconds in one["seconds"]], "o-", markersize=4, label=label)
            low, high = np.log10(axes.get_ylim())
            axes.set_ylim(10 ** np.floor(low), 10 ** np.ceil(high + 0.3 * (high - low)))  # with room for names
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
                axis.set_minor_formatter(NullFormatter())
            axes.set_title(title)
            axes.set_xlabel(" or ".join(NAMES[quantity] for quantity, _ in shown))
            axes.set_ylabel("processor time [ms]")
            axes.legend(fontsize=8, loc="upper left")
    save_figure(figure, IMAGES / "scaling.png")


PICTURES: Mapping[str, Callable[[], None]] = {"validation": validation, "campaign": campaign, "scaling": scaling}


def main(names: Sequence[str]) -> None:
    """Draw those that are named, or all."""
    for name in names or PICTURES:
        PICTURES[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
