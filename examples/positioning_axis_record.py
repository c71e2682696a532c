"""The positioning axis from its raw record, with its controller as it is programmed: has the axis a dead time?

    python examples/positioning_axis_record.py emps_estimation.csv

The controller computes each millisecond from the last three positions and holds its voltage in between: a state that updates alone
change. Axis and controller are simulated in closed loop from the reference, through every reversal and standstill, and compared
with the voltage that was recorded; nothing is filtered or differentiated. The same with a force that comes 0.5 ms late, and with
friction that is smooth about 1 mm/s. Then pieces of the record in open loop, their starts unknown, with a dead time that is
estimated. Record, controller and published estimates: A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS,
Workshop on Nonlinear System Identification Benchmarks, Eindhoven 2019.
"""

import sys
import warnings
from pathlib import Path

import numpy as np

import fisherpoint as fp

# The velocity is the difference of the last two means of two positions: of the position now and that two milliseconds ago.
VOLTAGE = "max(min(243.45*(160.18*(r - q) - (q - q_2)/(2*T)), 10), -10)"
PARAMETERS = {"M": "kg", "F_v": "N s/m", "F_c": "N", "offset": "N"}
START = {"M": 100.0, "F_v": 200.0, "F_c": 20.0, "offset": 0.0, "tau": 1e-3}
GAIN = (35.15065188, "N/V")

PUBLISHED = {"M": (95.109, 0.109), "F_v": (203.50, 1.15), "F_c": (20.394, 0.101), "offset": (-3.165, 0.044)}


def loop(friction: str = "sign(v)", late: str = "") -> fp.SymbolicModel:
    """The axis in closed loop: u is the voltage, q_1 and q_2 are the positions before; what drives it, w, may come `late`."""
    states = {"q": ("m", 0.1), "v": ("m/s", 0.1), "q_1": ("m", 0.1), "q_2": ("m", 0.1), "u": "V"}
    updates = {"every 1 ms": {"u": VOLTAGE, "q_1": "q", "q_2": "q_1"}}
    if late:
        states, updates = states | {"w": "V"}, updates | {f"every 1 ms from {late}": {"w": "u"}}
    return fp.SymbolicModel(
        f=["v", f"(g*{'w' if late else 'u'} - F_v*v - F_c*{friction} - offset)/M", *["0"] * (len(states) - 2)],
        g=[VOLTAGE],
        states=states,
        inputs={"r": "m"},
        parameters=PARAMETERS,
        outputs={"voltage": "V"},
        constants={"g": GAIN, "T": (1e-3, "s")},
        resets=updates,
    )


def axis(voltage: str) -> fp.SymbolicModel:
    """The axis alone, by how its voltage stands in the equations."""
    return fp.SymbolicModel(
        f=["v", f"(g*{voltage} - F_v*v - F_c*sign(v) - offset)/M"],
        g=["q"],
        states={"q": ("m", 0.1), "v": ("m/s", 0.1)},
        inputs={"u": "V"},
        parameters=PARAMETERS | ({"tau": "s"} if "tau" in voltage else {}),
        outputs={"q": "m"},
        constants={"g": GAIN},
    )


def record(path: Path, model: fp.SymbolicModel) -> fp.Record:
    """Voltages of all samples under the reference, and where the axis starts: at rest."""
    data = np.genfromtxt(path, delimiter=",", names=True)
    positions = dict.fromkeys(("q", "q_1", "q_2"), float(data["q_meas_m"][0]))
    start = {quantity.name: positions.get(quantity.name, 0.0) for quantity in model.states}
    return fp.Record(data["t_s"], data["q_ref_m"], data["v_drive_V"], x0=start)


def pieces(path: Path) -> list[fp.Record]:
    """Positions under the voltage, in pieces of 0.2 s that begin 2.4 s apart."""
    data = np.genfromtxt(path, delimiter=",", names=True)
    whole = fp.Record(data["t_s"], data["v_drive_V"], data["q_meas_m"])
    return [whole[first : first + 200] for first in range(0, len(whole) - 200, 2400)]


def judged(fit: fp.Fit) -> str:
    """How large residuals are, and what they look like."""
    (check,) = fit.residual_checks.values()
    size = np.sqrt(np.mean(fit.residuals**2))
    return f"{size:.3g}, {'white' if check.white else 'not white'}, {check.autocorrelation.values[0]:.2f} from sample to sample"


def estimate(model: fp.SymbolicModel, data: fp.Record | list[fp.Record]) -> fp.Fit:
    start = {quantity.name: START[quantity.name] for quantity in model.parameters}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that residuals are not white, which is printed
        return fp.estimate(model, data, start=start)


def main(path: Path) -> None:
    models = {"at once": loop(), "0.5 ms late": loop(late="0.5 ms"), "smooth": loop("tanh(v/0.001)")}
    fits = {name: estimate(model, record(path, model)) for name, model in models.items()}
    print("in closed loop" + "".join(f"{name:>20}" for name in fits) + "           published")
    for name, (value, error) in PUBLISHED.items():
        found = [f"{fit.estimate[name]:.2f} +- {fit.robust_standard_errors[name]:.2f}" for fit in fits.values()]
        print(f"{name:<14}" + "".join(f"{text:>20}" for text in found) + f"{value:>10.2f} +- {error:.2f}")
    for name, fit in fits.items():
        print(f"{name}: residuals [V] {judged(fit)}")
    for voltage in ("u", "delay(u, tau)"):
        fit = estimate(axis(voltage), pieces(path))
        tau = f", tau = {1e3 * fit.estimate['tau']:.3f} ms" if "tau" in fit.estimate else ""
        print(f"in pieces, with {voltage}: residuals [m] {judged(fit)}{tau}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
