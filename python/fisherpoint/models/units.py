"""Units: whether a text such as "m3/(s sqrt(Pa))" is one. They are checked and shown, never converted."""

from __future__ import annotations

import re

_PLAIN = "min h d deg degC % ppm rpm °C ha au"
_PREFIXED = "m g s A K mol cd Hz N Pa J W C F V ohm Ω S Wb T H lm lx Bq Gy Sv kat rad sr L l bar eV M t cal Ah Wh VA var Da U"
_PREFIXES = ("", "da", *"qryzafpnuµμmcdhkMGTPEZYRQ")
UNITS = frozenset(_PLAIN.split()) | {prefix + unit for prefix in _PREFIXES for unit in _PREFIXED.split()}

_TOKEN = re.compile(
    r"\s*(?:(?P<power>(?:\^|\*\*)\s*[+-]?(?:\d+\.\d+|\d+)|(?<=[A-Za-zΩ%])[+-]?\d+)|(?P<name>sqrt(?=\s*\()|[^\W\d_]+|%|°C)"
    r"|(?P<one>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)|(?P<mark>[*·/()]))"
)
MAX_LENGTH = 100


def check_unit(text: object, place: str) -> str:
    """Return `text` where it is a unit: products, quotients and powers of units, roots as ``sqrt(Pa)`` or ``Pa^0.5``, or ``1``.

    Raises
    ------
    ValueError
        Where it is none; the message names the place and the part that is not understood.
    """
    if not isinstance(text, str) or len(text) > MAX_LENGTH:
        raise ValueError(f"{place}: expected a unit such as 'm3/(s sqrt(Pa))', given {text!r:.60}")
    parser = _Parser(text, place)
    parser.product()
    if parser.kind:
        raise parser.error("the end")
    return text


class _Parser:
    """Reads product = factor {[* | · | /] factor}, factor = (name | number | [sqrt] "(" product ")") [power]."""

    def __init__(self, text: str, place: str) -> None:
        self.text, self.place, self.end = text.rstrip(), place, 0
        self.advance()

    def advance(self) -> None:
        self.start, self.kind, self.token = self.end, "", ""
        if self.end < len(self.text):
            match = _TOKEN.match(self.text, self.end)
            if match is None:
                raise self.error("units, numbers, * / ^ and brackets")
            self.kind, self.token, self.end = str(match.lastgroup), match[0].strip(), match.end()

    def error(self, expected: str) -> ValueError:
        where = f"{self.text[self.start :].strip()!r} at column {self.start + 1}" if self.start < len(self.text) else "its end"
        return ValueError(
            f"{self.place}: expected a unit such as 'm3/(s sqrt(Pa))', given {self.text!r:.60}: {expected} expected before {where}"
        )

    def product(self) -> None:
        self.factor()
        while self.kind and self.token != ")":
            if self.token in ("*", "·", "/"):
                self.advance()
            self.factor()

    def factor(self) -> None:
        if self.token == "(" or self.token == "sqrt":
            if self.token == "sqrt":
                self.advance()
            self.advance()
            self.product()
            if self.token != ")":
                raise self.error("')'")
        elif self.kind == "name" and self.token not in UNITS:
            raise ValueError(
                f"{self.place}: expected a unit such as 'm3/(s sqrt(Pa))', given {self.text!r}: unknown unit {self.token!r} "
                f"at column {self.end - len(self.token) + 1}"
            )
        elif self.kind not in ("name", "one"):
            raise self.error("a unit")
        self.advance()
        if self.kind == "power":
            self.advance()
