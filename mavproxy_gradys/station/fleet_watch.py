"""Reads the state of the fleet once a second, and logs its alarms."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.net.outage_log import Defects, Outage
from mavproxy_gradys.station.fleet import Alarm, AlarmLimits, FleetVehicle, alarms, vehicles
from mavproxy_gradys.station.store import FleetNow, Store, StoreCounts
from mavproxy_uavapi.core.timeout import wait_with_timeout

EVERY = 1.0  # s
LONGEST = 10.0  # s of one update; a database that hangs is told of as one that is gone
LINES = 5  # log lines for new alarms at once
log = logging.getLogger("station.fleet")


class FleetWatch:
    """The newest state of the fleet.

    Attributes:
        now: the store's clock at that time, s since 1970.
        vehicles, alarms, counts: the state.
        problem: why the newest read failed; empty if it succeeded.

    Args:
        store: the store of the readings.
        limits: the limits of the alarms.
    """

    def __init__(self, store: Store, limits: AlarmLimits) -> None:
        self._store = store
        self._limits = limits
        self._outage = Outage(log, "the fleet's state cannot be read", "the fleet's state is read again")
        self._defects = Defects("the reading of the fleet's state")
        self._updated = asyncio.Condition()
        self.now = 0.0
        self.vehicles: Sequence[FleetVehicle] = ()
        self.alarms: Sequence[Alarm] = ()
        self.counts = StoreCounts(0, 0)
        self.problem = "not read yet"

    async def run(self) -> None:
        """Update the state every second, until cancelled."""
        while True:
            await self.update()
            await asyncio.sleep(EVERY)

    async def update(self) -> None:
        """Update the state now."""
        try:
            fleet, self.counts = await wait_with_timeout(LONGEST, self._read())
        except asyncio.TimeoutError:
            self.problem = f"the database has not answered for {LONGEST:g} s"
        except NotStored as error:
            self.problem = str(error)
        except Exception as error:  # noqa: BLE001  a defect must not end the watch for ever
            self._defects.report(error)
            self.problem = f"{type(error).__name__}: {error}"
        else:
            self.now, self.vehicles, self.problem = fleet.now, vehicles(fleet), ""
            self._raise(alarms(self.vehicles, self.now, self._limits))
        self._outage.update(self.problem)
        async with self._updated:
            self._updated.notify_all()

    async def _read(self) -> tuple[FleetNow, StoreCounts]:
        return await self._store.fleet(), await self._store.counts()

    async def next_update(self) -> None:
        """Wait for the next update."""
        async with self._updated:
            await self._updated.wait()

    def _raise(self, raised: Sequence[Alarm]) -> None:
        """Log the alarms that have begun or ended."""
        for word, news in (("alarm", set(raised) - set(self.alarms)), ("over", set(self.alarms) - set(raised))):
            for alarm in sorted(news)[:LINES]:
                log.warning("%s: %a %s", word, alarm.device, alarm.kind)
            if len(news) > LINES:
                log.warning("%s: %d more", word, len(news) - LINES)
        self.alarms = raised
