"""What the guard of counts reports; the counting itself is `python -m bench cost`."""

from __future__ import annotations

import pytest

from bench import cost

BEFORE = cost.Cost("g++ 12.2.0", {kind: dict.fromkeys(cost.EVENTS.values(), 1000.0) for kind in cost.KINDS})


def changed(kind: str, event: str, count: float, compiler: str = "g++ 12.3.0") -> cost.Cost:
    return cost.Cost(compiler, BEFORE.counts | {kind: BEFORE.counts[kind] | {event: count}})


@pytest.mark.parametrize(
    ("kind", "event", "limit"), [("simulate", "instructions", 30), ("simulate", "I1 misses", 200), ("runs", "data reads", 200)]
)
@pytest.mark.parametrize(
    ("beyond", "passed", "word"), [(-1000, True, ""), (-1, True, ""), (1, False, "Dearer than is tolerated: {} ({}).")]
)
def test_growth_is_tolerated_up_to_a_limit(kind: str, event: str, limit: int, beyond: int, passed: bool, word: str) -> None:
    count, word = 1000 + max(0, limit + beyond), word.format(kind, event)
    lines, found = cost.verdict(changed(kind, event, count), BEFORE)
    assert found == passed
    assert [word in line for line in lines] == [True] * bool(word)


def test_what_has_become_cheaper_is_to_be_recorded() -> None:
    lines, passed = cost.verdict(changed("rows", "instructions", 969), BEFORE)
    assert passed and lines == ["Much cheaper: rows (instructions). Keep it: python -m bench cost --record."]


def test_a_few_misses_more_are_none() -> None:
    few = cost.Cost(BEFORE.compiler, changed("rows", "I1 misses", 0.1).counts)
    assert cost.verdict(cost.Cost(few.compiler, few.counts | {"rows": few.counts["rows"] | {"I1 misses": 5.0}}), few) == ([], True)
    assert not cost.verdict(cost.Cost(few.compiler, few.counts | {"rows": few.counts["rows"] | {"I1 misses": 50.0}}), few)[1]


def test_another_compiler_is_named_and_held_to_the_same_limit() -> None:
    lines, passed = cost.verdict(changed("tensor", "instructions", 1200, "g++ 14.1.0"), BEFORE)
    assert not passed and "g++ 12.2.0" in lines[0] and "g++ 14.1.0" in lines[0]


def test_every_kind_is_recorded() -> None:
    found = cost.recorded().counts
    assert set(found) == set(cost.KINDS) and all(set(counts) == set(cost.EVENTS.values()) for counts in found.values())
