"""The rules of the air for planes, QuadPlanes and rovers, as a judge of what a world with an embedded one shows.

The rules are written from the design alone: nothing here asks the authority what it thinks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.rules.rules_of_the_air import GUIDED_ONLY, ON_PURPOSE, STOP, goes_beside, rank
from tests.support import stages
from tests.support.flights import Flight, Sent
from tests.support.world import World

PILOTS_MODES = {"plane": ("FBWA", "CRUISE"), "quadplane": ("FBWA", "QHOVER"), "rover": ("MANUAL", "STEERING")}
HOLDS = {"plane": ("LOITER",), "quadplane": ("LOITER", "QLOITER"), "rover": ("HOLD",)}
STAGES: dict[str, dict[str, Callable[[World], None]]] = {
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


def requested_mode(world: World, message: Any) -> str:
    """The mode to which a message switches the vehicle; "" for none."""
    command = getattr(message, "command", None)
    if command == mavlink.MAV_CMD_DO_SET_MODE:
        return str(world.vehicle.modes[int(message.param2)].name)
    if command == mavlink.MAV_CMD_DO_REPOSITION and message.param2:
        return "GUIDED"
    return STARTS.get(command, "")


class TypesJudge:
    """Looks at what is sent, and remembers what is against the rules.

    Attributes:
        broken: what was against the rules.
        requested: modes that were asked for, and when (s).
        is_blind: whether a second autopilot makes all that is seen doubtful; then one rule counts for what is sent.
    """

    def __init__(self, world: World) -> None:
        self.broken: list[str] = []
        self.requested: list[tuple[float, str]] = []
        self.is_blind = False
        self._world = world
        self._pilots_mode, self._piloted_since = "", -math.inf
        world.on_send.append(self._sent)

    def _sent(self, sent: Sent) -> None:
        wrong = self._to_two(sent) if self.is_blind else self._wrong(sent)
        self.broken += [f"{sent.at:.2f} s: {wrong}"] if wrong else []
        mode = requested_mode(self._world, sent.message)
        if mode:
            self.requested.append((sent.at, mode))

    def _to_two(self, sent: Sent) -> str | None:
        """What is wrong with what was sent to two autopilots; None for nothing."""
        are_two = self._world.known.state.are_two(sent.at)
        return f"{sent.message} by {sent.flight}, to two autopilots" if are_two else None

    def _wrong(self, sent: Sent) -> str | None:
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
        if requested_mode(self._world, sent.message) == sent.mode or (disarms and rank(flight) >= STOP):
            return None  # it is in that mode; it undoes an arming of ours, in whatever mode
        if sent.mode in PILOTS_MODES[self._world.kind] and flight.verb not in MEANT:
            return f"{sent.message} by {flight} in the pilot's {sent.mode}"
        is_its_own = sent.mode in (flight.mode, "UNKNOWN") or any(
            mode == sent.mode and at >= flight.job.began_at - LATE_SWITCH for at, mode in self.requested
        )
        return None if is_its_own else f"{sent.message} by {flight}, begun in {flight.mode}, in {sent.mode}"

    @property
    def commanders(self) -> list[Flight]:
        """The flights under way that have commanded, but for those beside a movement."""
        return [one for one in self._world.running if one.sent and not goes_beside(one) and one.verb not in BESIDE]

    @property
    def is_held(self) -> bool:
        """Whether it is disarmed, has landed, holds, or is on its way to a height where it may."""
        mode = self._world.vehicle.mode.name
        if not self._world.vehicle.armed or (
            mode.endswith(("LAND", "RTL")) and -self._world.at[2] < ON_GROUND and self._world.speed < STANDS
        ):
            return True
        if self._world.kind == "rover":
            return mode == "HOLD" and self._world.speed < STANDS
        hovers = self._world.kind == "quadplane" and mode == "GUIDED" and self._world.speed < STANDS
        return mode in HOLDS[self._world.kind] or hovers

    def pilot(self, mode: str) -> None:
        """The pilot chooses a mode; the vehicle may refuse it."""
        self._world.control.answer("fault", name="pilot_mode", mode=mode)

    def look(self) -> None:
        """At any time."""
        now, mode = self._world.now, self._world.known.mode
        if mode != self._pilots_mode:
            self._pilots_mode, self._piloted_since = mode, now
        wrong = [str(defect) for defect in self._world.loop.defects]
        self._world.loop.defects = []
        if self.is_blind:
            self.broken += wrong
            return
        if len(self.commanders) > 1:
            wrong.append(f"several command: {[str(one) for one in self.commanders]}")
        if mode in PILOTS_MODES[self._world.kind] and now - self._piloted_since > PILOT_NOTICED:
            late = [
                one
                for one in self._world.running
                if one.verb in GUIDED_ONLY and one.job.began_at < self._piloted_since
            ]
            wrong += [f"{one} goes on in the pilot's {mode}" for one in late]
        self.broken += [f"{now:.2f} s: {what}" for what in wrong]
