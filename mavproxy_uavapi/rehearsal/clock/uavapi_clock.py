"""The clock of a rehearsed script: what it reads from `time` and `datetime`, and what it waits for, goes by it.

Sleeps, threads' and asyncio's waits, sockets' timeouts and alarms are on it, and it stands while the script computes.
Other programs' waits are not; a shell's `sleep` is the program beside this file. A lock's own timeout
(`Lock.acquire(timeout=…)`) is real. (libfaketime 0.9.10 scales clocks, but has none that stands,
and never ends a wait of a Python thread.)
"""

from __future__ import annotations

import datetime
import itertools
import math
import mmap
import os
import select
import selectors
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

FOLDER = os.environ["UAVAPI_CLOCK"]  # where the clock is
NOW, ASKED, OVER = struct.Struct("=d"), struct.Struct("=Qd"), struct.Struct("=Q")  # as `rehearsal.script_clock`
READ, WRITE = select.POLLIN, select.POLLOUT
SPINS, SPIN = 1000, 0.01  # looks at a clock that stands, after which it goes on by so many s
Watched = Iterable["tuple[int, int]"]  # descriptors, and what of them

_real_connect, _real_timeout = socket.socket.connect, socket.socket.gettimeout
_real_poll = select.poll
_numbers = itertools.count(1)


class _Line(threading.local):
    """This thread's connection to the clock."""

    near: socket.socket | None = None

    def connected(self) -> socket.socket:
        if self.near is None:
            self.near = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            _real_connect(self.near, os.path.join(FOLDER, "wait"))
        return self.near


_line = _Line()


def _forget_line() -> None:
    _line.near = None  # it is the parent's


def wait_until(then: float, watched: Watched = ()) -> bool:
    """Wait until the clock (s since 1970) is there, or until one of those is ready; whether one is."""
    line, number = _line.connected(), next(_numbers)
    poll = _real_poll()
    poll.register(line, READ)
    for descriptor, events in watched:
        poll.register(descriptor, events)
    line.send(ASKED.pack(number, then))
    while True:
        ready = [descriptor for descriptor, _ in poll.poll()]
        if any(descriptor != line.fileno() for descriptor in ready):
            return True
        answer = line.recv(OVER.size)
        if not answer:
            raise SystemExit("the rehearsal is over")
        if OVER.unpack(answer)[0] == number:
            return False


def _scale_time() -> Callable[[], float]:
    with open(os.path.join(FOLDER, "now"), "rb") as file:
        page = mmap.mmap(file.fileno(), NOW.size, prot=mmap.PROT_READ)
    begin: float = time.monotonic() - NOW.unpack_from(page)[0]

    last: float = 0.0
    reads = 0

    def now() -> float:
        nonlocal last, reads
        then = float(NOW.unpack_from(page)[0])
        reads = reads + 1 if then == last else 0
        last = then
        if reads > SPINS:  # it waits by looking at the clock, which stands as long as it does not wait
            reads = 0
            wait_until(then + SPIN)
        return last

    def since_boot() -> float:
        return begin + now()

    def sleep(seconds: float) -> None:
        if seconds < 0:
            raise ValueError("sleep length must be non-negative")
        wait_until(now() + float(seconds))

    for name, clock in (("time", now), ("monotonic", since_boot), ("perf_counter", since_boot)):
        setattr(time, name, clock)
        setattr(time, f"{name}_ns", lambda clock=clock: int(clock() * 1e9))
    time.sleep = sleep  # type: ignore[assignment]
    _scale_presents(now, since_boot)
    return now


def _scale_presents(now: Callable[[], float], since_boot: Callable[[], float]) -> None:
    """What reads the time without `time.time`."""
    for name in ("localtime", "gmtime", "ctime"):
        real = getattr(time, name)
        setattr(time, name, lambda seconds=None, real=real: real(now() if seconds is None else seconds))
    strftime, gettime = time.strftime, time.clock_gettime
    boot = (time.CLOCK_MONOTONIC, time.CLOCK_MONOTONIC_RAW, time.CLOCK_BOOTTIME)

    def read(clock: int) -> float:
        if clock == time.CLOCK_REALTIME:
            return now()
        return since_boot() if clock in boot else gettime(clock)

    time.clock_gettime = read
    time.clock_gettime_ns = lambda clock: int(read(clock) * 1e9)
    time.strftime = lambda form, moment=None: strftime(form, time.localtime() if moment is None else moment)


