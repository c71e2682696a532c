"""Equations as text, read by Python itself: the routes that the campaign checks fisherpoint against share none of its code.

Every equation is turned into two Python functions. One runs along trajectories: branches on the state, of `max`, `abs`, `sign`,
`heaviside` and `where`, are held on given sides, so that a step never mixes two of them. The other looks where a trajectory is: it
tells the value of every surface, whose sign is the side, and of everything that must not change its sign, such as the arguments of
roots and divisors, in the branches that are taken.
"""

from __future__ import annotations

import ast
import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arithmetic import Dual, Rough, names_for, slope_of

Floats = NDArray[np.float64]
Values = Sequence[float]


def _exp(a: float) -> float:
    return math.exp(a) if a < 709.7 else math.inf


def _sinh(a: float) -> float:
    return math.sinh(a) if abs(a) < 709.7 else math.copysign(math.inf, a)


def _cosh(a: float) -> float:
    return math.cosh(a) if abs(a) < 709.7 else math.inf


NAMES: dict[str, Any] = {
    **{name: getattr(math, name) for name in ("sqrt", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "tanh")},
    "exp": _exp,
    "sinh": _sinh,
    "cosh": _cosh,
    "_power": math.pow,  # a real power, or ValueError: Python's own would be complex
    "abs": abs,
    "sign": lambda a: (a > 0) - (a < 0),
    "heaviside": lambda a: float(a > 0),
    "inf": math.inf,
    "pi": math.pi,
    "__builtins__": {},
}
ERRORS = (ArithmeticError, ValueError)
"""What Python raises where an expression has no real value."""


@dataclass(frozen=True)
class Limit:
    """What must keep its sign along a trajectory, and be positive unless it is a pole; see `Reading.look`."""

    text: str
    pole: bool


