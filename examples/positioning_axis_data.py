"""The positioning axis from its measured records: mass, friction and offset by inverse dynamics, checked on another record.

    python examples/positioning_axis_data.py emps_estimation.csv emps_validation_pulses.csv

The force that the drive must have given is a static model of acceleration and velocity; these come from the measured position by a
filter without phase and central differences. Force and regressors are then brought down to 100 Hz by the same filter, so that what
the filter does to one it does to the other. Records and published estimates: A. Janot, M. Gautier, M. Brunot, Data Set and
Reference Models of EMPS, Workshop on Nonlinear System Identification Benchmarks, Eindhoven 2019.
"""

import sys
from pathlib import Path

import numpy as np
from scipy import signal

import fisherpoint as fp

DRIVE_GAIN = 35.15065188  # N/V
RATE = 1000.0  # samples per s
CUTOFF = 100.0  # Hz, of the position's filter
DECIMATION = 10
SETTLING = 200  # samples at either end, which the filters spoil

PUBLISHED = {"M": (95.109, 0.109), "F_v": (203.50, 1.15), "F_c": (20.394, 0.101), "offset": (-3.165, 0.044)}
PUBLISHED_ERROR = 0.0598


@fp.model(
    states={},
    inputs={"a": "m/s^2", "v": "m/s", "direction": "1"},
    parameters={"M": "kg", "F_v": "N s/m", "F_c": "N", "offset": "N"},
    outputs={"force": "N"},
    nominal={"M": 100.0, "F_v": 100.0, "F_c": 10.0, "offset": 0.0},
)
def inverse_axis(x, u, p):
    return [], [p.M * u.a + p.F_v * u.v + p.F_c * u.direction + p.offset]


def measurements(path: Path) -> fp.Measurements:
    """Force, and the motion that it goes with, at 100 Hz."""
    record = np.genfromtxt(path, delimiter=",", names=True)
    numerator, denominator = signal.butter(4, 2 * CUTOFF / RATE)
    velocity = np.gradient(signal.filtfilt(numerator, denominator, record["q_meas_m"]), 1 / RATE)
    columns = [np.gradient(velocity, 1 / RATE), velocity, np.sign(velocity), DRIVE_GAIN * record["v_drive_V"]]
    *motion, force = (signal.decimate(column[SETTLING:-SETTLING], DECIMATION, zero_phase=True) for column in columns)
    return fp.Measurements(fp.Experiments(np.empty((len(force), 0)), np.column_stack(motion)), force)


def relative_error(fit: fp.Fit, data: fp.Measurements) -> float:
    """Norm of what the fit leaves unexplained of another record's force, as a share of the force's."""
    predicted = fp.simulate(inverse_axis, data.points, fit.theta).y
    return float(np.linalg.norm(data.y - predicted) / np.linalg.norm(data.y))


def main(estimation: Path, validation: Path) -> None:
    fit = fp.estimate(inverse_axis, measurements(estimation))
    print("parameter      estimate  std. error   published            difference in published std. errors")
    for name, (value, error) in PUBLISHED.items():
        off = (fit.estimate[name] - value) / error
        print(f"{name:<12}{fit.estimate[name]:>11.3f}{fit.standard_errors[name]:>12.3f}{value:>12.3f} +- {error:<6}{off:>12.2f}")
    error = relative_error(fit, measurements(validation))
    print(f"error of the force on the other record {error:.2%}, published {PUBLISHED_ERROR:.2%}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
