"""Random models as texts, with points, priors and rules: what the campaign draws.

A rate is written in quantities of the order of one, such as ``(x1/1e+06)``, times its own size by the time scale. So the same
shapes come at all scales, and a case that Hypothesis has made small reads as one would write it by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from hypothesis import strategies as st

import fisherpoint as fp
from reading import Floats, Reading

NUMBERS = ("1", "2", "0.5", "3", "0.1", "5", "0.98", "1.2", "20")
EDGES = ("1", "0.5", "0.98", "0", "1.2", "0.02", "1.7", "-0.3", "5")  # where a state that is of the order of one may pass
RULES = (
    "TensorGrid(3, span=1.5)",
    "SparseGaussHermite(2)",
    "GaussHermite(3)",
    "Unscented()",
    "Sobol(64)",
    "LinearizedRule()",
    "SparseGaussHermite(3)",
    "TensorGrid(2, span=1.0)",
    "TensorGrid(edges=[-2, -0.7, 0.4, 1, 3])",
    "Sobol(1024, seed=3)",
    "GaussHermite(5)",
)
ALSO = (
    "",
    "bits",
    "record",
    "levels",
    "callable",
    "floats",
    "nice",
    "nice",
    "definitions",
    "delay",
    "late",
    "updates",
    "sampling",
    "shared",
    "noise",
    "runs",
    "runs",
    "runs",
    "kinds",
    "kinds",
    "kinds",
)
POWERS = (0, 0, 0, 0, -3, 6, -6, 3, 9, -9, 12, -12)  # of ten, of states, inputs and parameters


@dataclass(frozen=True)
class Case:
    """A model in words, and what is asked of it. States, inputs and parameters are numbers near 1 times their sizes."""

    rates: tuple[str, ...]
    outputs: tuple[str, ...]
    state_sizes: tuple[float, ...]
    input_sizes: tuple[float, ...]
    parameter_sizes: tuple[float, ...]
    constants: tuple[tuple[str, float], ...] = ()
    time: float = 1.0
    duration: tuple[float, float] = (0.1, 1.0)  # shortest and longest, in units of `time`
    low: float = 0.1  # of states and inputs, in units of their sizes; the highest is 2
    relative_std: tuple[float, ...] = (0.1,)
    log: tuple[bool, ...] = (False,)
    correlation: float = 0.0  # of neighbouring parameters
    rule: str = RULES[0]
    seed: int = 0
    grid: bool = False  # states, inputs and times are multiples of a tenth of their sizes, parameters those of the prior's mean
    also: str = ""  # what else is checked: see `rounds.checked`

    @property
    def states(self) -> tuple[str, ...]:
        return _names("x", self.state_sizes)

    @property
    def inputs(self) -> tuple[str, ...]:
        return _names("u", self.input_sizes)

    @property
    def parameters(self) -> tuple[str, ...]:
        return _names("p", self.parameter_sizes)

    @property
    def sizes(self) -> Floats:
        return np.array(self.state_sizes)

    def reading(self) -> Reading:
        return Reading(self.rates, self.outputs, self.states, self.inputs, self.parameters, dict(self.constants))

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments of `fp.SymbolicModel`."""
        return {
            "f": list(self.rates),
            "g": list(self.outputs),
            "states": {name: "1" if size == 1 else ("1", size) for name, size in zip(self.states, self.state_sizes, strict=True)},
            "inputs": dict.fromkeys(self.inputs, "1"),
            "parameters": dict.fromkeys(self.parameters, "1"),
            "constants": {name: (value, "1") for name, value in self.constants},
        }

    def model(self) -> fp.SymbolicModel:
        return fp.SymbolicModel(**self.arguments())

    def points(self, count: int) -> tuple[fp.Experiments, Floats]:
        """Random points and parameters (count, p) about the prior's mean."""
        rng = np.random.default_rng(self.seed)
        shape = (count, len(self.states))
        x0, u = rng.uniform(self.low, 2.0, shape), rng.uniform(self.low, 2.0, (count, len(self.inputs)))
        dt = self.time * np.exp(rng.uniform(*np.log(self.duration), count))
        theta = self.mean * (1 + np.array(self.relative_std) * rng.uniform(-1, 1, (count, len(self.parameters))))
        if self.grid:
            x0, u, theta = np.round(x0, 1), np.round(u, 1), np.tile(self.mean, (count, 1))
            dt = self.time * np.maximum(np.round(dt / self.time, 1), 0.1)
        return fp.Experiments(_round(x0) * self.sizes, _round(u) * self.input_sizes, _round(dt)), _round(theta)

    @property
    def mean(self) -> Floats:
        return np.array(self.parameter_sizes)

    def prior(self) -> fp.GaussianPrior:
        mean = dict(zip(self.parameters, self.parameter_sizes, strict=True))
        log = [name for name, chosen in zip(self.parameters, self.log, strict=True) if chosen]
        std = np.array(self.relative_std) * self.mean
        if not self.correlation:
            return fp.GaussianPrior(mean, dict(zip(mean, std.tolist(), strict=True)), log=log)
        p = len(mean)
        near = np.eye(p) + self.correlation * (np.eye(p, k=1) + np.eye(p, k=-1))
        return fp.GaussianPrior(mean, covariance=near * np.outer(std, std), log=log)

    def rule_of(self) -> fp.Rule:
        rule: fp.Rule = eval(f"fp.{self.rule}", {"fp": fp})
        return rule

    def code(self) -> str:
        """The model as one would write it."""
        given = ", ".join(f"{name}={value!r}" for name, value in self.arguments().items() if value or name != "constants")
        return f"import fisherpoint as fp\n\nmodel = fp.SymbolicModel({given})"

    def point_code(self, points: fp.Experiments, k: int, theta: Floats | None = None) -> str:
        """One point, with its parameters or the prior and rule."""
        point = points[k]
        one = f"points = fp.Experiments({point.x0.tolist()}, {point.u.tolist()}, {point.dt.tolist()})"
        if theta is not None:
            return f"{self.code()}\n{one}\ntheta = {np.asarray(theta).tolist()}"
        return (
            f"{self.code()}\n{one}\nprior = {self.prior()!r}".replace("prior = Gau", "prior = fp.Gau") + f"\nrule = fp.{self.rule}"
        )


