"""Named intermediate quantities in expressions: symbols that know what they stand for."""

from __future__ import annotations

from typing import Any

import sympy


class Definition(sympy.Symbol):  # type: ignore[misc]
    """A symbol for an expression, which may have further such symbols in it; two are equal where names and expressions are.

    To SymPy it is a symbol like any other: nothing looks at its value but what asks for it.

    Attributes
    ----------
    value : sympy.Expr
    """

    __slots__ = ("value",)

    def __new__(cls, name: str, value: Any) -> Definition:
        made: Definition = sympy.Symbol.__xnew__(cls, name, real=True)
        made.value = value
        return made

    @classmethod
    def class_key(cls) -> Any:
        return sympy.Symbol.class_key()  # so that it is printed where a symbol of its name would be

    def __getnewargs_ex__(self) -> tuple[Any, ...]:
        return (self.name, self.value), {}

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), self.value)
