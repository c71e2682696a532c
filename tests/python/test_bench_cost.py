"""What the guard of instruction counts says; the counting itself is `python -m bench cost`."""

from __future__ import annotations

import pytest

from bench import cost

BEFORE = cost.Cost("g++ 12.2.0", dict.fromkeys(cost.KINDS, 1000))


@pytest.mark.parametrize(
    ("count", "passed", "word"),
    [(1000, True, ""), (1099, True, ""), (1101, False, "dearer: simulate."), (899, True, "cheaper: simulate.")],
)
def test_a_tenth_is_tolerated(count: int, passed: bool, word: str) -> None:
    said, found = cost.verdict(cost.Cost("g++ 12.3.0", BEFORE.instructions | {"simulate": count}), BEFORE)
    assert found == passed
    assert [word in line for line in said] == [True] * bool(word)


def test_another_compiler_is_named_and_held_to_the_same_limit() -> None:
    said, passed = cost.verdict(cost.Cost("g++ 14.1.0", BEFORE.instructions | {"tensor": 1200}), BEFORE)
    assert not passed and "g++ 12.2.0" in said[0] and "g++ 14.1.0" in said[0]


def test_every_kind_is_recorded() -> None:
    assert set(cost.recorded().instructions) == set(cost.KINDS)
