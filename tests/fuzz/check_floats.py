"""Whether 1.0 is 1: a model whose whole numbers are written as floats does what the other does."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

import fisherpoint as fp
from checks import ALLOWED, OK, TIGHT, Bench, magnification, state_error
from random_models import Case

NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
RTOL = 1e-9


def in_floats(text: str) -> str:
    """The expression with 2.0 for 2, also of exponents."""
    return NUMBER.sub(lambda found: found[0] if set(found[0]) & set(".eE") else f"{found[0]}.0", text)


def check_floats(bench: Bench) -> None:
    """End states and outputs, where both are ok; other statuses that differ are counted."""
    case = bench.case
    if type(case) is not Case or not len(bench.points):
        return
    floats = replace(case, rates=tuple(map(in_floats, case.rates)), outputs=tuple(map(in_floats, case.outputs)))
    if floats == case:
        return
    try:
        model = floats.model()
        done = fp.simulate(model, bench.points, bench.theta, rtol=TIGHT, threads=1, jumps="exclude")
    except ValueError:
        bench.figures.count("floats: refused, where whole numbers are not")
        return
    bench.figures.count("floats: trajectories", len(bench.points))
    bench.figures.count("floats: other statuses", int((done.status != bench.tight.status).sum()))
    both = np.flatnonzero((done.status == OK) & (bench.tight.status == OK))
    error = state_error(bench, done.x, bench.tight.x)
    for k in both[error[both] > ALLOWED * RTOL].tolist():
        if error[k] > ALLOWED * RTOL * magnification(bench, k, RTOL) and not bench.undecided(k):
            call = "fp.simulate(model, points, theta, rtol=1e-12, jumps='exclude').x"
            remark = f"of {floats.rates}: {done.x[k].tolist()}, of whole numbers: {bench.tight.x[k].tolist()}"
            bench.report("wrong ok: floats", float(error[k] / (ALLOWED * RTOL)), k, call, remark)
            return
