"""What one client of a stream wants to hear, and what it has not read yet. Pure."""

from __future__ import annotations

import asyncio
import itertools
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

from mavproxy_uavapi.http.stream.stream_event import Event
from mavproxy_uavapi.http.stream.stream_views import OF_A_VEHICLE

QUEUED = 1000  # entries
TOGETHER = 100  # events that a client gets at once


class NamePatterns:
    """A list of names by comma, with `*` and `?`.

    Args:
        text: the list.
    """

    def __init__(self, text: str = "") -> None:
        self.patterns = [word.strip() for word in text.split(",") if word.strip()]
        self._known: dict[str, bool] = {}

    def __bool__(self) -> bool:
        return bool(self.patterns)

    def __contains__(self, name: str) -> bool:
        known = self._known.get(name)
        if known is None:
            known = self._known[name] = any(fnmatchcase(name, pattern) for pattern in self.patterns)
        return known


@dataclass(frozen=True)
class Wishes:
    """What a client wants to hear.

    Attributes:
        name: of messages.
        view, event: of those.
        systems: the system ids; empty for all.
        rate: highest rate in Hz of each message of each component, and of each view; None for all.
    """

    name: NamePatterns = field(default_factory=NamePatterns)
    view: NamePatterns = field(default_factory=NamePatterns)
    event: NamePatterns = field(default_factory=NamePatterns)
    systems: frozenset[int] = frozenset()
    rate: float | None = None

    def __contains__(self, event: Event) -> bool:
        if event.name not in getattr(self, event.kind):
            return False
        return not self.systems or not event.system or event.system in self.systems  # 0 is of no vehicle

    @property
    def needs_ticks(self) -> bool:
        """Whether there is something that no message announces."""
        return bool(self.event) or any(name in self.view for name in OF_A_VEHICLE)


Later = Callable[[float, Callable[[], None]], asyncio.TimerHandle]


class Subscription:
    """One client's wishes, and its events that are not yet read.

    Of what comes more often than `rate` the newest is kept, and passed on when its time has come. It then takes the
    place of an older one that is not yet read, so that a slow reader gets few new values instead of many old ones.

    Args:
        wishes: what it wants.
        later: runs a function after so many seconds; without it only a later message shows that the time has come.
        queued: entries; a client that reads slower than that loses the oldest.
        keeps_all: whether a newer value leaves an older one that is not yet read in the queue.

    Attributes:
        dropped: events lost because the client reads too slowly.
    """

    def __init__(
        self, wishes: Wishes, later: Later | None = None, *, queued: int = QUEUED, keeps_all: bool = False
    ) -> None:
        self.wishes = wishes
        self._most, self._keeps_all = queued, keeps_all
        self.dropped = 0
        self._later = later
        self._interval = 1.0 / wishes.rate if wishes.rate else 0.0
        self._next: dict[tuple[Any, ...], float] = {}  # when each may be passed on again
        self._held: dict[tuple[Any, ...], Event] = {}
        self._timers: dict[tuple[Any, ...], asyncio.TimerHandle] = {}
        self._queue: OrderedDict[Any, Event] = OrderedDict()  # what has a number is never replaced
        self._numbers = itertools.count()
        self._news = asyncio.Event()

    def offer(self, event: Event, now: float) -> None:
        """Queue an event that arrived at `now` (s), if it is wanted; a full queue loses its oldest."""
        if event not in self.wishes:
            return
        if not self._interval or event.kind == "event":  # an event comes only once
            self._put(next(self._numbers), event)
            return
        key = event.system, event.component, event.kind, event.name
        due = self._next.get(key, now)
        if now >= due:
            self._pass_on(key, event, now)
            return
        self._held[key] = event
        if self._later is not None and key not in self._timers:
            self._timers[key] = self._later(due - now, lambda: self._release(key, due))

    def _release(self, key: tuple[Any, ...], due: float) -> None:
        del self._timers[key]
        event = self._held.get(key)
        if event is not None:
            self._pass_on(key, event, due)

    def _pass_on(self, key: tuple[Any, ...], event: Event, now: float) -> None:
        self._held.pop(key, None)
        self._next[key] = now + self._interval
        self._put(next(self._numbers) if self._keeps_all else key, event)

    def _put(self, key: Any, event: Event) -> None:
        self._queue[key] = event  # in the place of an older one
        if len(self._queue) > self._most:
            self._queue.popitem(last=False)
            self.dropped += 1
        self._news.set()

    async def next(self, quiet: float) -> list[Event]:
        """The next events; none when there is none for `quiet` s."""
        if not self._queue:
            self._news.clear()
            timer = asyncio.get_running_loop().call_later(quiet, self._news.set)  # no task: this runs for each event
            try:
                await self._news.wait()
            finally:
                timer.cancel()
        return [self._queue.popitem(last=False)[1] for _ in range(min(len(self._queue), TOGETHER))]

    def take(self) -> list[Event]:
        """All that is queued, at once."""
        events = list(self._queue.values())
        self._queue.clear()
        return events

    def close(self) -> None:
        """Forget what is held."""
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
