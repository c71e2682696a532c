"""Figure 2 of the paper: a valve step that closes at t = 0.45 s, with and without leakage. Draws docs/images/figure2.png.

python examples/figure2.py [PICTURE]
"""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import root

import fisherpoint as fp
from fisherpoint.show.style import CRITERION, NOISE, PRIOR, STYLE, TEXT

HERE = Path(__file__).resolve().parent
STEP = [(0.10, 0.0), (0.35, -0.2), (1.05, 0.0)]  # s, u: closed, open, closed again at 0.45 s; k_u = -1, so u < 0 extends
Q_START, SAMPLE = 0.05, 1e-3  # m, s


def rest_state(model, theta, q):
    """State (5,) of the closed valve: what leaks into the chambers moves the piston so that v and both pressures stay."""
    scale = np.array([1e-3, 1e6, 1e6])

    def rates(z):
        x = np.array([q, *(scale * z), 0.0])
        return model.rhs(x, 0.0, theta)[1:4] / [1.0, 1e6, 1e6]

    solution = root(rates, [1.0, 6.0, 12.0], tol=1e-12)
    if not solution.success:
        raise RuntimeError(f"rest state: expected a solution, given: {solution.message}")
    return np.array([q, *(scale * solution.x), 0.0])


def response(model, theta, x, step=STEP, sample=SAMPLE):
    """Times (N,) and states (N, 5) from x under an input that is held for one duration after the other."""
    times, states = [0.0], [x]
    for duration, u in step:
        dt = np.linspace(0, duration, round(duration / sample) + 1)[1:]
        points = fp.Experiments(np.tile(states[-1], (len(dt), 1)), np.full((len(dt), 1), u), dt)
        done = fp.simulate(model, points, theta, rtol=1e-8)
        if done.status.any():
            raise RuntimeError(fp.Status(done.status.max()).advice)
        times, states = [*times, *(times[-1] + dt)], [*states, *done.x]
    return np.array(times), np.array(states)


def figure(t, full, simplified, rest):
    """The paper's three panels; thin grey in the lowest is the full model again."""
    with mpl.rc_context(STYLE):
        drawn = Figure(figsize=(7.0, 6.0), layout="constrained")
        spool, middle, lower = drawn.subplots(3, 1, sharex=True, height_ratios=[1, 2, 2])
        closes = STEP[0][0] + STEP[1][0]
        spool.plot(t, full[:, 4], color=TEXT, linewidth=1.3)
        spool.set(ylabel="x_v [1]", title="Valve spool", ylim=(-0.03, 0.24))
        for axes, x, title in ((middle, full, "Full model"), (lower, simplified, "Without leakage, c_L = 0")):
            for column, name, color in ((2, "p_A", NOISE), (3, "p_B", CRITERION)):
                if axes is lower:
                    axes.plot(t, full[:, column] / 1e6, color=PRIOR, linewidth=0.7)
                axes.axhline(rest[column] / 1e6, color=color, linestyle=(0, (4, 3)), linewidth=0.8)
                axes.plot(t, x[:, column] / 1e6, color=color, linewidth=1.3)
                axes.annotate(name, (t[-1], x[-1, column] / 1e6), (4, 0), textcoords="offset points", va="center", color=color)
            axes.set(ylabel="pressure [MPa]", title=title, ylim=(0, 14.5))
        for axes in (spool, middle, lower):
            axes.axvline(closes, color=TEXT, linewidth=0.6, linestyle=":")
        lower.annotate("full model", (1.1, 12.2), color=PRIOR, ha="left", va="top")
        lower.set(xlabel="t [s]", xlim=(0, t[-1]))
        middle.annotate("rest state", (0.62, rest[3] / 1e6), (0, 3), textcoords="offset points", color=TEXT)
        return drawn


def main(picture):
    model = fp.load_model(HERE / "figure2.toml")
    theta = dict(model.nominal)
    rest = rest_state(model, theta, Q_START)
    print(f"rest state: v = {1e3 * rest[1]:.3f} mm/s, p_A = {rest[2] / 1e6:.3f} MPa, p_B = {rest[3] / 1e6:.3f} MPa")
    t, full = response(model, theta, rest)
    _, simplified = response(model, theta | {"c_L": 0.0}, rest)
    for name, x in (("full model", full), ("c_L = 0", simplified)):
        later = " and ".join(f"{x[-1, i] / 1e6:.2f} MPa" for i in (2, 3))
        moved = x[-1, 0] - x[np.searchsorted(t, 1.0), 0]
        print(f"{name}: {later} at {t[-1]:.1f} s, moved by {1e3 * moved:.3f} mm in the last {t[-1] - 1:.1f} s")
    figure(t, full, simplified, rest).savefig(picture, dpi=150)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else HERE.parent / "docs" / "images" / "figure2.png")
