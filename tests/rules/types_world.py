"""The embedded plane, QuadPlane or rover for random flights, and the rules of the air for what is seen of it.

The rules are written from the design alone: nothing here asks the authority what it thinks.
"""

from __future__ import annotations

import asyncio
import json
import math
import random
from collections import Counter
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.rules.rules_of_the_air import GUIDED_ONLY, ON_PURPOSE, STOP, goes_beside, rank
from tests.rules.scripted_world import Flight, Sent, the_job, watch_jobs
from tests.support import stages
from tests.support.mavproxy import mavproxy_state
from tests.support.virtual_time import TimeTravellingLoop
from tests.support.world import Sent as OnTheWire
from tests.support.world import World

SETTINGS = {"max_rate": 100000.0, "max_jobs": 1000}
PILOTS_MODES = {"plane": ("FBWA", "CRUISE"), "quadplane": ("FBWA", "QHOVER"), "rover": ("MANUAL", "STEERING")}
HOLDS = {"plane": ("LOITER",), "quadplane": ("LOITER", "QLOITER"), "rover": ("HOLD",)}
STAGES: dict[str, dict[str, Callable[[Any], None]]] = {
    "plane": {"ground": stages.armed_with_mission, "flying": stages.cruising, "mission": stages.on_mission},
    "quadplane": {"ground": World.armed, "hovering": stages.hovering},
    "rover": {"ground": World.armed, "driving": stages.driven_away, "mission": stages.on_mission},
}
STARTS = {mavlink.MAV_CMD_DO_LAND_START: "AUTO", mavlink.MAV_CMD_MISSION_START: "AUTO"}
MEANT = ON_PURPOSE | {"start", "stop", "land_at"}  # also in a pilot's mode; `start` is that of a mission
BESIDE = {"set_reverse"}
LATE_SWITCH = 10.0  # s in which a mode may still come that was asked for
PILOT_NOTICED = 5.0  # s after which nothing that needs GUIDED runs on in a pilot's mode
STANDS = 0.5  # m/s
ON_GROUND = 0.3  # m above home
LOW = 15.0  # m above home, below which a plane climbs before it circles


def requested_mode(world: Any, message: Any) -> str:
    """The mode to which a message switches the vehicle; "" for none."""
    command = getattr(message, "command", None)
    if command == mavlink.MAV_CMD_DO_SET_MODE:
        return str(world.vehicle.modes[int(message.param2)].name)
    if command == mavlink.MAV_CMD_DO_REPOSITION and message.param2:
        return "GUIDED"
    return STARTS.get(command, "")


