"""What soaks note: how requests ended, what must not be, and what MAVProxy holds."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from figures import table

RSS_ALLOWED = 5.0  # MB
BAD_WORDS = ("Traceback", "defect in", "defect of this program", "Task was destroyed", "never retrieved")


@dataclass
class Notes:
    """What happened: how often each kind of request ended how, how long it took, and what must not be."""

    outcomes: dict[str, Counter[str]] = field(default_factory=dict)
    slowest: dict[str, float] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    events: Counter[str] = field(default_factory=Counter)

    def answered(self, kind: str, outcome: str, seconds: float) -> None:
        """A request of that kind ended."""
        self.outcomes.setdefault(kind, Counter())[outcome] += 1
        self.slowest[kind] = max(self.slowest.get(kind, 0.0), seconds)

    def fail(self, what: str) -> None:
        """Something that must not be."""
        print(f"  FAILURE: {what}", flush=True)
        self.failures.append(what)

    def summary(self) -> str:
        """All as a table."""
        rows = []
        for kind, counts in sorted(self.outcomes.items()):
            reported = ", ".join(f"{outcome} {count}" for outcome, count in counts.most_common())
            rows.append([kind, str(sum(counts.values())), f"{self.slowest[kind]:.1f}", reported])
        happened = ", ".join(f"{name} {count}" for name, count in sorted(self.events.items()))
        return f"{table(['requests', 'count', 'slowest s', ''], rows)}\nmeanwhile: {happened}"


@dataclass(frozen=True)
class Usage:
    """What MAVProxy holds."""

    rss: float  # MB
    threads: int
    descriptors: int
    children: int

    @classmethod
    def of(cls, pid: int) -> Usage:
        """Of a process."""
        lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
        status = dict(line.split(":", 1) for line in lines)
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
        rss = int(status["VmRSS"].split()[0]) / 1024
        return cls(rss, int(status["Threads"]), len(os.listdir(f"/proc/{pid}/fd")), len(children))

    def __str__(self) -> str:
        return f"{self.rss:.1f} MB, {self.threads} threads, {self.descriptors} descriptors, {self.children} children"


def look_for_bad_words(log: str, notes: Notes) -> None:
    """What no log may hold; of several alike the first one is told in full."""
    lines = log.splitlines()
    seen: Counter[str] = Counter()
    for number, line in enumerate(lines):
        if not any(word in line for word in BAD_WORDS):
            continue
        last = next((one for one in lines[number + 1 :] if one[:1].isalpha() and not one.startswith("During")), "")
        seen[last] += 1
        if seen[last] == 1:
            notes.fail("in MAVProxy's log:\n    " + "\n    ".join(lines[max(number - 1, 0) : number + 40]))
    for last, count in seen.items():
        print(f"  {count} x {last}")
