"""Counts of what makes the package hard to carry on do not grow: `tests/structure/structure_counts.py`."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from structure_counts import LIMITS


@pytest.mark.parametrize("count", LIMITS, ids=lambda count: count.__name__)
def test_no_count_grows(count: Callable[[], int]) -> None:
    assert count() <= LIMITS[count]
