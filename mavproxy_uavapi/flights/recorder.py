"""Records flights: from arming to disarming of each vehicle, and named ones for as long as somebody wishes.

What is recorded is the telemetry stream, with every event of the trail, and what belongs to it: parameters, missions,
envelopes, pictures, what scripts printed. It is collected in the asyncio thread and written by another, `PERIOD` s at
a time: a kill or a power cut loses no more. Nothing is sent but one question, for the version of an autopilot that
has not told it; a disk that refuses ends a record, not a flight.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Coroutine, Iterator, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

from mavproxy_uavapi import __version__
from mavproxy_uavapi.core.errors import Invalid, NotFound, ToolFailed, UavApiError
from mavproxy_uavapi.core.geotag import Geotag
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.messages import MESSAGE_IDS, request_message
from mavproxy_uavapi.core.streaming import Slots
from mavproxy_uavapi.core.timeout import kept, wait_with_timeout
from mavproxy_uavapi.flights.commands import calm
from mavproxy_uavapi.flights.flight_file import FlightFile
from mavproxy_uavapi.flights.flight_record import AttachedFile, FlightRecord
from mavproxy_uavapi.flights.flight_store import ENDED, Flight, FlightStore, utc
from mavproxy_uavapi.http.stream.stream_views import NAMES
from mavproxy_uavapi.http.stream.subscription import NamePatterns, Subscription, Wishes
from mavproxy_uavapi.programs.program import run_tool

log = logging.getLogger("uavapi.flights")
PERIOD = 0.5  # s from one write to the next
RATE = 10.0  # Hz of each view at most
SETTLES = 3.0  # s after disarming in which the autopilot and the trail tell of it
LOST = 60.0  # s without a link after which a flight counts as over
PACKING = 3600.0  # s that packing a flight may take
DISK_ANSWERS = 10.0  # s
EVENTS = "mode,armed,link,authority,statustext,job,tag,readings,history"
QUEUED = 10_000  # events from one write to the next: a hundred vehicles, or ten while a disk stands for 10 s
MOST_NAMED = 16  # records with a name at once

Gather = Callable[[Sequence[int], float], list[AttachedFile]]  # what scripts of vehicles have printed since (s)


class EventSource(Protocol):
    """Offers what arrives; `TelemetryBroadcast`."""

    def heard_by(self, subscription: Subscription) -> contextlib.AbstractContextManager[Subscription]:
        """Offer everything to a subscription for as long as the context lasts."""


class FlightRecorder:
    """Records the flights of all vehicles. Asyncio thread only.

    Args:
        host: the vehicles.
        source: what arrives.
        folder: where the flights are kept; None to keep none.
        quota: MB of all flights; the oldest are deleted.
        gather: gives files of scripts at the end of a record; blocking.

    Attributes:
        readers: the places for those who read moments of flights.
        exports: the place for what makes a zip: one at a time, because it takes a processor and a disk.
    """

    def __init__(
        self,
        host: Host,
        source: EventSource,
        folder: Callable[[], str],
        quota: Callable[[], int],
        gather: Gather = lambda _systems, _since: [],
    ) -> None:
        self._host, self._source, self._gather = host, source, gather
        self._folder, self._quota = folder, quota
        self._records: list[FlightRecord] = []
        self._subscription: Subscription | None = None
        self._listening = contextlib.ExitStack()
        self._has_stopped = False
        self._is_refused = False  # the disk refused; it has been said
        self._has_ended, self._wish = asyncio.Event(), asyncio.Event()
        self._questions, self._asked = HeldTasks(), set[int]()  # which vehicles were asked what they run
        self.exports = Slots(1, "flight is being exported")
        self.readers = Slots(4, "flights are being read")

    @property
    def store(self) -> FlightStore:
        """The flights of this machine.

        Raises:
            NotFound: the setting `flights` is off.
        """
        if not self._folder():
            raise NotFound("no flights are recorded here (the setting `flights` is off)")
        return FlightStore(Path(self._folder()).expanduser().absolute())

    @property
    def recording(self) -> list[Flight]:
        """The flights that are being recorded now."""
        return [replace(record.flight, messages=record.messages) for record in self._records]

    async def run(self) -> None:
        """Record until it is cancelled."""
        self._has_ended.set()  # what a crash left is packed, too
        self._host.on_picture.append(self._take_picture)
        try:
            while True:
                with contextlib.suppress(asyncio.TimeoutError):
                    await wait_with_timeout(PERIOD, self._wish.wait())
                self._wish.clear()
                if self._folder() or self._records:
                    await _to_its_end(self._turn())
        finally:
            self._has_stopped = True
            self._host.on_picture.remove(self._take_picture)
            await self._questions.end()
            for record in self._records:
                record.is_over = True
            await _to_its_end(self._write())

    async def begin(self, name: str, notes: str, systems: Sequence[int]) -> Flight:
        """Begin a record with a name.

        Raises:
            Invalid: too many are being recorded.
            ToolFailed: the disk refuses.
            NotFound: no flights are recorded here.
        """
        if sum(bool(record.flight.name) for record in self._records) >= MOST_NAMED:
            raise Invalid(f"{MOST_NAMED} flights with a name are being recorded; end one first")
        return (await self._begin(systems, name, notes)).flight

    async def end(self, flight_id: str) -> Flight:
        """End a record, whoever began it; its vehicle's next one begins when it arms again.

        Raises:
            NotFound: it is not being recorded.
            ToolFailed: the disk does not answer.
        """
        record = next((one for one in self._records if one.flight.id == flight_id), None)
        if record is None:
            raise NotFound(f"flight {flight_id[:80]!r} is not being recorded")
        record.is_over = True
        self._wish.set()  # only `run` writes
        try:
            await wait_with_timeout(DISK_ANSWERS, record.ended.wait())
        except asyncio.TimeoutError:
            raise ToolFailed(f"the disk has not taken flight {flight_id} within {DISK_ANSWERS:g} s") from None
        return record.flight

    # -- a turn -------------------------------------------------------------------------------------------

    async def _turn(self) -> None:
        recorded = {system for record in self._records if not record.flight.name for system in record.flight.vehicles}
        for system in [*self._armed()]:
            if self._folder() and system not in recorded:
                await self._begin_quietly(system)
        self._collect()
        for record in self._records:
            record.attach_missions(self._host)
        self._notice_ends()
        await self._write()

    def _armed(self) -> Iterator[int]:
        is_alive, vehicles = self._host.link_watch.is_alive, self._host.fleet.vehicles
        return (system for system, state in vehicles.items() if state.armed and is_alive(state))

    async def _begin_quietly(self, system: int) -> None:
        try:
            await self._begin([system])
            self._is_refused = False
        except UavApiError as error:
            if not self._is_refused:
                self._host.warn(f"the flight of vehicle {system} is not recorded: {error}")
            self._is_refused = True

    async def _begin(self, systems: Sequence[int], name: str = "", notes: str = "") -> FlightRecord:
        store, now = self.store, time.time()
        known = (systems, now, name, notes, self._versions(systems))
        making = asyncio.ensure_future(asyncio.to_thread(store.begin, *known))
        try:
            flight, file = await wait_with_timeout(DISK_ANSWERS, kept(making))
        except asyncio.CancelledError:
            making.add_done_callback(_abandon)
            raise
        except asyncio.TimeoutError:
            making.add_done_callback(_abandon)
            raise ToolFailed(f"{store.folder} does not answer within {DISK_ANSWERS:g} s") from None
        except OSError as error:
            raise ToolFailed(f"cannot write to {store.folder}: {error.strerror}") from error
        if self._has_stopped:  # meanwhile: nobody would write it
            file.abandon()
            raise ToolFailed("the API stops")
        record = FlightRecord(flight, file, now)
        self._records.append(record)
        if self._subscription is None:
            wishes = Wishes(view=NamePatterns(",".join(NAMES)), event=NamePatterns(EVENTS), rate=RATE)
            subscription = Subscription(wishes, queued=QUEUED, keeps_all=True)
            self._subscription = self._listening.enter_context(self._source.heard_by(subscription))
        record.attach_what_is_known(self._host)
        self._ask_what_they_run(systems)
        self._tell(flight)
        return record

    def _ask_what_they_run(self, systems: Sequence[int]) -> None:
        """Ask each vehicle once for its version, if it has not told it; the answer is in the record at its end."""
        for system in systems:
            state = self._host.fleet.vehicles.get(system)
            if state is not None and not state.firmware and system not in self._asked:
                self._asked.add(system)
                self._questions.start(self._ask(system), f"the question for the version of vehicle {system}")

    async def _ask(self, system: int) -> None:
        vehicle = self._host.registry.find(system)
        with contextlib.suppress(UavApiError):  # then it is not known
            await vehicle.post(request_message(MESSAGE_IDS["AUTOPILOT_VERSION"]).to(vehicle.address, 0))

    def _take_picture(self, system: int, tag: Geotag, jpeg: bytes) -> None:
        for record in self._records:
            record.take_picture(system, tag, jpeg)

    def _versions(self, systems: Sequence[int]) -> dict[str, str]:
        """Of the program, MAVProxy, and each vehicle's autopilot as far as it has named its firmware."""
        states = {system: self._host.fleet.vehicles.get(system) for system in systems}
        said = {f"vehicle-{system}": state.firmware for system, state in states.items() if state and state.firmware}
        return {"mavproxy-uavapi": __version__, "MAVProxy": mavproxy_version(), **said}

    def _collect(self) -> None:
        if self._subscription is None:
            return
        for event in self._subscription.take():
            for record in self._records:
                record.take(event)
        lost, self._subscription.dropped = self._subscription.dropped, 0
        if lost:
            for record in self._records:
                record.lose(lost)

    def _notice_ends(self) -> None:
        """A flight without a name ends when its vehicle was disarmed, or not heard, for a while."""
        now, armed = self._host.clock(), set(self._armed())
        for record in self._records:
            (system, *_) = record.flight.vehicles
            if record.flight.name or system in armed:
                record.quiet_since = None
                continue
            if record.quiet_since is None:
                record.quiet_since = now
            is_lost = self._host.fleet.vehicles[system].armed
            record.is_over |= now - record.quiet_since >= (LOST if is_lost else SETTLES)

    async def _write(self) -> None:
        for record in list(self._records):
            is_over = record.is_over  # it may become so meanwhile
            try:
                if is_over:
                    await self._attach_last(record)
                await asyncio.to_thread(record.write)
                if is_over:
                    await self._finish(record)
            except OSError as error:
                self._records = [one for one in self._records if one is not record]
                await asyncio.to_thread(record.file.abandon)
                record.ended.set()
                self._host.warn(f"the record of flight {record.flight.id} ends here: {error.strerror}")
        if not self._records and self._subscription is not None:
            self._listening.close()
            self._subscription = None

    async def _attach_last(self, record: FlightRecord) -> None:
        record.attach_parameters(self._host, "parameters-at-the-end")
        systems = record.flight.vehicles
        try:
            record.attachments += await asyncio.to_thread(self._gather, systems, record.began_at)
            record.attachments += await asyncio.to_thread(record.rehearsed)
        except OSError as error:
            log.warning("flight %s has nothing that scripts printed, and no rehearsal: %s", record.flight.id, error)
        record.flight = replace(record.flight, versions=self._versions(systems))
        await asyncio.to_thread(record.file.note, "versions", record.flight.versions)

    async def _finish(self, record: FlightRecord) -> None:
        self._records.remove(record)
        record.flight = replace(record.flight, ended=utc(time.time()), state=ENDED, messages=record.messages)
        await asyncio.to_thread(FlightStore(record.file.path.parent).finish, record.flight, record.file)
        self._tell(record.flight)
        record.ended.set()
        self._has_ended.set()

    # -- afterwards ---------------------------------------------------------------------------------------

    async def tidy(self) -> None:
        """Pack what has ended, and delete the oldest beyond the quota while nobody flies; until it is cancelled."""
        while True:
            await self._has_ended.wait()
            self._has_ended.clear()
            if self._folder():
                try:
                    await self._pack(self.store)
                except (OSError, UavApiError) as error:
                    log.warning("flights are not packed: %s", error)

    async def _pack(self, store: FlightStore) -> None:
        for name in await asyncio.to_thread(store.unpacked):
            outcome = await run_tool(calm("--folder", str(store.folder), "pack", name), PACKING)
            if outcome.status == 0:
                self._tell(await asyncio.to_thread(store.find, name))
            else:
                log.warning("flight %s is not packed: %s", name, outcome.stderr.strip()[-200:])
        if not any(self._armed()):
            for flight in await asyncio.to_thread(store.make_room, self._quota() * 1_000_000):
                log.info("flight %s is deleted: the flights have more than the quota", flight.id)

    def _tell(self, flight: Flight) -> None:
        log.info("flight %s: %s", flight.id, flight.state)
        self._host.tell("flight", 0, {"flight": flight.id, "state": flight.state})


@cache
def mavproxy_version() -> str:
    """The version of MAVProxy; `unknown` where it runs without having been installed."""
    try:
        return version("MAVProxy")
    except PackageNotFoundError:
        return "unknown"


async def _to_its_end(turn: Coroutine[Any, Any, None]) -> None:
    """Do a turn whole, also if it is cancelled meanwhile: two would write one file, or nobody would close it."""
    task = asyncio.ensure_future(turn)
    try:
        await kept(task)
    except asyncio.CancelledError:
        await asyncio.wait({task}, timeout=DISK_ANSWERS)
        raise


def _abandon(making: asyncio.Future[tuple[Flight, FlightFile]]) -> None:
    """Close a file that came when nobody waited for it any more."""
    if not making.cancelled() and making.exception() is None:
        making.result()[1].abandon()
