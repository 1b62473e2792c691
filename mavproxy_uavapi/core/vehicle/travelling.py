"""Moving at a velocity in GUIDED, and coming to rest there."""

from __future__ import annotations

import asyncio
import contextlib
import math

from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Expired, Stale, TimedOut, UavApiError
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.messages import NedTarget, Target, VelocityTarget
from mavproxy_uavapi.core.vehicle.guided import ARRIVAL_SPEED, GuidedVehicle
from mavproxy_uavapi.core.vehicle.own_target import STANDSTILL

RESENDS_PER_TIMEOUT = 3  # velocity setpoints sent in each GUID_TIMEOUT
ROUNDING = 1e-6  # s; a shorter remainder is a rounding error, not a setpoint
REST_PERIOD = 0.3  # s between two setpoints of a standstill
REST_SHOWN = 1.0  # s
REST_TIMEOUT = 10.0  # s
STOP_TIMEOUT = 20.0  # s from full speed to rest


class TravellingVehicle(GuidedVehicle):
    """A vehicle that takes velocities in GUIDED and can stand still there."""

    @property
    def standstill(self) -> Target:
        """The setpoint that stops it."""
        return STANDSTILL

    async def travel(
        self,
        job: Job,
        velocity: VelocityTarget,
        *,
        look_at_target: bool = False,
        heading: float | None = None,
        duration: float | None = None,
    ) -> None:
        """Fly at a velocity: one setpoint, which the autopilot drops after GUID_TIMEOUT.

        `heading` is the direction to point, degrees clockwise from north. With `duration` (s on the vehicle's clock)
        the setpoint is repeated for that time, then a stop is sent. A setpoint that is sent late, because the machine
        is busy, does not lengthen that time.
        """
        self.require_guided_flight()
        await self.command(job).take(Rank.MOVEMENT, self.inside(velocity))
        yaw = messages.facing(heading, look_at_target, velocity.vx, velocity.vy)
        job.steers = duration is not None
        await self.take_up(job, velocity, yaw)
        if math.hypot(velocity.vx, velocity.vy, velocity.vz) > 2 * ARRIVAL_SPEED:
            self.watch_pause(job)
        if duration is None:
            return
        due = self._boot_time
        ends_at = due + duration
        period = (await self.limits()).guided_timeout / RESENDS_PER_TIMEOUT
        while due < ends_at:
            is_late = due + period < self._boot_time  # the setpoints that are missing are not sent afterwards
            due = (self._boot_time if is_late else due) + period
            due = ends_at if due > ends_at - ROUNDING else due
            await self._travelled(due)
            lost = (Expired,) if due < ends_at else (Expired, Stale)
            with contextlib.suppress(*lost):  # the autopilot drops the last one by itself
                await self.send_setpoint(job, velocity if due < ends_at else self.standstill, yaw)

    def watch_pause(self, job: Job) -> None:
        """If the vehicle does not move soon, end a pause from before we knew it."""

        async def let_go_on() -> None:
            with contextlib.suppress(UavApiError):
                await self.end_unknown_pause(job, self.command(job).require)

        self._tasks.start(let_go_on(), "the watch over a pause from before")

    @property
    def _boot_time(self) -> float:
        """The vehicle's clock now, s since its boot."""
        return self.state.time_ratio.boot_time(self.clock())

    async def _travelled(self, until: float) -> None:
        """Wait until that time on the vehicle's clock (s) while it stays armed and in GUIDED."""
        while (remaining := until - self._boot_time) > 0:
            self.flying()
            with contextlib.suppress(TimedOut):  # the time has passed, unless the vehicle's clock runs slower
                await self.waiting.message(
                    {"HEARTBEAT"}, lambda beat: beat, max(remaining / self.state.time_ratio.ratio, 0.01), "beat"
                )

    async def rest(self, job: Job) -> None:
        """Stop by setpoints in GUIDED, until telemetry shows that it stands still.

        A setpoint may be lost, and a climb begins slowly, so the vehicle must stand still for REST_SHOWN s.

        Raises:
            TimedOut: it still moves.
        """
        now = self.waiting.listening.seconds  # what it does while nobody listens shows nothing
        deadline = now() + REST_TIMEOUT
        began, still_since, standstill = self.clock(), now(), self.standstill
        while now() - still_since < REST_SHOWN:
            if now() > deadline:
                raise TimedOut(f"vehicle {self.state.system} does not stop within {REST_TIMEOUT:g} s")
            was_sent = False
            with contextlib.suppress(Expired):
                await self.send_setpoint(job, standstill)
                was_sent = True
            await asyncio.sleep(REST_PERIOD)
            if was_sent and self.has_stopped_since(began):
                self.command(job).confirm()
            else:
                still_since = now()

    async def until_it_stands(self, job: Job, mode: str, since: float) -> None:
        """Wait until telemetry shows that it stands still in `mode`, for the job that stopped it at `since` (s)."""
        names = {"LOCAL_POSITION_NED"}
        await self.until(mode, names, lambda: self.has_stopped_since(since) or None, STOP_TIMEOUT, "stop")
        self.command(job).confirm()

    def has_stopped_since(self, sent_at: float) -> bool:
        """Whether it stands still, by a position that came after what we sent at `sent_at` (s) had arrived."""
        return self.stands_still and self.state.came_after(sent_at, "LOCAL_POSITION_NED")

    @property
    def stands_still(self) -> bool:
        """Whether fresh telemetry shows almost no movement."""
        try:
            return self.speed_by(NedTarget(0, 0, 0)) <= ARRIVAL_SPEED
        except Stale:
            return False