class TypesWorld(World):
    """A world of its own loop, which notes who sends what.

    Attributes:
        flights: the jobs so far, by number.
        broken: what was against the rules.
        way, jitter: s that each message takes either way, and at most so many more by chance.
        stands_until: s; until then MAVProxy's main loop stands.
        to_lose: how many messages of a name are lost, of what is told once.
        doubled: whether a second autopilot makes all that is seen doubtful; then one rule counts for what is sent.
    """

    def __init__(self, vehicle: str, stage: str) -> None:
        loop = TimeTravellingLoop()
        asyncio.set_event_loop(loop)
        super().__init__(loop, mavproxy_state(), dict(SETTINGS), vehicle)
        self.flights: dict[str, Flight] = {}
        self.broken: list[str] = []
        self.requested: list[tuple[float, str]] = []  # modes, and when they were asked for (s)
        self.pilots_mode, self.piloted_since = "", -math.inf
        self.way = self.jitter = 0.0
        self.doubled = False
        self.stands_until, self.to_lose = -math.inf, Counter[str]()
        self._chance = random.Random(1)
        self._unread: list[Any] = []
        self.host.bridge.links_have_unread = lambda: bool(self._unread)
        self.hears = self._hears
        watch_jobs(self.host, self.flights, [])
        self.host.endings.on_disconnect = Policy.HOLD
        STAGES[vehicle][stage](self)
        self.go_live()
        self.loop.pass_time(2.0)

    # -- what is sent -----------------------------------------------------------------------------------------

    async def send(self, message: Any, system: int) -> None:
        """As `World.send`; looks at what is sent."""
        job = the_job.get()
        flight = None if job is None else self.flights[job.id]
        await asyncio.sleep(0)
        await self.host.bridge.on_main(lambda: self._write(message, flight))

    def _write(self, message: Any, flight: Flight | None) -> None:
        sent = Sent(self.loop.time(), message, flight, self.known.mode, self.known.state.armed)
        self.sent.append(OnTheWire(sent.at, self._as_on_the_wire(message)))
        self._later(self._arrive, message)
        if sent.asks:
            return
        wrong = self.to_two(sent) if self.doubled else self.judge(sent)
        self.broken += [f"{sent.at:.2f} s: {wrong}"] if wrong else []
        mode = requested_mode(self, message)
        if mode:
            self.requested.append((sent.at, mode))
        if flight is not None:
            flight.sent.append(sent)

    def _arrive(self, message: Any) -> None:
        self._arriving.append(message)  # the list of that moment

    def _later(self, arrive: Callable[[Any], object], message: Any) -> None:
        if self.way:
            self.loop.call_later(self.way + self._chance.uniform(0.0, self.jitter), arrive, message)
        else:
            arrive(message)

    def _hears(self, message: Any) -> bool:
        lost = self.to_lose[message.get_type()] > 0
        self.to_lose[message.get_type()] -= lost
        return not lost

    def _read(self, messages: list[Any]) -> None:
        """As `World._read`, unless the main loop stands; the idle tasks come first."""
        for message in messages:
            self._later(self._unread.append, message)
        if self.loop.time() < self.stands_until:
            return
        self.host.bridge.turn()
        unread, self._unread[:] = list(self._unread), []
        super()._read(unread)

    def to_two(self, sent: Sent) -> str | None:
        """What is wrong with what was sent to two autopilots; None for nothing."""
        are_two = self.known.state.are_two(sent.at)
        return f"{sent.message} by {sent.flight}, to two autopilots" if are_two else None

    def judge(self, sent: Sent) -> str | None:
        """What is wrong with what was sent; None for nothing."""
        flight = sent.flight
        if flight is None:
            return f"{sent.message} by nobody"
        repeats = flight.job.error is None and str(sent.message) in [str(one.message) for one in flight.sent]
        if not flight.job.running and not (repeats and sent.is_setpoint):  # a place that was lost is sent again
            return f"{sent.message} by {flight}, which has ended: {flight.job.error}"
        if flight.verb == "disarm" or sent.message.get_type().startswith("MISSION_"):
            return None  # a list that is uploaded, or put back, moves nothing
        disarms = (
            getattr(sent.message, "command", 0) == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and not sent.message.param1
        )
        if requested_mode(self, sent.message) == sent.mode or (disarms and rank(flight) >= STOP):
            return None  # it is in that mode; it undoes an arming of ours, in whatever mode
        if sent.mode in PILOTS_MODES[self.kind] and flight.verb not in MEANT:
            return f"{sent.message} by {flight} in the pilot's {sent.mode}"
        is_its_own = sent.mode in (flight.mode, "UNKNOWN") or any(
            mode == sent.mode and at >= flight.job.began_at - LATE_SWITCH for at, mode in self.requested
        )
        return None if is_its_own else f"{sent.message} by {flight}, begun in {flight.mode}, in {sent.mode}"

    # -- what is known, and what is true ------------------------------------------------------------------------

    @property
    def known(self) -> Any:
        """Our side of the vehicle."""
        return self.host.registry.find(1)

    @property
    def speed(self) -> float:
        """The vehicle's true speed, m/s."""
        return math.hypot(*self.vehicle.body.velocity)

    @property
    def running(self) -> list[Flight]:
        """The flights without an outcome, oldest first."""
        return [self.flights[job.id] for job in self.host.jobs.running()]

    @property
    def commanders(self) -> list[Flight]:
        """The flights under way that have commanded, but for those beside a movement."""
        return [one for one in self.running if one.sent and not goes_beside(one) and one.verb not in BESIDE]

    @property
    def is_held(self) -> bool:
        """Whether it is disarmed, has landed, holds, or is on its way to a height where it may."""
        mode = self.vehicle.mode.name
        if not self.vehicle.armed or (
            mode.endswith(("LAND", "RTL")) and -self.at[2] < ON_GROUND and self.speed < STANDS
        ):
            return True
        if self.kind == "rover":
            return mode == "HOLD" and self.speed < STANDS
        hovers = self.kind == "quadplane" and mode == "GUIDED" and self.speed < STANDS
        return mode in HOLDS[self.kind] or hovers

    def pilot(self, mode: str) -> None:
        """The pilot chooses a mode; the vehicle may refuse it."""
        self.control.handle_line(json.dumps({"op": "fault", "name": "pilot_mode", "mode": mode}))

    def look(self) -> None:
        """At any time."""
        now, mode = self.loop.time(), self.known.mode
        if mode != self.pilots_mode:
            self.pilots_mode, self.piloted_since = mode, now
        wrong = [str(defect) for defect in self.loop.defects]
        self.loop.defects = []
        if self.doubled:
            self.broken += wrong
            return
        if len(self.commanders) > 1:
            wrong.append(f"several command: {[str(one) for one in self.commanders]}")
        if mode in PILOTS_MODES[self.kind] and now - self.piloted_since > PILOT_NOTICED:
            late = [one for one in self.running if one.verb in GUIDED_ONLY and one.job.began_at < self.piloted_since]
            wrong += [f"{one} goes on in the pilot's {mode}" for one in late]
        self.broken += [f"{now:.2f} s: {what}" for what in wrong]

    def end(self) -> None:
        """Close everything, and the loop."""
        self.close()
        self.host.bridge._calls.close()
        for timer in self.host.link_watch._timers.values():
            timer.cancel()
        self.loop.end()
