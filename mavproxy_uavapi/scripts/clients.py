"""The processes of a script, and the script that a connection comes from. Blocking: for an executor, not the loop."""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

import psutil

from mavproxy_uavapi.core.process_tree import below, with_variable
from mavproxy_uavapi.scripts.runs import Run

LONGEST = 200  # characters of a command
REHEARSED = "UAVAPI_CLOCK"  # in the environment of a program that is rehearsed


def session_of(address: str, port: int, running: Sequence[Run]) -> str | None:
    """The session of the script whose process has this connection; None if none has it.

    Args:
        address, port: the client's end of the connection.
        running: the scripts that run now.
    """
    if not ipaddress.ip_address(address).is_loopback:
        return None
    for run in running:
        if any(_connects_from(process, port) for process in _family(run)):
            return run.session
    return None


def is_rehearsed(port: int, own_port: int) -> bool:
    """Whether a program of this machine that is rehearsed, or what it has started, calls us.

    One that calls the API of its rehearsal does not.

    Args:
        port: the client's end of the connection.
        own_port: our end.
    """
    for pid in with_variable(REHEARSED):
        with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
            url = psutil.Process(pid).environ().get("UAVAPI_URL", "")
            if urlsplit(url).port != own_port and any(_has(one, port) for one in (pid, *below(pid))):
                return True
    return False


def processes(run: Run) -> list[dict[str, Any]]:
    """`pid` and `command` of each process of a script that runs, those that have left its session, too."""
    found = []
    for process in _family(run):
        with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
            found.append({"pid": process.pid, "command": " ".join(process.cmdline())[:LONGEST]})
    return found


def _family(run: Run) -> list[psutil.Process]:
    """All are below the runner (`scripts.runner`)."""
    if run.pid is None or not run.running:
        return []
    try:
        return psutil.Process(run.pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def _has(pid: int, port: int) -> bool:
    with suppress(psutil.NoSuchProcess):
        return _connects_from(psutil.Process(pid), port)
    return False


def _connects_from(process: psutil.Process, port: int) -> bool:
    try:
        return port in {connection.laddr.port for connection in process.net_connections("tcp") if connection.laddr}
    except (psutil.NoSuchProcess, psutil.AccessDenied):
        return False
