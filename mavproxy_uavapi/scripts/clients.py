"""Finds the script that a connection comes from. Blocking: for an executor, not for the loop."""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence

import psutil

from mavproxy_uavapi.scripts.runs import Run


def session_of(address: str, port: int, running: Sequence[Run]) -> str | None:
    """The session of the script whose process has this connection; None if none has it.

    Args:
        address, port: the client's end of the connection.
        running: the scripts that run now.
    """
    if not ipaddress.ip_address(address).is_loopback:
        return None
    for run in running:
        if run.pid is not None and any(_connects_from(process, port) for process in _processes(run.pid)):
            return run.session
    return None


def _processes(runner: int) -> list[psutil.Process]:
    try:
        return psutil.Process(runner).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def _connects_from(process: psutil.Process, port: int) -> bool:
    try:
        return port in {connection.laddr.port for connection in process.net_connections("tcp") if connection.laddr}
    except (psutil.NoSuchProcess, psutil.AccessDenied):
        return False
