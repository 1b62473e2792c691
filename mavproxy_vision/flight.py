"""One landing, search or mission in flight: the verbs of this module, over those of the copter."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.errors import Invalid, LinkLost, ModeChanged, Superseded
from mavproxy_uavapi.vehicle import messages
from mavproxy_uavapi.vehicle.copter import Copter
from mavproxy_uavapi.vehicle.jobs import Job
from mavproxy_uavapi.vehicle.modes import mode_number
from mavproxy_vision.errors import LandingFailed
from mavproxy_vision.geometry import Vector
from mavproxy_vision.history import Motion
from mavproxy_vision.landing import BLIND_BELOW, COAST, REST, Landing, Order, Phase, Plan
from mavproxy_vision.plnd import PrecisionLanding, landing_target
from mavproxy_vision.rates import FLIGHT
from mavproxy_vision.report import Report
from mavproxy_vision.search import step_for
from mavproxy_vision.setpoints import setpoint
from mavproxy_vision.tags import FAMILIES, Tag
from mavproxy_vision.target import Target
from mavproxy_vision.vision import Vision

mavlink = mavutil.mavlink

PERIOD = 0.05  # s of the vehicle's clock between two setpoints
SHORTEST = 0.01  # s of ours
STALE = 0.5  # s of the vehicle's clock without telemetry until it rests
BLIND = 5.0  # s without a frame until a landing is given up
PLND_LOST = 1.2  # s without a sighting until we take the vehicle back from LAND
PLND_HEARD = 3.0  # s until the autopilot must have said that it has a target
FINAL = 1.3  # of the height at which the tag fills the view
LOWEST_FINAL = 0.4  # m
DEPENDABLE = 0.85  # of the detection range
DISARM = 60.0  # s for the autopilot to land from low and disarm


class Flight:
    """A flight that is under way.

    Args:
        vision: the eye.
        vehicle: what carries it.
        job: who flies.
        report: filled in on the way.
    """

    def __init__(self, vision: Vision, vehicle: Copter, job: Job, report: Report) -> None:
        self.vision, self.vehicle, self.job, self.report = vision, vehicle, job, report
        self.plnd: PrecisionLanding | None = None
        self.phase = "on its way"
        self._in_land = False
        # Number of the frame whose way to a setpoint was timed last; what is there before the flight waited for it.
        self._timed = 0 if vision.seen is None else vision.seen.number

    # -- verbs ---------------------------------------------------------------------------------------------

    async def land(self, number: int | None, method: str) -> None:
        """Land on the tag from wherever the vehicle is; done when it stands on it, disarmed.

        A camera that gives no frames is a refusal at first, and a failure like that of a lost tag later.

        Raises:
            LandingFailed: no tag, or what is seen cannot be believed; the report says what was done instead.
            ModeChanged, NotArmed, LinkLost: somebody else has the vehicle, or nobody; nothing more was sent.
        """
        self.vehicle.require_guided_flight()
        if self.report.verb == "land":
            self.vision.require_camera()
        self.vehicle.seat.take(self.job)
        tags = await self._tags(number)
        main = next(iter(tags.values()))
        self.report.tag, self.report.method = main.id, method
        began = self.vision.now()
        try:
            with self._watched(tags) as target:
                landing = Landing(self._plan(tags, method != "landing_target"), target)
                if method == "landing_target":
                    await self._land_by_plnd(landing, target)
                else:
                    await self._land_by_velocity(landing)
        finally:
            self.report.duration = self.vision.now() - began
        self.report.touchdown_error = self.vision.touchdown_error(main.id)

    async def search(self, number: int | None, leash: float | None) -> None:
        """Fly an expanding square until the tag is in sight, and stay above where it was seen.

        Raises:
            LandingFailed: no tag within leash and time limit; the vehicle holds.
        """
        self.vehicle.require_guided_flight()
        self.vision.require_camera()
        self.vehicle.seat.take(self.job)
        tags = await self._tags(number)
        self.report.tag = next(iter(tags))
        plan = self._plan(tags, False, attempts=1000, leash=leash or self.vision.settings.leash)
        began = self.vision.now()
        with self._watched(tags) as target:
            order = await self._fly(Landing(plan, target))
            await self._send(REST)
            self.report.duration = self.vision.now() - began
            if order.phase is Phase.FAILED:
                self.report.action = "hold"
                raise self._failed(order.reason)
            self.report.place = self._place_of(target)

    def _place_of(self, target: Target) -> tuple[float, float, float] | None:
        """The target in m NED from the EKF origin."""
        motion = self.vision.history.last_motion
        if target.place is None or motion is None:
            return None
        north, east, down = (motion.position + (target.place - motion.travelled)).round(3)
        return float(north), float(east), float(down)

    # -- what they share -----------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _watched(self, tags: dict[int, Tag]) -> Any:
        with self.vision.rates.at(FLIGHT):
            try:
                yield self.vision.aim(tags)
            finally:
                self.vision.aim_no_more()

    async def _tags(self, number: int | None) -> dict[int, Tag]:
        settings = self.vision.settings
        tags = settings.tag_list
        if number is None or number == tags[0].id:
            return {tag.id: tag for tag in tags}
        if number >= FAMILIES[settings.families[0]][1]:
            raise Invalid(f"{settings.families[0]} has no id {number}", "body", "id")
        await self.vision.want(number)
        size = next((tag.size for tag in tags if tag.id == number), tags[0].size)
        return {number: Tag(number, size)}

    def _plan(self, tags: dict[int, Tag], descend: bool, **changes: Any) -> Plan:
        settings, model = self.vision.settings, self.vision.settings.model
        cells = FAMILIES[settings.families[0]][0]
        largest = max(tag.size for tag in tags.values())
        smallest = min(tag.size for tag in tags.values())
        reach = DEPENDABLE * model.detection_range(largest, cells)
        motion = self.vision.history.last_motion
        here = self.vision.height(float(motion.position[2])) if motion is not None else reach
        offset = settings.camera_mount.offset[2]
        final = max(FINAL * model.clip_height(smallest) + offset, LOWEST_FINAL)
        known = {
            "attempts": settings.attempts,
            "tolerance": settings.tolerance,
            "final": final,
            "speed": settings.speed,
            "descent": settings.descent,
            "step": step_for(model.footprint(min(max(here, 1.0), reach)), largest),
            "leash": settings.leash,
            "ceiling": reach,
            "time_limit": settings.time_limit,
            "descend": descend,
        }
        return Plan(**{**known, **changes})

    async def _fly(self, landing: Landing) -> Order:
        """Send setpoints as the landing wants them until it is to touch down, or has failed."""
        vision, vehicle = self.vision, self.vehicle
        blind_since: float | None = None
        while True:
            vehicle.held_by("GUIDED")
            now = vision.now()
            motion = vision.history.motion(now)
            if motion is None or now - vision.history.newest > STALE:
                await self._send(REST)  # nobody knows where it is; should it hear us, it shall rest
            else:
                if vision.health.state in ("ok", "starting"):
                    blind_since = None
                elif blind_since is None:
                    blind_since = now
                elif now - blind_since > BLIND and landing.phase is not Phase.LAST_METRE:
                    landing.fail(f"the camera: {vision.health.state}")
                order = landing.step(now, motion, vision.height(float(motion.position[2])))
                self._note(landing, motion)
                if order.phase in (Phase.LAND, Phase.FAILED):
                    return order
                await self._send(order.velocity)
                self._time_latency()
            await self._pause()

    def _time_latency(self) -> None:
        """Note how long the newest frame took from its arrival to the first setpoint that knows it."""
        seen = self.vision.seen
        if seen is not None and seen.number != self._timed:
            self._timed = seen.number
            self.vision.latencies.append(self.vision.host.clock() - seen.received_at)

    async def _pause(self) -> None:
        """Until the next setpoint is due, or a frame was looked at.

        Raises:
            LinkLost: the vehicle's heartbeats stopped.
        """
        seconds = max(PERIOD / max(self.vehicle.state.time_ratio.ratio, 0.1), SHORTEST)
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self.vision.changed.wait(), seconds)
        if not self.vision.host.is_alive(self.vehicle.state):
            silent = self.vision.host.clock() - self.vehicle.state.heartbeat_at
            raise LinkLost.since(self.vehicle.state.system, silent)

    def _note(self, landing: Landing, motion: Motion) -> None:
        report = self.report
        report.attempts, report.last_offset = landing.attempt, landing.offset
        report.phases = dict(landing.phases)
        self.phase = "landing by LANDING_TARGET" if self._in_land else landing.phase.value
        height = self.vision.height(float(motion.position[2]))
        self.job.progress = {"altitude": round(height, 2), "attempt": float(landing.attempt)}
        if landing.offset is not None:
            self.job.progress["offset"] = round(landing.offset, 3)

    async def _send(self, velocity: Vector) -> None:
        self.vehicle.held_by("GUIDED")
        attitude = self.vision.history.attitude(self.vision.now())
        await self.vehicle.link.send(
            setpoint(self.vehicle.address, velocity, None if attitude is None else attitude.yaw),
            self.vehicle.state.system,
        )

    def _failed(self, reason: str) -> LandingFailed:
        self.report.reason = reason
        did = {"rtl": "returned to launch", "land": "landed in place", "hold": "the vehicle holds"}
        done = f"; {did[self.report.action]}" if self.report.action else ""
        return LandingFailed(f"{reason}{done}", self.report.told())

    async def _give_up(self, landing: Landing, reason: str) -> None:
        """What the settings say for a landing that failed, then the error."""
        action = self.vision.settings.on_failure
        if landing.refused and self.report.verb == "land":
            action = "hold"  # nothing was wrong with where it is
        self.report.action = action
        if self.plnd is not None:
            await self.plnd.put_back()  # it would act in RTL too
        self.vehicle.held_by("GUIDED")
        if action == "rtl":
            await self.vehicle.rtl(self.job)
        elif action == "land":
            await self.vehicle.land(self.job)
        else:
            await self._send(REST)
        raise self._failed(reason)

    # -- by velocities ---------------------------------------------------------------------------------------

    async def _land_by_velocity(self, landing: Landing) -> None:
        order = await self._fly(landing)
        if order.phase is Phase.FAILED:
            await self._give_up(landing, order.reason)
        self.vehicle.held_by("GUIDED")
        self.phase = Phase.LAND.value
        await self.vehicle.land(self.job)

    # -- by LANDING_TARGET -----------------------------------------------------------------------------------

    async def _land_by_plnd(self, landing: Landing, target: Target) -> None:
        self.plnd = PrecisionLanding(self.vehicle)
        try:
            await self.plnd.set_up()
            await self._descend_by_plnd(landing, target)
        except asyncio.CancelledError:
            raise  # it may not wait any more: see `parting`
        except Exception:
            await self._put_back()
            raise
        await self._put_back()

    async def _descend_by_plnd(self, landing: Landing, target: Target) -> None:
        while True:
            order = await self._fly(landing)
            if order.phase is Phase.FAILED:
                await self._give_up(landing, order.reason)
            await self._be_heard(target)
            if await self._follow_down(landing, target):
                return

    async def _put_back(self) -> None:
        if self.plnd is not None and self.vision.host.is_alive(self.vehicle.state):
            await self.plnd.put_back()

    async def _be_heard(self, target: Target) -> None:
        """Send targets until the autopilot says that it has one."""
        vision, began = self.vision, self.vision.host.clock()
        ratio = max(self.vehicle.state.time_ratio.ratio, 0.1)
        while vision.host.clock() - began < max(PLND_HEARD / ratio, 1.0):
            await self._tell_target(target)
            await self._send(REST)
            if any("Target Found" in text for text in self.vehicle.state.said_since(began - 30.0)):
                return
            await self._pause()
        # It says so once only for a target that it did not lose meanwhile: go on, and see whether it follows.

    async def _follow_down(self, landing: Landing, target: Target) -> bool:
        """Let LAND fly and tell it where the target is: True when disarmed, False when it was taken back."""
        vehicle, vision = self.vehicle, self.vision
        vehicle.held_by("GUIDED")
        self._in_land = True
        await vehicle.switch_to("LAND")
        try:
            while vehicle.state.armed is not False:
                if vehicle.mode != "LAND":
                    raise ModeChanged(f"the vehicle left LAND: it is in {vehicle.mode} now")
                now = vision.now()
                motion = vision.history.motion(now)
                if motion is not None and target.place is not None:
                    above = float(target.place[2] - motion.travelled[2])
                    landing.offset = float(((target.place - motion.travelled)[:2] ** 2).sum() ** 0.5)
                    self._note(landing, motion)
                    if above > BLIND_BELOW and (target.age(now) > PLND_LOST or target.contradiction):
                        await vehicle.switch_to("GUIDED")
                        landing.resume(now, motion, vision.height(float(motion.position[2])))
                        return False
                    if target.age(now) <= COAST or above <= BLIND_BELOW:
                        await self._tell_target(target)
                await self._pause()
            return True
        finally:
            self._in_land = False

    async def _tell_target(self, target: Target) -> None:
        vision = self.vision
        now = vision.now()
        motion, attitude = vision.history.motion(now), vision.history.attitude(now)
        if motion is None or attitude is None or target.place is None:
            return
        message = landing_target(now, target.place - motion.travelled, attitude)
        await self.vehicle.link.send(message, self.vehicle.state.system)

    # -- the end -----------------------------------------------------------------------------------------------

    def parting(self) -> list[Any]:
        """What makes the vehicle hold, and puts its parameters back, when this flight is ended from outside.

        Nothing for a vehicle that is no longer ours: the pilot has it, or a newer command.
        """
        vehicle, found = self.vehicle, []
        if self.plnd is not None:
            found += self.plnd.remaining()
            self.plnd.before.clear()
        if isinstance(self.job.error, Superseded) or vehicle.seat.job is not self.job or not vehicle.state.armed:
            return found
        if vehicle.mode == "GUIDED":
            found.append(setpoint(vehicle.address, REST, None))
        elif vehicle.mode == "LAND" and self._in_land:
            guided = messages.set_mode(mode_number(vehicle.state.vehicle_type, "GUIDED"))
            found.append(guided.to(vehicle.address, 0))
        return found
