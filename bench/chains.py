"""``python -m bench.chains``: chains of 20 to 200 states next to CVODES through CasADi at matched accuracy, on one core.

A chain of cells in which something diffuses, with a reaction at its end, is stiff; a chain of masses with springs and dampers,
which is pulled at its end, is not. Both programs use the largest tolerance, in steps of 10^(1/2), with which every state is within
1e-6 of the largest, and every column of dx/dtheta within 1e-5 of its largest entry: of the values at 1e-12, which CVODES at 1e-10
must meet to a tenth of that. CVODES takes its BDF formulas for diffusion, and the faster of those and Adams' for masses. A batch's
parameters are spread by 5 %; it is shown of the model as it is written down, and compiled (to the same bits). CasADi's functions
are interpreted, as it does by default.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import fisherpoint as fp

from .timing import least_seconds

WITHIN_X, WITHIN_S = 1e-6, 1e-5
LADDER = 10.0 ** -np.arange(2, 11.5, 0.5)
BATCH = 32
ROUNDS, IN_A_ROW = 10, 5

Array = NDArray[np.float64]
Ends = tuple[Array, Array | None]


class Chain(NamedTuple):
    """x' = f from x0 over `duration`; the formulas of CVODES that are tried."""

    kind: str
    f: dict[str, str]
    x0: list[float]
    theta: dict[str, float]
    duration: float
    formulas: tuple[str, ...]

    def model(self) -> fp.SymbolicModel:
        return fp.SymbolicModel(
            list(self.f.values()),
            [list(self.f)[-1]],
            {name: ("1", 1.0) for name in self.f},
            {},
            dict.fromkeys(self.theta, "1"),
            check_units=False,
        )

    def points(self, count: int) -> fp.Experiments:
        return fp.Experiments([self.x0] * count, [[]] * count, [self.duration] * count)


class Row(NamedTuple):
    """Tolerances, and milliseconds of one trajectory, of each of a batch, of each with the model compiled, and of CVODES."""

    chain: str
    states: int
    sensitivities: bool
    rtol: float
    rtol_cvodes: float
    one: float
    each: float
    compiled: float
    cvodes: float


def diffusion(cells: int) -> Chain:
    """Of a particle in a battery's electrode, cut into cells; at its surface a reaction under a constant current."""
    f = {}
    for cell in range(1, cells + 1):
        inner = f"c{cell - 1} - c{cell}" if cell > 1 else "0"
        outer = f"c{cell + 1} - c{cell}" if cell < cells else "0"
        flux = f" + {cells}*(0.5 - k*sinh(4*(c{cell} - 0.5)))" if cell == cells else ""
        f[f"c{cell}"] = f"D*{cells**2}*(({inner}) + ({outer})){flux}"
    return Chain("diffusion", f, [1.0] * cells, {"D": 1.0, "k": 0.7}, 0.1, ("bdf",))


def masses(states: int) -> Chain:
    """Masses between springs, the first one held, the last one pulled."""
    count = states // 2
    f = {f"x{i}": f"v{i}" for i in range(1, count + 1)}
    for i in range(1, count + 1):
        before = f"k*(x{i - 1} - x{i}) + d*(v{i - 1} - v{i})" if i > 1 else "-k*x1 - d*v1"
        behind = f" + k*(x{i + 1} - x{i}) + d*(v{i + 1} - v{i})" if i < count else " + 1"
        f[f"v{i}"] = before + behind
    return Chain("masses", f, [0.0] * states, {"k": 4.0, "d": 0.1}, 5.0, ("bdf", "adams"))


def measured(chain: Chain, of_s: bool) -> Row:
    """Both programs in turn."""
    model, theta = chain.model(), np.array(list(chain.theta.values()))
    points, many = chain.points(1), chain.points(BATCH)
    spread = theta * (1 + 0.05 * np.random.default_rng(0).standard_normal((BATCH, len(theta))))

    def ours(at: fp.Experiments, parameters: Array, rtol: float, of: fp.Model = model) -> Ends:
        if of_s:
            found = fp.sensitivities(of, at, parameters, rtol=rtol, threads=1)
            return found.x[0], found.dx_dtheta[0]
        return fp.simulate(of, at, parameters, rtol=rtol, threads=1).x[0], None

    expected = ours(points, theta, 1e-12)
    rtol = matched(lambda rtol: ours(points, theta, rtol), expected)
    peers = {}
    for formula in chain.formulas:
        if not fits(cvodes(chain, 1e-10, of_s, formula)(theta), expected, 0.1):
            raise RuntimeError(f"{chain.kind}: expected both programs to agree, given others")
        loosest = matched(lambda rtol, formula=formula: cvodes(chain, rtol, of_s, formula)(theta), expected)  # type: ignore[misc]
        peers[formula] = loosest, cvodes(chain, loosest, of_s, formula)
    compiled = model.compile()
    tasks: dict[str, Callable[[], object]] = {
        "one": lambda: ours(points, theta, rtol),
        "each": lambda: ours(many, spread, rtol),
        "compiled": lambda: ours(many, spread, rtol, compiled),
        **{formula: lambda solve=solve: solve(theta) for formula, (_, solve) in peers.items()},  # type: ignore[misc]
    }
    times = {name: 1e3 * seconds for name, seconds in least_seconds(tasks, ROUNDS, IN_A_ROW).items()}
    best = min(peers, key=lambda formula: times[formula])
    each, of_compiled = times["each"] / BATCH, times["compiled"] / BATCH
    return Row(chain.kind, len(chain.f), of_s, rtol, peers[best][0], times["one"], each, of_compiled, times[best])


