"""`aerpawlib.v1.util.ports`."""

from __future__ import annotations

import socket


def is_udp_port_in_use(host: str, port: int) -> bool:
    """Whether a UDP port of this machine is taken."""
    return _is_taken(socket.SOCK_DGRAM, host, port)


def is_tcp_port_in_use(host: str, port: int) -> bool:
    """Whether a TCP port of this machine is taken."""
    return _is_taken(socket.SOCK_STREAM, host, port)


def _is_taken(kind: socket.SocketKind, host: str, port: int) -> bool:
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, kind) as one:
        try:
            one.bind((host, port))
        except OSError:
            return True
    return False
