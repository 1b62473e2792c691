"""Where a rehearsed script's sockets go: to the rehearsal's API and MAVLink, because no real vehicle is meant."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from typing import Any

THIS_MACHINE = ("127.0.0.1", "::1", "localhost")
SERIAL = ("/dev/ttyS", "/dev/ttyUSB", "/dev/ttyACM", "/dev/ttyAMA", "/dev/ttyTHS", "/dev/serial")


def lead_mavlink(address: str, line: str, ports: set[int]) -> None:
    """Let what goes to a vehicle's MAVLink go to the rehearsed one's, whose address is tcp:HOST:PORT, and for UDP.

    A stream goes by the Unix socket `line`, if there is one: data waits there for nothing.
    """
    host, port = address.split(":")[1:]
    there = (host, int(port))
    connect, connect_ex = socket.socket.connect, socket.socket.connect_ex
    real_bind, real_option = socket.socket.bind, socket.socket.setsockopt
    real_send: Callable[..., Any] = socket.socket.sendto

    def is_vehicle(where: Any) -> bool:
        return isinstance(where, tuple) and (where[1] in ports or where[:2] == there)

    def connecting(real: Callable[..., Any]) -> Callable[..., Any]:
        def connects(self: socket.socket, where: Any) -> Any:
            if not is_vehicle(where):
                return real(self, where)
            if self.type != socket.SOCK_STREAM or not line:
                return real(self, there)
            blocks, passed_on = os.get_blocking(self.fileno()), os.get_inheritable(self.fileno())
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as near:
                connect(near, line)
                os.dup2(near.fileno(), self.fileno(), passed_on)
            os.set_blocking(self.fileno(), blocks)
            return 0 if real is connect_ex else None

        return connects

    def bind(self: socket.socket, where: Any) -> None:
        if self.type != socket.SOCK_DGRAM or not is_vehicle(where):
            return real_bind(self, where)
        real_bind(self, (host, 0))
        real_send(self, b"", there)  # that it is there
        return None

    def set_option(self: Any, level: int, *rest: Any) -> None:
        if level == socket.IPPROTO_TCP and self.getsockopt(socket.SOL_SOCKET, socket.SO_DOMAIN) == socket.AF_UNIX:
            return None  # it has none of TCP's
        return real_option(self, level, *rest)

    def send(self: Any, *args: Any) -> Any:
        return real_send(self, *args[:-1], there if is_vehicle(args[-1]) else args[-1])

    led = {"connect": connecting(connect), "connect_ex": connecting(connect_ex), "bind": bind}
    for name, method in {**led, "setsockopt": set_option, "sendto": send}.items():
        setattr(socket.socket, name, method)


def lead_api(port: int, ports: set[int]) -> None:
    """Let what goes to an API of this machine, whose address is written in scripts, go to the rehearsal's."""

    def connecting(real: Callable[..., Any]) -> Callable[..., Any]:
        def connects(self: socket.socket, where: Any) -> Any:
            if isinstance(where, tuple) and where[0] in THIS_MACHINE and where[1] in ports:
                where = (where[0], port, *where[2:])
            return real(self, where)

        return connects

    for name in ("connect", "connect_ex"):
        setattr(socket.socket, name, connecting(getattr(socket.socket, name)))


def refuse_serial_lines() -> None:
    """Open none: a vehicle may be there."""
    real = os.open

    def opened(path: Any, *args: Any, **keywords: Any) -> int:
        if isinstance(path, str) and path.startswith(SERIAL):
            raise PermissionError(f"a rehearsal opens no {path}: MAVLink is at UAVAPI_MAVLINK")
        return real(path, *args, **keywords)

    os.open = opened
