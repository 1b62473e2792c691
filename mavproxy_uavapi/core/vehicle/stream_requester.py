"""Requests the messages that a vehicle should send but that do not arrive.

MAVProxy asks every vehicle for all streams at its `streamrate`, which stays as it is; a vehicle that it hears later
than the first is asked up to 15 s later. What does not arrive (EXTENDED_SYS_STATE is in no stream; a stream rate may
be 0) is requested with SET_MESSAGE_INTERVAL, and again when it stops.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import defaultdict

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.vehicle.messages import MESSAGE_IDS, set_interval
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

LOOK_EVERY = 2.0  # s
MISSING_AFTER = 3.0  # s without a message until it is requested
ASK_AGAIN = 30.0  # s between requests, after the first few
FIRST_ASKINGS = 3

# Hz: enough for flight (positions) and for a status (the rest), and few enough for a telemetry radio.
WANTED = {
    "GLOBAL_POSITION_INT": 4,
    "LOCAL_POSITION_NED": 4,
    "ATTITUDE": 4,
    "EXTENDED_SYS_STATE": 2,
    "SYS_STATUS": 2,
    "EKF_STATUS_REPORT": 2,
    "GPS_RAW_INT": 2,
    "VFR_HUD": 2,
    "POSITION_TARGET_LOCAL_NED": 2,
    "POSITION_TARGET_GLOBAL_INT": 2,
}
IN_GUIDED = {"POSITION_TARGET_LOCAL_NED", "POSITION_TARGET_GLOBAL_INT"}  # in other modes they say nothing
AT_ONCE = IN_GUIDED | {"EXTENDED_SYS_STATE"}  # requested without waiting for MAVProxy's streams to bring them


class StreamRequester:
    """Watches what arrives from each vehicle that MAVProxy hears.

    Args:
        registry: the vehicles.
    """

    def __init__(self, registry: VehicleRegistry) -> None:
        self._registry = registry
        self._watched_since: dict[tuple[int, int], float] = {}  # by system id and number of reboots
        self._asked_at: defaultdict[tuple[int, int, str], list[float]] = defaultdict(list)

    async def run(self) -> None:
        """Watch, until cancelled."""
        watched: set[int] = set()
        tasks = HeldTasks()  # one for each vehicle: one that does not acknowledge delays no other
        try:
            while True:
                for system in {vehicle.state.system for vehicle in self._registry.all()} - watched:
                    watched.add(system)
                    tasks.start(self._watch(system), f"the watch over the telemetry of vehicle {system}")
                await asyncio.sleep(LOOK_EVERY)
        finally:
            await tasks.end()

    async def _watch(self, system: int) -> None:
        while True:
            with contextlib.suppress(UavApiError):  # its link is lost, or it refuses: nothing can be requested
                await self.look(self._registry.commandable(system))
            await asyncio.sleep(LOOK_EVERY)

    async def look(self, vehicle: Vehicle) -> None:
        """Request what is missing now.

        Raises:
            LinkLost: it went away meanwhile.
        """
        for name in self.missing(vehicle):
            key = (vehicle.state.system, vehicle.state.reboots, name)
            self._asked_at[key].append(vehicle.clock())
            await vehicle.commands.send(set_interval(MESSAGE_IDS[name], WANTED[name]))

    def missing(self, vehicle: Vehicle) -> list[str]:
        """The wanted messages that do not arrive and whose next request is due."""
        now = vehicle.clock()
        since = self._watched_since.setdefault((vehicle.state.system, vehicle.state.reboots), now)
        missing = []
        guided = vehicle.state.armed and vehicle.mode == "GUIDED"
        for name in [name for name in WANTED if guided or name not in IN_GUIDED]:
            age = vehicle.state.age(name, now)
            if age is None:
                age = MISSING_AFTER if name in AT_ONCE else now - since
            if age < MISSING_AFTER:
                continue
            asked_at = self._asked_at[(vehicle.state.system, vehicle.state.reboots, name)]
            pause = LOOK_EVERY if len(asked_at) < FIRST_ASKINGS else ASK_AGAIN
            if not asked_at or now - asked_at[-1] >= pause:
                missing.append(name)
        return missing