def _names(letter: str, sizes: Sequence[float]) -> tuple[str, ...]:
    return tuple(f"{letter}{i + 1}" for i in range(len(sizes)))


def _round(values: Floats) -> Floats:
    """To four digits, so that a case reads well."""
    return np.vectorize(lambda value: float(f"{value:.3e}"), otypes=[float])(values)


# --- expressions ----------------------------------------------------------------------------------------------------------

Draw = Callable[[Any], Any]


@dataclass(frozen=True)
class Leaves:
    """What an expression may be made of, written as numbers of the order of one."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    constants: tuple[str, ...]

    @property
    def moving(self) -> tuple[str, ...]:
        return (*self.states, *self.inputs)


SMOOTH = (
    "{a} + {b}",
    "{a} - {b}",
    "{p}*({a})",
    "({a})*({b})",
    "({a})**2",
    "sin({a})",
    "tanh({a})",
    "exp(-({a}))",
    "exp({a})",
    "({a})**3",
    "cos({n}*({a}))",
    "atan({a})",
    "-({a})",
)
PARTIAL = (  # those that have no value everywhere
    "sqrt({a})",
    "1/({a})",
    "({a})/({n} + {b})",
    "{p}/({a} - {n})",
    "log({a})",
    "({a})**1.5",
    "({a})**(-2)",
    "1/(1 + exp(-{n}*({a})))",
    "sqrt({n} - ({a}))",
    "tan({a})",
    "asin(({a})/{n})",
    "({a})**({p})",
)
KINKED = (
    "max({a} - {e}, 0)",
    "abs({a} - {e})",
    "min({a}, {e})",
    "{p}*max({a} - {e}, 0)",
    "max({a}, {b})",
    "where({a} > {e}, {p}*({a} - {e}), 0)",
    "max({n} - ({a} - {e})**2, 0)",
    "({b})*max({a} - {p}, 0)",
    "sqrt(abs({a} - {e}) + 0.1)",
    "max({a} - {e}, {b}, 0)",
    "sqrt(max({a} - {e}, 0))",
    "max({a} - {e}, 0)**1.5",
    "min(max({a} - {e}, 0), {n})",
    "max({a} - {e}, 0)*max({b} - {e}, 0)",
    "abs({a} - {e})*({b} - {e})",
)
JUMPING = (
    "heaviside({a} - {e})",
    "sign({a} - {e})",
    "{p}*sign({a} - {e})",
    "where({a} > {e}, {b}, {p})",
    "where({a} > {e} and {b} < {e}, {a}, {b})",
    "where({a} < {e} or {b} > {p}, {a}, 0)",
    "heaviside({a} - {e})*heaviside({b} - {e})",
    "heaviside({a} - {e})*({b})",
    "max({c} - {e}, 0)*heaviside({a} - {e})",
    "heaviside({c} - {e})*sign({a} - {e})",
    "sign({a} - {e})*max({b} - {e}, 0)",
)


@st.composite
def expressions(draw: Draw, leaves: Leaves, depth: int, kinds: tuple[tuple[str, ...], ...]) -> str:
    """An expression of quantities near one; `kinds` are the templates that it may take."""
    if depth == 0 or not draw(st.integers(0, 3)):
        return draw(st.sampled_from(leaves.moving or leaves.parameters))
    template = draw(st.sampled_from(draw(st.sampled_from(kinds))))
    inner = expressions(leaves, depth - 1, kinds)
    parts = {name: draw(inner) for name in "ab" if f"{{{name}}}" in template}
    if "{p}" in template:
        parts["p"] = draw(st.sampled_from(leaves.parameters))
    if "{n}" in template:
        parts["n"] = draw(st.sampled_from((*NUMBERS, *leaves.constants)))
    while "{e}" in template:
        template = template.replace("{e}", draw(st.sampled_from((*EDGES, *leaves.constants))), 1)
    if "{c}" in template:
        parts["c"] = draw(st.sampled_from((*leaves.inputs, *leaves.constants, *leaves.parameters)))
    return template.format(**parts)


KINDS = (
    (SMOOTH,),
    (KINKED,),
    (SMOOTH, KINKED),
    (JUMPING,),
    (SMOOTH, JUMPING),
    (SMOOTH, PARTIAL),
    (KINKED, JUMPING),
    (SMOOTH, PARTIAL, KINKED, JUMPING),
)
BACKBONES = (
    "-{p}*{x}",
    "{p} - {x}",
    "{y} - {x}",
    "1",
    "{p}*{x}*(1 - {x})",
    "{n}*{y}",
    "-{n}*{y}",
    "{p}*{x}*{x}",
    "-{x}*{x}*{p}",
    "1000*({y} - {x})",
    "-{n}*({x} - {u})",
    "{p}/({n} - {x})",
    "-{p}*sqrt({x})",
    "{p}*{x}/({n} + {x})",
    "-100*({x} - cos({y}))",
    "0",
)


DRIVERS = (  # what the first states do, where they drive the others
    (),
    (),
    ("3*{1}", "-3*{0}"),  # an oscillator
    ("1",),  # a clock
    ("{p}",),
    ("-{p}*{0}",),
    ("{1}", "-{p}*{1} - 4*{0}"),
)


@st.composite
def rate(draw: Draw, leaves: Leaves, i: int, kinds: tuple[tuple[str, ...], ...]) -> str:
    """A well-known shape, an expression, or both."""
    shape = draw(st.sampled_from(("both", "both", "shape", "expression")))
    parts = []
    if shape != "expression":
        template = draw(st.sampled_from(BACKBONES))
        names = {
            "x": leaves.states[i],
            "y": draw(st.sampled_from(leaves.states)) if "{y}" in template else "",
            "p": draw(st.sampled_from(leaves.parameters)) if "{p}" in template else "",
            "u": draw(st.sampled_from((*leaves.inputs, *leaves.parameters))) if "{u}" in template else "",
            "n": draw(st.sampled_from((*NUMBERS, *leaves.constants))) if "{n}" in template else "",
        }
        parts.append(template.format(**names))
    if shape != "shape":
        parts.append(draw(expressions(leaves, 2, kinds)))
    return " + ".join(parts)


# --- cases ----------------------------------------------------------------------------------------------------------------


def _leaf(name: str, size: float) -> str:
    return name if size == 1 else f"({name}/{size:g})"


@st.composite
def cases(draw: Draw) -> Case:
    """Models with up to four states, two inputs, three parameters and two constants."""
    n_x = draw(st.sampled_from((1, 2, 1, 2, 3, 4, 0)))
    n_u = draw(st.sampled_from((0, 1, 2) if n_x else (1, 2)))
    n_p = draw(st.integers(1, 3))
    scaled = draw(st.booleans())
    powers = st.sampled_from(POWERS if scaled else (0,))

    def sizes(count: int) -> tuple[float, ...]:
        return tuple(10.0 ** draw(powers) for _ in range(count))

    state_sizes, input_sizes, parameter_sizes = sizes(n_x), sizes(n_u), sizes(n_p)
    parameter_sizes = tuple(size * draw(st.sampled_from((1.0, 0.5, 2.0))) for size in parameter_sizes)
    time = 10.0 ** draw(st.sampled_from((0, 0, 0, -3, -6, 3, 6))) if scaled and n_x else 1.0
    constants = tuple((f"c{k + 1}", draw(st.sampled_from((1.0, 0.3, 105.0, 12.0)))) for k in range(draw(st.integers(0, 2))))
    units = [10.0 ** np.round(np.log10(size)) for size in parameter_sizes]
    case = Case((), (), state_sizes, input_sizes, parameter_sizes, constants)
    leaves = Leaves(
        tuple(map(_leaf, case.states, state_sizes)),
        tuple(map(_leaf, case.inputs, input_sizes)),
        tuple(map(_leaf, case.parameters, units)),
        tuple(name for name, _ in constants),
    )
    chosen = draw(st.sampled_from(KINDS))
    rates = []
    driver = draw(st.sampled_from([driver for driver in DRIVERS if len(driver) < max(n_x, 1)]))
    for i, size in enumerate(state_sizes):
        if i < len(driver):
            shape = driver[i].format(*leaves.states, p=draw(st.sampled_from(leaves.parameters)))
        else:
            shape = draw(rate(leaves, i, chosen))
        rates.append(shape if size == time else f"{size / time:g}*({shape})")
    outputs = tuple(draw(expressions(leaves, draw(st.integers(0, 2)), chosen)) for _ in range(draw(st.integers(1, 2))))
    if not n_x:
        outputs = tuple(f"{output} + {draw(st.sampled_from(leaves.parameters))}" for output in outputs)
    return replace(
        case,
        rates=tuple(rates),
        outputs=outputs,
        time=time,
        duration=draw(st.sampled_from(((0.1, 1.0), (0.5, 5.0), (1e-3, 0.1), (5.0, 20.0)))),
        low=draw(st.sampled_from((0.1, -2.0, 1e-4))),
        relative_std=tuple(draw(st.sampled_from((0.1, 0.3, 0.02, 1.0))) for _ in range(n_p)),
        log=tuple(draw(st.booleans()) for _ in range(n_p)),
        correlation=draw(st.sampled_from((0.0, 0.0, 0.3, -0.4))) if n_p > 1 else 0.0,
        rule=draw(st.sampled_from(RULES)),
        seed=draw(st.integers(0, 9999)),
        grid=not draw(st.integers(0, 3)),
        also=draw(st.sampled_from(ALSO)),
    )
