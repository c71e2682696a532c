"""Numbers in another unit than the model's are converted, alike in TOML, CSV and Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.file.configuration import ConfigError, load_config

HEATER = """
[model]
name = "heater"
[model.states]
T = { unit = "K", scale = 300.0 }
[model.inputs]
P = "W"
[model.parameters]
C = "J/K"
T_a = { unit = "K", description = "of the room" }
[model.constants]
G = { value = 2.0, unit = "W/K" }
[model.outputs]
T = "K"
[model.equations]
T = "(P - G*(T - T_a))/C"
"""

IN_SI = """
[prior]
C = { mean = 1500.0, relative_std = 0.1 }
T_a = { mean = 294.15, std = 2.0 }
[noise]
T = 0.05
[uncertain]
G = 0.01
[initial_state_std]
T = 0.1
[region]
T = [293.15, 353.15]
P = [0.0, 200.0]
dt = [60.0, 7200.0]
"""

IN_OTHERS = """
[prior]
C = { mean = 1.5, relative_std = 0.1, unit = "kJ/K" }
T_a = { mean = 21.0, std = 2.0, unit = "degC" }
[noise]
T = { std = 50.0, unit = "mK" }
[uncertain]
G = { value = 10.0, unit = "mW/K" }
[initial_state_std]
T = { value = 0.1, unit = "degC" }
[region]
T = { bounds = [20.0, 80.0], unit = "°C" }
P = { bounds = [0.0, 0.2], unit = "kW" }
dt = { bounds = [1.0, 120.0], unit = "min" }
"""


def problem(tmp_path: Path, tables: str) -> fp.DesignProblem:
    path = tmp_path / "heater.toml"
    path.write_text(HEATER + tables)
    return load_config(path).problem()


def test_a_file_in_other_units_is_the_same_problem(tmp_path: Path) -> None:
    of, to = problem(tmp_path, IN_OTHERS), problem(tmp_path, IN_SI)
    for name in ("mean", "std"):
        assert dict(getattr(of.prior, name)) == pytest.approx(dict(getattr(to.prior, name)), rel=1e-15)
    for name in ("noise", "uncertain", "initial_state_std"):
        assert dict(getattr(of, name) or {}) == pytest.approx(dict(getattr(to, name) or {}), rel=1e-15), name
    for name, bounds in dict(to.region.bounds).items():
        assert of.region.bounds[name] == pytest.approx(bounds, rel=1e-15), name


def test_a_table_of_points_in_other_units_is_the_same(tmp_path: Path) -> None:
    model = problem(tmp_path, IN_SI).model
    path = tmp_path / "points.csv"
    path.write_text("T [degC],P [kW],dt [min],y_T [°C]\n20,0.1,10,35.5\n")
    data = fp.Measurements.from_table(path, model)
    assert data.points.table == pytest.approx(np.array([[293.15, 100.0, 600.0]]))
    assert data.y == pytest.approx(np.array([[308.65]]))


def test_a_constant_of_the_built_in_model_is_converted(tmp_path: Path) -> None:
    text = (Path(__file__).resolve().parents[2] / "examples" / "cylinder.toml").read_text()
    area = fp.HydraulicCylinder().constants["A_A"]
    line = next(line for line in text.splitlines() if line.startswith("A_A"))
    path = tmp_path / "cylinder.toml"
    path.write_text(text.replace(line, f'A_A = {{ value = {1e4 * area!r}, unit = "cm2" }}'))
    assert load_config(path).build_model().constants["A_A"] == pytest.approx(area, rel=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "kJ/K"', 'unit = "kJ"', "prior.C.unit: .* 'J/K', given 'kJ', .*something else: kg m2/s2, not kg m2/(s2 K)"),
        ('unit = "mK"', 'unit = "mV"', r"noise.T.unit: .* 'K', given 'mV', .*: kg m2/(s3 A), not K"),
        ('unit = "min"', 'unit = "foot"', "region.dt.unit: expected a unit such as .*unknown unit 'foot'"),
        ("std = 2.0", "relative_std = 0.1", "T_a.relative_std: expected std for a parameter in K that is given in degC"),
    ],
)
def test_what_cannot_be_converted_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in IN_OTHERS
    pattern = message.replace("(s", r"\(s").replace(" K)", r" K\)").replace("A)", r"A\)")
    with pytest.raises(ConfigError, match=pattern):
        problem(tmp_path, IN_OTHERS.replace(old, new))


def test_numbers_are_converted_in_python() -> None:
    assert fp.convert_unit(90.0, "min", "h") == 1.5
    assert fp.convert_unit([20.0, 80.0], "degC", "K") == pytest.approx([293.15, 353.15])
    assert fp.convert_unit(2.0, " degC", "K", width=True) == 2.0 and fp.convert_unit(2.0, " degC", "K") == 275.15
    with pytest.raises(ValueError, match=r"^given: expected a unit of what is in 'kg', given 'N', which measures something else"):
        fp.convert_unit(1.0, "N", "kg")
