"""The two ways to descend onto a target: by velocities, or in ArduPilot's LAND with LANDING_TARGET."""

from __future__ import annotations

import contextlib

from mavproxy_uavapi.core.airspace import braking, time_limits
from mavproxy_uavapi.core.errors import NotSupported, OutsideEnvelope, TimedOut, UavApiError
from mavproxy_uavapi.core.geodesy import moved
from mavproxy_uavapi.core.mission.mission_legs import PathPoint
from mavproxy_uavapi.core.vehicle.touchdown import Touchdown
from mavproxy_vision.landing.executor import TagFlight
from mavproxy_vision.landing.precision_landing import PrecisionLanding, landing_target
from mavproxy_vision.landing.state_machine import BLIND_BELOW, REST, Landing, Phase
from mavproxy_vision.tracking.target_filter import COAST

LOST = 1.2  # s without a detection, or without telemetry, until we take the vehicle back from LAND
SLOWER = 3.0  # times the expected duration of LAND until it is given up low above the target
TOLD = 1.3  # s from a position until the stop has an effect: a heartbeat is heard before, at 1 Hz
LEVEL = 2.0  # m above home: at least so high the way to the target is checked against the envelope
HEARD = 3.0  # s until the autopilot must have reported a target


class Descent:
    """A descent onto the target: by velocities, then the autopilot's LAND.

    Attributes:
        by_velocity: whether the landing's own velocities descend.
    """

    by_velocity = True

    def __init__(self, flight: TagFlight) -> None:
        self.flight = flight

    async def prepare(self) -> None:
        """Check whether the method works, before the vehicle is taken over."""

    async def __call__(self, landing: Landing) -> None:
        """Land.

        Raises:
            LandingFailed: the landing was given up.
        """
        flight = self.flight
        order = await flight.fly(landing)
        if order.phase is Phase.FAILED:
            await flight.give_up(landing, order.reason)
        await flight.wait_for_heartbeat(landing.until_it_lands)
        flight.phase = Phase.LAND.value
        await flight.fly_by("LAND", flight.vehicle.land)
        self.require_believed(order.reason)

    def require_believed(self, reason: str) -> None:
        """Raise LandingFailed if there is a reason why what it stands on may not be the tag."""
        if reason:
            self.flight.report.action = "land"
            raise self.flight.failed(reason)


