"""The verbs of a copter."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from mavproxy_uavapi.core.airspace import time_limits
from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Ending, Job
from mavproxy_uavapi.core.control.start_gate import pass_gate
from mavproxy_uavapi.core.errors import Expired, ModeChanged, Rejected, TimedOut
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.messages import NO_YAW
from mavproxy_uavapi.core.telemetry.flight_modes import MISSION_MODES, flies_mission
from mavproxy_uavapi.core.vehicle.guided import ARRIVAL_SPEED, GUIDED
from mavproxy_uavapi.core.vehicle.own_target import STANDSTILL
from mavproxy_uavapi.core.vehicle.travelling import REST_PERIOD
from mavproxy_uavapi.core.vehicle.turning import TurningVehicle

TAKEOFF_SHARE = 0.05  # of the altitude, between TAKEOFF_TOLERANCE's two ends
TAKEOFF_TOLERANCE = (0.3, 1.0)  # m
TAKEOFF_END = 3.0  # s at its altitude after which a takeoff counts as done, even if the autopilot still reports it
SLOWDOWN = 0.3  # s that a pause on the ground needs to slow the motors from full throttle
DROP_TIMEOUT = 5.0  # s until a stopped vehicle must report that it has dropped its old movement
SPEED_MODES = {"GUIDED", "RTL", *MISSION_MODES}  # others refuse DO_CHANGE_SPEED


class Copter(TurningVehicle):
    """A multicopter or helicopter."""

    holding_mode = "BRAKE"

    def hold_message(self) -> Any:
        """A zero velocity in GUIDED, else BRAKE."""
        if self.stops_in_its_mode:
            return STANDSTILL.to(self.address, NO_YAW)
        return super().hold_message()

    @property
    def takes_speeds(self) -> bool:
        """Whether its autopilot takes a speed in the mode that it is in."""
        return self.mode in SPEED_MODES

    @property
    def pauses_in_guided(self) -> bool:
        """See `GuidedVehicle.pauses_in_guided`."""
        return True

    # -- up and down --------------------------------------------------------------------------------------

    async def takeoff(self, job: Job, alt: float, *, vtol: bool = False, timeout: float | None = None) -> None:
        """Climb to `alt` m above home from the ground, armed and in GUIDED; done within tolerance of it.

        The tolerance is 5 % of `alt`, at least 0.3 m and at most 1 m. A copter ignores `vtol`.
        """
        await self.command(job).take(Rank.ARM, lambda: self.require_can_take_off(job, alt))
        was_paused = self.authority.paused
        await self.lift_off(job, alt)
        if was_paused:  # a pause outlives a takeoff in the autopilot
            await self.end_stop(job, GUIDED)
        self.watch_pause(job)
        limits = await self.limits()
        low, high = TAKEOFF_TOLERANCE
        tolerance = min(max(TAKEOFF_SHARE * alt, low), high)

        near_since: float | None = None

        def reached() -> bool | None:
            nonlocal near_since
            self.report_leg(job, abs(alt - self.height))
            position = self.state.position
            slow = position is None or abs(position.velocity[2]) <= 2 * ARRIVAL_SPEED
            near = abs(alt - self.height) <= tolerance and self.state.landed is False
            if not (near and slow):
                near_since = None
                return None
            near_since = self.clock() if near_since is None else near_since
            # The autopilot ends the takeoff a moment later, and refuses movements until then.
            over = not self.is_taking_off or self.clock() - near_since >= TAKEOFF_END
            return True if over else None

        allowed = self.allowed(time_limits.leg_time(limits, 0.0, alt), timeout)
        names = {"GLOBAL_POSITION_INT", "EXTENDED_SYS_STATE"}
        await self.until(GUIDED, names, reached, allowed, f"reach {alt:g} m")
        self.takeoff_is_done(job)

    async def land(self, job: Job, timeout: float | None = None) -> None:
        """Land where it is; done when it has disarmed.

        A vehicle whose next heartbeat shows it disarmed has landed; an `arm` that waits ends.
        """
        await self.command(job).take(Rank.STOP)
        if await self.stays_disarmed(job):
            return
        await self.command(job).switch_mode("LAND")
        self.command(job).confirm()
        limits = await self.limits()
        expected = time_limits.landing_time(limits, self.height)
        await self.landed_in(job, "LAND", self.allowed(expected, timeout))

    async def rtl(self, job: Job, timeout: float | None = None) -> None:
        """Return to launch; done when the vehicle has landed there and disarmed.

        A disarmed vehicle is not switched; an `arm` that waits ends. The verb is done then if the vehicle is at home;
        elsewhere it fails with `NotArmed`.

        Raises:
            NotFound: the vehicle is disarmed and has no home yet.
            ModeChanged: it was armed while we requested its home.
        """
        await self.command(job).take(Rank.STOP)
        if await self.is_done_at_home(job):
            return
        await self.command(job).switch_mode("RTL")
        self.command(job).confirm()
        limits = await self.limits()
        expected = time_limits.return_time(limits, self.distance_home() or 0.0, self.height)
        await self.landed_in(job, "RTL", self.allowed(expected, timeout))

    async def land_or_return(self, job: Job) -> None:
        """Land where it is."""
        await self.land(job)

    # -- stopping -----------------------------------------------------------------------------------------

    @property
    def stops_in_its_mode(self) -> bool:
        """Whether `hold` stops it by setpoints, which do nothing in a pilot's mode."""
        return self.mode == GUIDED and self.is_settled

    async def _finish_switch(self, job: Job, mode: str) -> None:
        """GUIDED ends a `stop` too: the vehicle stays where it is, and takes movements again."""
        stands = self.state.landed is False and self.stands_still and not self.is_taking_off
        may_be_paused = self.authority.paused or (self.authority.pause_is_unknown and stands)
        if mode == GUIDED and may_be_paused:
            if self.state.armed:
                await self._drop_movement(job)
            await self.end_stop(job, GUIDED)

    async def _drop_movement(self, job: Job) -> None:
        """Send a stopped vehicle a zero velocity until it reports that in place of its old setpoint.

        Raises:
            TimedOut: it does not; it stays stopped, because it would fly on to its old target.
        """
        deadline = self.waiting.listening.seconds() + DROP_TIMEOUT
        while self.waiting.listening.seconds() <= deadline:
            await self.send_setpoint(job, STANDSTILL)
            if await self.ask_setpoint() == STANDSTILL:
                return
            await asyncio.sleep(REST_PERIOD)
        raise TimedOut(
            f"vehicle {self.state.system} does not report within {DROP_TIMEOUT:g} s that it has dropped its old "
            "movement, so it stays stopped; `brake` ends that too"
        )

    async def stop(self, job: Job) -> None:
        """Hold the vehicle still, in GUIDED or in its mission, until `resume`; done when telemetry shows it.

        A movement in progress waits; no other begins. A mission that cannot be paused, or does not answer, is left
        for BRAKE. So is a vehicle during one of our mode switches: the pause might arrive in either mode.

        Raises:
            ModeChanged: it is in another mode.
        """
        began = self.clock()
        await self.end_waiting_arm(job)
        self.require_armed()
        waited = await self.command(job).wait_for_protection(self.state.mode_since)
        mode = self.mode
        if waited and self.is_protected:  # else the border's stop has failed
            await self.until_it_stands(job, mode, began)
            return
        coming = self.next_mode if self.authority.on_its_way else mode
        if not any(one == GUIDED or flies_mission(one) for one in (mode, coming)):
            raise ModeChanged(f"the vehicle is in {mode}, which cannot be paused; `brake` stops it")
        if not self.is_settled:
            await self.command(job).take(Rank.STOP)
            await self.command(job).switch_mode(self.holding_mode)
            await self.until_it_stands(job, self.holding_mode, began)
            return
        self.authority.admit(Rank.STOP)
        await pass_gate()
        began = self.clock()
        self.authority.interrupt(job)
        mode = await self._pause(job, mode)
        await self.until_it_stands(job, mode, began)
        if self.state.mode_since > began and mode != self.holding_mode and not self.authority.paused:
            raise ModeChanged(
                f"the pilot or a failsafe switched the mode meanwhile, and back to {mode}: it may fly on"
            )

    async def _pause(self, job: Job, mode: str) -> str:
        """Send the pause of `stop`; the mode in which it is to stand then, another one if it cannot be paused."""
        try:
            needs = (lambda: self.held_by(mode)), self.authority.keep_pause
            await self.command(job).send(messages.pause(True), *needs)
        except Expired:  # it was never written
            self.authority.end_pause()
            raise
        except (Rejected, TimedOut) as error:
            if mode != GUIDED:  # a mission may stand at a waypoint, and go on
                await self.wait_for_heartbeat()  # a pilot may have taken it meanwhile
                self.held_by(mode)
                await self.command(job).switch_mode(self.holding_mode)
                return self.holding_mode
            if isinstance(error, Rejected):
                self.authority.end_pause()
                raise
            # else the acks may be lost: telemetry shows whether it stands still
        return mode

    async def resume(self, job: Job) -> None:
        """Continue the movement that `stop` interrupted."""
        self.require_armed()
        mode = self.mode
        if not flies_mission(mode):
            self.require_mode(GUIDED)
        self.authority.accompany(job, "resume", stopped_too=True)
        interrupted = self.authority.interrupted
        is_over = interrupted is not None and (
            interrupted.ending is Ending.SUPERSEDED or (interrupted.steers and not interrupted.running)
        )
        if is_over and mode == GUIDED:
            await self.send_setpoint(job, STANDSTILL)  # its setpoints have stopped, or its client's lease is over
        await self.end_stop(job, mode)

    async def hold(self, job: Job) -> None:
        """Stop and stay: by zero velocities in GUIDED, else by BRAKE.

        A mode switch on its way counts: the vehicle may have left GUIDED when the message arrives.
        """
        await self.command(job).take(Rank.STOP)
        if not self.stops_in_its_mode:
            await self.command(job).switch_mode(self.holding_mode)
            self.command(job).confirm()
        elif self.state.landed and not self.authority.paused:
            await self._hold_down(job)
        else:
            await self.rest(job)

    async def _hold_down(self, job: Job) -> None:
        """Abort a takeoff before lift-off: pause first, so that the motors slow down.

        ArduCopter reports a setpoint between full throttle and lift-off as an internal error (flow_of_ctrl), and does
        not arm again until it reboots.
        """
        self.authority.begin_pause()  # the next commander must end the pause
        try:
            with contextlib.suppress(TimedOut):  # the setpoints are sent anyway
                await self.command(job).send(messages.pause(True), self.flying)
                await asyncio.sleep(SLOWDOWN)
        except (Expired, Rejected):
            self.authority.end_pause()
            await self.rest(job)
        else:
            await self.rest(job)
            await self.end_stop(job, GUIDED)
