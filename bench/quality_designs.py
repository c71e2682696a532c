"""The designs that `design_quality` compares: of every criterion, averaged over the prior, random, corners, and records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

import fisherpoint as fp
from fisherpoint.estimation.response import RecordResponse
from fisherpoint.information.candidates import CandidateSource
from fisherpoint.information.point_information import PointInformation

from .designs import NOISE_STD, REGION, RELATIVE_STD

Array = NDArray[np.float64]

N = 12
MODEL = fp.HydraulicCylinder()
PRIOR = fp.GaussianPrior(MODEL.nominal, relative_std=RELATIVE_STD)
RULE = fp.SparseGaussHermite(level=2)
NODES = fp.Sobol(16)
"""Over which the averaged criterion takes its mean; its points and the corners can run on all of them."""

SMOOTH = {"v": 5e-3, "x_v": 5e-3}
"""Widths of the form that records run on, as the sharp one ends where v = 0: five times the example's, for speed."""

SMOOTH_MODEL = fp.HydraulicCylinder(smooth=SMOOTH)
SAMPLES, AMPLITUDES = (2e-3, 5e-3, 1e-2, 2e-2), (0.1, 0.2, 0.5, 1.0)
"""Times between the samples of records, s, and amplitudes of their input: the pair with the best promise is taken."""

ROUNDS, FRESH, NEAR = 160, 50, 12
"""Of the averaged criterion: rounds, fresh candidates in each, and candidates near each point."""


def problem(noise: float = 1.0, kind: str = "noise") -> fp.DesignProblem:
    """The default problem with `noise` times the default std, without points that meet a jump."""
    std = {name: noise * value for name, value in NOISE_STD.items()}
    return fp.DesignProblem(MODEL, PRIOR, REGION, noise=std, rule=RULE, output_covariance=kind, jumps="exclude")


@dataclass(frozen=True, eq=False)
class Candidate:
    """Points or a record, and the standard errors (p,) that its own D promised, in prior std; None where D is R."""

    data: fp.Experiments | fp.Record
    own: Array | None = None


def searched(kind: str, bare: bool = False, paper: bool = False) -> Callable[[float, int], Candidate]:
    """Of `exchange`; `bare`: without R, `paper`: the 3^9 grid and Algorithm 1 alone, a single candidate draw of 50 as printed."""

    @cache
    def design(noise: float, seed: int) -> Candidate:
        asked = problem(noise, kind)
        if bare:
            asked = asked.replace(noise=None)
        if paper:
            asked = asked.replace(rule=fp.TensorGrid(levels=3, span=1.5))
        found = fp.exchange(asked, N, seed=seed, method=fp.ExchangeMethod("paper", references=False, local=0.0 if paper else 0.5))
        errors, own = found.evaluation.standard_errors, None
        if kind != "noise" and errors is not None:
            own = np.array([errors[name] / PRIOR.std[name] for name in asked.estimated])
        return Candidate(found.points, own)

    # Neither R times a number nor a D without R change with the level.
    return (lambda noise, seed: design(1.0, seed)) if kind == "noise" or bare else design


@cache
def averaged(_noise: float, seed: int) -> Candidate:
    """The mean over NODES of log det F with D = R, by exchange among fresh candidates and some near the points."""
    asked = problem().replace(rule=NODES)
    source = CandidateSource(asked, np.random.default_rng([seed, 2]), None)
    chosen = source.draw_confirmed(N)
    for _ in range(ROUNDS):
        near, _ = source.draw_near(chosen.experiments, NEAR)
        pool = PointInformation.join([chosen, source.draw_confirmed(FRESH), source.confirm(near)])
        chosen = pool[best_exchanges(node_rows(pool.experiments), list(range(N)))]
    return Candidate(chosen.experiments)


def node_rows(points: fp.Experiments) -> Array:
    """Sensitivities (R, K, n_y, p) at the nodes, in prior std and noise std."""
    theta, _ = NODES.nodes(PRIOR)
    scale = np.array([PRIOR.std[name] for name in PRIOR.names]) / np.array(list(NOISE_STD.values()))[:, None]
    many = points[np.tile(np.arange(len(points)), len(theta))]
    found = fp.sensitivities(MODEL, many, np.repeat(theta, len(points), axis=0), jumps="exclude")
    dy: Array = found.dy_dtheta.reshape(len(theta), len(points), *scale.shape)
    rows: Array = dy * scale
    return rows


def best_exchanges(rows: Array, chosen: list[int]) -> list[int]:
    """Exchange points while the mean of log det sum_k s_k^T s_k over the nodes rises."""
    eye = np.eye(rows.shape[2])

    def change(sign: float, places: list[int], of: list[int]) -> Array:
        fisher = np.einsum("rkip,rkiq->rpq", rows[:, of], rows[:, of])
        some = rows[:, places]
        inner = some @ np.linalg.solve(fisher[:, None], some.swapaxes(2, 3))
        sign_of, log_det = np.linalg.slogdet(eye + sign * inner)
        result: Array = np.where(sign_of > 0, log_det, -np.inf).mean(axis=0)
        return result

    everything = list(range(rows.shape[1]))
    while True:
        enters = int(np.argmax(change(1.0, everything, chosen)))
        grown = [*chosen, enters]
        leaves = int(np.argmax(change(-1.0, grown, grown)))
        if grown[leaves] == enters:
            return chosen
        chosen = grown[:leaves] + grown[leaves + 1 :]