class _Kind(type):
    def __instancecheck__(cls, instance: object) -> bool:
        return isinstance(instance, _DATETIME)


_DATETIME = datetime.datetime


class _Datetime(_DATETIME, metaclass=_Kind):
    """The same, with the clock's present."""

    @classmethod
    def now(cls, tz: datetime.tzinfo | None = None) -> Any:
        return _DATETIME.fromtimestamp(time.time(), tz)

    @classmethod
    def utcnow(cls) -> Any:
        return _DATETIME.fromtimestamp(time.time(), datetime.timezone.utc).replace(tzinfo=None)

    @classmethod
    def today(cls) -> Any:
        return _DATETIME.fromtimestamp(time.time())


def _scale_selectors(now: Callable[[], float]) -> None:
    def waiting(select_: Callable[..., Any], watched: Callable[[Any], Watched]) -> Callable[..., Any]:
        def waits(self: Any, timeout: float | None = None) -> Any:
            if timeout is not None and timeout > 0:
                wait_until(now() + timeout, watched(self))
                timeout = 0
            return select_(self, timeout)

        return waits

    def of_map(self: Any) -> Watched:
        events = {selectors.EVENT_READ: READ, selectors.EVENT_WRITE: WRITE}
        return [(key.fd, events.get(key.events, READ | WRITE)) for key in self.get_map().values()]

    def of_one(self: Any) -> Watched:
        return [(self.fileno(), READ)]

    for kind, watched in (
        (selectors.EpollSelector, of_one),
        (selectors.PollSelector, of_map),
        (selectors.SelectSelector, of_map),
    ):
        kind.select = waiting(kind.select, watched)  # type: ignore[method-assign]
    real, real_epoll = select.select, select.epoll

    def waits(r: Any, w: Any, x: Any, timeout: float | None = None) -> Any:
        if timeout is not None and timeout > 0:
            descriptors = [(one, READ) for one in (*r, *x)] + [(one, WRITE) for one in w]
            events: dict[int, int] = {}
            for one, event in descriptors:
                number = one if isinstance(one, int) else one.fileno()
                events[number] = events.get(number, 0) | event
            wait_until(now() + timeout, events.items())
            timeout = 0
        return real(r, w, x, timeout)

    select.select = waits
    select.poll = lambda: _Poll(now, _real_poll())  # type: ignore[assignment,misc,return-value]
    select.epoll = lambda *args, **keywords: _Epoll(now, real_epoll(*args, **keywords))  # type: ignore[misc,assignment]


class _Epoll:
    """`select.epoll`, whose timeout is on the clock."""

    def __init__(self, now: Callable[[], float], real: Any) -> None:
        self._now, self._real = now, real

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self._real.close()

    def poll(self, timeout: float | None = None, maxevents: int = -1) -> Any:
        if timeout is not None and timeout > 0:
            wait_until(self._now() + timeout, [(self._real.fileno(), READ)])
            timeout = 0
        return self._real.poll(timeout, maxevents)


class _Poll(_Epoll):
    """`select.poll`: its timeout is in ms, and it has no descriptor of its own."""

    def __init__(self, now: Callable[[], float], real: Any) -> None:
        super().__init__(now, real)
        self._watched: dict[int, int] = {}

    def register(self, one: Any, events: int = READ | WRITE | select.POLLPRI) -> None:
        self._watched[one if isinstance(one, int) else one.fileno()] = events
        self._real.register(one, events)

    def modify(self, one: Any, events: int) -> None:
        self._real.modify(one, events)
        self.register(one, events)

    def unregister(self, one: Any) -> None:
        self._real.unregister(one)
        del self._watched[one if isinstance(one, int) else one.fileno()]

    def poll(self, timeout: float | None = None, _: int = -1) -> Any:
        if timeout is not None and timeout > 0:
            wait_until(self._now() + timeout / 1000, self._watched.items())
            timeout = 0
        return self._real.poll(timeout)


