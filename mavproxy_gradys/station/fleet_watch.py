"""Looks at the fleet once a second, and says what is wrong with it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.net.outage_log import Defects, Outage
from mavproxy_gradys.station.fleet import Alarm, AlarmLimits, FleetVehicle, alarms, vehicles
from mavproxy_gradys.station.store import Store, StoreCounts

EVERY = 1.0  # s
LINES = 5  # of alarms at once
log = logging.getLogger("station.fleet")


class FleetWatch:
    """The fleet at the newest look.

    Attributes:
        now: the store's clock then, s since 1970.
        vehicles, alarms, counts: what was there.
        problem: why the newest look failed; empty when it did not.

    Args:
        store: where the fleet is.
        limits: when there is an alarm.
    """

    def __init__(self, store: Store, limits: AlarmLimits) -> None:
        self._store = store
        self._limits = limits
        self._outage = Outage(log, "the fleet cannot be seen", "the fleet is seen again")
        self._defects = Defects("the look at the fleet")
        self._looked = asyncio.Condition()
        self.now = 0.0
        self.vehicles: Sequence[FleetVehicle] = ()
        self.alarms: Sequence[Alarm] = ()
        self.counts = StoreCounts(0, 0)
        self.problem = "not looked yet"

    async def run(self) -> None:
        """Look, until cancelled."""
        while True:
            await self.look()
            await asyncio.sleep(EVERY)

    async def look(self) -> None:
        """Look now."""
        try:
            fleet, self.counts = await self._store.fleet(), await self._store.counts()
        except NotStored as error:
            self.problem = str(error)
        except Exception as error:  # noqa: BLE001  a defect must not end the watch for ever
            self._defects.tell(error)
            self.problem = f"{type(error).__name__}: {error}"
        else:
            self.now, self.vehicles, self.problem = fleet.now, vehicles(fleet), ""
            self._raise(alarms(self.vehicles, self.now, self._limits))
        self._outage.now(self.problem)
        async with self._looked:
            self._looked.notify_all()

    async def next_look(self) -> None:
        """Wait until it has looked again."""
        async with self._looked:
            await self._looked.wait()

    def _raise(self, raised: Sequence[Alarm]) -> None:
        """Say what is new."""
        for word, news in (("alarm", set(raised) - set(self.alarms)), ("over", set(self.alarms) - set(raised))):
            for alarm in sorted(news)[:LINES]:
                log.warning("%s: %a %s", word, alarm.device, alarm.kind)
            if len(news) > LINES:
                log.warning("%s: %d more", word, len(news) - LINES)
        self.alarms = raised
