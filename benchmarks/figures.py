"""Figures of a run: the machine, what a process has used, percentiles, a table."""

from __future__ import annotations

import math
import os
from pathlib import Path


def put_first(*pids: int) -> None:
    """Let the sessions of these processes, and ours, run before the machine's other work, all alike.

    Needs root and Linux's scheduling by session (autogroup).

    Raises:
        OSError: it has neither.
    """
    for pid in (os.getpid(), *pids):
        Path(f"/proc/{pid}/autogroup").write_text("-15", encoding="ascii")


def percentile(values: list[float], share: float) -> float:
    """The value below which that share of `values` lies; NaN of nothing."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)] if ordered else math.nan


def jitter(values: list[float]) -> float:
    """Mean difference between one value and the next (as in RFC 3550); NaN of nothing."""
    steps = [abs(after - before) for before, after in zip(values, values[1:], strict=False)]
    return sum(steps) / len(steps) if steps else math.nan


def cpu_seconds(pid: int) -> float:
    """What a process has used of all cores so far, its threads included."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def machine() -> str:
    """The machine and how busy others keep it."""
    load = ", ".join(f"{one:.1f}" for one in os.getloadavg())
    return f"{os.cpu_count()} cores, load average {load} (1, 5, 15 min) before the run"


def table(headings: list[str], rows: list[list[str]]) -> str:
    """Aligned columns."""
    widths = [max(len(row[column]) for row in [headings, *rows]) for column in range(len(headings))]
    lines = [
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in [headings, *rows]
    ]
    return "\n".join(lines)
