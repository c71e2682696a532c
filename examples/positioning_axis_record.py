"""The positioning axis from its raw record: the axis and its controller are simulated through every reversal and standstill.

    python examples/positioning_axis_record.py emps_estimation.csv

Coulomb friction is taken as it is: where the axis comes to rest it sticks, until the drive overcomes the friction. Nothing is
filtered or differentiated. The axis is simulated in closed loop, from the reference alone, and compared with the voltage that the
controller gave. Beside it stands the same model with tanh(v / 1 mm/s) in place of the sign. Record, controller and published
estimates: A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, Workshop on Nonlinear System Identification
Benchmarks, Eindhoven 2019.
"""

import sys
from pathlib import Path

import numpy as np

import fisherpoint as fp

# The controller takes the velocity from the last two means of two positions: it lags by one sample, which w stands for.
VOLTAGE = "max(min(243.45*(160.18*(r - q) - w), 10), -10)"
LAG = 1e-3  # s

PUBLISHED = {"M": (95.109, 0.109), "F_v": (203.50, 1.15), "F_c": (20.394, 0.101), "offset": (-3.165, 0.044)}


def axis(friction: str) -> fp.SymbolicModel:
    """The axis in closed loop; the reference r is known by its slope, so that it runs straight from sample to sample."""
    return fp.SymbolicModel(
        f=["v", f"(g*{VOLTAGE} - F_v*v - F_c*{friction} - offset)/M", "(v - w)/lag", "slope"],
        g=[VOLTAGE],
        states={"q": ("m", 0.1), "v": ("m/s", 0.1), "w": ("m/s", 0.1), "r": ("m", 0.1)},
        inputs={"slope": "m/s"},
        parameters={"M": "kg", "F_v": "N s/m", "F_c": "N", "offset": "N"},
        outputs={"u": "V"},
        constants={"g": (35.15065188, "N/V"), "lag": (LAG, "s")},
        nominal={"M": 100.0, "F_v": 100.0, "F_c": 10.0, "offset": 0.0},
    )


def record(path: Path) -> fp.Record:
    """Voltages of all samples, and where the axis starts: at rest."""
    data = np.genfromtxt(path, delimiter=",", names=True)
    slope = np.append(np.diff(data["q_ref_m"]) / np.diff(data["t_s"]), 0.0)
    start = {"q": float(data["q_meas_m"][0]), "v": 0.0, "w": 0.0, "r": float(data["q_ref_m"][0])}
    return fp.Record(data["t_s"], slope, data["v_drive_V"], x0=start)


def main(path: Path) -> None:
    measured = record(path)
    fits = {name: fp.estimate(axis(law), measured) for name, law in (("sharp", "sign(v)"), ("smooth", "tanh(v/0.001)"))}
    print("parameter        sharp     smooth   published")
    for name, (value, error) in PUBLISHED.items():
        print(f"{name:<10}" + "".join(f"{fit.estimate[name]:>11.3f}" for fit in fits.values()) + f"{value:>12.3f} +- {error}")
    for name, fit in fits.items():
        print(f"{name}: the voltage of {len(measured)} samples to {np.sqrt(np.mean(fit.residuals**2)):.4f} V")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
