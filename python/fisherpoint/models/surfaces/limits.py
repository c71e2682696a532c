"""What must be positive, or other than zero, so that parts of expressions have a value; and which of it SymPy leaves out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import sympy

from ..tape.definition import Definition
from ..tape.kinds import KINDS, expression_of
from ..tape.parts import symbols_of
from ..tape.signs import is_nonnegative, is_positive
from .zeros import normal_form

Key = tuple[Any, int | None, tuple[Any, ...]]
"""The form of what is limited, which sign it must have, None for a pole, and the conditions under which it is."""


def limits_of(part: Any, origin: Mapping[Any, Any]) -> Sequence[tuple[Any, Any, bool]]:
    """What must be positive, or other than zero, for this part to have a value: (expression, as it was written, pole)."""
    if not part.args:
        return ()
    argument = part.args[0]
    written = origin.get(argument, argument)
    if isinstance(part, sympy.Pow):
        if part.exp.is_Integer:
            return [(argument, written, True)] if part.exp < 0 else ()
        if isinstance(argument, sympy.Abs) and (not part.exp.is_number or part.exp > 0):
            return ()
        return [(argument, written, False)]
    if part.func in KINDS:
        function = KINDS[part.func]
        limits = [*((text, False) for text in function.positive), *((text, True) for text in function.nonzero)]
        return [(expression_of(text, argument), expression_of(text, written), pole) for text, pole in limits]
    if isinstance(part, sympy.atan2):
        # Off the negative x axis, where it jumps, and off the origin.
        pairs = zip(part.args, (origin.get(other, other) for other in part.args), strict=True)
        (y, y_written), (x, x_written) = pairs
        ahead = [x + (1 - 1e-6) * sympy.sqrt(x * x + y * y) for y, x in ((y, x), (y_written, x_written))]
        return [(ahead[0], ahead[1], False)]
    return ()


def is_root(part: Any) -> bool:
    """Whether it is a power that is zero where its base is, without being one of a whole exponent."""
    return isinstance(part, sympy.Pow) and not part.exp.is_Integer and (not part.exp.is_number or bool(part.exp > 0))


def left_out(value: Any, operands: Iterable[Any]) -> tuple[Any, ...]:
    """Parts of operands that have limits of which SymPy has left nothing in the value that it made of them.

    Of sqrt(e)*sqrt(e), which it makes e, that is sqrt(e). What stands in a branch is limited only there: then it is the branch.
    """
    before: dict[Key, Any] = {}
    for operand in operands:
        if not _stands_in(operand, value):
            before |= _limited(operand)
    if not before:
        return ()
    after = _limited(value)
    forms = {(form, conditions) for form, _, conditions in after}
    lost = [whole for key, whole in before.items() if key not in after and not (key[1] is None and (key[0], key[2]) in forms)]
    return tuple(dict.fromkeys(lost))


def has_limits(expression: Any) -> bool:
    """Whether an expression has no value somewhere."""
    return bool(_limited(expression))


def _stands_in(operand: Any, value: Any) -> bool:
    """Whether the operand is seen at once to be whole in the value."""
    if operand == value or not (operand.args or isinstance(operand, Definition)):
        return True
    there = set(value.args)
    same = isinstance(operand, sympy.Add | sympy.Mul) and operand.func is value.func
    return operand in there or (same and there.issuperset(a for a in operand.args if not a.is_Number))


def _limited(expression: Any) -> dict[Key, Any]:
    """Limits of an expression, each with the part that has it; of what stands in a branch, the branch."""
    found: dict[Key, Any] = {}
    seen: set[Any] = set()
    stack: list[tuple[Any, Any, tuple[Any, ...]]] = [(expression, None, ())]
    while stack:
        part, branch, conditions = stack.pop()
        if (part, conditions) in seen or part.is_number:
            continue
        seen.add((part, conditions))
        if isinstance(part, sympy.Piecewise):
            before = conditions
            for value, condition in part.args:
                stack += [(value, branch or part, (*before, condition)), (condition, branch or part, before)]
                before = (*before, sympy.Not(condition, evaluate=False))
            continue
        found |= {(form, sign, conditions): branch or part for form, sign in _forms(part)}
        stack += [(argument, branch, conditions) for argument in part.args]
    return found


def _forms(part: Any) -> Iterator[tuple[Any, int | None]]:
    """Forms by which the limits of a part are recognised; a definition counts as one, as its value may have limits."""
    if isinstance(part, Definition):
        yield part, 0
    for argument, _, pole in limits_of(part, {}):
        factors = [factor for factor in sympy.Mul.make_args(argument) if symbols_of(factor)]
        if pole:
            yield from ((normal_form(_base(one))[0], None) for one in factors if not is_positive(one))
        elif not (isinstance(part, sympy.Pow) and part.exp.is_positive and is_nonnegative(argument)):
            numbers = sympy.Mul(*(factor for factor in sympy.Mul.make_args(argument) if factor not in factors))
            rest = sympy.Mul(numbers, *(factor for factor in factors if not is_nonnegative(factor)))
            if symbols_of(rest):
                yield normal_form(rest)


def _base(factor: Any) -> Any:
    return factor.base if factor.is_Pow and factor.exp.is_Number and factor.exp > 0 else factor
