"""What every model is: named quantities, the functions f and g, and where they are smooth and defined."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_floats, in_order
from ..basics.quantity import DURATION, Quantity, names_of
from ..basics.values import Array, FrozenMapping
from ..engine.levels import Kernels, kernels
from .tape.update import UpdateTimes

if TYPE_CHECKING:
    from .dependence import Dependence


def quantities(described: Iterable[tuple[str, str, str, float]]) -> tuple[Quantity, ...]:
    """Quantities as the core describes them."""
    return tuple(Quantity(name, unit, text, scale=scale) for name, unit, text, scale in described)


class Model(ABC):
    """A state space model x' = f(x, u, theta), y = g(x, u, theta); without states it is y = g(u, theta).

    Attributes
    ----------
    name : str
    states, inputs, outputs, parameters, constant_quantities : tuple of Quantity
    constants : mapping of name to float
        Values of the known constants, SI units.
    nominal : mapping of name to float
        A usual value of each parameter; empty where none is known.
    jumps, kinks : tuple of str
        What is zero where f itself jumps, and where f has a corner.
    crossable : tuple of str
        The jumps that trajectories can cross or slide along: none of a `CallableModel`, and none that another condition reads.
    domain : tuple of str
        What must stay positive so that f and g have a value, and limits along the way.
    along : tuple of str
        Limits along the way, see `within`; in `domain` too, each as it was written.
    offsets : mapping of parameter name to state name
        By what states start off their x0, see `free_start`.
    poles : tuple of str
        The first of `domain`: divisors and the like, which may have either sign but must not change it.
    clock : sympy.Symbol or None
        The time since the start, where equations read it.
    delays : mapping of input name to str or float
        The dead times of inputs: the name of a parameter or a known constant, or a number, s.
    late_outputs : mapping of output name to str or float
        The delays of outputs that show the states as they were before, in the same way.
    latches : int
        How many conditions equations remember, see `fisherpoint.math.latch`.
    """

    name: str
    states: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    constant_quantities: tuple[Quantity, ...] = ()
    jumps: tuple[str, ...] = ()
    kinks: tuple[str, ...] = ()
    domain: tuple[str, ...] = ()
    poles: tuple[str, ...] = ()
    crossable: tuple[str, ...] = ()
    clock: Any = None
    latches: int = 0
    updates: tuple[UpdateTimes, ...] = ()
    along: tuple[str, ...] = ()
    delays: Mapping[str, str | float] = FrozenMapping({})
    late_outputs: Mapping[str, str | float] = FrozenMapping({})
    offsets: Mapping[str, str] = FrozenMapping({})
    nominal: Mapping[str, float] = FrozenMapping({})

    @property
    @abstractmethod
    def core(self) -> Any:
        """The model as the compiled kernels take it."""

    @property
    @abstractmethod
    def constants(self) -> Mapping[str, float]:
        """The known constants by name, SI units."""

    @cached_property
    def states_without_size(self) -> tuple[int, ...]:
        """Places of the states whose natural size (`Quantity.scale`) is not stated."""
        return tuple(i for i, quantity in enumerate(self.states) if quantity.scale is None)

    @property
    def kernels(self) -> Kernels:
        """What runs `core`: the compiled kernels for this machine."""
        return kernels

    @property
    def in_core(self) -> bool:
        """Whether the compiled kernels run it; functions of Python take thousands of times as long."""
        return True

    @abstractmethod
    def _identity(self) -> Hashable:
        """What two equal models share."""

    def at(self, x: Array, t: Any) -> Array:
        """States (..., n_x) at the times t (...) as `core` and `kernels` take them: t counts where equations read it."""
        return x

    @property
    def least(self) -> Mapping[str, float]:
        """The least value of each parameter that has one, such as a mass; names of parameters only."""
        return {}

    @property
    def delay_columns(self) -> Mapping[str, int]:
        """Places, among the parameters, of the dead times that are parameters, by the delayed inputs."""
        return self._columns_of(self.delays)

    @property
    def late_columns(self) -> Mapping[str, int]:
        """Places, among the parameters, of the delays that are parameters, by the late outputs."""
        return self._columns_of(self.late_outputs)

    def _columns_of(self, times: Mapping[str, str | float]) -> Mapping[str, int]:
        places = {name: i for i, name in enumerate(names_of(self.parameters))}
        return {name: places[tau] for name, tau in times.items() if isinstance(tau, str) and tau in places}

    @property
    def divides_segments(self) -> bool:
        """Whether segments of runs are divided, where inputs switch late, states are updated, or late outputs are read."""
        return bool(self.delays or self.updates or self.late_outputs)

    @property
    def axes(self) -> tuple[Quantity, ...]:
        """What an experiment point consists of: states, inputs and, where there is a state, the duration dt."""
        return (*self.states, *self.inputs, *((DURATION,) if self.states else ()))

    def rhs(self, x: ArrayLike, u: ArrayLike, theta: Mapping[str, float] | ArrayLike) -> Array:
        """Right-hand side f(x, u, theta), at the start where equations read the time.

        Parameters
        ----------
        x : array_like, (n_x,) or (K, n_x)
        u : array_like, (n_u,) or (K, n_u); a scalar for a single input
        theta : mapping by name, or array_like (p,) or (K, p)

        Returns
        -------
        ndarray, (n_x,) or (K, n_x)
            State derivatives in SI units. On a switching surface that is written as sign or heaviside, their value there.

        Raises
        ------
        ValueError
            For wrong shapes, non-finite numbers, or a state outside the domain.
        """
        return self._map(self.core.rhs, x, u, theta)

    def output(self, x: ArrayLike, u: ArrayLike, theta: Mapping[str, float] | ArrayLike) -> Array:
        """Output g(x, u, theta); shapes as in `rhs`, with n_y instead of n_x."""
        return self._map(self.core.output, x, u, theta)

    def switching(self, x: ArrayLike, u: ArrayLike, theta: Array) -> Array:
        """Values of the surfaces where f is not smooth, jumps then kinks: (K, number of surfaces)."""
        return self._map(self.core.switching, x, u, theta)

    def limits(self, x: ArrayLike, u: ArrayLike, theta: Array) -> Array:
        """Values of what must stay positive, in the order of `domain`: (K, number of limits)."""
        return self._map(self.core.limits, x, u, theta)

    def theta(self, values: Mapping[str, float] | ArrayLike) -> Array:
        """Return parameters as an array in the order of `parameters`, (p,) or (K, p), after a check of their sense.

        Raises
        ------
        ValueError
            Where a parameter is missing, not finite, or one with which the model has no value.
        """
        names = names_of(self.parameters)
        array = in_order(values, names, "theta") if isinstance(values, Mapping) else as_floats(values, "theta")
        if array.ndim not in (1, 2) or array.shape[-1] != len(names):
            raise ValueError(f"theta: expected shape ({len(names)},) or (K, {len(names)}), given {array.shape}")
        if array.size:
            self._check_theta(np.atleast_2d(array))
        return array

    def symbolic(self) -> Model:
        """The model as equations.

        Raises
        ------
        TypeError
            Where it has none.
        """
        raise TypeError(f"{self.name}: expected a model with equations, given {type(self).__name__}")

    def estimate(self, *names: str) -> Model:
        """Return the model with known constants made parameters; their values become nominal ones."""
        return self.symbolic().estimate(*names)

    def fix(self, **values: float) -> Model:
        """Return the model with parameters made known constants of these values, SI units."""
        return self.symbolic().fix(**values)

    def compile(self) -> Model:
        """Return the model with kernels compiled for it; itself where it has them or cannot have them."""
        return self

    @property
    def compiled(self) -> bool:
        """Whether the kernels are compiled for this model."""
        return False

    def free_start(self, *names: str) -> Model:
        """Return the model in which these states start off their x0 by a further parameter each: they come last, nominally 0.

        Its sensitivities by these parameters are those by the start.
        """
        return self.symbolic().free_start(*names)

    def within(self, *limits: str) -> Model:
        """Return the model with limits that its states keep on the way; the built-in cylinder becomes one of equations."""
        return self.symbolic().within(*limits)

    def limit_text(self, place: int) -> str:
        """The condition of a limit: "h > 0", "h other than 0" of a pole, a limit along the way as it was written."""
        name = self.domain[place]
        return name if name in self.along else f"{name} other than 0" if place < len(self.poles) else f"{name} > 0"

    @property
    def reaches(self) -> Mapping[str, tuple[str, ...]]:
        """For each parameter the outputs that it reaches, directly or through states, by the structure of the equations."""
        return self._dependence.reaches

    @property
    def states_by_parameters(self) -> NDArray[np.bool_] | None:
        """Which states depend on which parameters in the end (n_x, p), as kernels take it; None where that is not known here."""
        return None

    @property
    def idle(self) -> tuple[str, ...]:
        """Parameters that reach no output."""
        return self._dependence.idle

    @property
    def blocks(self) -> tuple[tuple[str, ...], ...]:
        """Groups of parameters that can be identified independently of each other, by the equations.

        A state is known where the measured outputs determine it, such as one that is an output, v in q' = v with q known, and
        the pose of a platform on legs whose lengths are measured. Rates of known states are equations in parameters and
        in what is not known, and parameters belong together where these do not separate: rates of a body in six directions
        separate the frictions of its six legs. What the outputs leave open is open within a block. This holds for outputs that
        are measured without gap or error, locally and generically, not for a design: see `fisherpoint.models.blocks` for
        the rule, and `fisherpoint.identifiability` for what a region shows.
        """
        return self._dependence.blocks

    @property
    def shown_states(self) -> Mapping[str, str]:
        """For each state that is an output as it is, by its equation, the first such output."""
        return self._dependence.shown_states

    @property
    def direct_inputs(self) -> Mapping[str, tuple[str, ...]]:
        """For each output the inputs that its equation reads: it jumps where they do."""
        return self._dependence.direct_inputs

    @property
    def _dependence(self) -> Dependence:
        """What depends on what in the equations."""
        return self.symbolic()._dependence

    @abstractmethod
    def to_toml(self) -> str:
        """The model as the table [model] of a TOML file; `load_model` reads it back."""

    @abstractmethod
    def _check_theta(self, rows: Array) -> None:
        """Raise where one of the rows (K, p), K > 0, makes no sense."""

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
            self._refuse_outside(int(np.argwhere(~np.isfinite(result).all(axis=1))[0, 0]), x, u, theta)
        return result[0] if single else result

    def _refuse_outside(self, row: int, x: Array, u: Array, theta: Array) -> None:
        """Raise for a row at which the model has no finite value."""
        limits = self.core.limits(x, u, theta)[row]
        given = f"given x = {x[row]}, u = {u[row]} in row {row}"
        pole = np.arange(len(self.domain)) < len(self.poles)
        crossed = [self.limit_text(int(m)) for m in np.flatnonzero(np.where(pole, limits == 0, ~(limits > 0)))]
        if not crossed:
            raise ValueError(f"x: expected a state at which the model has a finite value, {given}")
        raise ValueError(f"x: expected {', '.join(crossed)}; {given}")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and type(self) is type(other) and self._identity() == other._identity()

    def __hash__(self) -> int:
        return hash(self._identity())
