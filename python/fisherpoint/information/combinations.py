"""Null directions in words: how parameters can move together without a change of any output, and what of them counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ..basics.values import Array

SMALL, SAME = 1e-4, 1e-3
"""Shares of the largest component up to which one is zero, and up to which two are the same."""

LARGE = 0.05
"""Share of the largest component above which one is worth mentioning."""

LARGEST_RATIO = 12

LEAST_SHARE = 0.01
"""Smallest share of a combination's largest factor at which a factor is shown; below, only the name is."""


def describe(
    directions: Array, effects: Array, theta: Array, names: Sequence[str], starts: Mapping[str, Sequence[Array]]
) -> tuple[str, Mapping[str, float]]:
    """Return a direction in words, and its components as relative changes of the parameters.

    Parameters
    ----------
    directions : ndarray, (n, p)
        The direction at each of n sets of parameters, relative changes d log theta; absolute ones where theta is zero.
    effects : ndarray, (n, p)
        How much the change of each parameter alone changes the outputs: a small change counts where they feel it.
    theta : ndarray, (n, p)
    names : sequence of str
    starts : mapping of state name to sequence of n ndarrays
        Relative changes of starts that are not known and go along with each of the directions.

    Returns
    -------
    text : str
        Where the relative changes are the same at every theta, a scaling: which products count. Where the absolute changes are, a
        shift: which sums count. Else the changes at the first theta.
    components : mapping of parameter name to float
        At the first theta, of those that are not zero.
    """
    felt = (np.abs(effects) > SMALL * np.abs(effects).max(axis=1, keepdims=True)).all(axis=0)
    relative, absolute = _normalised(directions, felt), _normalised(directions * np.where(theta != 0, theta, 1.0), felt)
    first, largest = relative[0], np.argmax(np.abs(relative[0]))
    sizes = relative[:, largest] / directions[:, largest]
    along = {name: np.concatenate([size * move for size, move in zip(sizes, moves, strict=True)]) for name, moves in starts.items()}
    moved = [j for j in range(len(names)) if first[j]]
    components = {names[j]: float(first[j]) for j in moved}
    if len(moved) == 1 and not _start_changes(along, None):
        return f"{names[moved[0]]}: no output changes with it", components
    scaling, shift = (_ratios(given[:, moved]) for given in (relative, absolute))
    chosen = [names[j] for j in moved]
    if scaling is not None and (theta[:, moved] != 0).all():
        size = scaling[0] / first[moved[0]]
        changes = [*map(_percent, chosen, scaling), *_start_changes(along, size)]
        return f"{', '.join(changes)}: no output changes{_invariants(chosen, scaling, _product)}", components
    if shift is not None:
        changes = [f"{name} {'up' if step > 0 else 'down'} by {abs(step)}" for name, step in zip(chosen, shift, strict=True)]
        changes += _start_changes(along, None)
        return f"{', '.join(changes)}: no output changes{_invariants(chosen, shift, _sum)}", components
    steps = first[moved] / np.abs(first[moved]).max()
    changes = [*map(_percent, chosen, steps), *_start_changes(along, None)]
    where = "" if _same(relative[:, moved]) else f", at {', '.join(f'{names[j]} = {theta[0, j]:g}' for j in moved)}"
    return f"{', '.join(changes)}: no output changes{where}", components


def changes_of(direction: Array, names: Sequence[str], effects: Array | None = None) -> str:
    """The larger components of a direction of relative changes (p,), such as "k1 up 1 %, k2 down 0.5 %".

    Larger ones, or those of the larger `effects` (p,): see `describe`.
    """
    steps = direction / np.abs(direction).max()
    felt = np.zeros(len(steps)) if effects is None else effects / np.abs(effects).max()
    order = np.argsort(-np.abs(steps), kind="stable")
    shown = [j for j in order if max(abs(steps[j]), abs(felt[j])) > LARGE]
    return ", ".join(_percent(names[j], steps[j] * np.sign(steps[order[0]])) for j in shown)