class Reading:
    """f and g of texts.

    Attributes
    ----------
    surfaces : list of str
        What is zero where a branch of f on the state changes.
    limits : list of Limit
        What must keep its sign in f, or in g for those from `limits_of_f` on.
    """

    def __init__(
        self,
        rates: Sequence[str],
        outputs: Sequence[str],
        states: Sequence[str],
        inputs: Sequence[str],
        parameters: Sequence[str],
        constants: Mapping[str, float],
        names: Mapping[str, Any] = NAMES,
    ) -> None:
        self._texts = rates, outputs, states, inputs, parameters, constants
        self._names = names
        self.surfaces: list[str] = []
        self.limits: list[Limit] = []
        self._vary = {*states, *inputs}
        self._states = set(states)
        self._constants = dict(constants)
        arguments = "x, u, p"
        places = {"x": states, "u": inputs, "p": parameters}
        self._unpack = "".join(f"({', '.join(names)},) = {of}\n    " for of, names in places.items() if names)
        held = [self._branched(_tree(text), held=True) for text in rates]
        self._held = self._compiled(f"{arguments}, S", held)
        self._seen = [self._compiled(arguments, [self._branched(_tree(text), held=False)]) for text in self.surfaces]
        looks = [self._looking(self._branched(_tree(text), held=True)) for text in rates]
        self._looks = self._compiled(f"{arguments}, S, T", looks)
        self.limits_of_f = len(self.limits)
        self._output = self._compiled(arguments, [self._branched(_tree(text), held=False) for text in outputs])
        noted = [self._branched(_tree(text), held=False, noted=True) for text in outputs]
        self._noted = self._compiled(f"{arguments}, B", noted)
        looks = [self._looking(self._branched(_tree(text), held=False)) for text in outputs]
        self._output_looks = self._compiled(f"{arguments}, T", looks)
        self.n_x, self.n_y = len(rates), len(outputs)

    def held(self, x: Values, u: Values, p: Values, sides: Sequence[int]) -> list[float] | None:
        """f on the given sides of the surfaces; None where it has no value."""
        try:
            return [float(value) for value in self._held(x, u, p, sides)]
        except ERRORS:
            return None

    def output(self, x: Values, u: Values, p: Values) -> list[float] | None:
        """g; None where it has no value."""
        try:
            return [float(value) for value in self._output(x, u, p)]
        except ERRORS:
            return None

    @cached_property
    def _dual(self) -> Reading:
        return Reading(*self._texts, names_for(NAMES, Dual))

    @cached_property
    def rough(self) -> Reading:
        """The same texts, with roundings that vary from call to call (arithmetic.py)."""
        return Reading(*self._texts, names_for(NAMES, Rough))

    def output_slope(self, x: Values, u: Values, p: Values, place: int) -> list[float] | None:
        """The derivative of g by one of x, p; None where it has no value."""
        at = [Dual(value, float(i == place)) for i, value in enumerate((*x, *p))]
        try:
            return [slope_of(value) for value in self._dual._output(at[: len(x)], u, at[len(x) :])]
        except ERRORS:
            return None

    def output_branches(self, x: Values, u: Values, p: Values) -> list[int]:
        """Which branches g takes."""
        taken: list[int] = []
        with contextlib.suppress(ERRORS):
            self._noted(x, u, p, taken)
        return taken

    def heights(self, x: Values, u: Values, p: Values) -> list[float]:
        """Values of the surfaces; NaN where one has none."""
        return [_or_nan(seen, x, u, p)[0] for seen in self._seen]

    def sides(self, x: Values, u: Values, p: Values) -> list[int]:
        """On which side of every surface a state lies: 1 or -1, or 0 where its height is zero."""
        return [side_of(height) for height in self.heights(x, u, p)]

    def look(self, x: Values, u: Values, p: Values, sides: Sequence[int]) -> dict[int, float]:
        """Values of the limits of f that count in the branches that are taken, by their place among `limits`."""
        seen: dict[int, float] = {}
        with contextlib.suppress(ERRORS):
            self._looks(x, u, p, sides, seen)
        return seen

    def look_at_output(self, x: Values, u: Values, p: Values) -> dict[int, float]:
        """As `look`, of g."""
        seen: dict[int, float] = {}
        with contextlib.suppress(ERRORS):
            self._output_looks(x, u, p, seen)
        return seen

    # --- from trees to functions ------------------------------------------------------------------------------------------

    def _compiled(self, arguments: str, trees: Sequence[ast.expr]) -> Callable[..., list[float]]:
        body = ", ".join(ast.unparse(_Power().visit(deepcopy(tree))) for tree in trees)
        source = f"def function({arguments}):\n    {self._unpack}return [{body}]\n"
        space = {
            **self._names,
            **self._constants,
            "_root": _root,
            "_pole": _pole,
            "_last": _last,
            "_note": _note,
            "side_of": side_of,
        }
        exec(source, space)
        function: Callable[..., list[float]] = space["function"]
        return function

    def _branched(self, tree: ast.expr, held: bool, noted: bool = False) -> ast.expr:
        """The tree with conditional expressions in the place of functions with branches; on the state, held on sides."""
        return _Brancher(self, held, noted).visit(tree)

    def side(self, height: ast.expr, held: bool, noted: bool) -> ast.expr:
        """The sign of a height; held, where the state enters it."""
        if not (held and self._reads(height, self._states)):
            by_value = self._branched(deepcopy(height), held=False, noted=noted)
            return _call("_note", ast.Name("B", ast.Load()), by_value) if noted else _call("side_of", by_value)
        text = ast.unparse(height)
        if text not in self.surfaces:
            self.surfaces.append(text)
        return _tree(f"S[{self.surfaces.index(text)}]")

    def _looking(self, tree: ast.expr) -> ast.expr:
        return _Looker(self).visit(tree)

    def _reads(self, tree: ast.expr, names: set[str]) -> bool:
        return any(isinstance(node, ast.Name) and node.id in names for node in ast.walk(tree))

    def limit(self, tree: ast.expr, pole: bool) -> ast.expr:
        """The tree, with its value put down where it is carried out; what no trajectory changes is left out."""
        if not self._reads(tree, self._vary | {"S"}):
            return tree
        entry = Limit(ast.unparse(tree), pole)
        if entry not in self.limits:
            self.limits.append(entry)
        place = ast.Constant(self.limits.index(entry))
        return _call("_pole" if pole else "_root", ast.Name("T", ast.Load()), place, tree)


