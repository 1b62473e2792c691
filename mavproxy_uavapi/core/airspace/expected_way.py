"""Where a vehicle of one MAVProxy goes from now on, as far as its orders, its mode and its velocity tell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mavproxy_uavapi.core.airspace import braking, cruise
from mavproxy_uavapi.core.airspace.forecast import Pace, Path
from mavproxy_uavapi.core.errors import Stale
from mavproxy_uavapi.core.geodesy import from_deg_e7, moved, offset
from mavproxy_uavapi.core.mission.item_legs import return_height
from mavproxy_uavapi.core.mission.item_places import polygon
from mavproxy_uavapi.core.mission.mission_legs import PathPoint
from mavproxy_uavapi.core.telemetry.flight_modes import LANDING_MODES, RETURN_MODES, flies_mission

Vector = tuple[float, float, float]
Way = tuple[Path, bool]  # degrees and m above sea level; whether each leg may be flown at any time
STOPPED = {"BRAKE", "HOLD"}
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
    ours = vehicle.flies_for_us or vehicle.state.landed
    if flies_mission(vehicle.mode) and (ours or vehicle.obeys_us):
        ahead = vehicle.guard.path_ahead()
        if ahead is not None:
            return _mission_from(vehicle, here, ahead, within)
    return path_of(vehicle, _expected_stops(vehicle, here, seconds)), False


def _expected_stops(vehicle: Any, here: PathPoint, seconds: float) -> list[PathPoint]:
    if vehicle.mode in LANDING_MODES:
        return [here, here._replace(up=home_amsl(vehicle))]
    if vehicle.mode == "SMART_RTL":
        return [here, _shown_target(vehicle) or here]  # it comes back as it went, which only it knows
    if vehicle.mode in RETURN_MODES:
        return _way_home(vehicle, here)
    planned = vehicle.guard.remaining()
    if planned and (vehicle.flies_for_us or vehicle.state.landed):
        return _rounded(vehicle, swung(vehicle, [here, *to_amsl(vehicle, planned)]))
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
    if loops:
        return path_of(vehicle, [here]).then(legs), True
    turned = swung(vehicle, [here, PathPoint(*legs.ends[0])])[1:-1]  # on its way there it turns first
    begins = Path.through([here, *turned, legs.ends[0]], Pace(*legs.fastest[0]))
    begins = replace(begins, slowest=np.repeat(legs.slowest[:1], len(begins.waits), axis=0))
    begins.waits[-1] = legs.waits[0]
    way, end = begins.then(legs.part(1)), PathPoint(*legs.ends[-1])
    circle = _rounded(vehicle, [end])
    return (way.then(path_of(vehicle, circle)) if len(circle) > 1 else way), False


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


def path_of(vehicle: Any, stops: Sequence[PathPoint]) -> Path:
    """The way from place to place, at the speeds at which it flies to them."""
    return Path.through(stops, cruise.pace(vehicle.kind, vehicle.state.parameters, vehicle.speeds))


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


def _rounded(vehicle: Any, stops: list[PathPoint]) -> list[PathPoint]:
    """The way, with the circle that a plane flies at its end."""
    radius, end = vehicle.guard.check.circle, stops[-1]
    if not radius:
        return stops
    return [*stops, *polygon(end, radius)]


def _way_home(vehicle: Any, here: PathPoint) -> list[PathPoint]:
    home, ground = vehicle.state.home, home_amsl(vehicle)
    shown = _shown_target(vehicle)
    if shown is not None and math.hypot(*offset(here.lat, here.lon, shown.lat, shown.lon)) > SAME_PLACE:
        return [here, shown, shown._replace(up=ground)]  # a rally point, or home
    if home is None:
        return [here]
    up = ground + return_height(vehicle.state.parameters, here._replace(up=here.up - ground), home.place)
    above = PathPoint(home.lat, home.lon, up)
    return [here, here._replace(up=up), above, above._replace(up=ground)]


def _shown_target(vehicle: Any) -> PathPoint | None:
    """The place to which a copter reports that it returns, with m above sea level; None where it does not tell."""
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
