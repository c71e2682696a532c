"""What comes of calls with clumsy arguments: refused in our words, taken where that may be, or a fault."""

from __future__ import annotations

import re
import signal
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from types import FrameType
from typing import Any

from fisherpoint.design.file.configuration import ConfigError
from misuse_cases import cases
from misuse_values import CLASS, CLUMSY, FUNCTION

OURS = re.compile(r"[^\n]*\bexpected\b[^\n]*\b(given|found)\b[^\n]*")
LONGEST = 1000
"""Characters of a message."""


@dataclass
class Outcome:
    """How a call ended: "refused" in our words, "taken" where the value may be, or in a way that must not be."""

    kind: str
    text: str = ""


class Hangs(BaseException):
    """A call takes too long."""


def outcome(call: Callable[[], Any], may_be_taken: bool, seconds: float = 20.0) -> Outcome:
    """Call, and judge what comes of it."""

    def ring(number: int, frame: FrameType | None) -> None:
        raise Hangs

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = call()
    except Hangs:
        return Outcome("hangs")
    except OSError as error:  # of a path, which the system names
        return Outcome("refused" if error.filename is not None or OURS.fullmatch(str(error)) else "foreign", repr(error))
    except (ValueError, TypeError, KeyError, IndexError) as error:
        text = str(error)
        ours = (OURS.fullmatch(text) or isinstance(error, ConfigError)) and text.isprintable() and len(text) <= LONGEST
        return Outcome("refused" if ours else "foreign", f"{type(error).__name__}: {text[:300]!r}")
    except Exception as error:
        return Outcome("foreign", f"{type(error).__name__}: {str(error)[:300]!r}")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    return Outcome("taken" if may_be_taken else "accepted", repr(type(result)))


@dataclass
class Misuse:
    """What came of calls with clumsy arguments."""

    counts: dict[str, int] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def try_one(self, name: str, argument: str, value: str) -> None:
        """Call with one argument replaced."""
        self.try_some(name, {argument: value})

    def try_some(self, name: str, values: dict[str, str]) -> None:
        """Call with arguments replaced; what comes of it may be a result only where each may be taken."""
        case = cases()[name]
        kinds = {argument: set(case.arguments[argument][1:]) for argument in values}
        if any(FUNCTION in kinds[argument] and CLASS in CLUMSY[value].kinds for argument, value in values.items()):
            return  # a function too, of which the errors are its own
        arguments = {key: good for key, (good, *_) in case.arguments.items()}
        arguments |= {argument: CLUMSY[value].make() for argument, value in values.items()}
        may_be_taken = all(CLUMSY[value].kinds & kinds[argument] for argument, value in values.items())
        self.count(f"{name}({values})", outcome(lambda: case.call(**arguments), may_be_taken))

    def count(self, call: str, found: Outcome) -> None:
        """Count an outcome, and keep what must not be."""
        self.counts[found.kind] = self.counts.get(found.kind, 0) + 1
        if found.kind not in ("refused", "taken"):
            self.faults.append(f"{call}: {found.kind} {found.text}")
