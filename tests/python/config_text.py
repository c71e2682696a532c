"""The recommended example with the paper's rule, as text to be changed."""

from __future__ import annotations

from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
RECOMMENDED, PAPER = ((EXAMPLES / name).read_text() for name in ("cylinder.toml", "paper.toml"))


def rule_of(text: str) -> str:
    """Its table [rule]."""
    return text[text.index("[rule]") : text.index("[design]")]


TEXT = RECOMMENDED.replace(rule_of(RECOMMENDED), rule_of(PAPER))


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def without(table: str) -> str:
    """The example without one of its tables."""
    start = TEXT.index(f"\n[{table}]")
    return TEXT[:start] + TEXT[TEXT.index("\n[", start + 1) :]
