"""A robot joint that obeys 5 ms late: what a fit without the dead time takes for inertia and friction, and one with it.

    python examples/joint_dead_time.py

The joint is simulated: sharp Coulomb friction, gravity, a torque that sweeps and steps, and an encoder that is read each
millisecond. Without a dead time the fit is off by many standard errors, and its residuals say that something is missing.
"""

import warnings

import numpy as np

import fisherpoint as fp

TRUE = {"J": 0.05, "b": 0.1, "F_c": 0.6, "G": 0.3, "tau": 0.005}
START = {"J": 0.06, "b": 0.12, "F_c": 0.5, "G": 0.35, "tau": 0.002}
NOISE = 1e-4  # rad


def joint(torque: str) -> fp.SymbolicModel:
    """The joint, by how its torque stands in the equations."""
    units = {"J": "kg m2", "b": "N m s/rad", "F_c": "N m", "G": "N m", "tau": "s"}
    return fp.SymbolicModel(
        f=["w", f"({torque} - F_c*sign(w) - b*w - G*sin(q))/J"],
        g=["q"],
        states={"q": "rad", "w": "rad/s"},
        inputs={"u": "N m"},
        parameters={name: unit for name, unit in units.items() if name != "tau" or "tau" in torque},
        outputs={"q": "rad"},
    )


def record(model: fp.SymbolicModel) -> fp.Record:
    """Two seconds at 1 kHz, from rest."""
    t = np.arange(2000) / 1000
    u = 1.2 * np.sin(2 * np.pi * (0.8 + 0.8 * t) * t) + 0.6 * np.sign(np.sin(2 * np.pi * 2.3 * t))
    true = fp.simulate_record(model, t, u, TRUE, {"q": 0.0, "w": 0.0}, rtol=1e-8)
    noise = NOISE * np.random.default_rng(0).standard_normal(true.y.shape)
    return fp.Record(t, u, true.y + noise, x0={"q": 0.0, "w": 0.0})


def main() -> None:
    measured = record(joint("delay(u, tau)"))
    for torque in ("u", "delay(u, tau)"):
        model = joint(torque)
        start = {q.name: START[q.name] for q in model.parameters}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that residuals are not white, which is printed below
            fit = fp.estimate(model, measured, start=start)
        print(f"with {torque}: residuals {1e3 * np.sqrt(np.mean(fit.residuals**2)):.3f} times 1e-3 rad,", end=" ")
        print("white" if fit.residual_checks["q"].white else "not white")
        for name, value in fit.estimate.items():
            off = (value - TRUE[name]) / fit.standard_errors[name]
            print(f"  {name:<4}{value:9.5f} +- {fit.standard_errors[name]:.5f}, {off:+.1f} standard errors off")


if __name__ == "__main__":
    main()
