"""Some cases in a row, all checks of each, and what is wrong made as small as Hypothesis can."""

from __future__ import annotations

import signal
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from hypothesis.errors import Flaky

from check_bits import Levels, check_bits, check_compiled
from check_callables import check_callable
from check_covariances import check_covariance
from check_definitions import check_definitions
from check_delay import check_delay
from check_floats import check_floats
from check_kinds import check_kinds
from check_late import check_late
from check_local import check_local
from check_nice import check_nice
from check_noise import check_noise
from check_records import check_record
from check_runs import check_runs
from check_sampling import check_sampling
from check_sensitivities import check_sensitivities
from check_shared import check_shared
from check_states import check_states
from check_updates import check_updates
from checks import Bench, check_functions, check_static
from figures import Figures, Finding
from random_cylinders import cylinders
from random_models import Case, cases

SLOW, HANGS = 20.0, 120  # seconds of the processor that no model may take to be made, and no case for all its checks
COMPILES = 900  # seconds for a case with a compilation
WAITS = 10  # times as many seconds by the clock: others may keep the processor busy
SMALLER = 40.0  # seconds for making one finding small
EXAMPLES = 2  # findings of one kind that are made small; further ones are counted


class Wrong(Exception):
    """Something in this case is not as it should be."""


class Enough(BaseException):
    """The time is over; Hypothesis lets it through."""


class Hangs(Exception):
    """A case takes longer than it may."""


@dataclass
class Round:
    """What came out of a round: figures, and findings that were made small, with the seed."""

    number: int
    figures: Figures = field(default_factory=Figures)
    findings: list[Finding] = field(default_factory=list)


@st.composite
def everything(draw: Callable[[Any], Any]) -> Case:
    case: Case = draw(cylinders()) if draw(st.integers(0, 11)) == 11 else draw(cases())
    return case


def run_round(
    number: int,
    count: int,
    known: Mapping[str, int],
    until: float,
    levels: Levels | None = None,
    before: Callable[[Case], None] = lambda case: None,
    also: str | None = None,
) -> Round:
    """Draw cases, at most `count` and none after the time `until`, up to the first that is wrong in a way not yet `known`.

    That one is made small. What is wrong in a known way is counted. `before` is called with every case; `also` is checked of each,
    in the place of what it says itself.
    """
    done = Round(number)
    wanted: Finding | None = None
    found: dict[str, Finding] = {}
    deadline = until

    @seed(number)
    @settings(
        max_examples=count,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate, Phase.shrink),
        report_multiple_bugs=False,
        print_blob=False,
    )
    @given(everything())
    def one(case: Case) -> None:
        nonlocal wanted, deadline
        case = case if also is None else replace(case, also=also)
        if repr(case) in found:
            raise Wrong
        now = time.monotonic()
        if now > deadline:
            raise Enough
        before(case)
        findings = examined(case, done.figures, levels) if wanted is None else examined(case, Figures(), levels, wanted.check)
        if wanted is None:
            for finding in findings:
                done.figures.count(f"WRONG: {finding.kind}")
            new = [finding for finding in findings if known.get(finding.kind, 0) < EXAMPLES]
            if not new:
                return
            wanted, deadline = new[0], time.monotonic() + SMALLER
        for finding in findings:
            if finding.kind == wanted.kind:
                found[repr(case)] = finding
                raise Wrong

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # as those of Hypothesis, SciPy, and of what functions cost
            warnings.filterwarnings("error", category=RuntimeWarning, module="fisherpoint")
            one()
    except (Wrong, Flaky, Enough):
        pass
    finally:
        if found:
            done.findings.append(min(found.values(), key=lambda finding: len(finding.code)))
    return done


def examined(case: Case, figures: Figures, levels: Levels | None = None, only: str = "") -> list[Finding]:
    """Check a case, by all checks or one alone; whatever is raised is a finding too."""
    figures.count("cases")
    try:
        with no_longer_than(COMPILES if case.also == "compiled" else HANGS):
            return checked(case, figures, levels, only)
    except Hangs:
        figures.count("cases that take too long")
        return [Finding("takes too long", 1.0, case.code())]
    except Exception:
        last = traceback.format_exc().strip().splitlines()
        return [Finding(f"raises {last[-1]:.60}", 1.0, case.code() + "\n# " + "\n# ".join(last[-14:]))]


def checked(case: Case, figures: Figures, levels: Levels | None, only: str) -> list[Finding]:
    begin = time.process_time()
    try:
        bench = Bench(case, figures)
    except ValueError as error:
        figures.count("models refused")
        if "depends on something" not in str(error):
            figures.example(Finding("refused", 1.0, f"{case.code()}\n# {error}"))
        return []
    if (taken := time.process_time() - begin) > SLOW:
        return [Finding("slow to be made", taken / SLOW, case.code())]
    checks: dict[str, Callable[[], None]] = {
        "functions": lambda: check_functions(bench),
        "static": lambda: check_static(bench),
        "states": lambda: check_states(bench),
        "sensitivities": lambda: check_sensitivities(bench, 1e-6, ("DOP853", "Radau")[case.seed % 3 == 0]),
        "sensitivities, other tolerances": lambda: check_sensitivities(bench, (1e-4, 1e-9)[case.seed % 2], "RK45"),
        "covariances": lambda: check_covariance(bench, (None, "RK45")[case.seed % 2]),
    }
    also: dict[str, Callable[[], None]] = {
        "bits": lambda: check_bits(bench),
        "floats": lambda: check_floats(bench),
        "nice": lambda: check_nice(bench),
        "kinds": lambda: check_kinds(bench),
        "runs": lambda: check_runs(bench),
        "definitions": lambda: check_definitions(bench),
        "delay": lambda: check_delay(bench),
        "late": lambda: check_late(bench),
        "updates": lambda: check_updates(bench),
        "sampling": lambda: check_sampling(bench),
        "shared": lambda: check_shared(bench),
        "noise": lambda: check_noise(bench),
        "local": lambda: check_local(bench),
        "record": lambda: check_record(bench, by_scipy=True),
        "callable": lambda: check_callable(bench),
        "levels": lambda: levels.check(bench) if levels is not None else None,
        "compiled": lambda: check_compiled(bench),
    }
    for name, check in (checks | ({case.also: also[case.also]} if case.also else {})).items():
        if only and name != only:
            continue
        begin, before = time.monotonic(), len(bench.findings)
        check()
        figures.seconds[name] += time.monotonic() - begin
        bench.findings[before:] = [replace(finding, check=name) for finding in bench.findings[before:]]
    return bench.findings


@contextmanager
def no_longer_than(seconds: int) -> Iterator[None]:
    """Raise `Hangs` in the body after that time of the processor, or `WAITS` times as long by the clock."""

    def ring(*_: object) -> None:
        raise Hangs

    timers = ((signal.SIGPROF, signal.ITIMER_PROF, seconds), (signal.SIGALRM, signal.ITIMER_REAL, WAITS * seconds))
    former = [signal.signal(number, ring) for number, _, _ in timers]
    for _, timer, limit in timers:
        signal.setitimer(timer, limit)
    try:
        yield
    finally:
        for (number, timer, _), handler in zip(timers, former, strict=True):
            signal.setitimer(timer, 0)
            signal.signal(number, handler)
