"""MAVLink's log protocol: the list of a vehicle's dataflash logs, and the download of one.

A log is requested in chunks, so that a vehicle stops soon when nobody listens any more. What is missing is requested
again. LOG_ENTRY and LOG_DATA have no target: other ground stations of the same link, and MAVProxy's own `log` module,
get our messages, and we get theirs. An ArduPilot sends one log at a time and, while it is armed, none.
"""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Aborted, Busy, LinkLost, NotFound, TimedOut, UavApiError
from mavproxy_uavapi.core.link.link import Link
from mavproxy_uavapi.core.link.log_pieces import PIECE, LogEntry, LogList, LogPieces
from mavproxy_uavapi.core.link.message_waiter import MessageExchange, MessageWaiter
from mavproxy_uavapi.core.link.turns import Turns
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

mavlink = mavutil.mavlink

CHUNK = 1024 * PIECE  # bytes of one request; 20 s on a telemetry radio at 57600 baud
LIST_SILENCE = 1.5  # s without an entry until we ask again
SILENCE = 0.7  # s without a new piece until we ask again; an ArduPilot that still sends ignores that
NO_NEWS_TIMEOUT = 10.0  # s of requests without anything new until we give up
FOREIGN = 2.0  # s for which a piece that we did not request shows that another program downloads

Bytes = tuple[int, bytes]  # where they begin, and they
Save = Callable[[Sequence[Bytes]], Awaitable[None]]
Progress = Callable[[int, int], None]


class DataflashLogs:
    """The dataflash logs that one vehicle holds.

    Attributes:
        newest: the last list, by id, and when it came, on the clock of arrivals (s); None before the first one.
        fetching: the log that is being downloaded.

    Args:
        state: the vehicle's.
        link: the way out.
        waiting: its waits.
    """

    def __init__(self, state: VehicleState, link: Link, waiting: MessageWaiter) -> None:
        self._state = state
        self._link = link
        self._waiting = waiting
        self._turns = Turns("transfers of logs")
        self._ended_at: float | None = None  # s; the end of our last download
        self.newest: tuple[list[LogEntry], float] | None = None
        self.fetching: LogEntry | None = None

    async def read_list(self, *, while_armed: bool = False) -> list[LogEntry]:
        """The vehicle's logs, by id.

        Args:
            while_armed: ask an armed vehicle, too.

        Raises:
            Busy: the vehicle is armed, or sends a log.
            TimedOut, LinkLost.
        """
        async with self._turn(while_armed):
            entries = await self._list()
        self.newest = entries, self._waiting.clock()
        return entries

    async def find(self, number: int, *, while_armed: bool = False) -> LogEntry:
        """The log of that number, as the vehicle lists it now.

        Raises:
            NotFound: there is no such log; also as `read_list`.
        """
        for entry in await self.read_list(while_armed=while_armed):
            if entry.id == number:
                return entry
        raise NotFound(f"vehicle {self._state.system} has no log {number}")

    async def fetch(self, entry: LogEntry, save: Save, progress: Progress, *, while_armed: bool = False) -> None:
        """Download a log. The vehicle is told when we want no more.

        Args:
            entry: the log.
            save: called with some bytes of it at a time, in any order.
            progress: called with the number of bytes that have arrived, and of all.
            while_armed: go on while the vehicle is armed.

        Raises:
            Busy: the vehicle is armed; or it sends a log to another program, which is not stopped.
            Aborted: it booted meanwhile.
            TimedOut: nothing new came for NO_NEWS_TIMEOUT s.
            LinkLost; also the errors of `save`.
        """
        async with self._turn(while_armed):
            self.fetching = entry
            try:
                await self._fetch(_Fetch(self._state, entry, while_armed, progress), save)
            except (LinkLost, OthersLog):
                raise
            except BaseException:
                await self._stop()
                raise
            else:
                await self._stop()
            finally:
                self.fetching, self._ended_at = None, self._waiting.clock()

    # -- the protocol -------------------------------------------------------------------------------------

    async def _list(self) -> list[LogEntry]:
        listing, asked_at = LogList(), self._waiting.clock()
        known, news_at = 0, asked_at
        with self._talk("LOG_ENTRY") as talk:
            while (missing := listing.missing) is not None:
                if self._waiting.listening.seconds() - news_at >= NO_NEWS_TIMEOUT:
                    raise self._no_answer("list its logs", asked_at)
                await self._send(mavlink.MAVLink_log_request_list_message(*self._target, *missing))
                while listing.missing is not None and (message := await talk.next(LIST_SILENCE)) is not None:
                    listing.take(message)
                if len(listing.entries) > known:
                    known, news_at = len(listing.entries), self._waiting.clock()
        return listing.entries

    async def _fetch(self, fetch: _Fetch, save: Save) -> None:
        entry, pieces = fetch.entry, fetch.pieces
        asked_at, news_at = self._waiting.clock(), self._waiting.listening.seconds()
        with self._talk("LOG_DATA") as talk:
            while (gap := pieces.next_gap(CHUNK)) is not None:
                fetch.check()
                if self._waiting.listening.seconds() - news_at >= NO_NEWS_TIMEOUT:
                    raise fetch.others_log or self._no_answer(f"send the rest of log {entry.id}", asked_at)
                start, end = gap
                await self._send(
                    mavlink.MAVLink_log_request_data_message(*self._target, entry.id, start, end - start)
                )
                new = await self._take_chunk(talk, fetch, end)
                if new:
                    await save(new)
                    news_at = self._waiting.listening.seconds()

    async def _take_chunk(self, talk: MessageExchange[Any], fetch: _Fetch, end: int) -> Sequence[Bytes]:
        """The new bytes that come, until the vehicle has sent the one before `end`, or is silent."""
        new: list[Bytes] = []
        deadline = self._waiting.clock() + SILENCE
        while (message := await talk.next(max(deadline - self._waiting.clock(), 0.0))) is not None:
            fetch.check()
            piece = fetch.take(message)
            if piece is None:
                continue
            new.append(piece)
            deadline = self._waiting.clock() + SILENCE
            if piece[0] < end <= piece[0] + len(piece[1]):
                break
        return new

    async def _stop(self) -> None:
        """Tell the vehicle that we want no more; an armed ArduPilot ignores that, and stops after the chunk."""
        with contextlib.suppress(UavApiError):
            await self._send(mavlink.MAVLink_log_request_end_message(*self._target))

    # -- helpers ------------------------------------------------------------------------------------------

    @property
    def _target(self) -> tuple[int, int]:
        return self._state.system, self._state.component

    def _talk(self, name: str) -> contextlib.AbstractContextManager[MessageExchange[Any]]:
        return self._waiting.exchange({name}, self._link.source)

    async def _send(self, message: Any) -> None:
        await self._link.send(message, self._state.system)

    @contextlib.asynccontextmanager
    async def _turn(self, while_armed: bool) -> AsyncIterator[None]:
        self._require_rest(while_armed)  # a download may have the turn for long
        async with self._turns.one():
            self._require_rest(while_armed)
            yield

    def _require_rest(self, while_armed: bool) -> None:
        """Raise Busy unless the vehicle may list or send a log now."""
        system = self._state.system
        if not while_armed:
            require_disarmed(self._state)
        if self.fetching is not None:
            raise Busy(f"log {self.fetching.id} of vehicle {system} is being downloaded; one at a time")
        piece, now = self._state.newest("LOG_DATA"), self._waiting.clock()
        ours = self._ended_at is not None and piece is not None and piece.at - self._ended_at < FOREIGN
        if piece is not None and now - piece.at < FOREIGN and not ours:
            raise OthersLog(f"another program downloads log {piece.message.id} of vehicle {system}; try again later")

    def _no_answer(self, action: str, asked_at: float) -> TimedOut:
        texts = self._state.statustexts.since(asked_at)
        return TimedOut(f"vehicle {self._state.system} did not {action}, asked for {NO_NEWS_TIMEOUT:g} s", texts)