def fits(found: Ends, expected: Ends, share: float = 1.0) -> bool:
    """Whether ends are within what is asked."""
    pairs = [(found[0], expected[0], WITHIN_X * np.abs(expected[0]).max())]
    if found[1] is not None and expected[1] is not None:
        pairs.append((found[1], expected[1], WITHIN_S * np.abs(expected[1]).max(axis=0)))
    return all(bool((np.abs(one - other) <= share * within).all()) for one, other, within in pairs)


def matched(solve: Callable[[float], Ends], expected: Ends) -> float:
    """The largest tolerance that is good enough."""
    return next(float(rtol) for rtol in LADDER if fits(solve(float(rtol)), expected))


def cvodes(chain: Chain, rtol: float, of_s: bool, formula: str) -> Callable[[Array], Ends]:
    """CVODES, which CasADi gives derivatives."""
    import casadi

    symbols = {name: casadi.SX.sym(name) for name in (*chain.f, *chain.theta)}
    names = symbols | {"sinh": casadi.sinh}
    rates = casadi.vertcat(*(eval(text, {"__builtins__": {}}, names) for text in chain.f.values()))
    x, theta = (casadi.vertcat(*(symbols[name] for name in of)) for of in (chain.f, chain.theta))
    options: dict[str, Any] = {"reltol": rtol, "abstol": 1e-2 * rtol, "max_num_steps": 10**6, "linear_multistep_method": formula}
    integrator = casadi.integrator("cvodes", "cvodes", {"x": x, "p": theta, "ode": rates}, 0, chain.duration, options)
    if not of_s:
        return lambda at: (np.asarray(integrator(x0=chain.x0, p=at)["xf"]).ravel(), None)
    both = integrator.factory("both", ["x0", "p"], ["xf", "jac:xf:p"])

    def solve(at: Array) -> Ends:
        end: Any
        slopes: Any
        end, slopes = both(chain.x0, at)
        return np.asarray(end).ravel(), np.asarray(slopes)

    return solve


def rows(states: list[int]) -> Iterator[Row]:
    """All chains, states first."""
    for make in (diffusion, masses):
        for count in states:
            for of_s in (False, True):
                yield measured(make(count), of_s)


def exponents(first: Row, last: Row) -> str:
    """With what power of the states the times of one trajectory, and of each of a batch, grow."""
    of = "x, dx/dtheta" if last.sensitivities else "x"
    one, each = (np.log(b / a) / np.log(last.states / first.states) for a, b in ((first.one, last.one), (first.each, last.each)))
    return f"{last.chain}, {of}, {first.states} to {last.states} states: one n^{one:.2f}, each of {BATCH} n^{each:.2f}"


def main() -> None:
    """Print the table, and how times grow."""
    parser = argparse.ArgumentParser(prog="python -m bench.chains", description=__doc__)
    parser.add_argument("--states", type=int, nargs="+", default=[20, 64, 100, 200])
    heads = "chain", "states", "of", "rtol", "CVODES'", "one, ms", "ratio", "each of 32", "ratio", "compiled", "ratio", "CVODES"
    print(f"| {' | '.join(heads)} |", "|---|--:|---|" + "--:|" * 9, sep="\n")
    made: dict[tuple[str, bool], list[Row]] = {}
    for row in rows(parser.parse_args().states):
        made.setdefault((row.chain, row.sensitivities), []).append(row)
        of = "x, dx/dtheta" if row.sensitivities else "x"
        pairs = ((row.one, 2), (row.each, 3), (row.compiled, 3))
        ratios = " | ".join(f"{ours:.{digits}f} | {row.cvodes / ours:.1f}" for ours, digits in pairs)
        rtols = f"{row.rtol:.0e} | {row.rtol_cvodes:.0e}"
        print(f"| {row.chain} | {row.states} | {of} | {rtols} | {ratios} | {row.cvodes:.2f} |", flush=True)
    for of_kind in made.values():
        if len(of_kind) > 1:
            print(exponents(of_kind[0], of_kind[-1]))


if __name__ == "__main__":
    main()
