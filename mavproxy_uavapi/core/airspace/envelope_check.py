"""Checks the ways, missions, speeds and battery of one vehicle against its envelopes."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import cruise
from mavproxy_uavapi.core.airspace.forecast import Way
from mavproxy_uavapi.core.airspace.guided_radius import GuidedRadius
from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, rows
from mavproxy_uavapi.core.airspace.prisms import Rules
from mavproxy_uavapi.core.airspace.space import Breach, Space, outside_by
from mavproxy_uavapi.core.airspace.speeds import Speeds
from mavproxy_uavapi.core.errors import OutsideEnvelope, Stale
from mavproxy_uavapi.core.link import orders
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import Leg, MissionRoute, PathPoint, Setting
from mavproxy_uavapi.core.mission.mission_way import route as route_of
from mavproxy_uavapi.core.telemetry.readings import GlobalPosition, LocalPosition, VehicleAttitude
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

mavlink = mavutil.mavlink

NO_HOME = "the envelope limits the distance from home, and the vehicle has not reported its home yet"
Spaces = Callable[[], Sequence[Space]]
PLANE_RADIUS = 60.0  # m; used until WP_LOITER_RAD is known
LEVEL = 0.1  # m; a leg that leads up or down by less is level
LIMIT_OF = {"air": "speed", "ground": "speed", "climb": "climb", "descent": "descent"}


class Checked(Protocol):
    """What the check needs from its vehicle."""

    state: VehicleState
    clock: Callable[[], float]
    speeds: Speeds

    @property
    def kind(self) -> str:
        """`copter`, `plane`, `rover` or `other`."""

    @property
    def holding_modes(self) -> Collection[str]:
        """The modes in which it stays where it is."""

    @property
    def moving_modes(self) -> Collection[str]:
        """The modes in which it flies by a movement, or takes off, for us."""

    def position(self) -> GlobalPosition:
        """Where it is. Raises Stale."""

    def local_position(self) -> LocalPosition:
        """Where it is in the EKF's frame. Raises Stale."""

    def attitude(self) -> VehicleAttitude:
        """How it is turned. Raises Stale."""


@dataclass(frozen=True)
class MissionQuestion:
    """Whether a mission stays inside: its items, what it is flown with, where it may begin, and the envelopes."""

    items: Sequence[MissionItem]
    setting: Setting
    starts: tuple[int, ...]
    spaces: tuple[Space, ...]


@dataclass(frozen=True)
class MissionAnswer:
    """A mission that stays inside: its way, the s that it takes (infinite if nobody knows), its speeds by kind.

    It has no way where it moves nothing.
    """

    question: MissionQuestion
    way: Way | None
    seconds: float
    speeds: Sequence[tuple[str, float]]