class PrecisionDescent(Descent):
    """A descent in LAND with LANDING_TARGET: LAND flies, and the vehicle is taken back when the target is lost.

    Args:
        flight: the flight.
        precision_landing: the vehicle's precision landing.
    """

    by_velocity = False

    def __init__(self, flight: TagFlight, precision_landing: PrecisionLanding) -> None:
        super().__init__(flight)
        self._contradiction = ""  # seen when it was too low to be taken back
        flight.precision_landing = self.precision_landing = precision_landing

    async def prepare(self) -> None:
        """Check whether the method works, before the vehicle is taken over.

        Raises:
            NotSupported, Rejected: the autopilot has no precision landing, or needs a reboot for it.
        """
        if self.flight.tracker.settings.target == "moving":
            raise NotSupported("landing_target does not land on a tag that moves; velocity does")
        await self.precision_landing.check()

    async def __call__(self, landing: Landing) -> None:
        """Land.

        Raises:
            LandingFailed: the landing was given up.
            Rejected: the autopilot refuses its parameters.
            Superseded, Paused, ModeChanged, NotArmed: the job no longer has the vehicle; no more parameters are set.
            OutsideEnvelope: the target has left the envelope; the vehicle has been stopped.
            TimedOut: it stays low above the target, in LAND.
        """
        flight, vehicle = self.flight, self.flight.vehicle
        await self.precision_landing.set_up(
            vehicle.command(flight.job).permit(lambda: vehicle.held_by("GUIDED")).check
        )
        while True:
            order = await flight.fly(landing)
            if order.phase is Phase.FAILED:
                await flight.give_up(landing, order.reason)
            await self._be_heard(landing)
            if await self._follow_down(landing):
                break
        self.precision_landing.in_use = False
        with contextlib.suppress(UavApiError):  # it has landed; `FlightJobs` tries again
            await self.precision_landing.give_back()
        self.require_believed(self._contradiction)

    async def _be_heard(self, landing: Landing) -> None:
        """Send targets until the autopilot reports that it has one."""
        flight, tracker = self.flight, self.flight.tracker
        state, began = flight.vehicle.state, tracker.host.clock()
        while tracker.host.clock() - began < max(HEARD / max(state.time_ratio.ratio, 0.1), 1.0):
            await self._send_target(landing)
            await flight.send(REST)
            if any("Target Found" in text for text in state.statustexts.since(began - 30.0)):
                return
            await flight.pause()
        # It reports a target only once unless it loses it: go on, and see whether it follows.

    async def _follow_down(self, landing: Landing) -> bool:
        """Let LAND fly and send it the target: True when the vehicle stands disarmed, False when it is taken back."""
        flight, vehicle, tracker = self.flight, self.flight.vehicle, self.flight.tracker
        limits = await vehicle.limits()
        touchdown = Touchdown(limits)
        await flight.wait_for_heartbeat()
        flight.autopilot = "LAND"
        await vehicle.set_mode(flight.job, "LAND")
        late = tracker.carrier.now() + SLOWER * time_limits.landing_time(limits, vehicle.height)
        while not self._stands(touchdown):
            now = tracker.carrier.now()
            if now > late and not self._can_come_back(landing):
                flight.autopilot = None  # it is almost down; it is not taken back
                raise TimedOut(f"vehicle {vehicle.state.system} has not landed and disarmed; it is in LAND")
            if self._must_come_back(landing, now):
                await vehicle.wait_for_heartbeat()  # its pilot may have it by now
                if self._stands(touchdown) or not self._must_come_back(landing, tracker.carrier.now()):
                    continue
                await vehicle.set_mode(flight.job, "GUIDED")
                flight.autopilot = None
                motion = tracker.carrier.history.last_motion
                assert motion is not None
                landing.resume(now, motion, flight.height(motion))
                return False
            self._contradiction = self._contradiction or landing.target.contradiction or ""
            if not self._contradiction and await self._keeps_inside(landing):
                await self._send_target(landing)
            await flight.pause()
        flight.autopilot = None
        return True

    async def _keeps_inside(self, landing: Landing) -> bool:
        """Whether target and vehicle stay inside the envelope. LAND would follow a target that leaves it.

        Raises:
            OutsideEnvelope: one of them leaves it; the vehicle, high enough for that, has been stopped.
            ModeChanged, NotArmed, Superseded, Paused, LinkLost: the job no longer has the vehicle; nothing is sent.
        """
        flight, vehicle = self.flight, self.flight.vehicle
        place, motion = landing.target.place, flight.tracker.carrier.history.last_motion
        if not vehicle.guard.in_force or place is None or motion is None:
            return True
        here = vehicle.guard.check.here()
        up = max(here.up, LEVEL)  # a landing goes below the envelope's floor, if it has one
        north, east, down = map(float, motion.velocity)
        brakes = braking.of(vehicle.kind, vehicle.state.parameters)
        ends = place - motion.travelled, brakes.to_rest((north, east, -down), TOLD)
        stops = [PathPoint(*moved(here.lat, here.lon, float(end[0]), float(end[1])), up) for end in ends]
        try:
            vehicle.guard.check.require_way([[PathPoint(here.lat, here.lon, up), stop] for stop in stops])
        except OutsideEnvelope:
            if not self._can_come_back(landing):
                return False  # it lands straight down
            await vehicle.wait_for_heartbeat()
            if not self._can_come_back(landing):
                return False
            await vehicle.set_mode(flight.job, vehicle.holding_mode)
            flight.autopilot = None
            raise
        return True

    def _stands(self, touchdown: Touchdown) -> bool:
        """Whether it has landed and disarmed.

        Raises:
            NotArmed: its motors stopped in flight.
            ModeChanged: the pilot or a failsafe has the vehicle.
        """
        return bool(self.flight.vehicle.has_landed(touchdown, "LAND"))

    def _must_come_back(self, landing: Landing, now: float) -> bool:
        """Whether it must not descend further: it takes too long, or the target or the vehicle is lost."""
        history, target = self.flight.tracker.carrier.history, landing.target
        if self.flight.vehicle.state.landed or not self._can_come_back(landing):
            return False  # too low to climb away: it may already be on the ground
        if landing.overdue(now) or now - history.newest > LOST:
            return True
        return self.flight.motion(now) is not None and (target.age(now) > LOST or target.contradiction is not None)

    def _can_come_back(self, landing: Landing) -> bool:
        """Whether it is high enough above the target to be taken back, and no failsafe lands it."""
        place, motion = landing.target.place, self.flight.tracker.carrier.history.last_motion
        if place is None or motion is None or self.flight.vehicle.may_be_a_failsafes:
            return False
        return float(place[2] - motion.travelled[2]) > BLIND_BELOW

    async def _send_target(self, landing: Landing) -> None:
        """Send the target's position to the autopilot, if it is known."""
        flight, tracker, place = self.flight, self.flight.tracker, landing.target.place
        now = tracker.carrier.now()
        motion, attitude = flight.motion(now), tracker.carrier.history.attitude(now)
        if motion is None or attitude is None or place is None:
            return
        relative = place - motion.travelled
        landing.offset = float((relative[:2] ** 2).sum() ** 0.5)
        flight.note(landing, motion)
        if landing.target.age(now) <= COAST or relative[2] <= BLIND_BELOW:
            await flight.send_message(landing_target(now, relative, attitude))