@cache
def random(_: float, seed: int) -> Candidate:
    """Valid points of the region, as an exchange starts from."""
    source = CandidateSource(problem(), np.random.default_rng([seed, 3]), None)
    return Candidate(source.draw_confirmed(N).experiments)


@cache
def corners(_: float, seed: int) -> Candidate:
    """Twelve at random of the 2^7 corners of the region that are points at the prior mean and on the NODES."""
    table = np.array(list(product(*REGION.bounds.values())))
    every = fp.Experiments(table[:, :5], table[:, 5:6], table[:, 6])
    theta, _nodes = NODES.nodes(PRIOR)
    fine = np.ones(len(every), dtype=bool)
    for node in (np.array(list(PRIOR.mean.values())), *theta):
        fine &= fp.sensitivities(MODEL, every, node, jumps="exclude").status == fp.Status.ok
    return Candidate(every[np.random.default_rng([seed, 4]).permutation(np.flatnonzero(fine))[:N]])


def rest_state() -> Array:
    """State with the valve closed at mid-stroke in which v and the pressures stay, at the prior mean."""
    from scipy.optimize import root

    scale, theta = np.array([1e-3, 1e6, 1e6]), PRIOR.mean

    def rates(z: Array) -> Array:
        rate: Array = MODEL.rhs(np.array([0.15, *(scale * z), 0.0]), 0.0, theta)[1:4] / [1.0, 1e6, 1e6]
        return rate

    return np.array([0.15, *(scale * root(rates, [1.0, 6.0, 12.0], tol=1e-12).x), 0.0])


def prbs(samples: int, seed: int) -> Array:
    """A maximum-length sequence of +-1, one bit a sample."""
    from scipy.signal import max_len_seq

    bits = 4 if samples <= 15 else 7
    state = np.random.default_rng([seed, 5]).permutation([1, *np.random.default_rng([seed, 6]).integers(0, 2, bits - 1)])
    return np.where(max_len_seq(bits, state=state, length=samples)[0] > 0, 1.0, -1.0)


def steps(samples: int, _: int) -> Array:
    """Out, in and closed, a third each."""
    return np.repeat([-1.0, 1.0, 0.0], samples // 3)


def record(shape: Callable[[int, int], Array], samples: int) -> Callable[[float, int], Candidate]:
    """One coherent record from the known rest state, with so many samples behind the start."""

    @cache
    def best(seed: int) -> Candidate:
        theta = np.vstack([list(PRIOR.mean.values()), NODES.nodes(PRIOR)[0]])
        scale = np.array([PRIOR.std[name] for name in PRIOR.names]) / np.array(list(NOISE_STD.values()))[:, None]
        x0, y = rest_state(), np.zeros((samples + 1, 4))
        y[0] = np.nan  # the start is known, so its measurement says nothing
        start = dict(zip((q.name for q in MODEL.states), x0.tolist(), strict=True))
        found: list[tuple[float, fp.Record]] = []
        for dt, amplitude in product(SAMPLES, AMPLITUDES):
            u = amplitude * np.append(shape(samples, seed), 0.0)
            one = fp.Record(dt * np.arange(samples + 1.0), u, y, x0=start)
            response = RecordResponse(SMOOTH_MODEL, one, range(len(PRIOR.names)))(theta, np.tile(x0, (len(theta), 1)))
            if response.status[0] == fp.Status.ok and (response.status == fp.Status.ok).sum() >= len(theta) - 1:
                rows = (response.dy[0, 1:] * scale).reshape(-1, len(PRIOR.names))
                found.append((float(np.linalg.slogdet(rows.T @ rows)[1]), one))
        return Candidate(max(found, key=lambda pair: pair[0])[1])

    return lambda _, seed: best(seed)


SOURCES: dict[str, tuple[Callable[[float, int], Candidate], int]] = {
    "pooled, no R": (searched("pooled", bare=True), 3),
    "pooled": (searched("pooled"), 3),
    "region": (searched("region"), 3),
    "pointwise": (searched("pointwise"), 3),
    "noise": (searched("noise"), 3),
    "noise, averaged": (averaged, 3),
    "random": (random, 5),
    "corners": (corners, 3),
    "PRBS": (record(prbs, N), 2),
    "steps": (record(steps, N), 1),
    "PRBS, 120": (record(prbs, 120), 1),
    "steps, 120": (record(steps, 120), 1),
    "pooled, no R, paper": (searched("pooled", bare=True, paper=True), 3),
    "noise, paper": (searched("noise", paper=True), 3),
}
"""Name of each design, what makes it for a noise level and a seed, and the number of seeds."""