def _tree(text: str) -> ast.expr:
    tree: ast.expr = _Undone().visit(ast.parse(text.strip(), mode="eval").body)
    return tree


class _Undone(ast.NodeTransformer):
    """sin(asin(a)) and sqrt(a)**2 are a, exp(-log(a)) is 1/a, (a**1.5)**(-2) is a**-3, and none has a limit of a's: so SymPy reads
    them too."""

    PAIRS = (("sin", "asin"), ("cos", "acos"), ("tan", "atan"), ("exp", "log"))

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        inner, power = (node.args[0] if node.args else None), 1
        if ast.unparse(node.func) == "exp" and isinstance(inner, ast.UnaryOp) and isinstance(inner.op, ast.USub):
            inner, power = inner.operand, -1
        if isinstance(inner, ast.Call) and (ast.unparse(node.func), ast.unparse(inner.func)) in self.PAIRS:
            return inner.args[0] if power == 1 else ast.BinOp(ast.Constant(1), ast.Div(), inner.args[0])
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        of_root = isinstance(node.left, ast.Call) and ast.unparse(node.left.func) == "sqrt"
        if isinstance(node.op, ast.Pow) and isinstance(node.left, ast.Call) and of_root and _exponent(node) % 2 == 0:
            return ast.BinOp(node.left.args[0], ast.Pow(), ast.Constant(int(_exponent(node)) // 2))
        of_power = isinstance(node.left, ast.BinOp) and isinstance(node.left.op, ast.Pow)
        if isinstance(node.op, ast.Pow) and isinstance(node.left, ast.BinOp) and of_power and _exponent(node) % 1 == 0:
            both = _exponent(node.left) * _exponent(node)
            if both % 1 == 0:
                return ast.BinOp(node.left.left, ast.Pow(), ast.Constant(int(both)))
        return node


def _call(name: str, *arguments: ast.expr) -> ast.expr:
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), [])


def side_of(height: float) -> int:
    """The sign of a height; 0 also where it has no value."""
    return 1 if height > 0 else -1 if height < 0 else 0


def _or_nan(function: Callable[..., list[float]], *arguments: Any) -> list[float]:
    try:
        return [float(value) for value in function(*arguments)]
    except ERRORS:
        return [math.nan]


def _root(seen: dict[int, float], place: int, value: float) -> float:
    seen[place] = min(value, seen.get(place, math.inf))
    return value


def _pole(seen: dict[int, float], place: int, value: float) -> float:
    if abs(value) < abs(seen.get(place, math.inf)):
        seen[place] = value
    return value


def _note(taken: list[int], height: float) -> int:
    taken.append(side_of(height))
    return taken[-1]


def _last(*values: float) -> float:
    return values[-1]


def _difference(a: ast.expr, b: ast.expr) -> ast.expr:
    return a if isinstance(b, ast.Constant) and b.value == 0 else ast.BinOp(a, ast.Sub(), b)


def _is_zero(tree: ast.expr) -> bool:
    return isinstance(tree, ast.Constant) and tree.value == 0


def _exponent(power: ast.BinOp) -> float:
    """The exponent of a power, NaN where it is no number."""
    return float(ast.unparse(power.right)) if isinstance(power.right, ast.Constant | ast.UnaryOp) else math.nan


