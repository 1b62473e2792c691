"""Whether a program has something to do, or waits: from /proc."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from mavproxy_uavapi.core.process_tree import below

COMPUTES = "RD"  # states of threads (proc(5)): it runs, or waits for a disk
ENDED = "ZX"
STATE, USER, SYSTEM = 0, 11, 12  # behind the name in a thread's stat: its state, and the ticks that it has had
BACKLOG = 11  # column of softnet_stat, since Linux 5.14
TICK = 1 / os.sysconf("SC_CLK_TCK")  # s


class Work(NamedTuple):
    """Whether a program and what it has started compute, and the s of processor that they have had."""

    is_busy: bool
    seconds: float


def work_of(pid: int) -> Work:
    """That of a child of ours; one that has ended is busy until that is known.

    Its threads are looked at one after the other: one may be woken after it has been looked at, by one that has gone
    when its own turn comes. So that nobody computes is seen twice.
    """
    work = _seen(pid)
    return work if work.is_busy else _seen(pid)


def _seen(pid: int) -> Work:
    threads = list(_threads(pid))
    has_ended = not threads or threads[0][STATE] in ENDED
    for child in below(pid):
        threads += _threads(child)
    seconds = sum(int(one[USER]) + int(one[SYSTEM]) for one in threads) * TICK
    return Work(has_ended or any(one[STATE] in COMPUTES for one in threads), seconds)


def packets_wait() -> bool:
    """Whether the kernel has packets of this machine for which it had no time: they will wake somebody."""
    with suppress(OSError, IndexError):
        rows = Path("/proc/net/softnet_stat").read_text(encoding="ascii").splitlines()
        return any(int(row.split()[BACKLOG], 16) for row in rows)
    return False


def _threads(pid: int) -> Iterator[list[str]]:
    """The stat of each thread, from its state on; those that end meanwhile are left out."""
    with suppress(OSError):
        for thread in os.listdir(f"/proc/{pid}/task"):
            with suppress(OSError):
                stat = Path(f"/proc/{pid}/task/{thread}/stat").read_text(encoding="utf-8", errors="replace")
                yield stat.rpartition(")")[2].split()
