"""One landing, search or mission in flight: the verbs of this module, over those of the copter."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Awaitable, Callable, Iterator
from typing import Any, Protocol

from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Conflict, Expired, LinkLost, Rejected, Stale, UavApiError
from mavproxy_uavapi.core.mainloop.permit import SETPOINT_LASTS
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_vision.apriltag.tag_layout import Tag
from mavproxy_vision.errors import LandingFailed
from mavproxy_vision.geometry.frames import Vector
from mavproxy_vision.landing.plan import Plan, landable, plan_for, tags_for
from mavproxy_vision.landing.precision_landing import PrecisionLanding
from mavproxy_vision.landing.report import Report
from mavproxy_vision.landing.setpoints import setpoint
from mavproxy_vision.landing.state_machine import BLIND_BELOW, REST, Landing, LandingCommand, Phase, unseen
from mavproxy_vision.tracking.pose_history import Motion
from mavproxy_vision.tracking.stream_rates import in_flight
from mavproxy_vision.tracking.target_filter import Target
from mavproxy_vision.tracking.tracker import Tracker

PERIOD = 0.05  # s on the vehicle's clock between two setpoints
SHORTEST = 0.03  # s of ours, for any camera rate and vehicle clock
STALE = 0.5  # s on the vehicle's clock without telemetry until it rests
POSITION_TIMEOUT = 10.0  # s on that clock until a landing is given up
BLIND = 5.0  # s without a frame until a landing is given up
RESTS = 0.15  # m/s over the ground, at most, by its own estimate, of a vehicle that stands
WANDERS = 0.12  # m by which a tag that rests may leave its place in the last pictures: without a fault by 0.04
SINKS = 0.5  # m that a flight sinks without a warning of hills
FIRST = 3.0  # s of ours for the first telemetry
SEARCHES = 1000  # attempts of a search; in practice its leash and time limit end it
DID = {"rtl": "returned to launch", "land": "landed in place", "hold": "the vehicle holds"}


class DescentMethod(Protocol):
    """A way to descend onto the target; `descent.py` has them."""

    @property
    def by_velocity(self) -> bool:
        """Whether the landing's own velocities descend."""

    async def prepare(self) -> None:
        """Check whether the method works, before the vehicle is taken over."""

    async def __call__(self, landing: Landing) -> None:
        """Land. Raises LandingFailed if the landing was given up."""


