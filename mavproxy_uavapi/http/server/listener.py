"""Accepts connections, and keeps strangers from taking all of them."""

from __future__ import annotations

import asyncio
import resource
import socket
import ssl
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from mavproxy_uavapi.http.callers.caller import address_of, group_of
from mavproxy_uavapi.http.callers.log_throttle import LogThrottle
from mavproxy_uavapi.http.wire.connection import Connection

BACKLOG = 2048  # connections that wait to be accepted; further clients retry a second later
AT_ONCE = 64  # connections accepted in one go: some 4 ms
SHARE = 20  # connections of one caller that is not on the loopback
RESERVE = 16  # connections kept for callers that have passed the door check
HANDSHAKE_TIMEOUT = 10.0  # s, for TLS
UNREAD_TIMEOUT = 30_000  # ms without an acknowledgement from the peer after which the kernel closes the connection
AFTER_FAILURE = 1.0  # s until we accept again when the system is out of descriptors or memory

SELECT_LIMIT = 1024  # MAVProxy's select() takes no descriptor from this number on
KEPT_FREE = 64  # descriptors below that and below the process's limit that no connection takes
REPLACING = 32  # descriptors below these; a connection that gets one of them replaces another


class NoRoom(Exception):
    """There is no room for another connection, and none can be closed for it; `cause` says which limit is reached."""

    def __init__(self, cause: str, sentence: str) -> None:
        super().__init__(sentence)
        self.cause = cause


def to_replace(
    connections: Iterable[Connection], group: str, is_local: bool, most: int, scarce: bool = False
) -> Connection | None:
    """Which connection to close for a new one of `group`; None while there is room.

    A connection that has not passed the door check goes first: one that has sent nothing, then the oldest; a refused
    client would be back at once. Then the one that has been idle longest, because HTTP clients open another. A
    connection with a call in flight stays.

    Args:
        connections: the open ones, oldest first.
        group: the group of the new one.
        is_local: whether it comes from the loopback, which has no share of its own.
        most: the limit for all connections.
        scarce: whether descriptors are running out.

    Raises:
        NoRoom: no connection can be closed.
    """
    open_ones = [connection for connection in connections if not connection.closing]
    of_group = [connection for connection in open_ones if connection.group == group]
    strangers = sum(not connection.admitted for connection in open_ones)
    if not is_local and len(of_group) >= SHARE:
        candidates, error = of_group, NoRoom("share", f"{group} has {SHARE} connections, all with calls in flight")
    elif scarce:
        candidates, error = open_ones, NoRoom("descriptors", "MAVProxy needs the descriptors that are left")
    elif len(open_ones) >= most or strangers >= most - RESERVE:
        candidates, error = (
            open_ones,
            NoRoom("full", f"all {most} connections have calls in flight (max_connections)"),
        )
    else:
        return None
    unknown = [connection for connection in candidates if not connection.admitted]
    idle = [connection for connection in candidates if not connection.answering]
    if unknown:
        return min(unknown, key=lambda connection: not connection.silent)
    if idle:
        return min(idle, key=lambda connection: connection.idle_since)
    raise error


