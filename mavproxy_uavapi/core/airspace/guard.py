"""The envelope before the link: no message that leads out of it is sent, whoever asks for it.

Each vehicle has a guard, and all that is sent to the vehicle passes it (`GuardedLink`), so no verb can forget it.
Verbs ask it earlier too, so that a refused command ends no other (`CommandAuthority.take`).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mavproxy_uavapi.core.airspace import braking
from mavproxy_uavapi.core.airspace.envelope_check import Checked, EnvelopeCheck, Spaces
from mavproxy_uavapi.core.airspace.space import LocalFrame, Space, Spot, to_leg
from mavproxy_uavapi.core.airspace.traffic import Traffic
from mavproxy_uavapi.core.errors import OutsideEnvelope, Stale
from mavproxy_uavapi.core.geodesy import moved, offset, rotate
from mavproxy_uavapi.core.link import orders
from mavproxy_uavapi.core.link.link import Address, Link
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_way import Stop
from mavproxy_uavapi.core.telemetry.flight_modes import STOPPING_MODES, flies_mission, mode_name

REACH = 200_000.0  # m from the vehicle: no target lies farther, with or without an envelope
STAY = 1.0  # m: a target this near holds the vehicle where it is
CORNER = 3.0  # m; a vehicle this near to a corner of its way has passed it
CHECKED_FOR = 30.0  # s for which a checked mission may be started
KEPT = {"GUIDED", *STOPPING_MODES}  # in any other mode nobody keeps the envelope
# Parameters that decide where an autopilot flies by itself, and how long it goes on without us; in any case.
PROTECTED = ("FENCE_", "RTL_", "SRTL_", "Q_RTL_", "GUID_", "WP_LOITER_RAD")
# What moves nothing by itself.
STANDING = orders.ChangeSpeed | orders.SetParameter | orders.MoveHome | orders.ChangeMission


@dataclass(eq=False)
class Ordered:
    """The movement that the newest message commands.

    Attributes:
        way: its path; empty where none is known.
        is_to_place: whether it leads to positions, or is a velocity.
        at: when it was sent (s).
        passed: legs of the path that the vehicle has flown.
    """

    way: Sequence[Stop] = ()
    is_to_place: bool = True
    at: float = -math.inf
    passed: int = 0


class EnvelopeGuard:
    """Says whether a message keeps a vehicle in its envelopes, and away from other vehicles.

    Attributes:
        check: holds ways against the envelopes.
        traffic: keeps it away from other vehicles; None where nobody does.
        ordered: the newest message that moves the vehicle.

    Args:
        vehicle: which.
        spaces: gives the envelopes in force for it.
    """

    def __init__(self, vehicle: Checked, spaces: Spaces) -> None:
        self.check = EnvelopeCheck(vehicle, spaces)
        self.traffic: Traffic | None = None
        self.ordered = Ordered()
        self._vehicle = vehicle
        self._checked_mission: tuple[Sequence[Space], float, list[Stop]] | None = None

    @property
    def in_force(self) -> bool:
        """Whether there is an envelope for it, or other vehicles are to be kept away from."""
        return bool(self.check.spaces) or (self.traffic is not None and self.traffic.in_force)

    @property
    def ordered_at(self) -> float:
        """When the newest message went out that moves the vehicle (s); -inf for none."""
        return self.ordered.at

    @property
    def way(self) -> Sequence[Stop]:
        """The way that it was last allowed to fly, straight from place to place; empty with velocities."""
        return self.ordered.way if self.ordered.is_to_place else ()

    def require(self, message: Any) -> None:
        """Raise unless `message` may be sent.

        Raises:
            OutsideEnvelope: it leads out of an envelope, or nobody can say where.
            TooNear: it leads too near to another vehicle.
            Stale: the vehicle's position, or its home, is not known.
        """
        order = orders.order_of(message)
        if isinstance(order, orders.GoTo):
            self._require_sane(order)
        if order is not None and self.in_force:
            self._require_order(order)

    def require_mission(self, items: Sequence[MissionItem], *, from_here: bool) -> None:
        """Raise OutsideEnvelope unless the whole mission stays inside. With `from_here` it may then be flown.

        Raises:
            TooNear: from here it leads too near to another vehicle.
        """
        if self.in_force:
            way = self.check.require_mission(items, from_here=from_here)
            if from_here:
                self._require_apart(way)
                self._checked_mission = self.check.spaces, self._vehicle.clock(), way

    def sending(self, message: Any) -> Ordered:
        """Record a message just before it is sent, so that checks for other vehicles see it.

        Returns:
            The previous order.
        """
        before, order = self.ordered, orders.order_of(message)
        self.check.guided_radius.sent(message, self._vehicle.clock())
        if isinstance(order, orders.ChangeMission):
            self._checked_mission = None
        if order is None or isinstance(order, STANDING):
            return before
        way: list[Stop] = []
        with contextlib.suppress(Stale):  # a message that needs no position, such as a stop, is sent
            way = self._way_by(order)
        self.take_up(Ordered(way, not isinstance(order, orders.Fly), self._vehicle.clock()))
        return before

    def _way_by(self, order: orders.VehicleOrder) -> list[Stop]:
        """The way that an order leads along, as far as it is known. Raises Stale."""
        if self.in_force and isinstance(order, orders.GoTo | orders.Climb):
            return self._way_of(order)
        if self.in_force and isinstance(order, orders.Fly):
            return self._way_at(order)
        if self._checked_mission is not None and self._starts_mission(order):
            return self._checked_mission[2]
        return []

    def take_up(self, ordered: Ordered) -> None:
        """Set the present order. If sending fails, the caller passes the previous one."""
        self.ordered = ordered

    def remaining(self) -> Sequence[Stop]:
        """The corners of its way that are still ahead; empty if it has none. Call it at each position."""
        ordered = self.ordered
        way = ordered.way
        if len(way) < 2:
            return ()
        try:
            here = self.check.here()
        except Stale:
            return way[ordered.passed + 1 :]
        frame = LocalFrame((here.lat, here.lon))
        spots, at = [frame.spot((stop.lat, stop.lon), stop.up) for stop in way], Spot(0.0, 0.0, here.up)
        while ordered.passed + 2 < len(way) and _is_past(at, spots[ordered.passed : ordered.passed + 3]):
            ordered.passed += 1
        return way[ordered.passed + 1 :]

    def beside_way(self, stop: Stop) -> float:
        """Metres from a place to the way that was allowed last; infinite where there is none."""
        frame = LocalFrame((stop.lat, stop.lon))
        spots = [frame.spot((at.lat, at.lon), at.up) for at in self.way]
        nearest = (to_leg(Spot(0.0, 0.0, stop.up), a, b) for a, b in zip(spots, spots[1:], strict=False))
        return min(nearest, default=math.inf)

    # -- orders -------------------------------------------------------------------------------------------

    def _require_sane(self, order: orders.GoTo) -> None:
        """Refuse what is plainly wrong, whether there is an envelope or not."""
        target = order.target
        here = self._vehicle.state.messages.get("GLOBAL_POSITION_INT")
        if isinstance(target, NedTarget):
            distance = math.hypot(target.x, target.y)
        elif here is not None:
            distance = math.hypot(*offset(here.message.lat / 1e7, here.message.lon / 1e7, target.lat, target.lon))
        else:
            return
        if distance > REACH:
            sentence = f"the target is {distance / 1000:.0f} km away; {REACH / 1000:g} km are the most"
            raise OutsideEnvelope(sentence, {"what": "the reach of any vehicle", "by": round(distance - REACH)})

    def _require_order(self, order: orders.VehicleOrder) -> None:
        if isinstance(order, orders.GoTo | orders.Climb):
            self._require_place(order)
        elif isinstance(order, orders.Fly):
            self._require_velocity(order)
        elif isinstance(order, orders.ChangeSpeed):
            self.check.require_speed(order.kind, order.speed)
        elif isinstance(order, orders.SwitchMode):
            self._require_mode(order.number)
        elif isinstance(order, orders.FlyMission):
            if order.now or self._vehicle.state.armed is not False:
                self._require_checked_mission()
        elif isinstance(order, orders.SetParameter):
            if order.name.upper().startswith(PROTECTED):
                raise OutsideEnvelope(f"{order.name} decides where the autopilot flies; an envelope is in force")
        elif isinstance(order, orders.ChangeMission):
            return  # it is checked before a vehicle flies it
        elif isinstance(order, orders.MoveHome):
            if self._vehicle.state.armed is not False and self.check.spaces:
                raise OutsideEnvelope("home cannot be moved in flight: the envelope is measured from it")
        else:
            raise OutsideEnvelope(f"nobody can say whether {order.name} keeps the vehicle in the envelope")

    def _require_place(self, order: orders.GoTo | orders.Climb) -> None:
        way = self._way_of(order)
        stays = isinstance(order, orders.GoTo) and _length(way) <= STAY
        circle = self.check.own_circle if isinstance(order, orders.GoTo) and order.own_radius else None
        self.check.require_way([way], stays=stays, circle=circle)
        self.check.require_speeds()
        if not stays:
            self._require_apart(way)

    def _require_mode(self, number: int) -> None:
        mode = mode_name(self._vehicle.state.vehicle_type, number)
        if flies_mission(mode):
            self._require_checked_mission()
        elif mode == "TAKEOFF" and self._vehicle.kind == "plane":
            return  # the verb has checked its height; the place where it levels off is watched
        elif self.check.spaces and mode not in KEPT.union(self._vehicle.holding_modes):
            raise OutsideEnvelope(f"in {mode} nobody keeps the vehicle in the envelope; a pilot may switch to it")

    def _require_checked_mission(self) -> None:
        checked = self._checked_mission
        if checked is None or checked[0] != self.check.spaces or self._vehicle.clock() - checked[1] > CHECKED_FOR:
            raise OutsideEnvelope("the vehicle's mission was not checked against the envelope; start it by the API")
        self._require_apart(checked[2])

    def _starts_mission(self, order: orders.VehicleOrder) -> bool:
        if isinstance(order, orders.SwitchMode):
            return flies_mission(mode_name(self._vehicle.state.vehicle_type, order.number))
        return isinstance(order, orders.FlyMission)

    def _require_apart(self, way: Sequence[Stop]) -> None:
        if self.traffic is not None:
            self.traffic.require(self._vehicle, way)

    def _require_velocity(self, order: orders.Fly) -> None:
        north, east, down = self._velocity(order)
        if math.hypot(north, east, down) < 1e-3:
            return  # it stops
        way = self._way_at(order)
        self.check.require_way([way], may_return=False)
        for kind, speed in (("ground", math.hypot(north, east)), ("climb", -down), ("descent", down)):
            self.check.require_speed(kind, speed)
        self._require_apart(way)

    def _velocity(self, order: orders.Fly) -> tuple[float, float, float]:
        """m/s north, east, down."""
        north, east, down = order.velocity
        if order.by_heading:
            north, east = rotate(north, east, self._vehicle.fresh("ATTITUDE").yaw)
        return north, east, down

    def _way_at(self, order: orders.Fly) -> list[Stop]:
        """The way that is flown until the autopilot drops the setpoint, and until it stands."""
        north, east, down = self._velocity(order)
        if math.hypot(north, east, down) < 1e-3:
            return self._way_to_rest()
        parameters, drives = self._vehicle.state.parameters, self.check.drives
        stopping = braking.of_rover(parameters) if drives else braking.of_guided(parameters)
        lasts = max(parameters.get("GUID_TIMEOUT", 3.0), 0.1) + braking.LATENCY
        here = self.check.here()
        on = stopping.to_rest((north, east, 0.0 if drives else -down), lasts)
        return [here, Stop(*moved(here.lat, here.lon, on[0], on[1]), here.up + on[2])]

    def _way_to_rest(self) -> list[Stop]:
        """The way that it needs to stand, from the velocity that it has."""
        here, position = self.check.here(), self._vehicle.fresh("GLOBAL_POSITION_INT")
        stopping = braking.of_rover if self.check.drives else braking.of_guided
        velocity = position.vx / 100.0, position.vy / 100.0, 0.0 if self.check.drives else -position.vz / 100.0
        north, east, up = stopping(self._vehicle.state.parameters).to_rest(velocity, braking.LATENCY)
        return [here, Stop(*moved(here.lat, here.lon, north, east), here.up + up)]

    def _way_of(self, order: orders.GoTo | orders.Climb) -> list[Stop]:
        here = self.check.here()
        if isinstance(order, orders.Climb):
            return [here, here._replace(up=order.alt)]
        target = order.target
        if isinstance(target, NedTarget):
            local = self._vehicle.fresh("LOCAL_POSITION_NED")
            lat, lon = moved(here.lat, here.lon, target.x - local.x, target.y - local.y)
            up = here.up + local.z - target.z
        else:
            lat, lon, up = target.lat, target.lon, target.alt
        return [here, Stop(lat, lon, 0.0 if self.check.drives else up)]


class GuardedLink:
    """A vehicle's way out, past its guard.

    Args:
        link: sends messages.
        guard: says which may be sent.
    """

    def __init__(self, link: Link, guard: EnvelopeGuard) -> None:
        self._link = link
        self._guard = guard

    @property
    def source(self) -> Address:
        """See `Link.source`."""
        return self._link.source

    async def send(self, message: Any, system: int) -> None:
        """See `Link.send`.

        Raises:
            OutsideEnvelope, TooNear, Stale: as `EnvelopeGuard.require`; nothing is sent.
        """
        self._guard.require(message)
        before = self._guard.sending(message)
        noted = self._guard.ordered
        try:
            await self._link.send(message, system)
        except BaseException:
            if self._guard.ordered is noted:
                self._guard.take_up(before)
            raise


def _is_past(at: Spot, corners: Sequence[Spot]) -> bool:
    """Whether a vehicle at `at` has passed the second of three corners."""
    a, b, c = corners
    return math.dist(at, b) < CORNER or to_leg(at, b, c) + CORNER < to_leg(at, a, b)


def _length(way: Sequence[Stop]) -> float:
    a, b = way[0], way[-1]
    return math.hypot(*offset(a.lat, a.lon, b.lat, b.lon), b.up - a.up)