class _Alarms:
    """`signal.alarm` and `signal.setitimer`: a thread rings."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now, self._real = now, signal.setitimer
        self._number, self._then, self._interval = 0, 0.0, 0.0

    def left(self) -> tuple[float, float]:
        return (max(self._then - self._now(), 1e-6) if self._then else 0.0), self._interval

    def set(self, which: int, seconds: float, interval: float = 0.0) -> tuple[float, float]:
        if which != signal.ITIMER_REAL:
            return self._real(which, seconds, interval)
        before = self.left()
        self._number += 1
        self._then, self._interval = (self._now() + seconds if seconds else 0.0), interval
        if seconds:
            threading.Thread(target=self._ring, args=(self._number,), daemon=True).start()
        return before

    def alarm(self, seconds: int) -> int:
        return math.ceil(round(self.set(signal.ITIMER_REAL, seconds)[0], 3))

    def _ring(self, number: int) -> None:
        while self._then:
            wait_until(self._then)
            if number != self._number:
                return
            self._then = self._then + self._interval if self._interval else 0.0
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGALRM)


def _scale_alarms(now: Callable[[], float]) -> None:
    alarms = _Alarms(now)
    signal.alarm, signal.setitimer = alarms.alarm, alarms.set


def _scale_sockets(now: Callable[[], float]) -> None:
    def waiting(name: str, event: int) -> None:
        real = getattr(socket.socket, name)

        def waits(self: Any, *args: Any, **keywords: Any) -> Any:
            timeout = _real_timeout(self)
            if timeout and not wait_until(now() + timeout, [(self.fileno(), event)]):
                raise TimeoutError("timed out")
            return real(self, *args, **keywords)

        setattr(socket.socket, name, waits)

    for name in ("recv", "recv_into", "recvfrom", "recvfrom_into", "accept"):
        waiting(name, READ)
    for name in ("send", "sendall", "sendto"):
        waiting(name, WRITE)


class _Alarm:
    """What a thread waits at in place of a lock, with a limit on the clock."""

    def __init__(self) -> None:
        self._descriptor = os.eventfd(0)

    def release(self) -> None:
        os.eventfd_write(self._descriptor, 1)

    def wait(self, then: float) -> None:
        wait_until(then, [(self._descriptor, READ)])

    def close(self) -> None:
        os.close(self._descriptor)


def _scale_threads(now: Callable[[], float]) -> None:
    condition_wait, join = threading.Condition.wait, threading.Thread.join

    def wait(self: Any, timeout: float | None = None) -> bool:
        if timeout is None or timeout <= 0:
            return condition_wait(self, timeout)
        if not self._is_owned():
            raise RuntimeError("cannot wait on un-acquired lock")
        alarm = _Alarm()
        self._waiters.append(alarm)
        state = self._release_save()
        try:
            alarm.wait(now() + timeout)
        finally:
            self._acquire_restore(state)
            is_late = alarm in self._waiters  # nobody has notified it
            if is_late:
                self._waiters.remove(alarm)
            alarm.close()
        return not is_late

    def joined(self: Any, timeout: float | None = None) -> None:
        if timeout is None:
            return join(self)
        ended = threading.Event()

        def tell() -> None:
            join(self)
            ended.set()

        threading.Thread(target=tell, daemon=True).start()
        ended.wait(timeout)
        return None

    threading.Condition.wait = wait  # type: ignore[method-assign]
    threading.Thread.join = joined  # type: ignore[method-assign]
    threading._time = time.monotonic  # type: ignore[attr-defined]


def go_by_it() -> None:
    """Put everything on the clock, for as long as this Python runs."""
    os.register_at_fork(after_in_child=_forget_line)
    now = _scale_time()
    datetime.datetime = _Datetime  # type: ignore[misc]
    _scale_selectors(now)
    _scale_sockets(now)
    _scale_threads(now)
    _scale_alarms(now)
