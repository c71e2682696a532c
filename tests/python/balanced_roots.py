"""Right values where a root balances what drives it, by SciPy: in the root itself as variable, in pieces between reversals."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

Drive = Callable[[float], float]


def settled(d0: float, rate: float, t: float) -> float:
    """d' = -rate sign(d) sqrt(|d|)."""
    left = np.sqrt(abs(d0)) - 0.5 * rate * t
    return float(np.sign(d0) * max(left, 0.0) ** 2)


def balanced(drive: Drive, reversals: Sequence[float], k: float, h0: float, end: float) -> float:
    """The end of h' = drive(t) - k sign(h) sqrt(|h|), where the drive goes through zero at the reversals."""
    t, h = 0.0, h0
    for stop in [*[r for r in sorted(reversals) if 1e-9 < r < end], end]:
        while t < stop:
            t, h = _on_one_side(drive, k, t, h, stop)
        if abs(h) < 1e-9:
            h = 0.0
    return h


def _on_one_side(drive: Drive, k: float, t: float, h: float, stop: float) -> tuple[float, float]:
    start, side = t, np.sign(h)
    if h == 0.0:  # h grows like drive' t^2 / 2, less what flows, or like drive t
        # At a reversal the drive is a rounded difference: of steps that are too short LSODA takes millions.
        step = min(1e-6 if abs(drive(t)) >= 1e-9 else 1e-4, 1e-3 * (stop - t))
        q, side = drive(t + step), np.sign(drive(t + step))
        slope = abs(q - drive(t)) / step
        if abs(drive(t)) < 1e-9:
            root = (np.sqrt(k * k + 8 * slope) - k) / 4
            h = side * (root * step) ** 2
        else:
            h = side * (abs(q) * step - 2 / 3 * k * np.sqrt(abs(q)) * step**1.5)
        start = t + step

    def rates(s: float, w: np.ndarray) -> list[float]:
        return [(side * drive(s) - k * w[0]) / (2 * max(w[0], 1e-12))]

    def empty(_: float, w: np.ndarray) -> float:
        return float(w[0] - 1e-5)

    empty.terminal = True  # type: ignore[attr-defined]
    empty.direction = -1  # type: ignore[attr-defined]
    jac = lambda s, w: [[-side * drive(s) / (2 * max(w[0], 1e-12) ** 2)]]  # noqa: E731
    done = solve_ivp(rates, (start, stop), [np.sqrt(abs(h))], "LSODA", jac=jac, events=empty, rtol=1e-11, atol=1e-14)
    t, h = float(done.t[-1]), side * float(done.y[0, -1]) ** 2
    if t < stop:  # through zero at a definite rate, or next to where the drive reverses
        against = -side * drive(t)
        return (stop, 0.0) if against <= 0 else (t + (abs(h) / against if against > 1e-4 else 0.0), 0.0)
    return t, h


def refilled(e: float, k: float, h0: float, start: float, q: float, t: float) -> float:
    """h' = q max(t - start, 0) - k max(h, 0)**e, which is empty before it is filled again."""
    left = h0 ** (1 - e) - (1 - e) * k * min(t, start)
    assert left < 0 or t <= start
    if t <= start:
        return float(max(left, 0.0) ** (1 / (1 - e)))
    first = 1e-5
    p = 1 / e - 1
    rates = lambda s, w: [e * (q * s - k * w[0]) / max(w[0], 1e-30) ** p]  # noqa: E731
    jac = lambda s, w: [[-e * (p * q * s * w[0] ** (-p - 1) + (1 - p) * k * w[0] ** -p)]]  # noqa: E731
    w0 = (np.sqrt(k * k + 8 * q) - k) / 4 * first if e == 0.5 else q * first / k
    with np.errstate(divide="ignore"):  # of steps whose estimated error is zero
        done = solve_ivp(rates, (first, t - start), [w0], "Radau", jac=jac, rtol=1e-11, atol=1e-14)
    return float(done.y[0, -1] ** (1 / e))
