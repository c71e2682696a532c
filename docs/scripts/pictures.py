"""Draws docs/images/validation.png and campaign.png anew, in a minute or two: run it after a change of how these pictures look.

``python docs/scripts/pictures.py validation`` draws one of them alone.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import fisherpoint as fp
from fisherpoint.design.file.configuration import load_config

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


PICTURES: Mapping[str, Callable[[], None]] = {"validation": validation, "campaign": campaign}


def main(names: Sequence[str]) -> None:
    """Draw those that are named, or both."""
    for name in names or PICTURES:
        PICTURES[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
