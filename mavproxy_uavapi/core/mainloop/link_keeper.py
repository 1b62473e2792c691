"""Keeps MAVProxy's main loop going while the other end of a TCP link is gone.

pymavlink reconnects a TCP link inside MAVProxy's main loop, and sleeps a second between its attempts. If all of them
fail, the closed descriptor stays in MAVProxy's `select()`. Then that call fails for all links, and MAVProxy hears no
vehicle any more. `LinkKeeper` reconnects in pymavlink's place. It never waits, and keeps the link out of `select()`
meanwhile.

Everything here runs in MAVProxy's main loop.
"""

from __future__ import annotations

import contextlib
import select
import socket
from collections.abc import Callable, Sequence
from typing import Any

from pymavlink import mavutil

PAUSE = 1.0  # s between two attempts
ATTEMPT_TIMEOUT = 5.0  # s for one attempt
NO_DESCRIPTOR = -1


class TcpLink:
    """One TCP link; it replaces pymavlink's `reconnect`.

    Args:
        master: MAVProxy's link, a `mavutil.mavtcp`.
        clock: monotonic seconds.
    """

    def __init__(self, master: Any, clock: Callable[[], float]) -> None:
        self._master, self._clock = master, clock
        self._address = address_of(master)
        self._attempt: socket.socket | None = None
        self._due = clock()  # for the next attempt, or for the end of this one
        master.reconnect = self._lose
        if master.port is None:
            self._exclude()

    def turn(self) -> None:
        """Begin an attempt, or look at the one that runs; does nothing while the link has a socket."""
        if self._master.port is not None:
            return
        if self._attempt is not None:
            self._look(self._attempt)
        elif self._clock() >= self._due:
            self._begin()

    def release(self) -> None:
        """Give the link back to pymavlink."""
        del self._master.reconnect
        if self._attempt is not None:
            self._attempt.close()

    def _lose(self) -> None:
        """Close the socket; pymavlink calls this each time that it misses the other end."""
        if self._master.port is None:
            return
        self._master.port.close()
        self._master.port = None
        self._due = self._clock() + PAUSE
        self._exclude()

    def _exclude(self) -> None:
        """Keep the link out of `select()`: another socket may get its descriptor."""
        self._master.portdead = True
        self._master.fd = NO_DESCRIPTOR

    def _begin(self) -> None:
        self._due = self._clock() + PAUSE  # for the case that this attempt fails at once
        try:
            attempt = socket.socket(socket.AF_INET, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
        except OSError:  # no descriptor is free
            return
        attempt.setblocking(False)
        try:
            attempt.connect_ex(self._address)
        except OSError:  # its name cannot be looked up
            attempt.close()
            return
        self._attempt, self._due = attempt, self._clock() + ATTEMPT_TIMEOUT
        self._look(attempt)

    def _look(self, attempt: socket.socket) -> None:
        """Take the socket over when it is connected."""
        _, decided, _ = select.select([], [attempt], [], 0)
        if not decided and self._clock() < self._due:
            return
        self._attempt = None
        if decided and is_connected(attempt):
            attempt.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._master.port, self._master.fd, self._master.portdead = attempt, attempt.fileno(), False
        else:
            attempt.close()
            self._due = self._clock() + PAUSE


def address_of(master: Any) -> Any:
    """The other end, as a number if it is known: the look-up of a name may take seconds."""
    if master.port is not None:
        with contextlib.suppress(OSError):
            return master.port.getpeername()
    return master.destination_addr


def is_connected(attempt: socket.socket) -> bool:
    """Whether it has another end. A socket may connect to itself if nobody listens on a port of this machine."""
    if attempt.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) != 0:
        return False
    try:
        return bool(attempt.getpeername() != attempt.getsockname())
    except OSError:
        return False


class LinkKeeper:
    """Watches over MAVProxy's TCP links.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._links: dict[Any, TcpLink] = {}

    def turn(self, masters: Sequence[Any]) -> None:
        """Take care of the present links; called several times a second."""
        for master in masters:
            if type(master) is mavutil.mavtcp and master not in self._links:
                self._links[master] = TcpLink(master, self._clock)
        for master in [one for one in self._links if one not in masters]:
            self._links.pop(master).release()
        for link in self._links.values():
            link.turn()

    def release(self) -> None:
        """Give all links back to pymavlink."""
        for link in self._links.values():
            link.release()
        self._links.clear()
