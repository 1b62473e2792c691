"""Ports that nobody has; below those that the kernel gives to outgoing connections.

The workers of pytest-xdist run side by side. Each has a range of its own, so that they do not race; benchmarks are
workers 10 to 24. Two sessions begin at different places of a range, by their process numbers.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import socket

MOST_WORKERS = 25
INSTANCES_OF_A_WORKER = 40
FIRST_INSTANCE = 30  # the low ones are left to people
PORTS_OF_A_WORKER = 200
_turns = itertools.count(os.getpid())


def _base(instance: int) -> int:
    """The first port of an SITL instance; the next one's is ten more."""
    return 5760 + 10 * instance


FIRST_PORT = _base(FIRST_INSTANCE + MOST_WORKERS * INSTANCES_OF_A_WORKER)


def _worker() -> int:
    return int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))


def free_port() -> int:
    """A TCP port of the loopback that nobody has just now; not soon the same again."""
    first = FIRST_PORT + PORTS_OF_A_WORKER * _worker()
    for _ in range(PORTS_OF_A_WORKER):
        port = first + next(_turns) % PORTS_OF_A_WORKER
        with contextlib.suppress(OSError), socket.socket() as probe:
            probe.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no free port")


def free_instance(count: int = 1) -> int:
    """The first of `count` SITL instances in a row whose ports nobody has just now; not soon the same again."""
    first = FIRST_INSTANCE + INSTANCES_OF_A_WORKER * _worker()
    places = INSTANCES_OF_A_WORKER - count + 1
    for _ in range(places):
        instance = first + next(_turns) % places
        ports = [_base(instance + more) + offset for more in range(count) for offset in (0, 2, 3)]
        with contextlib.ExitStack() as probes:
            try:
                for port in ports:
                    probes.enter_context(socket.socket()).bind(("127.0.0.1", port))
            except OSError:
                continue
            return instance
    raise AssertionError("no free SITL instance")
