"""The numbers that steer the search for windows of a record."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PieceSearchTuning:
    """The search for disjoint windows, in the order of its stages (piece_search.py)."""

    weight_rounds: int = 60
    """Maximum number of rounds in which weights on all windows are improved."""

    line_halvings: int = 40
    """Number of halvings of the step of such a round, after which it is known to the last digits."""

    least_gain: float = 1e-7
    """Gain of log det that an exchange must exceed."""

    most_exchanges: int = 10_000
    """Maximum number of exchanges."""

    pairs_at_once: int = 4096
    """Number of exchanges whose gains are computed at once, those with the largest bounds first."""

    numbers_at_once: int = 4_000_000
    """Maximum number of bounds at once, so that memory stays bounded."""
