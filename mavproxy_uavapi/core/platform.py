"""What the systems do differently. Client, simulated vehicles, station and relay run without POSIX."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
from collections.abc import Callable

try:
    import fcntl  # noqa: F401  what has it, has the others
except ModuleNotFoundError:
    POSIX = False
else:
    POSIX = True

# Its processes are ended by pidfds.
LINUX = hasattr(os, "pidfd_open")
NICENESS = 10
NEEDED = "this needs Linux; on Windows WSL is one (docs/deploy.md says what runs without)"


def require_posix() -> None:
    """Say at once what would fail later, by a missing module or function.

    Raises:
        ImportError: this is no POSIX system. MAVProxy prints the text of this error as one line.
    """
    if not POSIX:
        raise ImportError(NEEDED)


def on_stop(stop: Callable[[], object]) -> None:
    """Have the running loop call `stop` at Ctrl-C, and at SIGTERM."""
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        try:
            loop.add_signal_handler(number, stop)
        except NotImplementedError:  # Windows' loops have none
            signal.signal(number, lambda *_: loop.call_soon_threadsafe(stop))


def follow_at_once(server: socket.socket) -> None:
    """Let a server have the address of one that has just ended; on Windows the option would let two have it."""
    if POSIX:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)


def yield_processor() -> None:
    """Let other processes have the processor first, from now on and for good.

    A session that this process leads yields as a whole; one that it was started in, as a terminal, is not touched.
    """
    if not POSIX:
        return
    niceness = os.nice(NICENESS)
    if os.getsid(0) != os.getpid():
        return
    # Linux shares a desktop's processors among sessions, in each of which niceness counts only within.
    with contextlib.suppress(OSError), open("/proc/self/autogroup", "w", encoding="ascii") as group:
        group.write(str(niceness))
