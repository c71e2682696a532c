"""Blocks of parameters that can be identified apart from each other, where the outputs are measured without gap or error.

1. The course of a state is *known* where no parameter moves it, but through known states: its start is given. It is known too
   where the equations determine it at every instant: its unit vector is in the row space of their Jacobian by all that is not
   known, at random instants on random sides of all branches. So v is known in q' = v where q is, the pose of a platform
   where the lengths of its legs are measured, and a where a**2 is: locally, which is up to finitely many values.
2. The equations are the outputs, and the rates of known states, which are known as time derivatives; those alone whose branches
   are decided by what is known. Parameters are unknowns as states are, and known where the equations determine them.
3. Unknowns belong together where the Jacobian connects them at any of the instants: it is no direct sum of matrices of which
   one has the one unknown, and another the other. All other equations connect all unknowns that they read: the rate of a state
   that is not known, with this state; one whose branches hang on unknowns; that of a state that is set anew; and where a dead
   time is a parameter.

Where a Jacobian is a direct sum all over a neighbourhood, the set of unknowns that solve the equations of an instant is
locally a product of sets, one for each group. So is that of all instants together, as groups are the same at each. So each
block has equations of its own, with measured signals put in, and what they leave open is open in this block alone: the
sensitivities S of dense measurements have rank S = the sum of the ranks of the blocks' columns. How much each block is known
from noisy data is another matter: errors of one equation reach several blocks.

All this is generic: it holds but for instants, parameters and states on surfaces, at constants as they are. Where the
numbers do not part zero from rounding, equations connect all that they read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .eliminated import Eliminated, eliminated
from .instants import RandomInstants

Names = tuple[str, ...]


class Row(NamedTuple):
    """An equation: its place among rates and outputs, the state whose rate it is, and the states and parameters that it reads.

    `plain`: it holds at every instant as it is written.
    """

    place: int
    state: str | None
    reads: frozenset[str]
    plain: bool


class Separation:
    """What separates in the equations of a model, by the rule above.

    Parameters
    ----------
    rows : sequence of Row
        Outputs, and rates of states that reach one.
    unmoved : callable
        From what is known to the states that no parameter moves but through that.
    instants : RandomInstants

    Attributes
    ----------
    known : frozenset of str
        States whose course is known, and parameters that every instant determines alone.
    """

    def __init__(self, rows: Sequence[Row], unmoved: Callable[[frozenset[str]], frozenset[str]], instants: RandomInstants) -> None:
        self._rows, self._instants = rows, instants
        self._found: dict[tuple[Names, tuple[int, ...]], Eliminated | None] = {}
        known, before = unmoved(frozenset()), -1
        while len(known) > before:
            before = len(known)
            for names, found in self._eliminated(known):
                if found is not None:
                    known |= {name for name, sure in zip(names, found.determined, strict=True) if sure}
            known |= unmoved(known)
        self.known = known

    def of(self, parameters: Names) -> tuple[Names, ...]:
        """The blocks of those parameters that stand in a row, in the order of the parameters."""
        groups, places = Groups(), {name: j for j, name in enumerate(parameters)}
        for row in self._rows:
            groups.add(row.reads)
            if not self._usable(row, self.known):  # it connects all that it reads
                groups.join((row.reads | ({row.state} if row.state else set())) - self.known)
        for names, found in self._eliminated(self.known):
            if found is None:
                groups.join(names)
            else:
                for i, j in np.argwhere(np.triu(found.connected, 1)).tolist():
                    groups.join((names[i], names[j]))
        named = [tuple(sorted(places.keys() & group, key=places.__getitem__)) for group in groups]
        return tuple(sorted(filter(None, named), key=lambda names: places[names[0]]))

    def _usable(self, row: Row, known: frozenset[str]) -> bool:
        """Whether all is known of the row but what its smooth terms read."""
        return row.plain and self._instants.conditions[row.place] <= known and (row.state is None or row.state in known)

    def _eliminated(self, known: frozenset[str]) -> Iterator[tuple[Names, Eliminated | None]]:
        """The unknowns of each group of usable rows that share some, and what these rows show of them."""
        unknowns = {row.place: row.reads - known for row in self._rows if self._usable(row, known)}
        groups, rows_of = Groups(), dict[str, list[int]]()
        for unknown in unknowns.values():
            groups.join(unknown)
        for place, unknown in unknowns.items():
            if unknown:
                rows_of.setdefault(groups.first(next(iter(unknown))), []).append(place)
        for group in groups:
            names, rows = tuple(sorted(group)), rows_of[groups.first(next(iter(group)))]
            key = names, tuple(rows)
            if key not in self._found:
                self._found[key] = eliminated(*self._instants.matrix(rows, names))
            yield names, self._found[key]


class Groups:
    """Names in groups that grow together."""

    def __init__(self) -> None:
        self._above: dict[str, str] = {}

    def first(self, name: str) -> str:
        """The name that stands for the group of this one."""
        above = self._above.setdefault(name, name)
        while above != self._above[above]:
            self._above[above] = self._above[self._above[above]]
            above = self._above[above]
        return above

    def add(self, names: Iterable[str]) -> None:
        """Put each name into a group of its own, if it has none yet."""
        for name in names:
            self.first(name)

    def join(self, names: Iterable[str]) -> None:
        """Put names into one group, with the groups that they are in."""
        firsts = [self.first(name) for name in names]
        self._above |= dict.fromkeys(firsts, firsts[0]) if firsts else {}

    def __iter__(self) -> Iterator[frozenset[str]]:
        found: dict[str, set[str]] = {}
        for name in self._above:
            found.setdefault(self.first(name), set()).add(name)
        return iter([frozenset(group) for group in found.values()])


def block_lines(blocks: Sequence[Names], width: int = 100) -> list[str]:
    """Blocks as text: on one line where they fit, else each on its own."""
    each = [f"{{{', '.join(block)}}}" for block in blocks]
    together = ", ".join(each)
    return [together] if len(together) <= width else each