class TagFlight:
    """A running flight.

    Attributes:
        autopilot: the mode in which the autopilot flies for us now (LAND, RTL); None in GUIDED.
        precision_landing: the vehicle's precision landing, if this flight has used it.
        phase: its present activity.
        ended: set when the flight is over and has sent its last message.

    Args:
        tracker: the detections, and the target's position.
        vehicle: the vehicle.
        job: the flight's job.
        report: filled in during the flight.
        replace_running_flight: awaits the end of our previous flight of the vehicle.
    """

    def __init__(
        self,
        tracker: Tracker,
        vehicle: Copter,
        job: Job,
        report: Report,
        replace_running_flight: Callable[[TagFlight], Awaitable[None]],
    ) -> None:
        self.tracker, self.vehicle, self.job, self.report = tracker, vehicle, job, report
        self.precision_landing: PrecisionLanding | None = None
        self.phase = "on its way"
        self.autopilot: str | None = None
        self.ended = asyncio.Event()
        self._replace_running_flight = replace_running_flight
        self._floor = 0.0  # of the target's ground, m down of the EKF origin: as it was when the flight began
        self._sent_at = tracker.host.clock()
        # Number of the frame whose way to a setpoint was timed last; what is there before the flight waited for it.
        self._timed = 0 if tracker.result is None else tracker.result.number

    async def take_over(self) -> None:
        """Take the vehicle over, after the end of our previous flight of it. A vehicle in GUIDED stops.

        Call it when nothing can refuse the flight any more.
        """
        if self.commands:
            return
        self.vehicle.authority.take(self.job, Rank.MOVEMENT)
        self.job.steers = True
        await self._replace_running_flight(self)
        if self.vehicle.mode == "GUIDED" and self.vehicle.state.armed and not self.vehicle.state.landed:
            await self.send(REST)  # otherwise the previous setpoint would go on

    @property
    def commands(self) -> bool:
        """Whether this flight commands the vehicle: no newer command has taken it."""
        return self.vehicle.authority.commander is self.job

    # -- verbs ---------------------------------------------------------------------------------------------

    async def land(
        self, number: int | None, method: str, descent_method: Callable[[TagFlight], DescentMethod]
    ) -> None:
        """Land on the tag from the present position; done when the vehicle stands on it, disarmed.

        A camera without frames is a refusal at the start, and later a failure like a lost tag.

        Raises:
            LandingFailed: no tag, or the detections are implausible; the report says what was done instead.
            ModeChanged, NotArmed, LinkLost: the vehicle has another commander or is lost; nothing more was sent.
        """
        self.vehicle.require_guided_flight()
        if self.report.verb == "land":
            self.tracker.require_camera()
        tags = landable(self.tracker.settings, number)
        descend = descent_method(self)
        await descend.prepare()
        self.vehicle.require_guided_flight()
        await self.take_over()
        with self._watched():
            await self._look_for(tags)
            self.report.tag, self.report.method = next(iter(tags)), method
            with self._lasting(), self.tracker.aimed_at(tags, self._floor) as target:
                plan = plan_for(self.tracker.settings, tags, self._here(), descend=descend.by_velocity)
                self._warn_of_hills(plan)
                await descend(Landing(plan, target))
                self._warn_of_sight(target, plan)
            self.report.touchdown_error = self.tracker.touchdown_error(self.report.tag)

    async def search(self, number: int | None, leash: float | None) -> None:
        """Fly an expanding square until the tag is in sight, then stay above the place where it was seen.

        Raises:
            LandingFailed: no tag within leash and time limit; the vehicle holds.
        """
        self.vehicle.require_guided_flight()
        self.tracker.require_camera()
        tags = tags_for(self.tracker.settings, number)
        await self.take_over()
        with self._watched():
            await self._look_for(tags)
            self.report.tag = next(iter(tags))
            settings = self.tracker.settings
            changes = {"attempts": SEARCHES, "leash": leash or settings.leash}
            plan = plan_for(settings, tags, self._here(), descend=False, **changes)
            with self._lasting(), self.tracker.aimed_at(tags, self._floor) as target:
                self._warn_of_hills(plan)
                landing = Landing(plan, target)
                order = await self.fly(landing)
                if order.phase is Phase.FAILED:
                    await self.give_up(landing, order.reason)
                self.report.place = self._place_of(target)
            await self.vehicle.rest(self.job)

    def _warn_of_hills(self, plan: Plan) -> None:
        """Say if it sinks to the height of a search that only home's level is known for."""
        motion, here = self.tracker.carrier.history.last_motion, self._here()
        ranged = motion is not None and self.tracker.carrier.history.above_ground(motion.at) is not None
        if ranged or here is None or here <= plan.ceiling + SINKS:
            return
        ground = "home" if not self.tracker.settings.ground else "home and `ground`"
        vehicle = f"vehicle {self.vehicle.state.system} has no rangefinder"
        self._warn(f"{vehicle}: it sinks to {plan.ceiling:.0f} m above {ground}, and into any hill between")

    def _warn_of_sight(self, target: Target, plan: Plan) -> None:
        """Say if it landed without frames, by a sight from high up, or by pictures or a velocity that are wrong."""
        state, last, motion = self.tracker.health.state, target.last, self.tracker.carrier.history.last_motion
        slip = 0.0 if motion is None or target.moves else math.hypot(*motion.velocity[:2])
        if state not in ("ok", "starting"):
            self._warn(f"the camera: {state} on the last metre")
        elif last is not None and last.depth > max(BLIND_BELOW, plan.clip):
            self._warn(unseen(last.depth))
        elif target.wander > WANDERS:
            self._warn(f"the tag left its place by {target.wander:.1f} m in the last pictures, or these are wrong")
        elif slip > RESTS:
            moves = f"by its own velocity it moves with {slip:.1f} m/s"
            self._warn(f"the vehicle stands, though {moves}: it may stand beside the tag")
        else:
            return
        self.report.last_offset = None

    def _warn(self, sentence: str) -> None:
        self.report.warning = sentence
        self.tracker.host.warn(sentence)

    def _place_of(self, target: Target) -> tuple[float, float, float] | None:
        """The target in m NED from the EKF origin."""
        motion = self.tracker.carrier.history.last_motion
        if target.place is None or motion is None:
            return None
        north, east, down = (motion.position + (target.place - motion.travelled)).round(3)
        return float(north), float(east), float(down)

    # -- what they share -----------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _watched(self) -> Iterator[None]:
        with (
            self.tracker.carrier.flown(self.vehicle.state.system),
            self.tracker.carrier.rates.at(in_flight(self.vehicle.state)),
        ):
            yield

    @contextlib.contextmanager
    def _lasting(self) -> Iterator[None]:
        began = self.tracker.carrier.now()
        try:
            yield
        finally:
            self.report.duration = self.tracker.carrier.now() - began

    async def _look_for(self, tags: dict[int, Tag]) -> None:
        """Have the detector look for them, and wait for the first telemetry.

        Raises:
            Stale: none came.
        """
        for number in tags:
            await self.tracker.add_tag_id(number)
        tracker, deadline = self.tracker, self.tracker.host.clock() + FIRST
        while tracker.floor is None or tracker.carrier.history.motion(tracker.carrier.now()) is None:
            if tracker.host.clock() > deadline:
                raise Stale(f"vehicle {tracker.carrier.system} has not reported where it is for {FIRST:g} s")
            await self.pause()
        self._floor = tracker.floor
        await self.vehicle.limits()  # so that nothing has to wait between the last metre and LAND
        self.vehicle.held_by("GUIDED")

    def _here(self) -> float | None:
        motion = self.tracker.carrier.history.last_motion
        return None if motion is None else self.height(motion)

    def height(self, motion: Motion) -> float:
        """Metres above the ground by the rangefinder, or without one above the target's ground."""
        ranged = self.tracker.carrier.history.above_ground(motion.at)
        return self._floor - float(motion.position[2]) if ranged is None else ranged

    def motion(self, now: float) -> Motion | None:
        """The vehicle's position and motion; None if unknown."""
        if now - self.tracker.carrier.history.newest > STALE:
            return None
        return self.tracker.carrier.history.motion(now)

    async def fly(self, landing: Landing) -> LandingCommand:
        """Send the landing's setpoints until it is to touch down, or has failed."""
        tracker, vehicle = self.tracker, self.vehicle
        blind, unknown = ConditionTimer(), ConditionTimer()
        if landing.began is None:
            landing.begin(tracker.carrier.now())
        while True:
            vehicle.held_by("GUIDED")
            now = tracker.carrier.now()
            motion = self.motion(now)
            if unknown(motion is None, now) > POSITION_TIMEOUT:
                return landing.fail(f"the vehicle has not reported where it is for {POSITION_TIMEOUT:g} s")
            if motion is None:
                await self.send(REST)  # its position is unknown; if it hears us, it stops
            else:
                state = tracker.health.state
                fault = state if state not in ("ok", "starting") else tracker.too_late
                if blind(fault is not None, now) > BLIND and landing.phase is not Phase.LAST_METRE:
                    landing.fail(f"the camera: {fault}")
                order = landing.step(now, motion, self.height(motion), vehicle.state.landed is True)
                self.note(landing, motion)
                if order.phase in (Phase.LAND, Phase.FAILED):
                    return order
                await self.send(order.velocity)
                self._time_latency()
            await self.pause()

    def _time_latency(self) -> None:
        """Note the time from the newest frame's arrival to the first setpoint that uses it."""
        result = self.tracker.result
        if result is not None and result.number != self._timed:
            self._timed = result.number
            self.tracker.latencies.append(self.tracker.host.clock() - result.received_at)

    async def pause(self) -> None:
        """Wait until the next setpoint is due, or a frame has been processed.

        Raises:
            LinkLost: the vehicle's heartbeats stopped.
        """
        clock = self.tracker.host.clock
        seconds = max(PERIOD / max(self.vehicle.state.time_ratio.ratio, 0.1), SHORTEST)
        with contextlib.suppress(asyncio.TimeoutError):
            await wait_with_timeout(seconds, self.tracker.changed.wait())
        await asyncio.sleep(max(self._sent_at + SHORTEST - clock(), 0.0))
        if not self.tracker.host.link_watch.is_alive(self.vehicle.state):
            raise LinkLost.since(self.vehicle.state.system, clock() - self.vehicle.state.heartbeat_at)

    def note(self, landing: Landing, motion: Motion) -> None:
        """Record the distances."""
        report = self.report
        if self.tracker.carrier.history.stuck and not report.warning:
            self._warn("the rangefinder's height does not shrink as the vehicle sinks: it is not used")
        report.attempts, report.last_offset = landing.attempt, landing.offset
        report.phases = dict(landing.phases)
        self.phase = "landing by LANDING_TARGET" if self.autopilot else landing.phase.value
        self.job.progress = {"altitude": round(self.height(motion), 2), "attempt": float(landing.attempt)}
        if landing.offset is not None:
            self.job.progress["offset"] = round(landing.offset, 3)

    async def send(self, velocity: Vector) -> None:
        """Send a velocity (m/s NED) to a vehicle that is still in GUIDED.

        Raises:
            Superseded, Paused, ModeChanged, NotArmed: the job no longer has the vehicle; nothing is sent.
        """
        attitude = self.tracker.carrier.history.attitude(self.tracker.carrier.now())
        self._sent_at = self.tracker.host.clock()
        target = setpoint(velocity, None if attitude is None else attitude.yaw)
        with contextlib.suppress(Expired):  # the next one is due soon; how old telemetry may be, the landing decides
            await self.vehicle.send_setpoint(self.job, target)

    async def send_message(self, message: Any) -> None:
        """Send the vehicle a message; `pause` limits the rate.

        Raises:
            Superseded, Paused: another job commands it; nothing is sent.
        """
        self._sent_at = self.tracker.host.clock()
        await self.vehicle.command(self.job).post(message, lasts=SETPOINT_LASTS)

    async def wait_for_heartbeat(
        self, velocity: Callable[[float, Motion | None], Vector] = lambda _now, _motion: REST
    ) -> None:
        """Fly on in GUIDED until the next heartbeat, which shows what its pilot has done since the last one.

        Args:
            velocity: meanwhile, m/s NED, by the vehicle's time (s) and its motion.

        Raises:
            ModeChanged, NotArmed, Superseded, Paused, LinkLost: as `send` and `pause`.
        """
        asked_at = self.tracker.host.clock()
        while not self.vehicle.state.heard_since(asked_at):
            now = self.tracker.carrier.now()
            await self.send(velocity(now, self.motion(now)))
            await self.pause()
        self.vehicle.held_by("GUIDED")

    async def fly_by(self, mode: str, verb: Callable[[Job], Awaitable[None]]) -> None:
        """Let the autopilot fly in its own mode until it is done."""
        self.autopilot = mode
        await verb(self.job)
        self.autopilot = None

    # -- when it fails -------------------------------------------------------------------------------------

    def failed(self, reason: str) -> LandingFailed:
        """The error of a landing that has failed; the report says what was done instead."""
        self.report.reason = reason
        done = f"; {DID[self.report.action]}" if self.report.action else ""
        return LandingFailed(f"{reason}{done}", self.report.as_dict)

    async def give_up(self, landing: Landing, reason: str) -> None:
        """Apply the setting for a failed landing, then raise the error."""
        action = self.tracker.settings.on_failure
        if landing.stands:
            action = "land"  # which disarms it
        elif self.report.verb == "search" or (landing.refused and self.report.verb == "land"):
            action = "hold"  # its position is safe; the end of the job does it
        self.report.action = action
        if self.precision_landing is not None:
            try:
                await self.precision_landing.switch_off()  # it would also act in RTL
            except Rejected as error:
                reason = f"{reason} ({error})"
        await self.wait_for_heartbeat()  # last, because the above takes its time
        try:
            if action == "rtl":
                await self.fly_by("RTL", self.vehicle.rtl)
            elif action == "land":
                await self.fly_by("LAND", self.vehicle.land)
        except (Conflict, LinkLost):
            raise
        except UavApiError as error:  # refused, or very slow; it goes on then
            self.autopilot, reason = None, f"{reason} ({error})"
            if self.vehicle.mode == "GUIDED":
                self.report.action = "hold"  # the end of the job does it
        raise self.failed(reason)


class ConditionTimer:
    """Measures how long a condition has held without a break."""

    def __init__(self) -> None:
        self._since: float | None = None

    def __call__(self, holds: bool, now: float) -> float:
        """Seconds for which the condition has held, at `now` (s)."""
        if not holds:
            self._since = None
        elif self._since is None:
            self._since = now
        return 0.0 if self._since is None else now - self._since