class EnvelopeCheck:
    """The questions that the envelopes of a vehicle answer.

    Attributes:
        guided_radius: the radius that a DO_REPOSITION gave.
        rally: the rally points, to which it may return instead of home, as they were read last.

    Args:
        vehicle: which.
        spaces: gives the envelopes in force for it; it must be inside all of them.
    """

    def __init__(self, vehicle: Checked, spaces: Spaces) -> None:
        self.guided_radius = GuidedRadius()
        self.rally: Sequence[MissionItem] = ()
        self._vehicle = vehicle
        self._spaces = spaces

    @property
    def spaces(self) -> Sequence[Space]:
        """The envelopes in force."""
        return self._spaces()

    @property
    def drives(self) -> bool:
        """Whether it is a rover or boat, whose heights mean nothing: it is at 0 m."""
        return self._vehicle.kind == "rover"

    @property
    def circle(self) -> float:
        """The radius (m) of the circles that a plane flies where other types stand still; 0 for these."""
        own = self.own_circle
        return own and max(own, self.guided_radius.in_force(self._vehicle.state))

    @property
    def own_circle(self) -> float:
        """The plane's default circle radius (m): WP_LOITER_RAD."""
        if self._vehicle.kind != "plane":
            return 0.0
        return abs(self._vehicle.state.parameters.get("WP_LOITER_RAD", PLANE_RADIUS)) or PLANE_RADIUS

    def here(self) -> PathPoint:
        """Where the vehicle is.

        Raises:
            Stale: it does not report its position.
        """
        at = self._vehicle.position()
        return PathPoint(at.lat, at.lon, 0.0 if self.drives else at.alt)

    def rules(self, space: Space, near: PathPoint, inset: float, *, lands: bool = False) -> tuple[LocalFrame, Rules]:
        """The flat frame of an envelope, and its rules for this vehicle, `inset` m from its borders.

        For one that comes down to land no floor counts.

        Raises:
            Stale: the envelope is measured from home, and home is not known.
        """
        frame = space.frame((near.lat, near.lon))
        home = self.home()
        if home is None and space.envelope.limits.distance is not None:
            raise Stale(NO_HOME)
        return frame, space.rules(None if home is None else frame.metres(home), inset, self.drives or lands)

    # -- what raises --------------------------------------------------------------------------------------

    def require_way(
        self,
        ways: Iterable[Sequence[PathPoint]],
        *,
        may_return: bool = True,
        stays: bool = False,
        circle: float | None = None,
    ) -> None:
        """Raise OutsideEnvelope unless each way stays inside every envelope.

        Args:
            ways: each with its points in order.
            may_return: whether a way that begins outside may lead inside.
            stays: whether the vehicle only holds its place. Outside it may do so, but go no farther out.
            circle: the radius (m) that it keeps from the borders; None for its present circles.
        """
        ways = [list(way) for way in ways]
        for space in self.spaces if ways else ():
            if space.missing:
                raise OutsideEnvelope(space.missing)
            frame, rules = self.rules(space, ways[0][0], self.circle if circle is None else circle)
            for way in ways:
                spots = [frame.spot((stop.lat, stop.lon), stop.up) for stop in way]
                breach = space.breach(spots, rules, may_return=may_return)
                if breach is None or (stays and outside_by(spots[-1], rules) <= outside_by(spots[0], rules) + 1e-6):
                    continue
                raise _outside(breach, space, frame)
            self._require_reserve(
                space, lambda: cruise.seconds(self._vehicle, [stop for way in ways for stop in way])
            )

    def question(
        self, items: Sequence[MissionItem], *, from_here: bool, starts: Sequence[int] = (1,), apart: bool = False
    ) -> MissionQuestion:
        """What `answer` says of a mission. It takes seconds for thousands of items, and may be asked in a thread.

        Args:
            items: from item 1 on.
            from_here: whether it is about to be flown; else the way to its first place is not looked at.
            starts: the items at which it may begin.
            apart: whether it is kept from other vehicles, so that its heights matter in any case.

        Raises:
            Stale: the vehicle does not report its position, or its home, where they count.
        """
        vehicle = self._vehicle
        home = self.home()
        if home is None and any(space.envelope.limits.distance is not None for space in self.spaces):
            raise Stale(NO_HOME)
        fastest, slowest = cruise.mission_paces(vehicle)
        setting = Setting(
            kind=vehicle.kind,
            start=self.here() if from_here else None,
            home=home,
            home_amsl=self._home_amsl(),
            radius=self.own_circle,
            heights_matter=not self.drives and (apart or any(space.has_heights for space in self.spaces)),
            heading=self._heading() if from_here else None,
            fastest=fastest,
            slowest=slowest,
            parameters=dict(vehicle.state.parameters),
            has_rally=bool(self.rally),
        )
        return MissionQuestion(items, setting, tuple(starts), tuple(self.spaces))

    def require_limits(self, flown: MissionAnswer) -> None:
        """Raise OutsideEnvelope if a mission is too fast or lasts too long; its legs are inside."""
        advice = " in the mission; an item DO_CHANGE_SPEED before it makes it slower"
        for kind, speed in flown.speeds:
            self.require_speed(kind, speed, advice)
        for space in flown.question.spaces:
            self._require_reserve(space, lambda: flown.seconds)

    def require_speeds(self) -> None:
        """Raise OutsideEnvelope if it flies to places faster than the envelope allows."""
        for kind, speed in cruise.speeds(self._vehicle.kind, self._vehicle.state.parameters, self._vehicle.speeds):
            self.require_speed(kind, speed, f"; set_{kind}_speed first")

    def require_speed(self, kind: str, speed: float, advice: str = "") -> None:
        """Raise OutsideEnvelope if `speed` (m/s) exceeds the limit of its kind (air, ground, climb, descent)."""
        limit_of = LIMIT_OF[kind]
        for space in self.spaces:
            limit = getattr(space.envelope.limits, limit_of)
            if limit is not None and not speed <= limit + 0.005:
                sentence = (
                    f"{speed:g} m/s ({kind}) is faster than {space.envelope.source} allows, {limit:g} m/s{advice}"
                )
                raise OutsideEnvelope(sentence, _excess(f"the highest {limit_of}", speed - limit, space))

    def _require_reserve(self, space: Space, seconds_of: Callable[[], float]) -> None:
        """Raise OutsideEnvelope unless the battery lasts as long, with the reserve."""
        limits = space.envelope.limits
        if limits.reserve is None:
            return
        remaining = self._vehicle.state.field("SYS_STATUS", "battery_remaining")
        if remaining is None or remaining < 0:
            raise OutsideEnvelope(f"{space.envelope.source} keeps a reserve, and the battery reports no charge")
        seconds = seconds_of() if limits.endurance else 0.0
        if math.isinf(seconds):
            raise OutsideEnvelope(f"{space.envelope.source} keeps a reserve, and nobody can say how long it takes")
        needed = limits.reserve + (100.0 * seconds / limits.endurance if limits.endurance else 0.0)
        if not remaining >= needed:
            sentence = f"the battery has {remaining} %; the way, the way home and the reserve take {needed:.0f} %"
            raise OutsideEnvelope(sentence, _excess("the battery reserve", needed - remaining, space))

    # -- what a mission is checked against ----------------------------------------------------------------

    def home(self) -> tuple[float, float] | None:
        """Latitude and longitude of home; None where it is not known."""
        home = self._vehicle.state.home
        return None if home is None else home.place

    def _home_amsl(self) -> float | None:
        here = self._vehicle.state.position
        return None if here is None else here.home_msl

    def _heading(self) -> float | None:
        return self._vehicle.position().heading if self.own_circle else None


