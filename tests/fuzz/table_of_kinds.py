"""Random points of every kind of equations (kinds.py), states and sensitivities against the integration mode by mode.

    python tests/fuzz/table_of_kinds.py --points 200 [--kinds orifice relay] [--output run/kinds]

prints for every kind how many points were ok, refused with a status, or without an answer of the other integration, the worst
relative errors, and how many were wrong: states off by more than 1e-8, sensitivities by more than 1e-6 of their column, or 1e-5
beside roots.
Half of the points are on a grid of tenths. The smallest script of what is wrong or refused is written to the folder. Ends with 1
where anything was wrong or refused.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import fisherpoint as fp
from automaton import NoAnswer, PilesUp, slopes
from kinds import KINDS
from random_kinds import Drawn, drawn
from reading import Floats

RTOL = 1e-10
STATES, COLUMNS, BESIDE_ROOTS = 1e-8, 1e-6, 1e-5
OF_A_MODEL = 20  # points
KEPT = 3  # scripts of one sort


@dataclass
class Row:
    """Of one kind."""

    counts: Counter[str] = field(default_factory=Counter)
    states: float = 0.0
    columns: float = 0.0
    refused: Counter[str] = field(default_factory=Counter)
    scripts: dict[str, list[str]] = field(default_factory=dict)

    @property
    def wrong(self) -> int:
        return sum(count for name, count in self.counts.items() if name.startswith("wrong"))

    def keep(self, sort: str, code: str) -> None:
        self.counts[sort] += 1
        kept = self.scripts.setdefault(sort, [])
        kept.append(code)
        kept.sort(key=len)
        del kept[KEPT:]

    def line(self, name: str) -> str:
        refused = ", ".join(f"{count} {status}" for status, count in self.refused.items()) or "none"
        counts = self.counts
        return (
            f"{name:20} {counts['points']:6} {counts['compared']:6} {self.states:9.1e} {counts['columns']:8} {self.columns:9.1e} "
            f"{self.wrong:5}  {refused}" + (f"; no answer of {counts['no answer']}" if counts["no answer"] else "")
        )


HEAD = f"{'kind':20} points  ok,cmp    states  columns   columns wrong  refused"


def row_of(name: str, points: int, seed: int = 0) -> Row:
    row = Row()
    rng = np.random.default_rng([seed, *name.encode()])
    while row.counts["points"] < points:
        one = drawn(name, rng)
        count = min(OF_A_MODEL, points - row.counts["points"])
        model = one.model()
        for k in range(count):
            row.counts["points"] += 1
            compare(row, one, model, *one.numbers(rng, nice=k % 2 == 0))
    return row


def compare(row: Row, one: Drawn, model: fp.SymbolicModel, x0: Floats, u: Floats, dt: float, theta: Floats) -> None:
    def end(p: Floats) -> Floats:
        x = one.automaton.course(x0.tolist(), u.tolist(), p.tolist(), dt).x
        y = one.automaton.function(one.outputs)(x.tolist(), u.tolist(), p.tolist())
        return np.concatenate([x, y])

    point = one.experiments(x0, u, dt)
    values = f"fp.Experiments({point.x0.tolist()}, {point.u.tolist()}, {point.dt.tolist()}), {theta.tolist()}, rtol={RTOL:g}"
    code = one.code(f"done = fp.sensitivities(model, {values})\nprint(done.statuses, done.x, done.dx_dtheta)\n")
    piles = False
    try:
        expected = end(theta)
    except PilesUp:
        piles = True
    except (NoAnswer, ValueError, OverflowError) as error:
        row.counts["no answer"] += 1
        row.keep(f"no answer: {error}", code)
        return
    try:
        states = fp.simulate(model, point, theta, rtol=RTOL)
        done = fp.sensitivities(model, point, theta, rtol=RTOL)
    except ValueError as error:
        row.refused["error"] += 1
        row.keep("refused: error", f"{code}# {error}\n")
        return
    name = fp.Status(int(states.status[0])).name
    if piles:
        row.counts["piles up"] += 1
        if name != "chatters":
            row.keep(f"wrong: {name} where events pile up", code)
        return
    if name != "ok":
        row.refused[name] += 1
        row.keep(f"refused: {name}", f"{code}# x, y = {expected.tolist()}\n")
        return
    row.counts["compared"] += 1
    n = len(x0)
    given = np.concatenate([states.x[0], states.y[0]])
    error = float(np.max(np.abs(given - expected) / (1 + np.abs(expected))))
    row.states = max(row.states, error)
    if not error <= STATES:
        row.keep("wrong: states", f"{code}# x, y = {expected.tolist()}\n")
    name = fp.Status(int(done.status[0])).name
    try:
        beside = slopes(end, theta)
    except (NoAnswer, PilesUp, ValueError, OverflowError):
        row.counts["without differences"] += 1
        if name != "ok":
            row.refused[f"S {name} (no differences)"] += 1
        return
    if name != "ok":
        of_bent = " (bent)" if beside.bent.any() else ""
        row.refused[f"S {name}{of_bent}"] += 1
        row.keep(f"refused: S {name}{of_bent}", f"{code}# d(x, y)/dtheta = {beside.value.tolist()}\n")
        return
    found = np.concatenate([done.dx_dtheta[0], done.dy_dtheta[0]])
    column = np.maximum(1.0, np.max(np.abs(beside.value[:n]), axis=0))
    column = np.maximum(column, np.abs(beside.value))
    off = np.where(beside.bent, 0.0, np.maximum(np.abs(found - beside.value) - beside.error, 0.0) / column)
    row.counts["columns"] += int((~beside.bent).all(axis=0).sum())
    row.columns = max(row.columns, float(off.max(initial=0.0)))
    if not off.max(initial=0.0) <= (BESIDE_ROOTS if one.kind.beside_roots else COLUMNS):
        row.keep("wrong: columns", f"{code}# d(x, y)/dtheta = {beside.value.tolist()}\n")


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS))
    parser.add_argument("--output", type=Path, default=Path("run/kinds"))
    chosen = parser.parse_args(given)
    chosen.output.mkdir(parents=True, exist_ok=True)
    print(HEAD, flush=True)
    bad = 0
    for name in chosen.kinds:
        row = row_of(name, chosen.points, chosen.seed)
        print(row.line(name), flush=True)
        bad += row.wrong + row.refused.total()
        for sort, scripts in row.scripts.items():
            for n, code in enumerate(scripts):
                text = "".join(letter if letter.isalnum() else "_" for letter in f"{name} {sort}")
                (chosen.output / f"{text[:80]}_{n + 1}.py").write_text(code)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
