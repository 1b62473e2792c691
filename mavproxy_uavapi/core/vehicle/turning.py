"""Turning on the spot in GUIDED."""

from __future__ import annotations

import math

from mavproxy_uavapi.core.control.authority import YAW
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Stale
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.messages import Yaw
from mavproxy_uavapi.core.vehicle.guided import GUIDED
from mavproxy_uavapi.core.vehicle.travelling import TravellingVehicle

HEADING_TOLERANCE = 3.0  # degrees
RATE_TOLERANCE = 2.0, 0.2  # deg/s, and a share of the rate
SLOWEST_TURN = 10.0  # deg/s; a slower turn is too slow


class TurningVehicle(TravellingVehicle):
    """A vehicle that turns on the spot."""

    async def set_heading(self, job: Job, heading: float, timeout: float | None = None) -> None:
        """Turn to `heading` degrees clockwise from north by the shorter way; done when the attitude shows it.

        A movement goes on.
        """
        self.require_armed()
        self.require_mode(GUIDED)
        self.require_no_takeoff()
        self.authority.accompany(job, YAW)
        await self.command(job).send(messages.yaw_to(heading), self.flying)
        self.yaw = Yaw(heading=math.radians(heading))

        def turned() -> bool | None:
            try:
                yaw = math.degrees(self.attitude().yaw)
            except Stale:
                return None  # a gap in the telemetry; the deadline still holds
            degrees_to_go = abs((heading - yaw + 180.0) % 360.0 - 180.0)
            job.progress = {"degrees_to_go": round(degrees_to_go, 1)}
            return True if degrees_to_go <= HEADING_TOLERANCE else None

        if not self.state.landed:  # on the ground it turns only after takeoff
            allowed = self.allowed(180.0 / SLOWEST_TURN, timeout)
            await self.until(GUIDED, {"ATTITUDE"}, turned, allowed, f"turn to {heading:g} degrees")

    async def set_yaw_rate(self, job: Job, rate: float, timeout: float | None = None) -> None:
        """Turn at `rate` deg/s, clockwise positive; done when the attitude shows it. A movement goes on.

        ArduCopter takes a yaw rate only with a setpoint. So the setpoint in force is repeated; if the autopilot does
        not report one, the present position is sent.
        """
        self.require_guided_flight()
        self.authority.accompany(job, YAW)
        asked_at = self.clock()
        reported = await self.ask_setpoint()
        is_outdated = self.own_target.sent_at >= asked_at  # by what has been sent meanwhile
        target = self.own_target.newest if is_outdated else self.own_target.due(reported)
        self.require_no_takeoff()
        await self.send_setpoint(job, target or self.ned_from_here(0, 0, 0), Yaw(rate=math.radians(rate)))
        least, share = RATE_TOLERANCE

        def turns() -> bool | None:
            try:
                yaw_rate = math.degrees(self.attitude().rates[2])
            except Stale:
                return None
            if abs(yaw_rate - rate) <= max(least, share * abs(rate)):
                return True
            if self.has_foreign_target:
                self.own_target.require()  # raises: our setpoint, and the rate with it, was replaced
            return None

        allowed = self.allowed(abs(rate) / SLOWEST_TURN, timeout)
        await self.until(GUIDED, {"ATTITUDE"}, turns, allowed, f"turn at {rate:g} deg/s")
