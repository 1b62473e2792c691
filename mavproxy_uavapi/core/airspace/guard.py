"""The envelope before the link: no message that leads out of it is sent, whoever asks for it.

Each vehicle has a guard, and all that is sent to the vehicle passes it (`GuardedLink`), so no verb can forget it.
Verbs ask it earlier too, so that a refused command ends no other (`CommandAuthority.take`).
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import braking
from mavproxy_uavapi.core.airspace.envelope_check import (
    Checked,
    EnvelopeCheck,
    MissionAnswer,
    MissionQuestion,
    Spaces,
    answer,
)
from mavproxy_uavapi.core.airspace.forecast import Path, gaps_between
from mavproxy_uavapi.core.airspace.space import LocalFrame, Spot, to_leg
from mavproxy_uavapi.core.airspace.traffic import Traffic
from mavproxy_uavapi.core.errors import Busy, OutsideEnvelope, Stale
from mavproxy_uavapi.core.geodesy import from_deg_e7, moved, offset, rotate
from mavproxy_uavapi.core.link import orders
from mavproxy_uavapi.core.link.link import Address, Link
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_way import MissionRoute, PathPoint, return_starts
from mavproxy_uavapi.core.mission.table import is_navigation
from mavproxy_uavapi.core.telemetry.flight_modes import STOPPING_MODES, flies_mission, mode_name

mavlink = mavutil.mavlink

REACH = 200_000.0  # m from the vehicle: no target lies farther, with or without an envelope
STAY = 1.0  # m: a target this near holds the vehicle where it is
CORNER = 3.0  # m; a vehicle this near to a corner of its way has passed it
SHOWN_WITHIN = 1.0  # s in which MISSION_CURRENT shows the item that was selected
CHECKED_FOR = 30.0  # s for which a checked mission may be started
KEPT = {"GUIDED", *STOPPING_MODES}  # in any other mode nobody keeps the envelope
MOVED = 100.0  # m that a vehicle may move while its mission is checked
NOT_CHECKED = "the vehicle's mission was not checked against the envelope; start it by the API"
SHORT = 100  # items of a mission that is checked at once; a longer one holds the asyncio thread too long
LANDS_WITHIN = 5.0  # m over the ground from its landing place, at which a vehicle sinks
FLARES_WITHIN, FLARES_BELOW = 100.0, 10.0  # m from there, or above home, at which nobody stops a plane that lands
# Parameters that decide where and how fast an autopilot flies by itself, what it does in a failsafe, and how long it
# goes on without us; in any case. From 4.7 on many have other names.
PROTECTED = (
    "FENCE_", "RTL_", "SRTL_", "Q_RTL_", "GUID_", "GUIDED_", "WP_LOITER_RAD", "ALT_HOLD_RTL", "RALLY_", "CIRCLE_",
    "WPNAV_", "WP_SPD", "WP_SPEED", "WP_RADIUS", "CRUISE_SPEED", "AIRSPEED_", "TRIM_ARSPD_CM", "MIN_GNDSPD_CM",
    "MIN_GROUNDSPEED", "BATT_FS_", "BATT2_FS_", "BATT_LOW_", "BATT_CRT_", "FS_", "THR_FS", "THR_FAILSAFE", "TKOFF_",
    "LAND_", "MIS_", "AUTO_OPTIONS", "TERRAIN_", "SCR_",
)  # fmt: skip
# What moves nothing by itself.
STANDING = orders.ChangeSpeed | orders.SetParameter | orders.MoveHome | orders.ListChange


@dataclass(eq=False)
class Ordered:
    """The movement that the newest message commands.

    Attributes:
        way: its path; empty where none is known.
        is_to_place: whether it leads to positions, or is a velocity.
        at: when it was sent (s).
        passed: legs of the path that the vehicle has flown.
        route: that of a mission; `way` has the corners of its legs then.
    """

    way: Sequence[PathPoint] = ()
    is_to_place: bool = True
    at: float = -math.inf
    passed: int = 0
    route: MissionRoute | None = None

    @property
    def loops(self) -> bool:
        """Whether it is a mission that goes round, so that nobody knows how far it has come."""
        return self.route is not None and self.route.loops

    def beside(self, stop: PathPoint) -> float:
        """Metres from a place to the path; infinite where there is none."""
        if self._lines is None:
            return math.inf
        frame, begins, ends = self._lines
        here = np.array([frame.spot((stop.lat, stop.lon), stop.up)])
        return float(gaps_between(here, here, begins, ends).min())

    @cached_property
    def _lines(self) -> tuple[LocalFrame, Any, Any] | None:
        """A flat frame, and the beginning and the end of each leg in it; None for no legs."""
        if len(self.way) < 2:
            return None
        places = np.array(self.way)
        begins, ends = places[:-1], places[1:]
        if self.route is not None:
            begins, ends = self.route.path.begins, self.route.path.ends
        frame = LocalFrame(self.way[0][:2])
        return frame, frame.spots(begins), frame.spots(ends)


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
        self._looked_at: MissionAnswer | None = None  # what a thread has found
        self._checked_mission: tuple[MissionAnswer, float] | None = None  # and when (s)
        self._selected: tuple[int, float] = (0, -math.inf)  # the item that we told it to begin at, and when (s)
        self._requirements: dict[type, Callable[[Any], None]] = {
            orders.GoTo: self._require_place,
            orders.Climb: self._require_place,
            orders.Fly: self._require_velocity,
            orders.ChangeSpeed: lambda order: self.check.require_speed(order.kind, order.speed),
            orders.SwitchMode: lambda order: self._require_mode(order.number),
            orders.FlyMission: self._require_start,
            orders.SetParameter: self._require_free,
            orders.ChangeMission: lambda _: None,  # it is checked before a vehicle flies it
            orders.ChangeRally: self._require_return,
            orders.ChangeFence: self._require_fence,
            orders.MoveHome: self._require_home,
        }

    @property
    def in_force(self) -> bool:
        """Whether there is an envelope for it, or other vehicles are to be kept away from."""
        return bool(self.check.spaces) or (self.traffic is not None and self.traffic.in_force)

    @property
    def ordered_at(self) -> float:
        """When the newest message went out that moves the vehicle (s); -inf for none."""
        return self.ordered.at

    @property
    def way(self) -> Sequence[PathPoint]:
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

    async def look_at_mission(
        self, items: Sequence[MissionItem], *, from_here: bool, starts: Sequence[int] = (1,)
    ) -> None:
        """Check a mission in a thread, so that `require_mission` is quick for it.

        Args:
            items: from item 1 on.
            from_here: whether it is about to be flown.
            starts: the items at which it may begin.

        Raises:
            OutsideEnvelope, Stale: as `require_mission`.
        """
        self.require_reach(_places(items))
        if self.in_force:
            question = self.check.question(items, from_here=from_here, starts=starts)
            self._looked_at = found = await asyncio.to_thread(answer, question)
            if from_here and self.traffic is not None:
                await self.traffic.look_at_route(self._vehicle, found.route)

    def require_mission(self, items: Sequence[MissionItem], *, from_here: bool, starts: Sequence[int] = (1,)) -> None:
        """Raise OutsideEnvelope unless the whole mission stays inside. With `from_here` it may then be flown.

        For a long mission call `look_at_mission` first.

        Raises:
            TooNear: from here it leads too near to another vehicle.
            Busy: it is long, and the vehicle was elsewhere when `look_at_mission` was called.
        """
        if not self.in_force:
            return
        question = self.check.question(items, from_here=from_here, starts=starts)
        flown = self._looked_at
        if flown is None or not _is_answered(question, flown.question):
            if len(items) > SHORT and flown is not None and flown.question.items == items:
                raise Busy("the vehicle or its envelope has changed while its mission was checked; try again")
            flown = answer(question)
        elif from_here and flown.route.legs:
            here, began = self.check.here(), flown.question.setting.start
            self.check.require_way([[here, leg.end] for leg in flown.route.legs if leg.begin == began])
        self.check.require_limits(flown)
        if from_here:
            self._require_apart_on(flown.route)
            self._checked_mission = flown, self._vehicle.clock()

    def starts(self, items: Sequence[MissionItem], mode: str) -> list[int]:
        """The items at which the autopilot may begin its mission when it is switched to that mode."""
        everywhere = list(range(1, len(items) + 1))
        if mode == "AUTO_RTL":
            return return_starts(items) or everywhere
        current = self._vehicle.state.newest("MISSION_CURRENT")
        restarts = self._vehicle.state.parameters.get("MIS_RESTART")
        if restarts == 1:
            return [1]
        if current is None or not 0 <= current.message.seq <= len(items):
            return everywhere
        is_over = current.message.mission_state == mavlink.MISSION_STATE_COMPLETE
        goes_on = 1 if is_over else max(current.message.seq, 1)
        selected, at = self._selected
        if current.at < at + SHOWN_WITHIN:
            goes_on = selected
        return [goes_on] if restarts == 0 else sorted({1, goes_on})

    def lands_now(self, landings: Mapping[int, tuple[float, float] | None] | None) -> bool:
        """Whether a vehicle in AUTO has come to the vertical part of a landing, or nobody knows.

        Args:
            landings: as `landing_places`; None where the mission is not known.
        """
        current = self._vehicle.state.field("MISSION_CURRENT", "seq")
        if landings is None or current is None:
            return True
        if current not in landings:
            return False
        place = landings[current]
        if place is None:
            return True
        try:
            here = self.check.here()
        except Stale:
            return True
        within = LANDS_WITHIN
        if self._vehicle.kind == "plane":
            within = math.inf if here.up < FLARES_BELOW else FLARES_WITHIN
        return math.hypot(*offset(here.lat, here.lon, *place)) <= within

    def sending(self, message: Any) -> Ordered:
        """Record a message just before it is sent, so that checks for other vehicles see it.

        Returns:
            The previous order.
        """
        before, order = self.ordered, orders.order_of(message)
        self.check.guided_radius.sent(message, self._vehicle.clock())
        if isinstance(order, orders.ChangeMission | orders.ChangeRally):  # a mission may return to a rally point
            self._checked_mission = None
        if isinstance(order, orders.FlyMission) and order.begin is not None:
            self._selected = max(order.begin, 1), self._vehicle.clock()
        if order is None or isinstance(order, STANDING):
            return before
        if self._checked_mission is not None and self._starts_mission(order):
            self.ordered = _mission_order(self._checked_mission[0].route, self._vehicle.clock())
            return before
        way: list[PathPoint] = []
        with contextlib.suppress(Stale):  # a message that needs no position, such as a stop, is sent
            way = self._way_by(order)
        self.ordered = Ordered(way, not isinstance(order, orders.Fly), self._vehicle.clock())
        return before

    def _way_by(self, order: orders.VehicleOrder) -> list[PathPoint]:
        """The way that an order leads along, as far as it is known. Raises Stale."""
        if self.in_force and isinstance(order, orders.GoTo | orders.Climb):
            return self._way_of(order)
        if self.in_force and isinstance(order, orders.Fly):
            return self._way_at(order)
        return []

    def remaining(self) -> Sequence[PathPoint]:
        """The corners of its way that are still ahead; empty if it has none. Call it at each position."""
        ordered = self.ordered
        way = ordered.way
        if len(way) < 2 or ordered.loops:
            return way
        try:
            here = self.check.here()
        except Stale:
            return way[ordered.passed + 1 :]
        frame, at = LocalFrame((here.lat, here.lon)), Spot(0.0, 0.0, here.up)
        while ordered.passed + 2 < len(way):
            corners = [frame.spot(stop[:2], stop.up) for stop in way[ordered.passed : ordered.passed + 3]]
            if not _is_past(at, corners):
                break
            ordered.passed += 1
        return way[ordered.passed + 1 :]

    def path_ahead(self) -> Path | None:
        """The legs of its mission that are still ahead, all of them with `loops`; None where it has none."""
        ordered = self.ordered
        if ordered.route is None or not ordered.route.legs:
            return None
        if not ordered.loops:
            self.remaining()
        return ordered.route.path.part(ordered.passed)

    def beside_way(self, stop: PathPoint) -> float:
        """Metres from a place to the way that was allowed last; infinite where there is none."""
        return self.ordered.beside(stop) if self.ordered.is_to_place else math.inf

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
        _require_reach(distance, "the target")

    def require_reach(self, places: Iterable[tuple[str, float, float]]) -> None:
        """Raise OutsideEnvelope if a place lies too far away for any vehicle, with or without an envelope.

        Args:
            places: what is there, latitude and longitude.
        """
        here = self._vehicle.state.position
        if here is None:
            return
        for what, lat, lon in places:
            _require_reach(math.hypot(*offset(*here.place, lat, lon)), what)

    def _require_order(self, order: orders.VehicleOrder) -> None:
        if isinstance(order, orders.Unknown):
            raise OutsideEnvelope(f"nobody can say whether {order.name} keeps the vehicle in the envelope")
        self._requirements[type(order)](order)

    def _require_start(self, order: orders.FlyMission) -> None:
        if order.begin is None or self._vehicle.state.armed is not False:
            self._require_checked_mission("AUTO", order.begin)

    def _require_free(self, order: orders.SetParameter) -> None:
        if order.name.upper().startswith(PROTECTED):
            raise OutsideEnvelope(f"{order.name} decides where the autopilot flies; an envelope is in force")

    def _require_return(self, order: orders.ChangeRally) -> None:
        if order.place is not None:
            point = PathPoint(order.place.lat, order.place.lon, 0.0 if self.check.drives else order.place.alt)
            self.check.require_way([[point, point]])

    def _require_fence(self, _order: orders.ChangeFence) -> None:
        if self._vehicle.state.armed is not False and not all(one.envelope.is_own for one in self.check.spaces):
            raise OutsideEnvelope("the autopilot's fence cannot be changed in flight: an envelope is in force")

    def _require_home(self, _order: orders.MoveHome) -> None:
        if self._vehicle.state.armed is not False and self.check.spaces:
            raise OutsideEnvelope("home cannot be moved in flight: the envelope is measured from it")

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
            self._require_checked_mission(mode)
        elif mode == "SMART_RTL" and self.traffic is not None and self.traffic.in_force:
            raise OutsideEnvelope("nobody knows on which way it returns in SMART_RTL; RTL is kept from the others")
        elif mode == "TAKEOFF" and self._vehicle.kind == "plane":
            return  # the verb has checked its height; the place where it levels off is watched
        elif self.check.spaces and mode not in KEPT.union(self._vehicle.holding_modes):
            raise OutsideEnvelope(f"in {mode} nobody keeps the vehicle in the envelope; a pilot may switch to it")

    def _require_checked_mission(self, mode: str, begin: int | None = None) -> None:
        """Raise OutsideEnvelope unless the stored mission was checked from the item on at which it begins."""
        if self._checked_mission is None:
            raise OutsideEnvelope(NOT_CHECKED)
        checked, at = self._checked_mission
        question = checked.question
        if question.spaces != tuple(self.check.spaces) or self._vehicle.clock() - at > CHECKED_FOR:
            raise OutsideEnvelope(NOT_CHECKED)
        starts = self.starts(question.items, mode) if begin is None else [max(begin, 1)]
        if not set(question.starts).issuperset(starts):
            self.require_mission(question.items, from_here=True, starts=starts)
        else:
            self._require_apart_on(checked.route)

    def _require_apart_on(self, route: MissionRoute) -> None:
        if self.traffic is not None and self.traffic.in_force and route.legs:
            self.traffic.require_route(self._vehicle, route)

    def _starts_mission(self, order: orders.VehicleOrder) -> bool:
        if isinstance(order, orders.SwitchMode):
            return flies_mission(mode_name(self._vehicle.state.vehicle_type, order.number))
        return isinstance(order, orders.FlyMission)

    def _require_apart(self, way: Sequence[PathPoint]) -> None:
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
            north, east = rotate(north, east, self._vehicle.attitude().yaw)
        return north, east, down

    def _way_at(self, order: orders.Fly) -> list[PathPoint]:
        """The way that is flown until the autopilot drops the setpoint, and until it stands."""
        north, east, down = self._velocity(order)
        if math.hypot(north, east, down) < 1e-3:
            return self._way_to_rest()
        parameters, drives = self._vehicle.state.parameters, self.check.drives
        stopping = braking.of_rover(parameters) if drives else braking.of_guided(parameters)
        timeout = parameters.get("GUID_TIMEOUT", 3.0)
        lasts = (timeout if not timeout < 0.1 else 0.1) + braking.LATENCY
        here = self.check.here()
        on = stopping.to_rest((north, east, 0.0 if drives else -down), lasts)
        if not all(map(math.isfinite, on)):
            raise OutsideEnvelope("nobody can say how far it flies: a number that the vehicle reported is none")
        return [here, PathPoint(*moved(here.lat, here.lon, on[0], on[1]), here.up + on[2])]

    def _way_to_rest(self) -> list[PathPoint]:
        """The way that it needs to stand, from the velocity that it has."""
        here, velocity = self.check.here(), self._vehicle.position().velocity
        stopping = braking.of_rover if self.check.drives else braking.of_guided
        north, east, down = velocity
        to_rest = stopping(self._vehicle.state.parameters).to_rest
        north, east, up = to_rest((north, east, 0.0 if self.check.drives else -down), braking.LATENCY)
        if not all(map(math.isfinite, (north, east, up))):
            return [here]
        return [here, PathPoint(*moved(here.lat, here.lon, north, east), here.up + up)]

    def _way_of(self, order: orders.GoTo | orders.Climb) -> list[PathPoint]:
        here = self.check.here()
        if isinstance(order, orders.Climb):
            return [here, here._replace(up=order.alt)]
        target = order.target
        if isinstance(target, NedTarget):
            local = self._vehicle.local_position()
            lat, lon = moved(here.lat, here.lon, target.x - local.north, target.y - local.east)
            up = here.up + local.down - target.z
        else:
            lat, lon, up = target.lat, target.lon, target.alt
        return [here, PathPoint(lat, lon, 0.0 if self.check.drives else up)]


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
                self._guard.ordered = before
            raise


def _require_reach(distance: float, what: str) -> None:
    if not distance <= REACH:
        sentence = f"{what} is {distance / 1000:.0f} km away; {REACH / 1000:g} km are the most"
        raise OutsideEnvelope(sentence, {"what": "the reach of any vehicle", "by": round(distance - REACH)})


def _places(items: Sequence[MissionItem]) -> Iterator[tuple[str, float, float]]:
    """The places that a mission may fly to."""
    for seq, item in enumerate(items, 1):
        if is_navigation(item.command) and item.has_location and (item.x or item.y):
            yield f"item {seq} of the mission ({item.name})", from_deg_e7(item.x), from_deg_e7(item.y)


def _is_answered(question: MissionQuestion, by: MissionQuestion) -> bool:
    """Whether an answer holds for a newer question: it was asked of the same mission, from about the same place."""
    same = question.items is by.items or list(question.items) == list(by.items)
    if not same or (question.starts, question.spaces) != (by.starts, by.spaces):
        return False
    here, there = question.setting.start, by.setting.start
    if here is None or there is None:
        return here is there
    near = math.hypot(*offset(here.lat, here.lon, there.lat, there.lon)) <= MOVED and abs(here.up - there.up) <= STAY
    settings = [replace(one.setting, start=None, heading=None) for one in (question, by)]
    return near and settings[0] == settings[1]


def _mission_order(route: MissionRoute, at: float) -> Ordered:
    legs = route.legs
    return Ordered([legs[0].begin, *(leg.end for leg in legs)] if legs else (), at=at, route=route)


def _is_past(at: Spot, corners: Sequence[Spot]) -> bool:
    """Whether a vehicle at `at` has passed the second of three corners."""
    a, b, c = corners
    return math.dist(at, b) < CORNER or to_leg(at, b, c) + CORNER < to_leg(at, a, b)


def _length(way: Sequence[PathPoint]) -> float:
    a, b = way[0], way[-1]
    return math.hypot(*offset(a.lat, a.lon, b.lat, b.lon), b.up - a.up)
