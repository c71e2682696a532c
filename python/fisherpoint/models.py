"""Models: the named quantities and functions of x' = f(x, u, theta), y = g(x, u, theta)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from .quantity import Array, FrozenMapping, Quantity, as_float, as_floats, in_order, names_of


def _quantities(described: Iterable[tuple[str, str, str, float]]) -> tuple[Quantity, ...]:
    return tuple(Quantity(name, unit, description) for name, unit, description, _ in described)


class HydraulicCylinder:
    """Servo-hydraulic cylinder, eq. (19) of Dietrich, Raatz and Hesselbach.

    Every known constant can be given by keyword, in SI units; the defaults are a 50/36 mm cylinder with a two-stage servo valve.
    The friction makes f jump at v = 0, the valve gives it a kink at x_v = 0, and the pressures must stay between tank and supply.

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

    Raises
    ------
    TypeError
        For a constant that does not exist.
    ValueError
        For a constant that is not finite or makes no physical sense.
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
    states = _quantities(_core.HydraulicCylinder.states)
    inputs = _quantities(_core.HydraulicCylinder.inputs)
    outputs = _quantities(_core.HydraulicCylinder.outputs)
    parameters = _quantities(_core.HydraulicCylinder.parameters)
    jumps: tuple[str, ...] = tuple(_core.HydraulicCylinder.jumps)
    kinks: tuple[str, ...] = tuple(_core.HydraulicCylinder.kinks)
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

    def __init__(self, **constants: float) -> None:
        known = names_of(self.constant_quantities)
        for unknown in (name for name in constants if name not in known):
            raise TypeError(f"HydraulicCylinder: expected constants {', '.join(known)}; given unknown {unknown!r}")
        self.core = _core.HydraulicCylinder(**{name: as_float(value, name) for name, value in constants.items()})
        for name in ("A_A", "A_B", "p_s", "T_1"):
            if not getattr(self.core, name) > 0:
                raise ValueError(f"{name}: expected a positive number, given {getattr(self.core, name)}")
        if not self.core.q_min < self.core.q_max:
            raise ValueError(f"q_max: expected more than q_min = {self.core.q_min}, given {self.core.q_max}")

    @property
    def constants(self) -> Mapping[str, float]:
        """The known constants by name, SI units."""
        return FrozenMapping({name: float(getattr(self.core, name)) for name in names_of(self.constant_quantities)})

    def rhs(self, x: ArrayLike, u: ArrayLike, theta: Mapping[str, float] | ArrayLike) -> Array:
        """Right-hand side f(x, u, theta) of (19a).

        Parameters
        ----------
        x : array_like, (n_x,) or (K, n_x)
        u : array_like, (n_u,) or (K, n_u); a scalar for a single input
        theta : mapping by name, or array_like (p,) or (K, p)

        Returns
        -------
        ndarray, (n_x,) or (K, n_x)
            State derivatives in SI units. At v = 0 the Coulomb friction is zero.

        Raises
        ------
        ValueError
            For wrong shapes, non-finite numbers, or a state outside the domain of the square roots.
        """
        return self._map(self.core.rhs, x, u, theta)

    def output(self, x: ArrayLike, u: ArrayLike, theta: Mapping[str, float] | ArrayLike) -> Array:
        """Output g(x, u, theta) of (19b); shapes as in `rhs`, with n_y in the place of n_x."""
        return self._map(self.core.output, x, u, theta)

    def theta(self, values: Mapping[str, float] | ArrayLike) -> Array:
        """Return parameters as an array in the order of (20), (p,) or (K, p), after a check of their physical sense.

        Raises
        ------
        ValueError
            Where a parameter is missing, not finite, negative, or p_t is not below p_s.
        """
        names = names_of(self.parameters)
        array = in_order(values, names, "theta") if isinstance(values, Mapping) else as_floats(values, "theta")
        if array.ndim not in (1, 2) or array.shape[-1] != len(names):
            raise ValueError(f"theta: expected shape ({len(names)},) or (K, {len(names)}), given {array.shape}")
        rows = np.atleast_2d(array)
        if not len(rows):
            return array
        for name, lowest in zip(names, rows.min(axis=0).tolist(), strict=True):
            positive = name in ("m_q", "E_oil", "B_v", "V_0A", "V_0B")
            if lowest < 0 or (positive and lowest == 0):
                raise ValueError(f"{name}: expected a {'positive' if positive else 'non-negative'} number, given {lowest:g}")
        p_t = rows[:, names.index("p_t")].max()
        if not p_t < self.core.p_s:
            raise ValueError(f"p_t: expected less than the supply pressure p_s = {self.core.p_s:g} Pa, given {p_t:g} Pa")
        return array

    def switching(self, x: ArrayLike, u: ArrayLike, theta: Array) -> Array:
        """Values of the surfaces where f is not smooth, jumps then kinks: (K, number of surfaces)."""
        return self._map(self.core.switching, x, u, theta)

    def _map(self, function: Any, x: ArrayLike, u: ArrayLike, theta: Mapping[str, float] | ArrayLike) -> Array:
        x, theta = as_floats(x, "x"), self.theta(theta)
        u = as_floats(u, "u")
        single = x.ndim == 1 and theta.ndim == 1 and u.ndim <= 1
        if x.ndim not in (1, 2) or x.shape[-1] != len(self.states):
            raise ValueError(f"x: expected shape ({len(self.states)},) or (K, {len(self.states)}), given {x.shape}")
        if u.ndim == 0:
            u = u.reshape(1)
        if u.ndim not in (1, 2) or u.shape[-1] != len(self.inputs):
            raise ValueError(f"u: expected shape ({len(self.inputs)},) or (K, {len(self.inputs)}), given {u.shape}")
        try:
            (count,) = np.broadcast_shapes(*(a.shape[:-1] for a in (x, u, theta)), (1,))
        except ValueError as error:
            raise ValueError(f"x, u, theta: expected one number of rows, given {x.shape}, {u.shape}, {theta.shape}") from error
        x, u, theta = (np.ascontiguousarray(np.broadcast_to(a, (count, a.shape[-1]))) for a in (x, u, theta))
        result: Array = function(x, u, theta)
        if not np.isfinite(result).all():
            limits = self.core.limits(x, u, theta)
            row = int(np.argwhere(~np.isfinite(result).all(axis=1))[0, 0])
            if (limits[row] > 0).all():
                raise ValueError(f"x: expected a state at which the model has a finite value, given x = {x[row]} in row {row}")
            crossed = [name for name, value in zip(_core.HydraulicCylinder.domain, limits[row], strict=True) if not value > 0]
            raise ValueError(f"x: expected {' > 0, '.join(crossed)} > 0, given x = {x[row]} in row {row}")
        return result[0] if single else result

    def __eq__(self, other: object) -> bool:
        return isinstance(other, HydraulicCylinder) and self.constants == other.constants

    def __hash__(self) -> int:
        return hash((self.name, *self.constants.values()))

    def __reduce__(self) -> tuple[Any, ...]:
        return (_rebuild, (type(self), dict(self.constants)))

    def __repr__(self) -> str:
        return f"HydraulicCylinder({', '.join(f'{name}={value!r}' for name, value in self.constants.items())})"


def _rebuild(kind: type[HydraulicCylinder], constants: dict[str, float]) -> HydraulicCylinder:
    return kind(**constants)


MODELS = {HydraulicCylinder.name: HydraulicCylinder}
