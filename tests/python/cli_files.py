"""Files for commands at hand, and what a deliberate mistake is: its text, an edited file, and the line that it gets.

The files stand in the directory of each command. A mistake adds its own, which may be an edited one of these.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
ENZYME, DECAY, CYLINDER, REACTOR = (
    (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
    for name in ("michaelis_menten", "exponential_decay", "cylinder", "reactor")
)
CAMPAIGN = "\n[campaign]\nbatch = 2\ntargets = 0.05\n"
COST = "\n[cost]\nper_experiment = 2.0\n"
POINTS = "s\n1.1\n0.1\n"
DATA = "s,y_rate\n1.1,200\n0.1,130\n0.5,190\n"
HEADER = "q,v,p_A,p_B,x_v,u,dt\n"
ROW = "0.15,0.1,8e6,8e6,0.5,-0.5,0.002\n"
RUNS = "run,segment,A,B,C,T,dt,measured\n1,1,2,0,0,400,0.125,1\n1,2,,,,450,0.125,1\n"

FILES: dict[str, str | bytes] = {
    "enzyme.toml": ENZYME + CAMPAIGN + COST,
    "decay.toml": DECAY,
    "cylinder.toml": CYLINDER.replace('# constraints = ["p_A + p_B < 30e6"]', 'constraints = ["p_A + p_B < 30e6"]'),
    "reactor.toml": REACTOR,
    "points.csv": POINTS,
    "data.csv": DATA,
    "cylinder.csv": HEADER + 3 * ROW,
    "runs.csv": RUNS,
    "taken/design.json": "{}\n",
    "taken/report.txt": "a result\n",
    "there.csv": "somebody's\n",
}


@dataclass(frozen=True)
class Mistake:
    """What is typed behind ``fisherpoint``, what the line says, in this order, and the files that this one needs."""

    typed: str
    says: tuple[str, ...]
    files: dict[str, str | bytes] = field(default_factory=dict)
    stdin: str | None = None


def edited(text: str, *changes: tuple[str, str]) -> str:
    """A text in which each first is replaced by its second."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def enzyme(old: str, new: str, *says: str, typed: str = "design wrong.toml -o out") -> Mistake:
    """A mistake in the file of the enzyme."""
    return Mistake(typed, ("wrong.toml: ", *says), {"wrong.toml": edited(ENZYME, (old, new))})


def decay(old: str, new: str, *says: str, typed: str = "design wrong.toml -o out") -> Mistake:
    """A mistake in the file of the decay."""
    return Mistake(typed, ("wrong.toml: ", *says), {"wrong.toml": edited(DECAY, (old, new))})


def cylinder(old: str, new: str, *says: str) -> Mistake:
    """A mistake in the file of the cylinder."""
    return Mistake("design wrong.toml -o out", ("wrong.toml: ", *says), {"wrong.toml": edited(CYLINDER, (old, new))})


def reactor(old: str, new: str, *says: str) -> Mistake:
    """A mistake in the file of the reactor, which is one of runs."""
    return Mistake("design wrong.toml -o out", ("wrong.toml: ", *says), {"wrong.toml": edited(REACTOR, (old, new))})


def data(text: str | bytes, *says: str) -> Mistake:
    """A mistake in a file of measurements of the enzyme."""
    return Mistake("estimate enzyme.toml wrong.csv -o out", ("wrong.csv: ", *says), {"wrong.csv": text})


def points(text: str | bytes, *says: str) -> Mistake:
    """A mistake in a file of points of the cylinder."""
    return Mistake("evaluate cylinder.toml wrong.csv -o out", ("wrong.csv: ", *says), {"wrong.csv": text})
