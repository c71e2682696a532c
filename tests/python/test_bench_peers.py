"""The programs that the bench compares with: the list of them, and that those which are installed solve our task.

What a tolerance means differs between programs, so they may be off by a hundred times theirs; a slip in an equation shows as more.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import fisherpoint as fp
from bench.accuracy import output_errors, sensitivity_errors
from bench.peers import show
from bench.peers.peer import Peer, blocks
from bench.peers.registry import ENTRIES, OURS, Entry
from bench.workload import MODEL, Pairs, random_pairs

ALL = pytest.mark.parametrize("entry", [OURS, *ENTRIES], ids=lambda entry: entry.module)


@cache
def few_pairs() -> Pairs:
    """Eight experiments with five parameter sets each, a run of equal ones that no program's lanes divide."""
    pairs = random_pairs(5, seed=9)[:40]
    assert {len(block.spans) for block in blocks(pairs)} == {1, 2}  # with and without a passage of the spool's centre
    return pairs


def load(entry: Entry) -> list[Peer]:
    missing = entry.missing()
    if missing is not None:
        pytest.skip(f"not installed: {missing}")
    return entry.load()


@ALL
def test_outputs_are_ours(entry: Entry) -> None:
    pairs = few_pairs()
    expected = fp.simulate(MODEL, pairs.points, pairs.theta, rtol=1e-12).y
    for peer in load(entry):
        errors = output_errors(peer.outputs(pairs, 1e-6).y, expected)
        assert np.max(errors) < 1e-4, peer.name


@ALL
def test_sensitivities_are_ours(entry: Entry) -> None:
    pairs = few_pairs()
    expected = fp.sensitivities(MODEL, pairs.points, pairs.theta, rtol=1e-12)
    for peer in load(entry):
        if not peer.has_sensitivities:
            continue
        actual = peer.sensitivities(pairs, 1e-6)
        assert actual.dy_dtheta is not None
        assert np.max(output_errors(actual.y, expected.y)) < 1e-4, peer.name
        assert np.max(sensitivity_errors(actual.dy_dtheta, expected.dy_dtheta)) < 1e-4, peer.name


def test_blocks_are_the_runs_of_equal_points_in_parts() -> None:
    pairs = few_pairs()
    for most, sizes in ((None, [5] * 8), (3, [3, 2] * 8)):
        found = list(blocks(pairs, most))
        assert [len(block.theta) for block in found] == sizes
        np.testing.assert_array_equal(np.concatenate([block.theta for block in found]), pairs.theta)


def test_every_target_names_a_program() -> None:
    entries = [entry for entry in ENTRIES if entry.module in ("boost_odeint", "heyoka_batch")]
    names = {peer.name for entry in entries for peer in load(entry)}
    assert {name for _, name, _ in show.TARGETS} <= names


def test_a_program_that_is_not_installed_says_what_to_install() -> None:
    assert Entry("none", ("no_such_package",)).missing() == "pip install no_such_package"
