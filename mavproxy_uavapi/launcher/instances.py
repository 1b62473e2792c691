"""Simulated vehicles on one machine: the number of each sets its ports, 10 apart."""

from __future__ import annotations

import errno
import socket
from collections.abc import Iterator
from contextlib import contextmanager

from mavproxy_uavapi.launcher.errors import LaunchError

HIGHEST = 99

# Offsets from 5760 + 10 * instance: SITL's three serial ports over TCP; the embedded vehicle has the first.
SERIAL_PORTS = (0, 2, 3)
RESERVED = 8  # offset of the UDP port that a launcher holds


def is_free(port: int, host: str = "127.0.0.1", kind: socket.SocketKind = socket.SOCK_STREAM) -> bool:
    """Whether a server could listen on the port now. Raises OSError if the host is not this machine."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, kind) as probe:
        if kind == socket.SOCK_STREAM:
            # A server that has just ended does not count.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return False
            raise
    return True


def ports_are_free(instance: int) -> bool:
    """Whether no other simulation uses this number's ports."""
    tcp = all(is_free(5760 + 10 * instance + offset) for offset in SERIAL_PORTS)
    return tcp and is_free(5501 + 10 * instance, kind=socket.SOCK_DGRAM)


@contextmanager
def reserved(first: int) -> Iterator[int]:
    """The first free instance from `first` on, reserved against all other launchers on this machine.

    A look at the ports is not enough: the vehicle opens them seconds later. A UDP port that nobody else uses is known
    where they are, whatever the user and the state directory, and goes with the process that holds it.

    Args:
        first: the lowest number to consider.

    Raises:
        LaunchError: all numbers are taken.
    """
    for instance in range(first, HIGHEST + 1):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as held:
            try:
                held.bind(("127.0.0.1", 5760 + 10 * instance + RESERVED))
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    raise
                continue
            if ports_are_free(instance):
                yield instance
                return
    raise LaunchError(f"no free instance for a simulated vehicle from {first} to {HIGHEST}")
