"""Times as clocks and calendars show them, in seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .extras import needed_for
from .values import Array

FORMS = "a time such as 2025-05-01 12:00:00.25, 01.05.2025 12:00, 12:00:00.25 or 1.5 (pandas.to_datetime reads others)"

HALF_A_DAY = np.timedelta64(12, "h")

_DATE = re.compile(r"\d{4}-?\d\d-?\d\d([T ].*)?")
_DAY_FIRST = re.compile(r"^(\d\d)\.(\d\d)\.(\d{4})\b")
_CLOCK = re.compile(r"(\d+ days?,? )?\d+:\d\d:\d\d(\.\d+)?")
_COMMA = re.compile(r"(\d),(\d)")
_MARKS = re.compile(r"\d[-/:]\d|\d\.\d+\.\d")


def is_moment(text: str) -> bool:
    """Whether a text is of a clock or a calendar, rather than a number."""
    return _MARKS.search(text) is not None


def moments(texts: Sequence[str]) -> tuple[Array, NDArray[np.bool_]]:
    """Seconds from the first of times of day, or of dates as in ISO 8601 or with the day first and points, and which are none.

    A clock that falls by more than half a day has passed midnight. Offsets from UTC count.
    """
    with needed_for("dates and times of day"):
        import pandas as pd
    texts = [_COMMA.sub(r"\1.\2", _DAY_FIRST.sub(r"\3-\2-\1", text.strip())) for text in texts]
    dates = _DATE.fullmatch(texts[0]) is not None
    fits = np.array([(_DATE if dates else _CLOCK).fullmatch(text) is not None for text in texts])
    fitting = pd.Series(texts, dtype=object).where(fits, None)
    found: NDArray[Any]
    if dates:
        found = pd.to_datetime(fitting, format="ISO8601", utc=True, errors="coerce").dt.tz_localize(None).to_numpy("M8[ns]")
    else:
        found = pd.to_timedelta(fitting, errors="coerce").to_numpy("m8[ns]")
        midnights = np.cumsum(np.diff(found, prepend=found[:1]) < -HALF_A_DAY)
        found = found + midnights * np.timedelta64(1, "D")
    return since_first(found), np.isnat(found)


def since_first(moments: NDArray[Any]) -> Array:
    """Seconds of dates or durations, to the nanosecond, since the first."""
    return in_seconds(moments - moments[0])


def in_seconds(durations: NDArray[np.timedelta64]) -> Array:
    """Seconds of durations in ns, NaN where there is none."""
    return np.where(np.isnat(durations), np.nan, durations.astype(np.int64) / 1e9)
