"""A virtual world with a scripted vehicle: quick enough for long random flights."""

from __future__ import annotations

import asyncio
import math
from typing import Any

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.support.drone import Drone
from tests.support.virtual_world import VirtualWorld

TURN = 0.15  # s; messages and calls wake the main loop besides
SETTINGS = {"max_rate": 100000.0, "max_jobs": 1000}
# Landings and returns that are quick; deadlines follow from the same parameters.
PARAMETERS = {"LAND_SPEED": 150.0, "RTL_ALT": 0.0, "RTL_LOIT_TIME": 0.0}
UNREAD = {"VFR_HUD", "GPS_RAW_INT"}  # nobody flies by them


class ScriptedWorld(VirtualWorld):
    """As `VirtualWorld`, of a loop of its own.

    Attributes:
        drone: the vehicle.
        twin: a second autopilot with the same system id; None without one.
    """

    def __init__(self, on_disconnect: str = "nothing", on_script_exit: str = "hold") -> None:
        super().__init__(SETTINGS)
        self.drone = self._boot()
        self.drone.parameters.update(PARAMETERS)
        self.drone.disarm_delay, self.drone.mute = 10.0, set(UNREAD)
        self.twin: Drone | None = None
        endings = self.host.endings
        endings.on_disconnect, endings.on_script_exit = Policy(on_disconnect), Policy(on_script_exit)

    def _boot(self) -> Drone:
        return Drone(self.loop, self.hear)

    async def _run(self) -> None:
        self.drone.power_on()
        while True:
            self.turn()
            await asyncio.sleep(TURN)

    @property
    def systems(self) -> set[int]:
        """See `FaultyLink.systems`."""
        return {self.drone.system}

    def arrive(self, message: Any) -> None:
        """Let a message be at the vehicle at once, unless nothing arrives now."""
        for drone in (self.drone, self.twin):
            if drone is not None and self.now >= self.uplink_until:
                drone.on_send(message, self.drone.system)

    @property
    def at(self) -> tuple[float, float, float]:
        """See `VirtualWorld.at`."""
        north, east, down = self.drone.at
        return north, east, down

    @property
    def speed(self) -> float:
        """See `VirtualWorld.speed`."""
        return math.hypot(*self.drone.velocity)

    def double(self) -> None:
        """See `VirtualWorld.double`."""
        self.twin = self._boot()
        self.twin.reboot()
        self.twin.power_on()

    def part(self) -> None:
        """See `VirtualWorld.part`."""
        if self.twin is not None:
            self.twin.power_off()
            self.twin = None

    def close(self) -> None:
        """See `VirtualWorld.close`."""
        self.part()
        self.drone.power_off()
        super().close()