class OthersLog(Busy):
    """The vehicle sends a log to another program, which must not be disturbed."""


class _Fetch:
    """A download under way.

    Attributes:
        others_log: the error if it fails because the vehicle sends another log.
    """

    def __init__(self, state: VehicleState, entry: LogEntry, while_armed: bool, progress: Progress) -> None:
        self.entry = entry
        self.pieces = LogPieces(entry.size)
        self.others_log: OthersLog | None = None
        self._state = state
        self._while_armed = while_armed
        self._progress = progress
        self._reboots = state.reboots

    def check(self) -> None:
        """Raise Aborted or Busy if it must not go on: the vehicle booted, or is armed."""
        system = self._state.system
        if self._state.reboots != self._reboots:
            raise Aborted(f"vehicle {system} booted during the download of its log {self.entry.id}")
        if not self._while_armed:
            require_disarmed(self._state)

    def take(self, message: Any) -> Bytes | None:
        """The bytes of a LOG_DATA; None if it has no new ones of this log."""
        if message.id != self.entry.id:
            sentence = f"another program downloads log {message.id} of vehicle {self._state.system}"
            self.others_log = OthersLog(sentence)
            return None
        start = message.ofs
        end = min(start + min(message.count, PIECE), self.entry.size)
        if not self.pieces.take(start, end):
            return None
        self._progress(self.pieces.done, self.pieces.size)
        return start, bytes(message.data[: end - start])


def require_disarmed(state: VehicleState) -> None:
    """Raise Busy unless the vehicle is known to be disarmed."""
    if state.armed is not False:
        raise Busy(
            f"vehicle {state.system} is armed; a transfer would load its link; while_armed=true requests it anyway"
        )
