"""What a campaign counts, and what it finds."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

EXAMPLES = 3  # of every kind that are kept, the shortest ones


@dataclass(frozen=True)
class Finding:
    """One thing that is not as it should be.

    `kind` says what, `ratio` how much more than allowed, `code` shows it, and `check` is what has found it.
    """

    kind: str
    ratio: float
    code: str
    check: str = ""

    @property
    def title(self) -> str:
        return f"{self.kind} ({self.ratio:.3g} times what is allowed)"


@dataclass
class Figures:
    """Counts by name, the largest ratio of an error to its tolerance by name, and the shortest examples by kind."""

    counts: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)
    seconds: Counter[str] = field(default_factory=Counter)
    examples: dict[str, list[Finding]] = field(default_factory=dict)

    def count(self, name: str, number: int = 1) -> None:
        self.counts[name] += int(number)

    def ratio(self, name: str, value: float) -> None:
        """An error as a multiple of its tolerance."""
        self.worst[name] = max(self.worst.get(name, 0.0), float(value))

    def add(self, other: Figures) -> None:
        """Take in those of another round."""
        self.counts.update(other.counts)
        self.seconds.update(other.seconds)
        for name, value in other.worst.items():
            self.ratio(name, value)
        for findings in other.examples.values():
            for finding in findings:
                self.example(finding)

    def example(self, finding: Finding) -> None:
        """Keep a finding among the examples of its kind if it is one of the shortest."""
        kept = self.examples.setdefault(finding.kind, [])
        if all(finding.code != other.code for other in kept):
            kept.append(finding)
            kept.sort(key=lambda other: len(other.code))
            del kept[EXAMPLES:]

    def table(self) -> str:
        width = max(map(len, (*self.counts, *self.worst, "")))
        lines = [f"{name:{width}}  {number:>12,}" for name, number in sorted(self.counts.items())]
        if self.worst:
            lines += ["", "largest error, in units of what the tolerance asks for"]
            lines += [f"{name:{width}}  {value:>12.3g}" for name, value in sorted(self.worst.items())]
        lines += ["", "seconds", *(f"{name:{width}}  {value:>12.1f}" for name, value in self.seconds.most_common())]
        return "\n".join(lines)