def answer(question: MissionQuestion) -> MissionAnswer:
    """The route of a mission, if all of it stays inside every envelope. It touches no vehicle.

    Raises:
        OutsideEnvelope: it does not, or nobody can say.
    """
    setting = question.setting
    route = route_of(question.items, setting, question.starts)
    groups: dict[tuple[float, bool], list[Leg]] = {}
    for leg in route.legs:
        if not leg.is_last:  # the vertical end of a landing is not held against an envelope
            groups.setdefault((max(leg.margin, setting.radius), leg.lands), []).append(leg)
    for space in question.spaces:
        if space.missing:
            raise OutsideEnvelope(space.missing)
        for (margin, lands), legs in groups.items():
            _require_inside(space, legs, margin, setting, lands)
    seconds = math.inf if route.loops else cruise.mission_seconds(setting.home, route.legs) if route.legs else 0.0
    return MissionAnswer(question, route.way(), seconds, _speeds(question.items, route, setting))


def _require_inside(space: Space, legs: Sequence[Leg], margin: float, setting: Setting, lands: bool) -> None:
    frame = space.frame(legs[0].begin[:2])
    home = None if setting.home is None else frame.metres(setting.home)
    rules = space.rules(home, margin, setting.kind == "rover" or lands)
    begins, ends = (frame.spots(rows(places)) for places in zip(*((leg.begin, leg.end) for leg in legs), strict=True))
    found = space.first_breach(begins, ends, rules)
    if found is not None:
        number, breach = found
        raise _outside(breach, space, frame, f"item {legs[number].seq} of the mission")


def _speeds(items: Sequence[MissionItem], route: MissionRoute, setting: Setting) -> list[tuple[str, float]]:
    """The speeds (m/s) by kind that a mission is flown at, and those that its items set."""
    speeds = {
        (orders.SPEED_KINDS.get(int(item.params[0]), "ground"), item.params[1])
        for item in items
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED and item.params[1] > 0
    }
    for leg in route.legs if setting.start is not None else ():
        up = 0.0 if setting.kind == "rover" or leg.is_last else leg.end.up - leg.begin.up
        if leg.begin[:2] != leg.end[:2]:
            speeds.add(("ground", leg.fastest.level))
        if abs(up) > LEVEL:
            speeds.add(("climb", leg.fastest.climb) if up > 0 else ("descent", leg.fastest.descent))
    return sorted(speeds)


def _excess(what: str, by: float, space: Space) -> dict[str, Any]:
    return {"what": what, "by": round(by, 2), "source": space.envelope.source}


def _outside(breach: Breach, space: Space, frame: LocalFrame, it: str = "it") -> OutsideEnvelope:
    if not all(map(math.isfinite, breach.at)):
        return OutsideEnvelope(f"{it} leads to a place that is no number", {"what": breach.what})
    lat, lon = frame.degrees(breach.at)
    at = {"lat": round(lat, 7), "long": round(lon, 7), "alt": round(breach.at.up, 2)}
    by = f" by {breach.by:.1f} m" if math.isfinite(breach.by) else ""
    where = f"{lat:.6f}, {lon:.6f}, {breach.at.up:.1f} m above home"
    sentence = f"{it} would break {breach.what} of {space.envelope.source}{by}, at {where}"
    return OutsideEnvelope(sentence, {**_excess(breach.what, breach.by, space), "at": at})
