"""Windows that were picked from a record, as a report."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...show.numbers import computed, counted, number, percent
from ...show.section import Report, Section
from .picked_windows import CHOICES, PickedWindows

_ROWS = 20  # windows shown of a longer list


def piece_report(design: PickedWindows) -> Report:
    """Windows, parameters, comparison, search, and warnings."""
    taken = len(design.windows) * design.length
    headline = (
        f"{counted(len(design.windows), 'window')} of {design.length} samples: {percent(taken / design.n_samples)} of the record's"
        " samples"
    )
    share = design.versus("all")
    if share is not None:
        headline += f", {percent(share)} of the information in all windows side by side"
    inner = design.evaluation.report()
    sections = [_windows(design), *inner.sections, _comparison(design), _search(design)]
    return Report(headline, sections, [*_warnings(design), *inner.warnings])


def _windows(design: PickedWindows) -> Section:
    order = np.argsort(-np.nan_to_num(design.shares), kind="stable")[:_ROWS]
    numbers = np.isfinite(design.y).sum(axis=(1, 2))
    rows = [
        (str(design.windows[k]), str(design.first[k]), number(float(design.t[k]), 6), str(numbers[k]), percent(design.shares[k]))
        for k in order.tolist()
    ]
    more = len(design.windows) - len(rows)
    notes = [f"The largest shares; {counted(more, 'window')} more are picked"] if more else []
    columns = ("window", "first sample", "t [s]", "numbers", "share of what is known")
    return Section("Windows that say most", columns, rows, notes=notes)


def _comparison(design: PickedWindows) -> Section:
    rows = []
    for name, words in CHOICES.items():
        value, ratio = design.references[name], design.versus(name)
        text = computed(value, 6) if np.isfinite(value) else "singular"
        rows.append((words, text, "-" if ratio is None else f"{percent(ratio)}"))
    columns = ("other choices", "log det F", "information of those picked, by D-efficiency")
    return Section("Next to other choices", columns, rows)


def _search(design: PickedWindows) -> Section:
    efficiency = design.efficiency
    facts = [
        ("log det F, sum over samples", computed(design.log_det, 6) if np.isfinite(design.log_det) else "-inf: singular"),
        ("no choice exceeds", computed(design.bound, 6)),
        ("D-efficiency against the best choice", "-" if efficiency is None else f"at least {_whole(efficiency)}"),
        ("windows", f"{design.n_windows}, of which {design.n_disjoint} share no sample"),
        *((f"left out: {reason}", str(count)) for reason, count in design.left_out.items()),
        ("end of the search", f"{design.stop_reason.words} ({counted(design.exchanges, 'exchange')})"),
        *_added(design),
        ("time", f"{design.seconds:.1f} s"),
    ]
    return Section("Search", (), facts)


def _added(design: PickedWindows) -> Iterator[tuple[str, str]]:
    if design.ridge:
        what = f"{number(design.ridge)} of the information of all windows, to compare choices; no figure here contains it"
        yield "added to F while singular", what


def _whole(efficiency: float) -> str:
    """In percent, rounded down."""
    return f"{min(int(efficiency * 1e5) / 1e3, 100.0):g} %"


def _warnings(design: PickedWindows) -> Iterator[str]:
    evaluation = design.evaluation
    if evaluation.covariance is None:
        yield (
            f"The windows determine {evaluation.rank} of {len(evaluation.parameters)} parameters: the combinations named below the"
            " criterion cannot be estimated from them. Pick more, or longer ones."
        )
    if not design.stop_reason.complete:
        yield f"The search was ended early ({design.stop_reason.words}). {design.stop_reason.advice}"
