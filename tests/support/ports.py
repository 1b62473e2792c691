"""Ports that nobody has; below those that the kernel gives to outgoing connections."""

from __future__ import annotations

import contextlib
import itertools
import os
import socket

PORTS_OF_A_WORKER = 200
_turns = itertools.count(os.getpid())


def _worker() -> int:
    """The number of this worker of pytest-xdist; benchmarks have 10 to 24."""
    return int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))


def free_port() -> int:
    """A TCP port of the loopback that nobody has just now; not soon the same again.

    Tests that run side by side have ranges of their own, so that they do not race.
    """
    first = 11_000 + PORTS_OF_A_WORKER * _worker()
    for _ in range(PORTS_OF_A_WORKER):
        port = first + next(_turns) % PORTS_OF_A_WORKER
        with contextlib.suppress(OSError), socket.socket() as probe:
            probe.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no free port")


def free_instance(count: int = 1) -> int:
    """The first of `count` SITL instances whose ports nobody has just now; the low ones are left to people."""
    first = 30 + 100 * _worker()
    for instance in range(first, first + 100):
        bases = [5760 + 10 * (instance + more) for more in range(count)]
        with contextlib.ExitStack() as probes:
            try:
                for port in [base + offset for base in bases for offset in (0, 2, 3)]:
                    probes.enter_context(socket.socket()).bind(("127.0.0.1", port))
            except OSError:
                continue
            return instance
    raise AssertionError("no free SITL instance")
