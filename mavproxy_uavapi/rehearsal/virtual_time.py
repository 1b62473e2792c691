"""A clock that goes on only when everybody has done what there was to do at its present time.

The vehicles, the API and the scripts of a rehearsal share it. So the same files give the same flight, whatever the
machine, and a minute takes as long as it takes to compute.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import enum
import selectors
import signal
import threading
import time
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

T = TypeVar("T")

ON_THE_WAY = 0.001  # s of this machine in which what was sent wakes its receiver
LOOK_EVERY = 0.0005  # s of this machine, while programs compute
COMPUTES = 3.0  # s of processor that programs may have at a time; then the clock goes on as they have it
LONGEST_LOOK = 0.05  # s of this machine, while programs wait for something else
ANSWER_TAKES = 0.0005  # s on the clock: time passes for a program that asks again and again without a pause, too


class Activity(enum.Enum):
    """What the programs do that share the clock."""

    WAITS = enum.auto()  # all of them, for the clock or for what happens on it; or there is none
    COMPUTES = enum.auto()
    ELSEWHERE = enum.auto()  # they wait for what is not on the clock: a network, another program


def nobody() -> tuple[Activity, float]:
    """What no program does."""
    return Activity.WAITS, 0.0


class AtOnce(concurrent.futures.ThreadPoolExecutor):
    """Does in no time what the code gives to threads: theirs is the wall clock, and ours would run on meanwhile."""

    def submit(self, call: Callable[..., Any], /, *args: Any, **kwargs: Any) -> concurrent.futures.Future[Any]:
        """See `concurrent.futures.Executor.submit`."""
        done: concurrent.futures.Future[Any] = concurrent.futures.Future()
        try:
            done.set_result(call(*args, **kwargs))
        except Exception as error:  # noqa: BLE001  it is for whoever awaits it
            done.set_exception(error)
        return done


class VirtualLoop(asyncio.SelectorEventLoop):
    """An asyncio loop whose clock jumps to the next timer once nothing else is left to do.

    Args:
        pace: s on the clock in a second of this machine, where programs wait for what is not on it.

    Attributes:
        now: the clock, s.
        activity: tells what the programs do that share the clock, and the s of processor that they have had.
        is_paced: whether the clock goes at `pace` though all wait: somebody without it looks on.
        on_time: called with the clock after each jump.
    """

    def __init__(self, pace: float) -> None:
        self.now = 0.0
        self.pace = pace
        self.activity: Callable[[], tuple[Activity, float]] = nobody
        self.is_paced = False
        self.on_time: Callable[[float], None] = lambda _now: None
        self._stirred = True  # whether something was sent or came since the last look
        self._doing = Activity.WAITS
        self._worked = self._works_since = 0.0  # s of processor: by now, and when they began to compute
        self._paced_at = time.monotonic()
        super().__init__(_Selector(self))
        self.set_default_executor(AtOnce())

    def time(self) -> float:
        """The clock, s."""
        return self.now

    def call_soon_threadsafe(  # type: ignore[override]
        self, callback: Callable[..., object], *args: Any, context: Any = None
    ) -> asyncio.Handle:
        """As `call_soon` in the loop's own thread, which need not be woken."""
        own = threading.get_ident() == self._thread_id  # type: ignore[attr-defined]
        return (self.call_soon if own else super().call_soon_threadsafe)(callback, *args, context=context)

    def end(self) -> None:
        """End all tasks, those that begin while others end, too, and close it."""
        self.activity = nobody
        while tasks := asyncio.all_tasks(self):
            for task in tasks:
                task.cancel()
            self.run_until_complete(asyncio.wait(tasks))
        self.run_until_complete(self.shutdown_asyncgens())
        self.close()

    def stir(self) -> None:
        """Look at what the programs do before time passes."""
        self._stirred = True

    def about_to_send(self) -> None:
        """Let the time pass that a program's message takes; who reads it may look at the clock at once."""
        self.stir()
        self._jump(self.now + ANSWER_TAKES)

    def _make_socket_transport(self, *args: Any, **keywords: Any) -> Any:
        transport = super()._make_socket_transport(*args, **keywords)  # type: ignore[misc]
        for name in ("write", "writelines"):
            setattr(transport, name, self._noting(getattr(transport, name)))
        return transport

    def _noting(self, write: Callable[[Any], None]) -> Callable[[Any], None]:
        def noting(data: Any) -> None:
            self.about_to_send()
            write(data)

        return noting

    def _select(self, look: Callable[[float | None], Any], timeout: float | None) -> Any:
        """What is ready, at the present time or, if there is nothing left to do, after a jump to the next timer."""
        target = None if timeout is None else self.now + timeout
        ready = look(0 if timeout is not None else None)
        if ready or target is None or target <= self.now:
            self._stirred = self._stirred or bool(ready)
            return ready
        if self._stirred:
            ready = look(ON_THE_WAY)
            if ready:
                return ready
        if self._stirred or self._doing is not Activity.WAITS:
            self._look()
            ready = look(0)  # what was sent before they began to wait
            if ready:
                return ready
        self._stirred = False
        return self._pass(look, target)

    def _look(self) -> None:
        before, worked = self._doing, self._worked
        self._doing, self._worked = self.activity()
        if self._doing is not Activity.COMPUTES or before is not Activity.COMPUTES:
            self._works_since = self._worked
        elif worked - self._works_since > COMPUTES:
            self._jump(self.now + self._worked - worked)

    def _pass(self, look: Callable[[float | None], Any], target: float) -> Any:
        """Let time pass, to the target or towards it."""
        here = time.monotonic()
        passed, self._paced_at = min(here - self._paced_at, LONGEST_LOOK), here
        if self._doing is Activity.COMPUTES:
            return look(LOOK_EVERY)
        if self._doing is Activity.WAITS and not self.is_paced:
            self._jump(target)
            return []
        self._jump(min(target, self.now + passed * self.pace))
        return look(min((target - self.now) / self.pace, LONGEST_LOOK))

    def _jump(self, now: float) -> None:
        self.now = max(self.now, now)
        self.on_time(self.now)


class _Selector(selectors.DefaultSelector):
    def __init__(self, loop: VirtualLoop) -> None:
        super().__init__()
        self._loop = loop

    def select(self, timeout: float | None = None) -> Any:
        return self._loop._select(super().select, timeout)


def run_in_virtual_time(work: Coroutine[Any, Any, T], pace: float) -> T:
    """The result of a coroutine in a `VirtualLoop` of its own; Ctrl-C cancels it."""
    loop = VirtualLoop(pace)
    try:
        task = loop.create_task(work)
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, _once(task.cancel))
        return loop.run_until_complete(task)
    finally:
        loop.end()


def _once(call: Callable[[], object]) -> Callable[[], None]:
    """Does it the first time that it is called: the end takes its time, and a second Ctrl-C would break it off."""
    calls = [call]

    def do() -> None:
        while calls:
            calls.pop()()

    return do
