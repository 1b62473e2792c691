"""The envelope before the link: no message that leads out of it is sent, whoever asks for it.

Each vehicle has a guard, and all that is sent to the vehicle passes it (`GuardedLink`), so no verb can forget it.
Verbs ask it earlier too, so that a refused command ends no other (`CommandAuthority.take`).
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import braking
from mavproxy_uavapi.core.airspace.envelope_check import Checked, Spaces
from mavproxy_uavapi.core.airspace.forecast import Path
from mavproxy_uavapi.core.airspace.mission_guard import MissionGuard, require_distance
from mavproxy_uavapi.core.airspace.order_ways import OrderWays
from mavproxy_uavapi.core.airspace.ordered import Ordered
from mavproxy_uavapi.core.errors import OutsideEnvelope, Stale
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.link import orders
from mavproxy_uavapi.core.link.link import Address, Link
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.core.mainloop.permit import permitted, present_permit
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import WANTED, PathPoint
from mavproxy_uavapi.core.mission.mission_way import route as route_of
from mavproxy_uavapi.core.telemetry.flight_modes import STOPPING_MODES, flies_mission, mode_name

mavlink = mavutil.mavlink

STAY = 1.0  # m: a target this near holds the vehicle where it is
KEPT = {"GUIDED", *STOPPING_MODES}  # in any other mode nobody keeps the envelope
# Parameters that decide where and how fast an autopilot flies by itself, what it does in a failsafe, and how long it
# goes on without us; in any case. From 4.7 on many have other names.
PROTECTED = (
    "FENCE_", "RTL_", "SRTL_", "Q_RTL_", "GUID_", "GUIDED_", "WP_LOITER_RAD", "ALT_HOLD_RTL", "RALLY_", "CIRCLE_",
    "WPNAV_", "WP_SPD", "WP_SPEED", "WP_RADIUS", "CRUISE_SPEED", "AIRSPEED_", "TRIM_ARSPD_CM", "MIN_GNDSPD_CM",
    "MIN_GROUNDSPEED", "BATT_FS_", "BATT2_FS_", "BATT_LOW_", "BATT_CRT_", "FS_", "THR_FS", "THR_FAILSAFE", "TKOFF_",
    "LAND_", "MIS_", "AUTO_OPTIONS", "TERRAIN_", "SCR_",
)  # fmt: skip
# What a check has read: how a vehicle stops and turns, and what bends its way.
READ = {name for names in (*braking.WANTED, *braking.WANTED_OF_ROVER, *chain(*WANTED.values())) for name in names}
# What moves nothing by itself.
STANDING = orders.ChangeSpeed | orders.SetParameter | orders.MoveHome | orders.ListChange


def decides_where(parameter: str) -> bool:
    """Whether a parameter decides where or how fast an autopilot flies, as far as the envelope relies on it."""
    return parameter.startswith(PROTECTED) or parameter in READ


class EnvelopeGuard(MissionGuard):
    """Says whether a message keeps a vehicle in its envelopes, and away from other vehicles.

    Attributes:
        ordered: the newest message that moves the vehicle.
        speed_sent_at: when we last changed a speed of it, s.

    Args:
        vehicle: which.
        spaces: gives the envelopes in force for it.
    """

    def __init__(self, vehicle: Checked, spaces: Spaces) -> None:
        super().__init__(vehicle, spaces)
        self.ordered, self.speed_sent_at = Ordered(), -math.inf
        self._ways = OrderWays(vehicle, self.check)
        self._requirements: dict[type, Callable[[Any], None]] = {
            orders.GoTo: self._require_place,
            orders.Climb: self._require_place,
            orders.Fly: self._require_velocity,
            orders.ChangeSpeed: lambda order: self.check.require_speed(order.kind, order.speed),
            orders.SwitchMode: lambda order: self._require_mode(order.number),
            orders.FlyMission: self._require_start,
            orders.LandByMission: lambda _: self._require_landing(),
            orders.Arm: lambda _: self._require_start_by_arming(),
            orders.SetParameter: self._require_free,
            orders.ChangeMission: lambda _: None,  # it is checked before a vehicle flies it
            orders.ChangeRally: self._require_return,
            orders.ChangeFence: self._require_fence,
            orders.MoveHome: self._require_home,
        }

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

    def sending(self, message: Any) -> Ordered:
        """Record a message just before it is sent, so that checks for other vehicles see it.

        Returns:
            The previous order.
        """
        before, order = self.ordered, orders.order_of(message)
        self.check.guided_radius.sent(message, self._vehicle.clock())
        if isinstance(order, orders.ChangeMission | orders.ChangeRally):  # a mission may return to a rally point
            self._checked_mission = None
        if isinstance(order, orders.ChangeMission):
            self._changed_at = self._vehicle.state.field("MISSION_CURRENT", "seq")
        if isinstance(order, orders.ChangeSpeed):
            self.speed_sent_at = self._vehicle.clock()
        if isinstance(order, orders.FlyMission) and order.begin is not None:
            self._selected, self._changed_at = (max(order.begin, 1), self._vehicle.clock()), None
        if (
            order is None
            or isinstance(order, STANDING)
            or (isinstance(order, orders.Arm) and not self._is_in_mission)
        ):
            return before
        if self._checked_mission is not None and self._starts_mission(order):
            self.ordered = Ordered.by_mission(self._checked_mission[0].way, self._vehicle.clock())
            self.ordered.allowed_by = self._envelopes
            return before
        way: list[PathPoint] = []
        with contextlib.suppress(Stale):  # a message that needs no position, such as a stop, is sent
            way = self._ways.of(order) if self.in_force else []
        self.ordered = Ordered(way, not isinstance(order, orders.Fly), self._vehicle.clock())
        self.ordered.allowed_by = self._envelopes
        return before

    @property
    def _envelopes(self) -> Sequence[Any]:
        return [space.envelope for space in self.check.spaces]

    def forget_mission(self) -> None:
        """Another station changes its mission: it is another one than was checked, or is followed."""
        self._checked_mission = self._looked_at = None
        self._changed_at = self._vehicle.state.field("MISSION_CURRENT", "seq")
        self.ordered.allowed_by, self.ordered.is_unread = (), True

    async def follow(self, items: Sequence[MissionItem]) -> None:
        """Note the way of a mission that it flies unchecked, from here: for the others, not for the envelope.

        Raises:
            Stale: its position, or its home, is not known.
        """
        noted, current = self.ordered, self._vehicle.state.field("MISSION_CURRENT", "seq")
        starts = range(1, len(items) + 1) if current is None else [max(current, 1)]
        question = self._question(items, True, tuple(starts))
        way = None
        with contextlib.suppress(OutsideEnvelope):  # nobody can say where it leads
            way = await asyncio.to_thread(lambda: route_of(items, question.setting, question.starts).way())
        if self.ordered is noted:
            self.ordered = Ordered.by_mission(way, noted.at)

    def advance(self) -> None:
        """Note how far it has come on its way, and forget what is old. Call it at each position."""
        self.forget_old()
        with contextlib.suppress(Stale):
            self.ordered.advance(self.check.here(), self._vehicle.state.field("MISSION_CURRENT", "seq"))

    def remaining(self) -> Sequence[PathPoint]:
        """The corners of its way that are still ahead; empty if it has none, and for a mission."""
        self.advance()
        return self.ordered.ahead

    def path_ahead(self) -> Path | None:
        """The legs of its mission that are still ahead, all of them with `loops`; None where it has none."""
        self.advance()
        return self.ordered.path_ahead

    def is_on_way(self, stop: PathPoint, within: float) -> bool:
        """Whether a place is not farther than `within` m from the way that was allowed last, and is so still."""
        return self.ordered.is_to_place and self.ordered.is_beside(stop, within) and self._still_allows()

    def _still_allows(self) -> bool:
        """Whether the envelopes in force allow its way; those that came after it are asked, but not of a mission."""
        ordered, envelopes = self.ordered, self._envelopes
        if all(envelope in ordered.allowed_by for envelope in envelopes):
            return True
        if ordered.mission is not None:
            return False
        try:
            self.check.require_way([[self.check.here(), *ordered.ahead]])
        except (OutsideEnvelope, Stale):
            return False
        ordered.allowed_by = envelopes
        return True

    # -- orders -------------------------------------------------------------------------------------------

    def _require_sane(self, order: orders.GoTo) -> None:
        """Refuse what is plainly wrong, whether there is an envelope or not."""
        target = order.target
        here = self._vehicle.state.position
        if isinstance(target, NedTarget):
            distance = math.hypot(target.x, target.y)
        elif here is not None:
            distance = math.hypot(*offset(*here.place, target.lat, target.lon))
        else:
            return
        require_distance(distance, "the target")

    def _require_order(self, order: orders.VehicleOrder) -> None:
        if isinstance(order, orders.Unknown):
            raise OutsideEnvelope(f"nobody can say whether {order.name} keeps the vehicle in the envelope")
        self._requirements[type(order)](order)

    def _require_start(self, order: orders.FlyMission) -> None:
        if order.begin is None or self._vehicle.state.armed is not False:
            self._require_checked_mission("AUTO", order.begin)

    def _require_start_by_arming(self) -> None:
        if self._is_in_mission:
            self._require_checked_mission("AUTO")

    @property
    def _is_in_mission(self) -> bool:
        return flies_mission(mode_name(self._vehicle.state.vehicle_type, self._vehicle.state.mode))

    def _require_landing(self) -> None:
        """A plane lands so, which nobody refuses; another vehicle returns along its mission."""
        if self._vehicle.kind != "plane":
            self._require_checked_mission("AUTO_RTL")

    def _require_free(self, order: orders.SetParameter) -> None:
        if decides_where(order.name.upper()):
            raise OutsideEnvelope(f"{order.name} decides where the autopilot flies; an envelope is in force")

    def _require_return(self, order: orders.ChangeRally) -> None:
        if self._is_in_mission:
            raise OutsideEnvelope("the vehicle flies a mission, which may return to what a rally point is now")
        if order.place is not None:
            point = PathPoint(order.place.lat, order.place.lon, 0.0 if self.check.drives else order.place.alt)
            self.check.require_way([[point, point]])

    def _require_fence(self, _order: orders.ChangeFence) -> None:
        if self._vehicle.state.armed is not False and not all(one.envelope.is_own for one in self.check.spaces):
            raise OutsideEnvelope("the autopilot's fence cannot be changed in flight: an envelope is in force")

    def _require_home(self, _order: orders.MoveHome) -> None:
        if self._vehicle.state.armed is not False:
            raise OutsideEnvelope("home cannot be moved in flight: heights and distances count from it")

    def _require_place(self, order: orders.GoTo | orders.Climb) -> None:
        way = self._ways.of(order)
        stays = isinstance(order, orders.GoTo) and _length(way) <= STAY
        circle = self.check.own_circle if isinstance(order, orders.GoTo) and order.own_radius else None
        self.check.require_way([way], stays=stays, circle=circle)
        self.check.require_speeds()
        if not stays:
            self._require_apart(way)

    def _require_mode(self, number: int) -> None:
        mode = mode_name(self._vehicle.state.vehicle_type, number)
        if flies_mission(mode):
            self._require_checked_mission(mode)
        elif mode == "SMART_RTL" and self.traffic is not None and self.traffic.in_force:
            raise OutsideEnvelope("nobody knows on which way it returns in SMART_RTL; RTL is kept from the others")
        elif mode in self._vehicle.moving_modes:
            return  # in TAKEOFF the verb has checked its height; the place where it levels off is watched
        elif self.check.spaces and mode not in KEPT.union(self._vehicle.holding_modes):
            raise OutsideEnvelope(f"in {mode} nobody keeps the vehicle in the envelope; a pilot may switch to it")

    def _starts_mission(self, order: orders.VehicleOrder) -> bool:
        if isinstance(order, orders.Arm):
            return self._is_in_mission
        if isinstance(order, orders.SwitchMode):
            return flies_mission(mode_name(self._vehicle.state.vehicle_type, order.number))
        begins = orders.FlyMission if self._vehicle.kind == "plane" else orders.FlyMission | orders.LandByMission
        return isinstance(order, begins)

    def _require_apart(self, way: Sequence[PathPoint]) -> None:
        if self.traffic is not None:
            self.traffic.require(self._vehicle, way)

    def _require_velocity(self, order: orders.Fly) -> None:
        north, east, down = self._ways.velocity(order)
        if math.hypot(north, east, down) < 1e-3:
            return  # it stops
        way = self._ways.of(order)
        self.check.require_way([way], may_return=False)
        for kind, speed in (("ground", math.hypot(north, east)), ("climb", -down), ("descent", down)):
            self.check.require_speed(kind, speed)
        self._require_apart(way)


class GuardedLink:
    """A vehicle's way out, past its guard, which is asked again where a message is written if anything has changed.

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
        noted, permit = self._guard.ordered, present_permit()

        def basis() -> object:
            return permit.basis(), self._guard.basis

        guarded = replace(permit, again=lambda: self._guard.require(message), system=system, basis=basis)
        try:
            with permitted(guarded):
                await self._link.send(message, system)
        except BaseException:
            if self._guard.ordered is noted:
                self._guard.ordered = before
            raise


def _length(way: Sequence[PathPoint]) -> float:
    a, b = way[0], way[-1]
    return math.hypot(*offset(a.lat, a.lon, b.lat, b.lon), b.up - a.up)
