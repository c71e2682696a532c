"""Models given by NumPy functions: the slow path for what cannot be written as equations."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...basics.checks import by_name
from ...basics.messages import shown
from ...basics.quantity import names_of
from ...basics.values import Array
from ...engine.levels import Kernels
from ..quantities import Described, DescribedModel, start_offsets
from . import kernels
from .core import CallableCore, Columns, Function


class CallableModel(DescribedModel):
    """A model x' = f(x, u, theta), y = g(x, u, theta) given by Python functions.

    The functions are called with x (K, n_x), u (K, n_u) and p (K, p), whose columns can be read by name, ``p.k1 * x.h1``; known
    constants are attributes of p. They return an array (K, n), or a list of n entries each a number or (K,).

    Trajectories are integrated one by one with `scipy.integrate.solve_ivp`, on one core, whatever `threads` says. Within long
    steps the functions are looked at 50 times per duration, so that no step goes over what lasts longer than that, such as a bump
    that no stage of the step has seen; this costs a fifth more time. Where one did, steps are kept as short as these looks.
    Sensitivities come from the equations of variation with derivatives of f and g along their directions: by complex step where
    the functions take complex numbers and do not lose them, which is tried once, else by central differences; where rounding may
    cost these a thousandth of a sensitivity, as it does where f is of numbers that are far larger, the status is `step_limit`.
    Just on a jump, or where a slope is infinite on one side, derivatives are those of the side on which the value lies, and at a
    corner differences give the mean of both sides; where neither side has one, the status is `not_finite`. A `UserWarning` at the
    first use says which, and what it costs. Equations (`SymbolicModel`) are a thousand times faster and more.

    Parameters
    ----------
    f : callable or None
        Rates of the states, SI units; None for a model without states.
    g : callable
        Outputs.
    states, inputs, parameters, outputs, constants, name, nominal
        As for `SymbolicModel`.
    jumps, kinks : mapping of name to callable, optional
        What is zero where f jumps, and where it has a corner: functions of x, u, p that return (K,). What is not declared here is
        not seen.
    domain : mapping of name to callable, optional
        What must stay positive.

    Raises
    ------
    TypeError, ValueError
        For a function that fails, or that returns another shape; the message names it.
    """

    def __init__(
        self,
        f: Function | None,
        g: Function,
        states: Described | None,
        inputs: Described | None,
        parameters: Described,
        outputs: Described | None = None,
        *,
        constants: Mapping[str, Any] | None = None,
        domain: Mapping[str, Function] | None = None,
        jumps: Mapping[str, Function] | None = None,
        kinks: Mapping[str, Function] | None = None,
        name: str = "model",
        nominal: Mapping[str, float] | None = None,
    ) -> None:
        self._describe(states, inputs, parameters, {"y": "1"} if outputs is None else outputs, constants, name, nominal)
        if (f is None) != (not self.states):
            raise TypeError(f"f: expected {'a function' if self.states else 'None for a model without states'}, given {shown(f)}")
        self.f, self.g = f, g
        named = {"jumps": jumps, "kinks": kinks, "domain": domain}
        self._given = tuple(by_name(given, None, kind, _checked_function) for kind, given in named.items())
        self.jumps, self.kinks, self.domain = (tuple(of) for of in self._given)
        self.core.check()

    @cached_property
    def core(self) -> CallableCore:
        """The functions, with arrays in and arrays out."""
        return CallableCore(self, self.f, self.g, *self._given)

    @property
    def kernels(self) -> Kernels:
        """Integration by `solve_ivp`."""
        return kernels

    @property
    def in_core(self) -> bool:
        """Whether the compiled core runs the model: Python does."""
        return False

    def free_start(self, *names: str) -> CallableModel:
        """Return the model in which these states start off their x0 by a further parameter each: they come last, nominally 0."""
        offsets = start_offsets(self, names)
        places = tuple(names_of(self.states).index(name) for name in names)

        def shifted(function: Function) -> Function:
            return _Shifted(function, places, names_of(self.states), names_of(self.parameters), self.constants)

        jumps, kinks, domain = ({name: shifted(function) for name, function in of.items()} for of in self._given)
        return CallableModel(
            None if self.f is None else shifted(self.f),
            shifted(self.g),
            self.states,
            self.inputs,
            (*self.parameters, *offsets),
            self.outputs,
            constants=self._given_constants,
            domain=domain,
            jumps=jumps,
            kinks=kinks,
            name=self.name,
            nominal={**self.nominal, **dict.fromkeys(names_of(offsets), 0.0)},
        )

    def to_toml(self) -> str:
        """Refused: functions cannot be written into a file."""
        raise TypeError(f"{self.name}: expected a model with equations, given CallableModel")

    def _check_theta(self, rows: Array) -> None:
        """Nothing is known about parameters."""

    def _identity(self) -> Hashable:
        described = (self.states, self.inputs, self.parameters, self.outputs, self.constant_quantities)
        given = (tuple(of.items()) for of in self._given)  # their order is that of the surfaces
        return (self.name, self.f, self.g, *given, *described, self._constants, self.nominal)

    def __reduce__(self) -> tuple[Any, ...]:
        jumps, kinks, domain = map(dict, self._given)
        options: dict[str, Any] = dict(constants=self._given_constants, name=self.name, nominal=dict(self.nominal))
        options |= dict(domain=domain, jumps=jumps, kinks=kinks)
        return (partial(CallableModel, **options), (self.f, self.g, self.states, self.inputs, self.parameters, self.outputs))


def _checked_function(given: Function, label: str) -> Function:
    if not callable(given):
        raise TypeError(f"{label}: expected a function of x, u, p, given {shown(given)}")
    return given


class _Shifted:
    """A function of a model, with further parameters added to states."""

    def __init__(
        self, function: Function, places: tuple[int, ...], states: tuple[str, ...], parameters: tuple[str, ...], constants: Any
    ) -> None:
        self._function, self._places, self._states = function, places, states
        self._parameters, self._constants = parameters, constants

    def __call__(self, x: Any, u: Any, p: Any) -> Any:
        theta, n = np.asarray(p), len(self._parameters)
        moved = np.asarray(x).astype(np.result_type(x, theta))
        moved[:, list(self._places)] += theta[:, n:]
        return self._function(Columns(moved, self._states), u, Columns(theta[:, :n], self._parameters, self._constants))
