"""Numbers, shares, counts and uncertainties as text, the same everywhere."""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import ROUND_DOWN, Decimal

import numpy as np

LEAST_PROVEN, ROUNDING = 1e-4, 1e-12
"""Smallest proven share that is shown, and the share by which rounding may reduce a proven value."""

LEAST_PROBABILITY = 1e-6
"""Smallest p-value that is shown as a number."""


def number(value: float, digits: int = 4) -> str:
    """A number with at most that many significant digits; "-" where there is none."""
    return "-" if math.isnan(value) else _short_exponent(f"{value:.{digits}g}")


def computed(value: float, digits: int = 3) -> str:
    """A computed number, with exactly that many significant digits; "-" where there is none."""
    return "-" if math.isnan(value) else _short_exponent(f"{value:#.{digits}g}").rstrip(".")


def percent(share: float) -> str:
    """A share in percent with three significant digits; what is far above all, as a factor."""
    if share >= 9.995:
        return "inf" if math.isinf(share) else f"{computed(share)} times"
    if 0 < share < 1e-4:
        return "< 0.01 %"
    return "-" if math.isnan(share) else f"{computed(100 * share)} %"


def percent_down(share: float, digits: int = 3) -> str:
    """A proven share in percent with that many significant digits, rounded down: never more than what is proven."""
    if math.isnan(share):
        return "-"
    if share >= 10 and math.isfinite(share):
        return f"{_down(share, digits)} times"
    return percent(share) if math.isinf(share) else f"{_down(100 * share, digits)} %" if share >= LEAST_PROVEN else "0 %"


def _down(value: float, digits: int) -> str:
    exact = Decimal(value * (1 + ROUNDING))
    return f"{exact.quantize(Decimal(1).scaleb(max(exact.adjusted(), 0) - digits + 1), ROUND_DOWN):f}"


def with_error(value: float, error: float, unit: str = "") -> str:
    """A number with its error in its last digits: 0.987(22) for 0.987 +- 0.022."""
    if math.isnan(value):
        return "-"
    if not error > 0:
        return f"{value:.3g}{unit}"
    if error >= 9.95:
        return f"{value:.2g}({error:.1g}){unit}"
    decimals = min(9, max(0, 1 - math.floor(math.log10(error))))
    last_digits = round(error * 10**decimals)
    return f"{value:.{decimals}f}({last_digits}){unit}" if decimals else f"{value:.0f}({error:.0f}){unit}"


def digits_of(value: float, error: float) -> int:
    """Digits that show a value to a hundredth of its error, at least 4 and at most 9."""
    if not (error > 0 and math.isfinite(error) and value):
        return 6
    return min(9, max(4, 2 + math.ceil(math.log10(abs(value) / error))))


def column(values: Iterable[float], digits: int = 4) -> list[str]:
    """Numbers of one quantity with the same number of decimals, so that they line up."""
    values = np.asarray(list(values), dtype=float)
    largest = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
    if largest and not 1e-3 <= largest < 1e5:
        texts = [_short_exponent(f"{value:.{digits - 1}e}") for value in values]
    else:
        decimals = max(0, digits - 1 - math.floor(math.log10(largest))) if largest else 0
        # What would look like zero is written out.
        small = 10.0 ** (1 - decimals)
        texts = [f"{value:.{decimals}f}" if not 0 < abs(value) < small else computed(value, 2) for value in values]
    return ["-" if math.isnan(value) else text for value, text in zip(values, texts, strict=True)]


def probability(value: float) -> str:
    """Text of a p-value; "< 1e-6" of a smaller one, as no test's distribution is known that far out."""
    return number(value, 2) if value >= LEAST_PROBABILITY else f"< {LEAST_PROBABILITY:g}".replace("e-0", "e-")


def p_value_text(value: float) -> str:
    """Text of a p-value with its name: "p = 0.02", "p < 1e-6"."""
    shown = probability(value)
    return f"p {shown}" if shown.startswith("<") else f"p = {shown}"


def counted(count: int, one: str, many: str = "") -> str:
    """1 point, 2 points; 2 batches."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def _short_exponent(text: str) -> str:
    """1.2e+07 as 1.2e7."""
    mantissa, _, exponent = text.partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else text