class _Brancher(ast.NodeTransformer):
    """From functions with branches to conditional expressions, the arguments first as they were written."""

    def __init__(self, reading: Reading, held: bool, noted: bool) -> None:
        self.reading, self.held, self.noted = reading, held, noted

    def side(self, height: ast.expr) -> ast.expr:
        return self.reading.side(height, self.held, self.noted)

    def above(self, height: ast.expr) -> ast.expr:
        return ast.Compare(self.side(height), [ast.Gt()], [ast.Constant(0)])

    def visit_Call(self, node: ast.Call) -> ast.expr:
        assert isinstance(node.func, ast.Name)
        name, written = node.func.id, list(node.args)
        if name in ("max", "min"):
            return reduce(lambda pair, other: self.extreme(name, pair, other), [(a, self.visit(deepcopy(a))) for a in written])[1]
        if name == "where":
            return self.choice(written[0], self.visit(written[1]), self.visit(written[2]))
        if name not in ("abs", "sign", "heaviside"):
            node.args = [self.visit(argument) for argument in node.args]
            return node
        value = self.visit(deepcopy(written[0]))
        side, above = self.side(written[0]), self.above(written[0])
        if name == "sign":
            return side
        if name == "heaviside":
            return ast.IfExp(above, ast.Constant(1.0), ast.Constant(0.0))
        return ast.IfExp(above, value, ast.UnaryOp(ast.USub(), deepcopy(value)))

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """A power above 1 of what is zero on an edge goes on evenly past it, where a trial step may look."""
        self.generic_visit(node)
        fraction = isinstance(node.op, ast.Pow) and (exponent := _exponent(node)) > 1 and exponent != int(exponent)
        if fraction and isinstance(node.left, ast.IfExp):
            node.left = _call("abs", node.left)
        return node

    def extreme(self, name: str, first: tuple[ast.expr, ast.expr], second: tuple[ast.expr, ast.expr]) -> tuple[ast.expr, ast.expr]:
        above = self.above(_difference(first[0], second[0]))
        yes, no = (first[1], second[1]) if name == "max" else (second[1], first[1])
        written = ast.Call(ast.Name(name, ast.Load()), [first[0], second[0]], [])
        return written, ast.IfExp(above, yes, no)

    def choice(self, condition: ast.expr, yes: ast.expr, no: ast.expr) -> ast.expr:
        match condition:
            case ast.BoolOp(ast.And(), parts):
                return reduce(lambda value, part: self.choice(part, value, deepcopy(no)), reversed(parts), yes)
            case ast.BoolOp(ast.Or(), parts):
                return reduce(lambda value, part: self.choice(part, deepcopy(yes), value), reversed(parts), no)
            case ast.UnaryOp(ast.Not(), part):
                return self.choice(part, no, yes)
            case ast.Compare(left, [ast.Gt() | ast.GtE() | ast.Lt() | ast.LtE() as how], [right]):
                return ast.IfExp(ast.Compare(self.side(_difference(left, right)), [how], [ast.Constant(0)]), yes, no)
        raise ValueError(ast.unparse(condition))


class _Power(ast.NodeTransformer):
    """Powers that are not small integers become calls."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        whole = isinstance(node.right, ast.Constant) and isinstance(node.right.value, int)
        return node if not isinstance(node.op, ast.Pow) or whole else _call("_power", node.left, node.right)


class _Looker(ast.NodeTransformer):
    """Puts down what must keep its sign. Where a branch is not taken, its limits are not seen."""

    def __init__(self, reading: Reading) -> None:
        self.reading = reading

    def root(self, argument: ast.expr) -> ast.expr:
        """What must be positive, but for a branch that is zero."""
        if not isinstance(argument, ast.IfExp):
            return argument if _is_zero(argument) else self.reading.limit(argument, pole=False)
        return ast.IfExp(argument.test, self.root(argument.body), self.root(argument.orelse))

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        if isinstance(node.op, ast.Div):
            node.right = self.reading.limit(node.right, pole=True)
        if isinstance(node.op, ast.Pow) and not math.isnan(power := _exponent(node)):
            even = power > 1 and isinstance(node.left, ast.Call) and ast.unparse(node.left.func) == "abs"
            if power < 0 or (power != int(power) and not even):
                node.left = self.root(node.left) if power > 0 else self.reading.limit(node.left, pole=power == int(power))
        elif isinstance(node.op, ast.Pow):
            node.left = self.reading.limit(node.left, pole=False)
        return node

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        assert isinstance(node.func, ast.Name)
        if node.func.id == "sqrt":
            node.args = [self.root(node.args[0])]
        if node.func.id == "log":
            node.args = [self.reading.limit(node.args[0], pole=False)]
        others = {"tan": ["cos({})"], "asin": ["1 - ({})", "1 + ({})"], "acos": ["1 - ({})", "1 + ({})"]}.get(node.func.id)
        if not others:
            return node
        argument = ast.unparse(node.args[0])
        first = [self.reading.limit(_tree(other.format(argument)), node.func.id == "tan") for other in others]
        return _call("_last", *first, node)
