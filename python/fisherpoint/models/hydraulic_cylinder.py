"""The servo-hydraulic cylinder of the paper, compiled into the core."""

from __future__ import annotations

import copy
from collections.abc import Hashable, Mapping
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from ..basics.checks import as_float, as_positive, by_name
from ..basics.messages import shown
from ..basics.quantity import Quantity, names_of
from ..basics.values import Array, FrozenMapping
from ..engine import _core
from .base import Model, quantities
from .model_to_toml import cylinder_toml

if TYPE_CHECKING:
    from .symbolic import SymbolicModel


class HydraulicCylinder(Model):
    """Servo-hydraulic cylinder, eq. (19) of Dietrich, Raatz and Hesselbach.

    Every known constant can be given by keyword, in SI units; the defaults are a 50/36 mm cylinder with a two-stage servo valve.
    The friction makes f jump at v = 0, the valve gives it a kink at x_v = 0, and the pressures must stay between tank and supply.
    With `smooth`, tanh takes the place of sign and Heaviside function, so that trajectories may start, rest and turn round there.

    Parameters
    ----------
    A_A, A_B : float
        Piston areas, m2.
    q_min, q_max : float
        Ends of the stroke, m.
    p_s : float
        Supply pressure, Pa.
    T_1 : float
        Time constant of the valve, s.
    k_u : float
        Valve polarity in x_v' = (k_u u - x_v) / T_1; -1 is the paper's print, +1 the usual.
    smooth : mapping of "v" and "x_v" to float, optional
        Widths w, m/s and 1, of the transitions that replace the jump and the kink: sign(v) becomes tanh(v/w), and H(x_v) becomes
        (1 + tanh(x_v/w))/2. What is not named stays sharp. Friction then holds nothing still: under a force F < a_tau the piston
        creeps at w artanh(F/a_tau). Such a model is interpreted by the core; `compile` makes it faster.

    Raises
    ------
    TypeError
        For a constant that does not exist.
    ValueError
        For a constant that is not finite or makes no physical sense, or a width that is not positive.
    """

    constant_quantities = (
        Quantity("A_A", "m2", "piston area of chamber A"),
        Quantity("A_B", "m2", "piston area of chamber B"),
        Quantity("q_min", "m", "lower end of the stroke"),
        Quantity("q_max", "m", "upper end of the stroke"),
        Quantity("p_s", "Pa", "supply pressure"),
        Quantity("T_1", "s", "time constant of the valve"),
        Quantity("k_u", "1", "valve polarity"),
    )
    name = _core.HydraulicCylinder.name
    states = quantities(_core.HydraulicCylinder.states)
    inputs = quantities(_core.HydraulicCylinder.inputs)
    outputs = quantities(_core.HydraulicCylinder.outputs)
    parameters = quantities(_core.HydraulicCylinder.parameters)
    jumps: tuple[str, ...] = tuple(_core.HydraulicCylinder.jumps)
    kinks: tuple[str, ...] = tuple(_core.HydraulicCylinder.kinks)
    domain: tuple[str, ...] = tuple(_core.HydraulicCylinder.domain)
    nominal: Mapping[str, float] = FrozenMapping(
        {
            "a_tau": 400.0,
            "b_tau": 1500.0,
            "m_q": 150.0,
            "E_oil": 1.2e9,
            "p_t": 0.5e6,
            "B_v": 1.782e-7,
            "c_L": 2.5e-9,
            "V_0A": 5e-5,
            "V_0B": 4e-5,
        }
    )

    def __init__(self, *, smooth: Mapping[str, float] | None = None, **constants: float) -> None:
        known = names_of(self.constant_quantities)
        for unknown in (name for name in constants if name not in known):
            raise TypeError(f"HydraulicCylinder: expected constants {', '.join(known)}; given unknown {shown(unknown)}")
        self._core = _core.HydraulicCylinder(**{name: as_float(value, name) for name, value in constants.items()})
        for name in ("A_A", "A_B", "p_s", "T_1"):
            if not getattr(self._core, name) > 0:
                raise ValueError(f"{name}: expected a positive number, given {getattr(self._core, name)}")
        if not self._core.q_min < self._core.q_max:
            raise ValueError(f"q_max: expected more than q_min = {self._core.q_min}, given {self._core.q_max}")
        surfaces = (*type(self).jumps, *type(self).kinks)
        self.smooth = by_name(smooth, surfaces, "smooth", partial(as_positive, what="width"))
        self.jumps, self.kinks = (tuple(name for name in names if name not in self.smooth) for names in (self.jumps, self.kinks))
        self.crossable = self.jumps

    @property
    def core(self) -> Any:
        """The compiled model; of the smooth form its equations, as the kernels interpret them."""
        return self._equations.core if self.smooth else self._core

    @property
    def constants(self) -> Mapping[str, float]:
        """The known constants by name, SI units."""
        return FrozenMapping({name: float(getattr(self._core, name)) for name in names_of(self.constant_quantities)})

    @property
    def least(self) -> Mapping[str, float]:
        """Zero for every parameter."""
        return FrozenMapping(dict.fromkeys(names_of(self.parameters), 0.0))

    def _check_theta(self, rows: Array) -> None:
        names = names_of(self.parameters)
        for name, lowest in zip(names, rows.min(axis=0).tolist(), strict=True):
            positive = name in ("m_q", "E_oil", "B_v", "V_0A", "V_0B")
            if lowest < 0 or (positive and lowest == 0):
                raise ValueError(f"{name}: expected a {'positive' if positive else 'non-negative'} number, given {lowest:g}")
        p_t = rows[:, names.index("p_t")].max()
        if not p_t < self._core.p_s:
            raise ValueError(f"p_t: expected less than the supply pressure p_s = {self._core.p_s:g} Pa, given {p_t:g} Pa")

    def compile(self) -> HydraulicCylinder:
        """Return the cylinder with kernels compiled for it: itself where it is sharp, else see `SymbolicModel.compile`."""
        if not self.smooth:
            return self
        compiled = copy.copy(self)
        compiled.__dict__["_equations"] = self._equations.compile()
        return compiled

    @property
    def compiled(self) -> bool:
        """True for the sharp form, as the core has its kernels."""
        return not self.smooth or self._equations.compiled

    def symbolic(self) -> SymbolicModel:
        """The cylinder as equations, whose constants and parameters can be exchanged."""
        return self._equations

    @cached_property
    def _equations(self) -> SymbolicModel:
        from .cylinder_equations import symbolic_cylinder

        return symbolic_cylinder(self, self.smooth)

    def to_toml(self) -> str:
        """The model as the table [model] of a TOML file; `load_model` reads it back."""
        return cylinder_toml(self, self.smooth)

    def _identity(self) -> Hashable:
        return (self.name, *self.constants.values(), *self.smooth.items())

    def __reduce__(self) -> tuple[Any, ...]:
        kernels = {"_equations": self._equations} if self.smooth and self.compiled else None
        return partial(type(self), smooth=dict(self.smooth), **self.constants), (), kernels

    def __repr__(self) -> str:
        given = [f"{name}={value!r}" for name, value in self.constants.items()]
        return f"HydraulicCylinder({', '.join([*given, *([f'smooth={dict(self.smooth)}'] if self.smooth else [])])})"


MODELS: dict[str, type[HydraulicCylinder]] = {HydraulicCylinder.name: HydraulicCylinder}
"""Models that come with the package, by name."""
