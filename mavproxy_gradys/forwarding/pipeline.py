"""Store and forward of readings: samplers, the spool, and a sender for each sink."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Sequence
from typing import Any

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.quantities import POSITION, Quantity
from mavproxy_gradys.forwarding.readings import UAV, Reading, Sampler, device_of
from mavproxy_gradys.forwarding.recent import RecentReadings
from mavproxy_gradys.forwarding.sender import Sender
from mavproxy_gradys.forwarding.sensor import SensorFiles, SensorSampler
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.forwarding.spool_thread import SpoolThread
from mavproxy_gradys.net.schedule import Ticker
from mavproxy_gradys.position import position_of
from mavproxy_gradys.settings import GradysSettings
from mavproxy_uavapi.core.errors import Unavailable
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

MEGABYTE = 1e6


class ReadingPipeline:
    """Samples the quantities while there is a sink; keeps posted readings even without a sink.

    Attributes:
        recent: the newest readings, sampled and posted.

    Args:
        host: the vehicles.
        wall: s since 1970.
    """

    def __init__(self, host: Host, wall: Callable[[], float] = time.time) -> None:
        self._host = host
        self._wall = wall
        self.recent = RecentReadings()
        self._settings: GradysSettings | None = None
        self.spool_thread: SpoolThread | None = None
        self._settings_before: GradysSettings | None = None  # of the last start
        self._left: list[Reading] = []  # readings that were not on the disk at the last stop
        self._why_left = ""
        self._senders: list[Sender] = []
        self._samplers: list[Sampler | SensorSampler] = []
        self._files = SensorFiles(wall)
        self._sampled_at: dict[tuple[str, str], dict[int, float]] = {}  # of each name and message, across starts
        self._tasks = HeldTasks()
        self._sensors = HeldTasks()

    def start(self, settings: GradysSettings) -> None:
        """Sample and send, if there is a sink."""
        self._settings = self._settings_before = settings
        if settings.sink or self._left:
            self._started_thread()
        for address in settings.sink:
            sender = Sender(
                address,
                self._started_thread(),
                self._host.clock,
                tell=lambda info: self._host.tell("delivered", 0, info),
            )
            self._senders.append(sender)
            self._tasks.start(sender.run(settings), f"the delivery to {address}")
        self._remember(settings.quantities)
        for quantity in settings.quantities if settings.sink else ():
            name = f"the sampling of {quantity.name}"
            if quantity.is_sensor:
                self._sensors.start(self._sense(self._sensor(quantity), self._started_thread()), name)
            else:
                sampling = self._sample(self._sampler(quantity), self._started_thread(), settings.max_age)
                self._tasks.start(sampling, name)

    def _remember(self, quantities: Sequence[Quantity]) -> None:
        """Keep what was sampled of these quantities, and no others: a new setting samples nothing a second time."""
        self._files.keep(quantities)
        keys = [(quantity.name, quantity.message) for quantity in quantities]
        self._sampled_at = {key: self._sampled_at.get(key, {}) for key in keys}

    async def stop(self) -> None:
        """Stop, and close the spool; readings that cannot be written stay in memory until the next start."""
        self._settings = None
        await self._sensors.end()  # first, because it is quick and leaves no command running
        self._samplers.clear()
        self._senders.clear()
        try:
            if self.spool_thread is not None:
                await self.spool_thread.save()  # before the sinks close, which may take long
            await self._tasks.end()
        finally:
            await self._end_thread()

    async def _end_thread(self) -> None:
        spool_thread = self.spool_thread
        if spool_thread is None:
            return
        try:
            await spool_thread.stop()
        finally:
            self._left, self._why_left = spool_thread.left, spool_thread.problem
            self.spool_thread = None

    async def close(self) -> None:
        """Stop for good; readings that an earlier stop left in memory get one more attempt."""
        if self._settings is None and self._left and self._settings_before is not None:
            self._started_thread(self._settings_before)
        self._files.keep(())
        await self.stop()

    @property
    def lost(self) -> str:
        """What is lost if nothing more is written: the number of readings and the reason; empty if none is lost."""
        spool_thread = self.spool_thread  # it exists if its end was not awaited
        count = len(self._left) if spool_thread is None else spool_thread.waiting
        why = (self._why_left if spool_thread is None else spool_thread.problem) or "they were not written in time"
        return f"{count} {'reading is' if count == 1 else 'readings are'} lost: {why}" if count else ""

    def _started_thread(self, settings: GradysSettings | None = None) -> SpoolThread:
        """The spool's thread; started if necessary."""
        settings = settings or self._settings
        if settings is None:
            raise NotStored("gradys is stopped: `gradys start`")
        if self.spool_thread is None:
            spool, largest, longest = settings.spool, settings.spool_mb * MEGABYTE, settings.spool_hours * 3600
            self.spool_thread = SpoolThread(lambda: Spool(spool, largest, longest))
            self.spool_thread.start([address.name for address in settings.sink])
            for reading in self._left:
                self.spool_thread.put(reading)
            self._left = []
        return self.spool_thread

    async def keep(self, readings: Sequence[Reading]) -> list[int]:
        """Keep posted readings; returns their sequence numbers once they are on the disk.

        Raises:
            NotStored: they are not.
        """
        numbers = await self._started_thread().keep(readings)
        self._show(readings)
        return numbers

    def _put(self, spool_thread: SpoolThread, reading: Reading | None) -> None:
        """Take a sampled reading, if there is one."""
        if reading is not None:
            self._show([reading])
            spool_thread.put(reading)

    def _show(self, readings: Sequence[Reading]) -> None:
        """Tell of readings, those of a vehicle together."""
        systems: dict[int, list[dict[str, Any]]] = {}
        for reading in readings:
            self.recent.add(reading)
            systems.setdefault(reading.system, []).append(reading.report())
        for system, reports in systems.items():
            self._host.tell("readings", system, {"readings": reports})

    @property
    def reserved(self) -> set[str]:
        """The quantities that come from a vehicle itself only: the sampled ones and its position."""
        sampled = () if self._settings is None else self._settings.quantities
        return {POSITION, *(quantity.name for quantity in sampled)}

    def device_of(self, system: int) -> str:
        """The device name of a vehicle."""
        return device_of(system, UAV if self._settings is None else self._settings.device)

    def flush(self) -> None:
        """Try all sinks now."""
        for sender in self._senders:
            sender.flush()
        if self.spool_thread is not None:
            self.spool_thread.flush()

    # -- sampling -----------------------------------------------------------------------------------------

    def _sampler(self, quantity: Quantity) -> Sampler:
        assert self._settings is not None
        sampler = Sampler(quantity, self._settings.device, self._sampled_at[quantity.name, quantity.message])
        self._samplers.append(sampler)
        return sampler

    def _sensor(self, quantity: Quantity) -> SensorSampler:
        assert self._settings is not None
        source = self._files.source_of(quantity, self._settings.max_age)
        sampler = SensorSampler(quantity, source, self._host.clock, self._settings.device)
        self._samplers.append(sampler)
        return sampler

    async def _sense(self, sampler: SensorSampler, spool_thread: SpoolThread) -> None:
        """Sample a sensor; its readings belong to MAVProxy's current vehicle."""
        loop = asyncio.get_running_loop()
        ticker = Ticker(sampler.quantity.period, loop.time())
        while True:
            await asyncio.sleep(ticker.wait(loop.time()))
            system = self._host.registry.resolve()
            self._put(spool_thread, await sampler.sample(system if system in self._host.fleet.vehicles else 0))

    async def _sample(self, sampler: Sampler, spool_thread: SpoolThread, max_age: float) -> None:
        loop = asyncio.get_running_loop()
        ticker = Ticker(sampler.quantity.period, loop.time())
        while True:
            await asyncio.sleep(ticker.wait(loop.time()))
            for state in list(self._host.fleet.vehicles.values()):
                self._put(spool_thread, self._read(sampler, state, max_age))

    def _read(self, sampler: Sampler, state: VehicleState, max_age: float) -> Reading | None:
        now, wall = self._host.clock(), self._wall()
        if sampler.quantity.name != POSITION or sampler.quantity.message:
            return sampler.sample(state, now, wall, max_age)
        try:
            position = position_of(
                state,
                now,
                max_age=max_age,
                link_timeout=self._host.link_watch.timeout,
                has_position=self._host.registry.find(state.system).has_position,
            )
        except Unavailable as error:
            sampler.skip(state.system, str(error))
            return None
        received_at = state.messages["GLOBAL_POSITION_INT"].at
        value = [position.lat, position.lng, position.alt]
        return sampler.take(state.system, value, received_at, wall - position.age)

    # -- status -----------------------------------------------------------------------------------------------

    def report(self) -> dict[str, Any]:
        """The report for the status: spooled, oldest unsent, the spool, the sinks, the quantities."""
        spool_thread = self.spool_thread
        oldest = None if spool_thread is None else spool_thread.oldest_age
        return {
            "spooled": len(self._left) if spool_thread is None else spooled(spool_thread),
            "oldest_unsent_s": None if oldest is None else round(oldest, 1),
            "spool": None if spool_thread is None else self._spool_report(spool_thread),
            "sinks": [sender.report() for sender in self._senders],
            "quantities": [quantity_report(sampler) for sampler in self._samplers],
        }

    def _spool_report(self, spool_thread: SpoolThread) -> dict[str, Any]:
        assert self._settings is not None
        return {
            "file": str(self._settings.spool),
            "problem": spool_thread.problem or None,
            "dropped": dict(spool_thread.dropped),
            "set_aside": [str(file) for file in spool_thread.set_aside],
        }


def spooled(spool_thread: SpoolThread) -> int | None:
    """The number of kept readings; None while unknown."""
    return None if spool_thread.count is None else spool_thread.count + spool_thread.waiting


def quantity_report(sampler: Sampler | SensorSampler) -> dict[str, Any]:
    """The report of one quantity, for the status: a sensor has a `problem`, the others a reason by vehicle."""
    quantity = sampler.quantity
    report = {"quantity": quantity.name, "period_s": quantity.period, "taken": sampler.taken}
    if isinstance(sampler, SensorSampler):
        return {**report, "why_not": {}, "problem": sampler.problem or None}
    why_not = {str(system): why for system, why in sorted(sampler.why_not.items())}
    return {**report, "why_not": why_not, "problem": None}