def highest_descriptor() -> int:
    """The highest descriptor that a connection may have; KEPT_FREE ones, or a quarter, stay free."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    limit = SELECT_LIMIT if soft == resource.RLIM_INFINITY else min(soft, SELECT_LIMIT)
    return limit - 1 - min(KEPT_FREE, limit // 4)


def lowest(near: socket.socket) -> socket.socket:
    """The same socket under the lowest free descriptor, if that is lower."""
    try:
        copy = near.dup()
    except OSError:  # no descriptor is free
        return near
    higher, lower = sorted((near, copy), key=socket.socket.fileno, reverse=True)
    higher.close()
    return lower


class Listener:
    """Accepts connections for aiohttp; all methods belong to the asyncio thread.

    asyncio's own server has no limit, and writes a traceback for each connection without a descriptor.

    Args:
        ports: bound sockets, each with a factory of aiohttp's protocols; the limits count all of them together.
        tls: None for plain HTTP.
        most: returns the limit of connections.
        throttle: for the log lines.
    """

    def __init__(
        self,
        ports: Mapping[socket.socket, Callable[[], Any]],
        tls: ssl.SSLContext | None,
        most: Callable[[], int],
        throttle: LogThrottle,
    ) -> None:
        self._ports = dict(ports)
        self._tls = tls
        self._most = most
        self._throttle = throttle
        self._loop = asyncio.get_running_loop()
        self._connections: dict[Connection, socket.socket] = {}  # oldest first
        self._handshakes: set[asyncio.Task[None]] = set()
        self._resuming: dict[socket.socket, asyncio.TimerHandle] = {}
        for port in self._ports:
            port.listen(BACKLOG)
            self._resume(port)

    def _resume(self, port: socket.socket) -> None:
        self._resuming.pop(port, None)
        self._loop.add_reader(port, self._accept, port)

    def _accept(self, port: socket.socket) -> None:
        for _ in range(AT_ONCE):
            try:
                near, peer = port.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                self._throttle.log("accept", f"no connection can be accepted: {error.strerror}")
                self._loop.remove_reader(port)
                self._resuming[port] = self._loop.call_later(AFTER_FAILURE, self._resume, port)
                return
            self._take(near, peer[0], self._ports[port])

    def _take(self, near: socket.socket, remote: str, factory: Callable[[], Any]) -> None:
        """Serve a connection, or close it."""
        address = address_of(remote)
        group, is_local = group_of(address), address is not None and address.is_loopback
        highest = highest_descriptor()
        scarce = near.fileno() > highest - REPLACING
        try:
            going = to_replace(self._connections, group, is_local, self._most(), scarce)
            if going is not None:
                self._throttle.log("replaced", f"an idle connection of {going.group} was closed for one of {group}")
                going.abort()
            if scarce:
                near = lowest(near)
            if near.fileno() > highest:
                raise NoRoom("descriptors", "MAVProxy needs the descriptors that are left")
        except NoRoom as error:
            self._throttle.log(error.cause, f"a connection of {group} was refused: {error}")
            near.close()
            return
        near.setblocking(False)
        connection = Connection(factory, near, group, self._forget)
        self._connections[connection] = near
        connection.await_first_byte(self._begin)

    def _begin(self, connection: Connection) -> None:
        handshake = self._loop.create_task(self._hand_over(connection, self._connections[connection]))
        self._handshakes.add(handshake)
        handshake.add_done_callback(self._handshakes.discard)

    def _forget(self, connection: Connection) -> None:
        self._connections.pop(connection, None)

    async def _hand_over(self, connection: Connection, near: socket.socket) -> None:
        """Do the TLS handshake, if any, and hand over to aiohttp."""
        timeout = HANDSHAKE_TIMEOUT if self._tls else None
        try:
            await self._loop.connect_accepted_socket(
                lambda: connection, near, ssl=self._tls, ssl_handshake_timeout=timeout
            )
        except OSError:  # no TLS, hung up or replaced; asyncio closes the socket
            connection.abandon()

    def filenos(self) -> list[int]:
        """Descriptors of the ports and of every connection."""
        return [sock.fileno() for sock in (*self._ports, *self._connections.values())]

    def close_ports(self) -> None:
        """Accept no more connections."""
        for resuming in self._resuming.values():
            resuming.cancel()
        for port in self._ports:
            if port.fileno() >= 0:
                self._loop.remove_reader(port)
                port.close()

    def stop(self) -> None:
        """End every connection that aiohttp has not ended."""
        for connection in list(self._connections):
            connection.abort()


def listening_socket(host: str, port: int) -> socket.socket:
    """A bound TCP socket that can be bound again at once after we close it.

    Raises:
        OSError: the port is taken, or there is no such address.
    """
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    listening = socket.socket(family, kind, protocol)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if hasattr(socket, "TCP_USER_TIMEOUT"):  # on Linux; accepted sockets inherit it
            listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNREAD_TIMEOUT)
        listening.bind(address)
    except OSError:
        listening.close()
        raise
    listening.setblocking(False)
    return listening
