"""The one way to a terminal: what is printed may quote somebody else, and is escaped and cut line by line."""

from __future__ import annotations

from typing import TextIO

from mavproxy_uavapi.core.text import joined, line_of

BELL = "\a"


def say(*lines: str, file: TextIO | None = None) -> None:
    """Print lines, to stdout by default. A line break within one is spelled out: it may come from somebody else."""
    print(joined(lines), file=file, flush=True)


def say_text(text: str, file: TextIO | None = None) -> None:
    """Print a text whose line breaks are ours, such as one of `joined`."""
    say(*text.split("\n"), file=file)


def alarm(sentence: str) -> None:
    """Print a line that rings."""
    print(f"{BELL}*** {line_of(sentence)}", flush=True)
