"""Finds the processes of this run and ends exactly those, never by name.

A process is ours if it carries our tag, an environment variable with a random value that its children inherit, and
runs in one of the sessions in which we started something. The tag alone is not enough: a tmux server started by an
uploaded script inherits it and may hold windows of others; but it runs in its own session.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress

TAG = "MAVPROXY_UAVAPI_RUN"
POLL_S = 0.05


def carries(pid: int, tag: str) -> bool:
    """Whether the process was started with our tag; False also if it has gone or belongs to another user."""
    try:
        with open(f"/proc/{pid}/environ", "rb") as environ:
            return f"{TAG}={tag}".encode() in environ.read().split(b"\0")
    except (FileNotFoundError, ProcessLookupError, PermissionError):
        return False


def is_member(pid: int, tag: str, sessions: Collection[int]) -> bool:
    """Whether the process belongs to the run."""
    try:
        return os.getsid(pid) in sessions and carries(pid, tag)
    except ProcessLookupError:
        return False


def members(tag: str, sessions: Collection[int]) -> Iterator[int]:
    """The ids of the run's live processes."""
    for entry in os.listdir("/proc"):
        if entry.isdigit() and is_member(int(entry), tag, sessions):
            yield int(entry)


def signal_member(pid: int, signum: signal.Signals, tag: str, sessions: Collection[int]) -> bool:
    """Signal the process if it is ours; not if its number belongs to another process by now."""
    try:
        descriptor = os.pidfd_open(pid)
    except ProcessLookupError:
        return False
    try:
        # Checked with the descriptor open: from here on the signal can reach only this process.
        if not is_member(pid, tag, sessions):
            return False
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(descriptor, signum)
        return True
    finally:
        os.close(descriptor)


def signal_members(tag: str, sessions: Collection[int], signum: signal.Signals) -> int:
    """Signal all processes of the run; returns their number."""
    return sum(signal_member(pid, signum, tag, sessions) for pid in list(members(tag, sessions)))


def end_members(
    tag: str, sessions: Collection[int], grace_s: float, sleep: Callable[[float], None] = time.sleep
) -> bool:
    """SIGTERM to all processes of the run, SIGKILL to those that remain after the grace period (s).

    Returns:
        Whether they are all gone.
    """
    if not signal_members(tag, sessions, signal.SIGTERM):
        return True
    for _ in range(max(1, round(grace_s / POLL_S))):
        sleep(POLL_S)
        if not any(True for _ in members(tag, sessions)):
            return True
    # Repeated, because a process may have forked while the list was read.
    for _ in range(20):
        if not signal_members(tag, sessions, signal.SIGKILL):
            return True
        sleep(POLL_S)
    return False
