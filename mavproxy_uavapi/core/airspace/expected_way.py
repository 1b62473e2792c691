"""Where a vehicle of one MAVProxy goes from now on, as far as its orders, its mode and its velocity tell."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import braking, cruise
from mavproxy_uavapi.core.airspace.forecast import Pace, Path, Way
from mavproxy_uavapi.core.errors import Stale
from mavproxy_uavapi.core.geodesy import from_deg_e7, moved, offset
from mavproxy_uavapi.core.mission.leg_drawing import AMSL
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import PathPoint
from mavproxy_uavapi.core.mission.plane_turns import TURNED, WIDER, carried_beside, turning_radius
from mavproxy_uavapi.core.mission.returns import return_height, return_height_of_plane, return_pace
from mavproxy_uavapi.core.telemetry.flight_modes import LANDING_MODES, RETURN_MODES, flies_mission

mavlink = mavutil.mavlink

Vector = tuple[float, float, float]
STOPPED = {"BRAKE", "HOLD"}
EITHER_WAY = math.radians(150.0)  # from so much on nobody knows to which side a plane turns about
ON_CIRCLE, ALONG_CIRCLE = 0.3, math.radians(40.0)  # of the radius, and of the course, that a plane is off its circle
SLOWEST = 1.0  # m/s; slower than this a plane does not fly
STANDS = 0.5  # m/s; a vehicle on a mission that is slower may be waiting
SAME_PLACE = 2.0  # m: a target so near is above or below the vehicle
SWING = 0.5  # m that momentum carries a vehicle off its way; less does not count


def expected(vehicle: Any, seconds: float, *, within: float = math.inf) -> Way:
    """Where a vehicle goes from now on, with m above sea level; it stays at the end.

    Args:
        vehicle: which.
        seconds: how long it keeps its velocity, if nothing else is known.
        within: s; legs of a mission that begin later may be left out.
    """
    here = position_of(vehicle)
    ours = (vehicle.flies_for_us or vehicle.state.landed) and vehicle.mode not in LANDING_MODES
    if not RETURN_MODES.isdisjoint((vehicle.mode, vehicle.next_mode)):
        paths = [path_of(vehicle, way, pace=_pace_home(vehicle)) for way in _ways_home(vehicle, here)]
        return functools.reduce(Path.then, paths), len(paths) > 1
    ahead = vehicle.guard.path_ahead()
    if ahead is not None and (ours or (flies_mission(vehicle.mode) and vehicle.obeys_us)):
        return _mission_from(vehicle, here, ahead, within)
    if vehicle.mode in vehicle.holding_modes and vehicle.circles:  # around a place that nobody knows
        return path_of(vehicle, [here], circles=2.0), False
    planned = vehicle.guard.remaining()
    if planned and ours:
        return path_of(vehicle, swung(vehicle, [here, *to_amsl(vehicle, planned)])), False
    return path_of(vehicle, _expected_stops(vehicle, here, seconds), circles=0.0), False


def _expected_stops(vehicle: Any, here: PathPoint, seconds: float) -> list[PathPoint]:
    """The way of a vehicle that lands, stops, or of which its velocity is all that is known."""
    if vehicle.mode in LANDING_MODES:
        return [here, here._replace(up=home_amsl(vehicle))]
    velocity = velocity_of(vehicle)
    if vehicle.mode in STOPPED or vehicle.mode in vehicle.holding_modes:
        way = braking.of(vehicle.kind, vehicle.state.parameters).to_rest(velocity, braking.LATENCY)
    else:
        kept, to_rest = [speed * seconds for speed in velocity], _gently_to_rest(vehicle, velocity)
        way = max((kept[0], kept[1], kept[2]), to_rest, key=lambda one: math.hypot(*one))
    north, east, up = way
    return [here, PathPoint(*moved(here.lat, here.lon, north, east), here.up + up)]


def _mission_from(vehicle: Any, here: PathPoint, ahead: Path, within: float) -> Way:
    """The legs of a mission that are ahead, the first from here; a plane circles at its end."""
    loops, reach = vehicle.guard.ordered.loops, 2 * within * vehicle.guard.ordered.fastest
    legs = (ahead if loops else ahead.part(0, _soon(ahead, reach))).raised(home_amsl(vehicle))
    legs = _at_least_as_fast(legs, velocity_of(vehicle))
    if loops or legs.circles[0]:
        way = path_of(vehicle, [here], circles=0.0).then(legs)
        return (way, True) if loops else (_circled(vehicle, way), False)
    swing = swung(vehicle, [here, PathPoint(*legs.ends[0])])[1:-1]  # on its way there it turns first
    waits = [here] if _waits(vehicle) else []
    begins = Path.through([here, *waits, *swing, legs.ends[0]], Pace(*legs.fastest[0]))
    begins = replace(begins, slowest=np.repeat(legs.slowest[:1], len(begins.waits), axis=0))
    begins.waits[: len(waits)] = math.inf  # nobody knows how long
    begins.waits[-1], begins.margins[-1] = legs.waits[0], legs.margins[0]
    return _circled(vehicle, _turned(vehicle, begins).then(legs.part(1))), False


def _waits(vehicle: Any) -> bool:
    """Whether it stands in its mission: paused, or at a place where it waits."""
    paused = vehicle.state.field("MISSION_CURRENT", "mission_state") == mavlink.MISSION_STATE_PAUSED
    stands = math.hypot(*velocity_of(vehicle)) < STANDS
    return stands and (paused or vehicle.guard.ordered.has_come_to_wait)


def _at_least_as_fast(legs: Path, velocity: Vector) -> Path:
    """The legs, at the speed over the ground that the vehicle has if that is higher: anybody may have changed it."""
    speed, fastest = math.hypot(*velocity[:2]), legs.fastest
    if fastest[:, 0].min(initial=speed) >= speed:
        return legs
    fastest = fastest.copy()
    fastest[:, 0] = np.maximum(fastest[:, 0], speed)
    return replace(legs, fastest=fastest)


def _soon(path: Path, reach: float) -> int | None:
    """The number of legs until so many m are flown, and one more; None for all."""
    if math.isinf(reach):
        return None
    for number, (begin, end) in enumerate(zip(path.begins, path.ends, strict=True), 1):
        reach -= math.hypot(*offset(*begin[:2], *end[:2]), end[2] - begin[2])
        if reach < 0:
            return number + 1
    return None


def path_of(vehicle: Any, stops: Sequence[PathPoint], circles: float = 1.0, pace: Pace | None = None) -> Path:
    """The way from place to place, at `pace`, or at the speeds at which it flies to them.

    At its end a plane circles: it may be so many of its radii beside.
    """
    path = Path.through(stops, pace or cruise.pace(vehicle.kind, vehicle.state.parameters, vehicle.speeds))
    return _circled(vehicle, _turned(vehicle, path), circles)


def _turned(vehicle: Any, path: Path) -> Path:
    """The path of a plane, which is beside its first leg because it turns into it; it begins where the plane is."""
    north, east, _ = velocity_of(vehicle)
    speed = math.hypot(north, east)
    if not vehicle.guard.check.circle or speed < SLOWEST:
        return path
    begin, end = path.begins[0], path.ends[0]
    way = offset(*begin[:2], *end[:2])
    length = math.hypot(*way)
    ahead, course = math.atan2(way[1], way[0]), math.atan2(east, north)
    turn = math.remainder(course - ahead, math.tau) if length > 0 else math.pi
    is_at_circle = abs(length / vehicle.guard.check.circle - 1) < ON_CIRCLE
    if len(path.begins) == 1 and is_at_circle and abs(abs(turn) - math.pi / 2) < ALONG_CIRCLE:
        return path  # it circles there already
    radius = turning_radius(speed, vehicle.state.parameters)
    margin = carried_beside(turn, radius)
    first, share = path.part(0, 1), min(TURNED * radius / max(length, 1.0), 1.0)
    middle = begin + share * (end - begin)
    if abs(turn) < EITHER_WAY:  # on the side to which it flies
        margin /= 2
        side = ahead + math.copysign(math.pi / 2, turn)
        lat, lon = moved(float(begin[0]), float(begin[1]), margin * math.cos(side), margin * math.sin(side))
        aside = np.array([lat - begin[0], lon - begin[1], 0.0])
    else:
        aside = np.zeros(3)
    none = np.zeros(1)
    here = replace(first, ends=np.array([begin + aside]), waits=none, margins=none)
    turning = replace(first, begins=here.ends, ends=np.array([middle + aside]), waits=none, margins=none + margin)
    on_it = replace(first, begins=np.array([middle]))
    return here.then(turning).then(on_it).then(path.part(1))


def _circled(vehicle: Any, path: Path, circles: float = 1.0) -> Path:
    """The path, with the circle that a plane flies around its end: it may be anywhere in it."""
    radius = circles * WIDER * vehicle.guard.check.circle
    if not radius:
        return path
    end = replace(path.part(-1), begins=path.ends[-1:], waits=np.zeros(1), margins=np.array([radius]))
    return path.then(end)


def swung(vehicle: Any, stops: list[PathPoint]) -> list[PathPoint]:
    """The path, with a first point where the vehicle comes to after it has braked its present velocity."""
    if vehicle.guard.check.circle or len(stops) < 2:
        return stops
    here, to = stops[:2]
    way = *offset(here.lat, here.lon, to.lat, to.lon), to.up - here.up
    velocity, length = velocity_of(vehicle), max(math.hypot(*way), 0.1)
    forward = max(0.0, sum(speed * part for speed, part in zip(velocity, way, strict=True)) / length)
    across = [speed - forward * part / length for speed, part in zip(velocity, way, strict=True)]
    north, east, up = _gently_to_rest(vehicle, (across[0], across[1], across[2]))
    if math.hypot(north, east, up) < SWING:
        return stops
    return [here, PathPoint(*moved(here.lat, here.lon, north, east), here.up + up), *stops[1:]]


def _gently_to_rest(vehicle: Any, velocity: Vector) -> Vector:
    """Metres north, east, up that it needs to come to rest in GUIDED."""
    stopping = braking.of_rover if vehicle.guard.check.drives else braking.of_guided
    return stopping(vehicle.state.parameters).to_rest(velocity, 0.0)


def _pace_home(vehicle: Any) -> Pace:
    own = cruise.pace(vehicle.kind, vehicle.state.parameters, vehicle.speeds)
    return return_pace(vehicle.kind, vehicle.state.parameters, own)


def _ways_home(vehicle: Any, here: PathPoint) -> list[list[PathPoint]]:
    """The ways on one of which it returns: it decides between home and the nearest rally point."""
    home, ground = vehicle.state.home, home_amsl(vehicle)
    shown = _shown_target(vehicle)
    if vehicle.mode == "SMART_RTL":
        return [[here, shown or here]]  # it comes back as it went, which only it knows
    climbs = shown is not None and math.hypot(*offset(here.lat, here.lon, shown.lat, shown.lon)) <= SAME_PLACE
    if shown is not None and (vehicle.circles or not climbs):  # a rally point, or home
        return [[here, shown] if vehicle.circles else [here, shown, shown._replace(up=ground)]]
    places = [] if home is None else [PathPoint(home.lat, home.lon, ground)]
    points = [_rally_point(vehicle, item) for item in vehicle.guard.check.rally]
    places += sorted(points, key=lambda point: math.hypot(*offset(here.lat, here.lon, *point[:2])))[:1]
    return [_way_to(vehicle, here, place, shown) for place in places] or [[here]]


def _way_to(vehicle: Any, here: PathPoint, place: PathPoint, shown: PathPoint | None) -> list[PathPoint]:
    """The way of a return to a place; `shown` is where it climbs to before it flies there."""
    parameters, ground = vehicle.state.parameters, home_amsl(vehicle)
    if vehicle.circles:
        own = ground + return_height_of_plane(parameters, here.up - ground)
        return [here, place if place.up > ground else place._replace(up=own)]
    up = ground + return_height(parameters, here._replace(up=here.up - ground), place[:2])
    above = place._replace(up=max(up, place.up) if shown is None else shown.up)
    return [here, here._replace(up=above.up), above, above._replace(up=ground)]


def _rally_point(vehicle: Any, item: MissionItem) -> PathPoint:
    up = item.z + (0.0 if item.frame in AMSL else home_amsl(vehicle))
    return PathPoint(from_deg_e7(item.x), from_deg_e7(item.y), up)


def _shown_target(vehicle: Any) -> PathPoint | None:
    """The place to which a vehicle reports that it returns, with m above sea level; None where it does not tell."""
    received = vehicle.state.newest("POSITION_TARGET_GLOBAL_INT")
    if received is None or vehicle.mode not in ("RTL", "SMART_RTL") or received.at < vehicle.state.mode_since:
        return None
    if not vehicle.state.is_recent(received):
        return None
    target = received.message
    return PathPoint(from_deg_e7(target.lat_int), from_deg_e7(target.lon_int), target.alt)


def position_of(vehicle: Any) -> PathPoint:
    at = vehicle.state.position
    return PathPoint(at.lat, at.lon, at.msl)


def velocity_of(vehicle: Any) -> Vector:
    """m/s north, east, up."""
    north, east, down = vehicle.state.position.velocity
    return north, east, -down


def home_amsl(vehicle: Any) -> float:
    position = vehicle.state.position
    if position is None:
        raise Stale(f"vehicle {vehicle.state.system} does not report its position (GLOBAL_POSITION_INT)")
    return float(position.home_msl)


def to_amsl(vehicle: Any, way: Sequence[PathPoint]) -> list[PathPoint]:
    home = home_amsl(vehicle)
    return [stop._replace(up=stop.up + home) for stop in way]
