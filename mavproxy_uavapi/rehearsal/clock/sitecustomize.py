"""A script's clock that runs as fast as its simulated vehicle: UAVAPI_CLOCK s of it in one s.

Python imports this before a rehearsed script. What it waits for, and what it reads from `time` and `datetime`, is
scaled: sleeps, threads' and asyncio's waits, sockets' timeouts. Other programs are not; a shell's `sleep` is the
program beside this file. (libfaketime 0.9.10 scales all programs alike, but never ends a wait of a Python thread.)
"""

from __future__ import annotations

import datetime
import os
import select
import selectors
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

FACTOR = float(os.environ.get("UAVAPI_CLOCK", "1"))


def _scaled(clock: Callable[[], float]) -> Callable[[], float]:
    begin = clock()
    return lambda: begin + (clock() - begin) * FACTOR


def _in_ns(clock: Callable[[], float]) -> Callable[[], int]:
    return lambda: int(clock() * 1e9)


def _shorter(seconds: float | None) -> float | None:
    return None if seconds is None else seconds / FACTOR


def _with_shorter_wait(wait: Callable[..., Any]) -> Callable[..., Any]:
    """A method whose one argument is a timeout in s, or None."""

    def shorter(self: Any, timeout: float | None = None) -> Any:
        return wait(self, _shorter(timeout))

    return shorter


class _Kind(type):
    def __instancecheck__(cls, instance: object) -> bool:
        return isinstance(instance, _DATETIME)


_DATETIME = datetime.datetime


class _Datetime(_DATETIME, metaclass=_Kind):
    """The same, with the scaled present."""

    @classmethod
    def now(cls, tz: datetime.tzinfo | None = None) -> Any:
        return _DATETIME.fromtimestamp(time.time(), tz)

    @classmethod
    def utcnow(cls) -> Any:
        return _DATETIME.fromtimestamp(time.time(), datetime.timezone.utc).replace(tzinfo=None)

    @classmethod
    def today(cls) -> Any:
        return _DATETIME.fromtimestamp(time.time())


def scale() -> None:
    """Scale the clocks and waits of this process."""
    sleep, wait_for = time.sleep, select.select
    for name in ("time", "monotonic", "perf_counter"):
        clock = _scaled(getattr(time, name))
        setattr(time, name, clock)
        setattr(time, f"{name}_ns", _in_ns(clock))
    time.sleep = lambda seconds: sleep(float(seconds) / FACTOR)
    datetime.datetime = _Datetime  # type: ignore[misc]
    for kind in (selectors.EpollSelector, selectors.PollSelector, selectors.SelectSelector):
        kind.select = _with_shorter_wait(kind.select)  # type: ignore[method-assign]
    select.select = lambda r, w, x, timeout=None: wait_for(r, w, x, _shorter(timeout))
    threading.Condition.wait = _with_shorter_wait(threading.Condition.wait)  # type: ignore[method-assign]
    threading.Thread.join = _with_shorter_wait(threading.Thread.join)  # type: ignore[method-assign]
    set_timeout = socket.socket.settimeout
    socket.socket.settimeout = lambda self, value: set_timeout(self, _shorter(value))  # type: ignore[method-assign]


if FACTOR != 1.0:
    scale()
