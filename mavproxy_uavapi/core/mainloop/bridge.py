"""MAVProxy's select loop <-> one asyncio loop in one thread.

Two queues, one each way. In: the main loop hands over what it received (`feed`), all of one turn at a time; out:
the asyncio side hands calls to the main loop (`on_main`), which is the only thread that sends.

Python runs one thread at a time. A vehicle's messages come in bursts, and MAVProxy parses, logs and forwards each
message. Meanwhile we do not wake the asyncio loop, and new requests wait (`wait_for_main_loop`). Messages to send do
not wait: they go out between two received ones.

What was right when it was queued may be wrong when it is written: MAVProxy's main loop may stand for seconds (a name
server, a blocking write, a command at its prompt), and the pilot switches the mode meanwhile. So a call is run with
its `Permit`: `on_main` takes it back to the asyncio thread and checks it again if
- it has waited longer than FRESH, or
- a heartbeat of its vehicle has come since the check, or
- its basis has changed: another job commands.
After a long wait it is not run before the links are read: what the pilot has done lies there. If the permit has
expired meanwhile, it never runs; whoever waits for it hears `Expired`, also while the main loop stands.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import weakref
from collections import defaultdict, deque
from collections.abc import Callable
from typing import Any, TypeVar

from mavproxy_uavapi.core.errors import Expired
from mavproxy_uavapi.core.mainloop.event_loop_thread import EventLoopThread
from mavproxy_uavapi.core.mainloop.listening import Listening
from mavproxy_uavapi.core.mainloop.main_loop_queue import MainLoopQueue
from mavproxy_uavapi.core.mainloop.permit import Permit, present_permit
from mavproxy_uavapi.core.platform import require_posix
from mavproxy_uavapi.core.timeout import wait_with_timeout

T = TypeVar("T")
LONGEST_WAIT = 0.05  # s that new work waits for the main loop at most
FRESH = 0.1  # s; a call that waited longer is checked again
# s in which a late call waits for unread links, but no more than a share of what it lasts: where so many vehicles
# speak that no link is ever empty, it must not stop it.
READ_WITHIN, READ_SHARE = 1.0, 0.25

_bridges: weakref.WeakSet[Bridge] = weakref.WeakSet()


class Outdated(Exception):
    """A call was not run: something has changed since its check, or it is late, and the check too old."""

    def __init__(self, *, is_late: bool, has_stood: bool) -> None:
        super().__init__()
        self.is_late, self.has_stood = is_late, has_stood


class Bridge:
    """The only place where MAVProxy's main loop and our asyncio thread meet.

    Args:
        select_extra: MAVProxy's table of further descriptors for its select().
        receive: called in the asyncio thread with each message that was fed, and with when it came at the earliest
            (s) if it may have waited while the main loop stood, else None.
        loop: as for `EventLoopThread`.

    Attributes:
        listening: when the main loop reads.
        links_have_unread: whether MAVProxy has not read all that came on its links. Main loop only.
        patience: s that another thread waits for the asyncio thread.
    """

    patience = 4.0

    def __init__(
        self,
        select_extra: dict[int, tuple[Callable[..., None], Any]],
        receive: Callable[[Any, float | None], None],
        loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        self._select_extra = select_extra
        self._receive = receive
        self._inbox: deque[tuple[Any, float | None]] = deque()
        self._delivering = False  # whether `_deliver` is on its way
        self._busy = False  # whether the main loop handles messages
        self._feeding = False  # whether it hands over one of several that it has read
        self._turned_at = math.inf  # s; the end of its last turn
        self._waited_for = False
        self._turn_ended = asyncio.Event()
        self._calls = MainLoopQueue()
        self._thread = EventLoopThread("uavapi-loop", loop)
        self.listening = Listening(self.loop.time)
        self.links_have_unread: Callable[[], bool] = lambda: False
        self._fed: defaultdict[int, int] = defaultdict(int)  # heartbeats by system id; the main loop's
        self._delivered: defaultdict[int, int] = defaultdict(int)  # the asyncio thread's
        self._open_sockets: list[Callable[[], list[int]]] = [self._calls.filenos]
        _bridges.add(self)

    @property
    def loop(self) -> asyncio.AbstractEventLoop:
        """The asyncio loop of the one thread."""
        return self._thread.loop

    @property
    def running(self) -> bool:
        """Whether the asyncio thread is alive."""
        return self._thread.running

    @property
    def busy(self) -> bool:
        """Whether the main loop handles messages now."""
        return self._busy

    def start(self) -> None:
        """Start the asyncio thread and be woken by MAVProxy's select(). Main loop only."""
        self._select_extra[self._calls.fileno()] = (self._calls.on_readable, None)
        self._thread.start()

    def feed(self, message: Any) -> None:
        """Hand a received message over. Main loop only; never blocks, never raises.

        Messages to send do not wait for the end of a burst: they go out between two of its messages.
        """
        self._busy = self._feeding = True
        self.listening.look(self._has_unread)
        self._inbox.append((message, self.listening.behind_since))
        if message.get_type() == "HEARTBEAT":
            self._fed[message.get_srcSystem()] += 1
        self._calls.drain()
        self._feeding = False

    def feed_call(self, call: Callable[[], None]) -> None:
        """Let the asyncio side run `call` between the messages fed before and after it. Main loop only."""
        self._inbox.append((call, None))

    def _hand_over(self) -> None:
        """Wake the asyncio side for what was fed since the last turn, and for those who wait for its end."""
        self._busy = False
        if self._inbox and not self._delivering:
            self._delivering = True  # first, because the other thread may run before `call_soon` returns
            if not self._thread.call_soon(self._deliver):
                self._inbox.clear()  # the loop has ended, so nothing reads them
        if self._waited_for:
            self._waited_for = False
            self._thread.call_soon(self._turn_ended.set)

    async def wait_for_main_loop(self) -> None:
        """Await the end of the main loop's turn, if it handles messages now; LONGEST_WAIT s at most."""
        if not self._busy:
            return
        self._turn_ended.clear()
        self._waited_for = True
        with contextlib.suppress(asyncio.TimeoutError):
            await wait_with_timeout(LONGEST_WAIT, self._turn_ended.wait())

    def _deliver(self) -> None:
        self._delivering = False  # an item that comes from now on needs another call
        for _ in range(len(self._inbox)):
            item, came_after = self._inbox.popleft()
            if not callable(item) and item.get_type() == "HEARTBEAT":
                self._delivered[item.get_srcSystem()] += 1
            try:
                item() if callable(item) else self._receive(item, came_after)
            except Exception as error:  # noqa: BLE001  one bad message must not stop the next
                name = "what was fed" if callable(item) else item.get_type()
                context = {"message": f"uavapi: defect on {name}", "exception": error}
                self.loop.call_exception_handler(context)

    def turn(self) -> None:
        """Between two turns of the main loop: hand over what was fed, and run the calls of the asyncio side."""
        self.listening.look(self._has_unread)
        self._hand_over()
        self._calls.drain()
        self._turned_at = self.loop.time()

    def post(self, call: Callable[[], None]) -> None:
        """Let the main loop run `call`, which must not raise, and do not wait for it. Any thread."""
        self._calls.put(call)

    async def on_main(self, call: Callable[[], T]) -> T:
        """Let the main loop run `call`, if the present permit still holds then; its result, or its exception.

        If it is cancelled before the main loop gets to it, it never runs.

        Raises:
            Expired: the main loop did not get to it in time. Also what the permit's check raises.
        """
        permit, asked_at = present_permit(), self.loop.time()
        permit.written.value = bool(permit.written.value)
        late_since: float | None = None
        fresh = FRESH
        while True:
            try:
                return await self._run_on_main(call, permit, asked_at, late_since, fresh)
            except Outdated as outdated:
                if outdated.is_late:
                    fresh *= 2  # a machine that is always slow sends, too
                if outdated.has_stood or (outdated.is_late and late_since is None):
                    late_since = self.loop.time()
                permit.check()
                permit.again()

    async def _run_on_main(
        self, call: Callable[[], T], permit: Permit, asked_at: float, late_since: float | None, fresh: float
    ) -> T:
        future: asyncio.Future[T] = self.loop.create_future()
        checked_at, basis = self.loop.time(), (self._delivered[permit.system], permit.basis())
        claim = [call]  # whoever pops it decides: the main loop runs it, or the timer lets it expire

        def settle(result: T | None, error: Exception | None) -> None:
            if future.done():
                return
            if error is not None:
                future.set_exception(error)
            else:
                future.set_result(result)  # type: ignore[arg-type]

        def expire() -> None:
            if claim:
                claim.clear()
                settle(None, Expired.after(permit.lasts))

        def run() -> None:
            if not claim:
                return
            now = self.loop.time()
            has_stood = now - max(self._turned_at, late_since or -math.inf) > fresh
            is_late = has_stood or now - checked_at > fresh
            if permit.system and (is_late or (self._fed[permit.system], permit.basis()) != basis):
                self._hand_over()  # first: the check shall know all that was read
                self._thread.call_soon(settle, None, Outdated(is_late=is_late, has_stood=has_stood))
                return
            patience = min(READ_WITHIN, READ_SHARE * permit.lasts)
            if late_since is not None and now - late_since < patience and self._has_unread():
                self._calls.put(run, urgent=permit.stops)
                return
            try:
                claim.pop()
            except IndexError:  # it expired, or its task was cancelled, at this very moment
                return
            permit.written.value = True
            try:
                outcome = call(), None
            except Exception as error:  # noqa: BLE001  for the caller that awaits, not for MAVProxy
                self._thread.call_soon(settle, None, error)
            else:
                self._thread.call_soon(settle, *outcome)

        self._calls.put(run, urgent=permit.stops)
        remaining = max(asked_at + permit.lasts - checked_at, 0.0)
        timer = self.loop.call_later(remaining, expire)
        try:
            return await future
        finally:
            claim.clear()
            timer.cancel()

    def _has_unread(self) -> bool:
        """Whether the main loop has not read all, or has not handed over all that it has read."""
        return self._feeding or self.links_have_unread()

    def run(self, coroutine: Any, timeout: float | None = None) -> Any:
        """Run a coroutine in the asyncio loop and wait for it. Any thread but the loop's own."""
        return self._thread.run(coroutine, self.patience if timeout is None else timeout)

    def call_soon(self, call: Callable[..., object], *args: Any) -> bool:
        """Run `call` in the asyncio loop, without waiting; False when that has ended. Any thread."""
        return self._thread.call_soon(call, *args)

    def close_in_children(self, filenos: Callable[[], list[int]]) -> None:
        """Name descriptors that a forked child must close, so that it does not keep our port."""
        self._open_sockets.append(filenos)

    def keep_in_children(self, filenos: Callable[[], list[int]]) -> None:
        """Take back what `close_in_children` named, because those descriptors are closed."""
        self._open_sockets.remove(filenos)

    def close_inherited(self) -> None:
        """In a forked child: close our sockets, touching neither the loop nor its epoll (both are shared)."""
        for filenos in self._open_sockets:
            for fd in filenos():
                if fd >= 0:
                    os.close(fd)

    def stop(self) -> None:
        """End the thread and take our descriptor out of MAVProxy's select(). Any thread but the loop's."""
        self._select_extra.pop(self._calls.fileno(), None)
        self._thread.stop()
        self.release()

    def release(self) -> None:
        """Close our descriptors: the end of a bridge whose loop is the caller's."""
        self._calls.close()
        _bridges.discard(self)


def _close_inherited_sockets() -> None:
    for bridge in list(_bridges):
        bridge.close_inherited()


require_posix()  # all three modules come here
# MAVProxy forks children (map, console), which would keep our port open after an unload; close-on-exec does not
# affect a fork. Registered once per process, because Python cannot remove such a hook.
os.register_at_fork(after_in_child=_close_inherited_sockets)
