"""How trajectories show themselves: how many there are, how they ended, and the first ones as a table."""

from __future__ import annotations

import numpy as np

from ..basics.values import Array, IntArray
from ..show.numbers import counted
from ..show.section import Report
from ..show.table_preview import MOST, first_rows, numbered
from .status import Status, failures_of, named


def counted_statuses(status: IntArray) -> str:
    """How many trajectories ended how, by the names of their statuses: 3 ok, 1 met_jump."""
    ok = int((np.asarray(status) == Status.ok).sum())
    return ", ".join([*([f"{ok} ok"] if ok else []), *(f"{count} {name}" for name, count in failures_of(status).items())]) or "none"


def summary(kind: str, x: Array, y: Array, status: IntArray, one: str, parameters: int | None = None) -> str:
    """One line, as `repr` shows it."""
    of = "" if parameters is None else f" by {counted(parameters, 'parameter')}"
    sizes = f"{counted(len(status), one)}, {counted(x.shape[-1], 'state')}, {counted(y.shape[-1], 'output')}{of}"
    return f"{kind}({sizes}; status: {counted_statuses(status)})"


def of_points(headline: str, x: Array, y: Array, status: IntArray) -> Report:
    """States and outputs of the first points."""
    names = [one.name for one in named(status[:MOST])]
    return Report(headline, [first_rows(len(status), {**numbered("x", x), **numbered("y", y), "status": names})])


def of_runs(headline: str, x: Array, y: Array, status: IntArray, reached: IntArray) -> Report:
    """States and outputs at the ends of the segments of the first runs that were completed."""
    run, segment = np.nonzero(np.arange(y.shape[1]) < reached[:, None])
    shown = run[:MOST], segment[:MOST]
    ends = {"run": [str(k) for k in shown[0]], "segment": [str(n) for n in shown[1]]}
    table = first_rows(len(run), {**ends, **numbered("x", x[shown[0], shown[1] + 1]), **numbered("y", y[shown])})
    how = first_rows(
        len(status),
        {
            "run": [str(k) for k in range(min(MOST, len(status)))],
            "completed segments": [str(n) for n in reached[:MOST]],
            "status": [one.name for one in named(status[:MOST])],
        },
    )
    return Report(headline, [how, table])
