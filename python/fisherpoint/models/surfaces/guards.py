"""Conditions under which a branch is taken."""

from __future__ import annotations

from typing import Any

from ..tape.branch import Select

Guards = tuple[tuple[Any, bool], ...]
"""Conditions, and whether each holds."""


def guards_of(condition: Any, holds: bool) -> Guards:
    """What holds, or does not, where a condition does or does not: of "a and b" that holds, a and b."""
    if isinstance(condition, Select):
        first, *branches = condition.args
        for taken, other in ((True, branches[1]), (False, branches[0])):
            if other.is_number and (other > 0) != holds:  # so the first went the other way
                rest = branches[0] if taken else branches[1]
                return (*guards_of(first, taken), *(() if rest.is_number else guards_of(rest, holds)))
    return ((condition, holds),)