def _normalised(directions: Array, felt: NDArray[np.bool_]) -> Array:
    """Largest component 1, the first one that is not zero positive, small ones zero but for those (p,) that are felt."""
    directions = directions / np.abs(directions).max(axis=1, keepdims=True)
    directions = np.where(felt | (np.abs(directions) > SMALL), directions, 0.0)
    leading = directions[np.arange(len(directions)), np.argmax(directions != 0, axis=1)]
    normalised: Array = directions * np.sign(leading)[:, None]
    return normalised


def _same(directions: Array) -> bool:
    return bool((np.abs(directions - directions[0]) <= SAME).all())


def _ratios(directions: Array) -> list[int] | None:
    """Small whole numbers to which all rows are proportional, or None."""
    if not _same(directions):
        return None
    steps = directions.mean(axis=0)
    steps = steps / np.abs(steps[steps != 0]).min()
    fractions = [Fraction(float(step)).limit_denominator(LARGEST_RATIO) for step in steps]
    if any(abs(float(fraction) - step) > SAME * abs(step) for fraction, step in zip(fractions, steps, strict=True)):
        return None
    whole = math.lcm(*(fraction.denominator for fraction in fractions))
    numbers = [int(fraction * whole) for fraction in fractions]
    return numbers if max(map(abs, numbers)) <= LARGEST_RATIO else None


def _percent(name: str, step: float) -> str:
    return f"{name} {'up' if step > 0 else 'down'} {abs(step):.3g} %"


def _start_changes(starts: Mapping[str, Array], size: float | None) -> list[str]:
    """Words for the starts that go along; `size` scales their relative changes, None where only that they move is said."""
    words = []
    for state, change in starts.items():
        if np.abs(change).max() <= SMALL * (1 if size is None else 1 / abs(size)):
            continue
        if size is not None and np.ptp(change) <= SAME * np.abs(change).max():
            words.append(_percent(f"the start of {state}", float(change.mean() * size)))
        else:
            words.append(f"the start of {state} with them")
    return words


def _invariants(names: Sequence[str], steps: Sequence[int], written: Callable[[str, int, str, int], str]) -> str:
    """Invariants of the direction, each of the first parameter, whose step is positive, and one other."""
    found = []
    for name, step in zip(names[1:], steps[1:], strict=True):
        shared = math.gcd(steps[0], step)
        found.append(written(names[0], -step // shared, name, steps[0] // shared))
    identifiable = " and ".join([", ".join(found[:-1]), found[-1]] if len(found) > 1 else found)
    return f"; only {identifiable} can be identified" if found else ""


def _product(a: str, m: int, b: str, n: int) -> str:
    """a**m * b**n for n > 0."""
    first, second = (name if abs(power) == 1 else f"{name}**{abs(power)}" for name, power in ((a, m), (b, n)))
    return f"{first}*{second}" if m > 0 else f"{second}/{first}"


def _sum(a: str, m: int, b: str, n: int) -> str:
    """m a + n b for n > 0."""
    first, second = (name if abs(factor) == 1 else f"{abs(factor)}*{name}" for name, factor in ((a, m), (b, n)))
    return f"{first} + {second}" if m > 0 else f"{second} - {first}"


def combination(direction: Mapping[str, float]) -> str:
    """A direction in parameter space as a sum with a positive first term; terms with a small share are named after it."""
    terms = sorted(direction.items(), key=lambda term: -abs(term[1]))
    largest = terms[0][1]
    shown = [(name, value * math.copysign(1.0, largest)) for name, value in terms if abs(value) > LEAST_SHARE * abs(largest)]
    text = " ".join(f"{'-' if value < 0 else '+'} {_factor(abs(value))} {name}" for name, value in shown)
    small = ", ".join(name for name, _ in terms[len(shown) :])
    return text.removeprefix("+ ") + (f" (and less than {LEAST_SHARE * 100:g} % of {small})" if small else "")


def combinations(directions: Sequence[Mapping[str, float]]) -> str:
    """All of them as part of a sentence."""
    return "; ".join(map(combination, directions))


def _factor(value: float) -> str:
    return f"{value:.2f}" if value > 0.1 else f"{value:.2g}"
