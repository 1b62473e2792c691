"""Keeps the vehicles of one MAVProxy apart: no command leads nearer to another than the setting `separation`.

The way of each command is checked against where the others will be: on their allowed ways, at their speeds, with
slack; or where they stand, for as long as they stand. The asyncio thread only.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mavproxy_uavapi.core.airspace import braking, cruise
from mavproxy_uavapi.core.airspace.forecast import (
    Box,
    Forecast,
    NearMiss,
    Pace,
    Path,
    Slack,
    along_path,
    common_box,
    near_miss,
)
from mavproxy_uavapi.core.airspace.local_frame import LocalFrame
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Busy, Stale, Superseded, TooNear
from mavproxy_uavapi.core.geodesy import from_deg_e7, moved, offset
from mavproxy_uavapi.core.mission.item_legs import return_height
from mavproxy_uavapi.core.mission.item_places import polygon
from mavproxy_uavapi.core.mission.mission_legs import MissionRoute, PathPoint
from mavproxy_uavapi.core.shared_tasks import LONG
from mavproxy_uavapi.core.telemetry.flight_modes import LANDING_MODES, RETURN_MODES, flies_mission

Vector = tuple[float, float, float]
Way = tuple[Path, bool]  # degrees and m above sea level; whether each leg may be flown at any time
PLANNED = Slack(ahead=1.0, behind=4.0, share=0.15)
WATCHED = Slack(ahead=0.3, behind=0.5, share=0.1)
MARGIN = 1.0  # m more than the separation, for errors of the forecast
CERTAIN = 1.0  # s for which a vehicle that nobody commands through us keeps its velocity
LOOKED_AHEAD = 5.0  # s, likewise, before a command is sent
STOPPED = {"BRAKE", "HOLD"}
RETRY, LONGEST_WAIT = 0.5, 120.0  # s between two looks of a command that waits, and until it is refused
OLD = 3.0  # s; a vehicle with an older position may be anywhere on its way
CLEARED_FOR = 3.0  # s for which a mission that was compared in a thread is known to be free
SAME_MOMENT = 0.05  # s in which a question has the answer that it had
SAME_PLACE = 2.0  # m: a target so near is above or below the vehicle
SWING = 0.5  # m that momentum carries a vehicle off its way; less does not count


class Traffic:
    """Where the vehicles of one MAVProxy will be.

    Attributes:
        separation: m that they keep from each other; 0 keeps none.
        waits: whether a command that leads too near to another vehicle waits for its turn; else it is refused.

    Args:
        vehicles: gives all that were heard.
    """

    def __init__(self, vehicles: Callable[[], Iterable[Any]]) -> None:
        self.separation = 0.0
        self.waits = False
        self._vehicles = vehicles
        # By system id the last question whose way was found to be free, and when (s).
        self._free: dict[int, tuple[Any, float]] = {}
        # By system id the route that was found to be free, when (s), and what the others were ordered then.
        self._cleared: dict[int, tuple[MissionRoute, float, dict[int, Any]]] = {}

    @property
    def in_force(self) -> bool:
        """Whether vehicles are kept apart."""
        return self.separation > 0

    def require(self, vehicle: Any, way: Sequence[PathPoint]) -> None:
        """Raise unless a way (m above home) keeps away from all others, from now until it is flown.

        Raises:
            TooNear: it does not.
            Stale: the vehicle's position is not known.
        """
        if not self.in_force or not way:
            return
        others = self._others(vehicle)
        asked = list(way), _orders(others), [other.state.position for other in others]
        free, at = self._free.get(vehicle.state.system, (None, -math.inf))
        if free == asked and vehicle.clock() - at <= SAME_MOMENT:
            return  # the verb has asked, now the link does
        ours = _path(vehicle, _swung(vehicle, _to_amsl(vehicle, way))), False
        self._require_path(vehicle, ours, others)
        self._free[vehicle.state.system] = asked, vehicle.clock()

    async def look_at_route(self, vehicle: Any, route: MissionRoute) -> None:
        """As `require_route`, in a thread. What it finds holds for `require_route` for a while.

        Raises:
            TooNear, Stale: as `require`.
        """
        if not self.in_force or not route.legs:
            return
        others = self._others(vehicle)
        ours = route.path.raised(_home_amsl(vehicle)), route.loops
        theirs, orders = [(other, expected(other, LOOKED_AHEAD)) for other in others], _orders(others)
        found = await asyncio.to_thread(self._first_near_miss, ours, theirs, PLANNED)
        if found is not None:
            raise self._too_near(vehicle, *found, _frame_of(ours))
        self._cleared[vehicle.state.system] = route, vehicle.clock(), orders

    def require_route(self, vehicle: Any, route: MissionRoute) -> None:
        """As `require`, for a mission, from its beginning on. For a long one call `look_at_route` before.

        Raises:
            Busy: it is long, and another vehicle has begun a long way since `look_at_route`.
        """
        if not self.in_force or not route.legs:
            return
        others = self._others(vehicle)
        cleared, at, orders = self._cleared.get(vehicle.state.system, (None, -math.inf, {}))
        if cleared is route and vehicle.clock() - at <= CLEARED_FOR:
            others = [other for other in others if orders.get(other.state.system) != _order(other)]
        self._require_path(vehicle, (route.path.raised(_home_amsl(vehicle)), route.loops), others)

    def _require_path(self, vehicle: Any, ours: Way, others: Sequence[Any]) -> None:
        theirs = [(other, expected(other, LOOKED_AHEAD)) for other in others]
        if len(ours[0].begins) > LONG and any(len(way[0].begins) > LONG for _, way in theirs):
            raise Busy("the vehicles have other ways since the mission was compared with them; try again")
        found = self._first_near_miss(ours, theirs, PLANNED)
        if found is not None:
            raise self._too_near(vehicle, *found, _frame_of(ours))

    def nearing(self, vehicle: Any, seconds: float) -> tuple[Any, NearMiss] | None:
        """The vehicle that it will come too near to within that many s, and where; None if there is none."""
        if not self.in_force:
            return None
        others = [other for other in self._others(vehicle) if not self._apart_for(vehicle, other, seconds)]
        if not others:
            return None
        theirs = [(other, expected(other, CERTAIN, within=seconds)) for other in others]
        return self._first_near_miss(expected(vehicle, CERTAIN, within=seconds), theirs, WATCHED, seconds)

    async def in_turn(self, job: Job, verb: Callable[[Job], Awaitable[None]]) -> None:
        """Do `verb` for a job; with `waits` it begins when no other vehicle is in its way any more.

        Raises:
            TooNear: another vehicle is in its way, even after LONGEST_WAIT.
            Superseded: a newer command, or another ground station, took the vehicle meanwhile.
            ModeChanged: its pilot took it.
            Busy: another operator took it.
            TimedOut, LinkLost: no heartbeat shows whether the pilot took it.
        """
        vehicle = job.vehicle
        before, deadline = vehicle.authority.commander, vehicle.clock() + LONGEST_WAIT
        mode_since, was_foreign = vehicle.state.mode_since, vehicle.has_foreign_target
        while True:
            try:
                return await verb(job)
            except TooNear as error:
                if not self.waits or vehicle.authority.commander is job or vehicle.clock() > deadline:
                    raise
                job.progress = {"waits_for_vehicle": error.near["vehicle"]}
            await asyncio.sleep(RETRY)
            await vehicle.wait_for_heartbeat()
            if vehicle.authority.commander is not before:
                raise Superseded(f"{job.verb} was superseded by {vehicle.authority.commander.verb} while it waited")
            if vehicle.has_foreign_target and not was_foreign:
                raise Superseded(f"another ground station gave the vehicle a target while {job.verb} waited")
            vehicle.require_own_mode(mode_since)
            job.require_permit()

    @property
    def _kept(self) -> float:
        return self.separation + MARGIN

    # -- others -------------------------------------------------------------------------------------------

    def _others(self, vehicle: Any) -> list[Any]:
        """The vehicles that are in the air, or on their way there, and have reported a position."""
        return [other for other in self._vehicles() if other is not vehicle and _counts(other)]

    def _first_near_miss(
        self, ours: Way, others: Iterable[tuple[Any, Way]], slack: Slack, seconds: float = math.inf
    ) -> tuple[Any, NearMiss] | None:
        """The first of the others that comes too near on its way, and where."""
        frame = _frame_of(ours)
        mine = ours[0].in_frame(frame)
        for other, way in others:
            theirs = way[0].in_frame(frame)
            box = common_box(mine, theirs, self._kept)
            if box is None:
                continue
            forecast = self._forecast((theirs, way[1]), slack, seconds, box)
            if _age(other) > OLD:
                forecast = forecast.at_any_time()
            found = near_miss(self._forecast((mine, ours[1]), slack, seconds, box), forecast, self._kept)
            if found is not None:
                return other, found
        return None

    def _forecast(self, way: Way, slack: Slack, seconds: float, box: Box) -> Forecast:
        path, at_any_time = way
        if not at_any_time:
            return along_path(path, slack, self._kept, seconds=seconds, box=box)
        fastest = float(path.fastest.max()) * (1 + slack.share)
        return along_path(path, slack, self._kept, box=box).at_any_time().reached(fastest, seconds + slack.ahead)

    def _apart_for(self, vehicle: Any, other: Any, seconds: float) -> bool:
        """Whether two are too far apart to come near each other in that time; cheap."""
        a, b = _place(vehicle), _place(other)
        reach = sum(math.hypot(*_velocity(one)) + max(_fastest(one)) for one in (vehicle, other)) * seconds
        return math.hypot(*offset(a.lat, a.lon, b.lat, b.lon), a.up - b.up) > 2 * self.separation + reach

    def _too_near(self, vehicle: Any, other: Any, near_miss: NearMiss, frame: LocalFrame) -> TooNear:
        lat, lon = frame.degrees(near_miss.at)
        system, age = other.state.system, _age(other)
        when = f"in {near_miss.seconds:.0f} s" if age <= OLD else f"whose position is {age:.0f} s old"
        sentence = (
            f"it would come within {near_miss.gap:.1f} m of vehicle {system}, {when}; {self.separation:g} m are kept"
        )
        home = _home_amsl(vehicle)
        at = {"lat": round(lat, 7), "long": round(lon, 7), "alt": round(near_miss.at.up - home, 2)}
        return TooNear(sentence, {"vehicle": system, "in_s": round(near_miss.seconds, 1), "at": at})


def expected(vehicle: Any, seconds: float, *, within: float = math.inf) -> Way:
    """Where a vehicle goes from now on, with m above sea level; it stays at the end.

    Args:
        vehicle: which.
        seconds: how long it keeps its velocity, if nothing else is known.
        within: s; legs of a mission that begin later may be left out.
    """
    here = _place(vehicle)
    ours = vehicle.flies_for_us or vehicle.state.landed
    if flies_mission(vehicle.mode) and (ours or vehicle.obeys_us):
        ahead = vehicle.guard.path_ahead()
        if ahead is not None:
            return _mission_from(vehicle, here, ahead, within)
    return _path(vehicle, _expected_stops(vehicle, here, seconds)), False


def _expected_stops(vehicle: Any, here: PathPoint, seconds: float) -> list[PathPoint]:
    if vehicle.mode in LANDING_MODES:
        return [here, here._replace(up=_home_amsl(vehicle))]
    if vehicle.mode == "SMART_RTL":
        return [here, _shown_target(vehicle) or here]  # it comes back as it went, which only it knows
    if vehicle.mode in RETURN_MODES:
        return _way_home(vehicle, here)
    planned = vehicle.guard.remaining()
    if planned and (vehicle.flies_for_us or vehicle.state.landed):
        return _rounded(vehicle, _swung(vehicle, [here, *_to_amsl(vehicle, planned)]))
    velocity = _velocity(vehicle)
    if vehicle.mode in STOPPED or vehicle.mode in vehicle.holding_modes:
        way = braking.of(vehicle.kind, vehicle.state.parameters).to_rest(velocity, braking.LATENCY)
    else:
        kept, to_rest = [speed * seconds for speed in velocity], _gently_to_rest(vehicle, velocity)
        way = max((kept[0], kept[1], kept[2]), to_rest, key=lambda one: math.hypot(*one))
    north, east, up = way
    return [here, PathPoint(*moved(here.lat, here.lon, north, east), here.up + up)]


def _mission_from(vehicle: Any, here: PathPoint, ahead: Path, within: float) -> Way:
    """The legs of a mission that are ahead, the first from here; a plane circles at its end."""
    loops = vehicle.guard.ordered.loops
    legs = (ahead if loops else ahead.part(0, _soon(ahead, 2 * within))).raised(_home_amsl(vehicle))
    legs = _at_least_as_fast(legs, _velocity(vehicle))
    if loops:
        return _path(vehicle, [here]).then(legs), True
    turned = _swung(vehicle, [here, PathPoint(*legs.ends[0])])[1:-1]  # on its way there it turns first
    begins = Path.through([here, *turned, legs.ends[0]], Pace(*legs.fastest[0]))
    begins = replace(begins, slowest=np.repeat(legs.slowest[:1], len(begins.waits), axis=0))
    begins.waits[-1] = legs.waits[0]
    way, end = begins.then(legs.part(1)), PathPoint(*legs.ends[-1])
    circle = _rounded(vehicle, [end])
    return (way.then(_path(vehicle, circle)) if len(circle) > 1 else way), False


def _at_least_as_fast(legs: Path, velocity: Vector) -> Path:
    """The legs, at the speed over the ground that the vehicle has if that is higher: anybody may have changed it."""
    speed, fastest = math.hypot(*velocity[:2]), legs.fastest
    if fastest[:, 0].min(initial=speed) >= speed:
        return legs
    fastest = fastest.copy()
    fastest[:, 0] = np.maximum(fastest[:, 0], speed)
    return replace(legs, fastest=fastest)


def _soon(path: Path, seconds: float) -> int | None:
    """The number of legs until so many s are flown at the fastest, and one more; None for all."""
    if math.isinf(seconds):
        return None
    reach = seconds * float(np.linalg.norm(path.fastest, axis=1).max())
    for number, (begin, end) in enumerate(zip(path.begins, path.ends, strict=True), 1):
        reach -= math.hypot(*offset(*begin[:2], *end[:2]), end[2] - begin[2])
        if reach < 0:
            return number + 1
    return None


def _orders(vehicles: Iterable[Any]) -> dict[int, Any]:
    """By system id, what each was ordered last, and its mode."""
    return {vehicle.state.system: _order(vehicle) for vehicle in vehicles}


def _order(vehicle: Any) -> Any:
    return vehicle.guard.ordered, vehicle.mode


def _path(vehicle: Any, stops: Sequence[PathPoint]) -> Path:
    """The way from place to place, at the speeds at which it flies to them."""
    return Path.through(stops, cruise.pace(vehicle.kind, vehicle.state.parameters, vehicle.speeds))


def _frame_of(way: Way) -> LocalFrame:
    lat, lon, _ = map(float, way[0].begins[0])
    return LocalFrame((lat, lon))


def _swung(vehicle: Any, stops: list[PathPoint]) -> list[PathPoint]:
    """The path, with a first point where the vehicle comes to after it has braked its present velocity."""
    if vehicle.kind == "plane" or len(stops) < 2:
        return stops
    here, to = stops[:2]
    way = *offset(here.lat, here.lon, to.lat, to.lon), to.up - here.up
    velocity, length = _velocity(vehicle), max(math.hypot(*way), 0.1)
    forward = max(0.0, sum(speed * part for speed, part in zip(velocity, way, strict=True)) / length)
    across = [speed - forward * part / length for speed, part in zip(velocity, way, strict=True)]
    north, east, up = _gently_to_rest(vehicle, (across[0], across[1], across[2]))
    if math.hypot(north, east, up) < SWING:
        return stops
    return [here, PathPoint(*moved(here.lat, here.lon, north, east), here.up + up), *stops[1:]]


def _gently_to_rest(vehicle: Any, velocity: Vector) -> Vector:
    """Metres north, east, up that it needs to come to rest in GUIDED."""
    stopping = braking.of_rover if vehicle.kind == "rover" else braking.of_guided
    return stopping(vehicle.state.parameters).to_rest(velocity, 0.0)


def _rounded(vehicle: Any, stops: list[PathPoint]) -> list[PathPoint]:
    """The way, with the circle that a plane flies at its end."""
    radius, end = vehicle.guard.check.circle, stops[-1]
    if not radius:
        return stops
    return [*stops, *polygon(end, radius)]


def _way_home(vehicle: Any, here: PathPoint) -> list[PathPoint]:
    home, ground = vehicle.state.home, _home_amsl(vehicle)
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


def _counts(vehicle: Any) -> bool:
    """Whether it is in the air, or on its way there."""
    state = vehicle.state
    if state.position is None or state.armed is False:
        return False
    if vehicle.kind == "rover" or not state.landed:
        return True
    return bool(vehicle.guard.remaining()) or flies_mission(vehicle.mode)


def _place(vehicle: Any) -> PathPoint:
    at = vehicle.state.position
    return PathPoint(at.lat, at.lon, at.msl)


def _velocity(vehicle: Any) -> Vector:
    """m/s north, east, up."""
    north, east, down = vehicle.state.position.velocity
    return north, east, -down


def _home_amsl(vehicle: Any) -> float:
    position = vehicle.state.position
    if position is None:
        raise Stale(f"vehicle {vehicle.state.system} does not report its position (GLOBAL_POSITION_INT)")
    return float(position.home_msl)


def _to_amsl(vehicle: Any, way: Sequence[PathPoint]) -> list[PathPoint]:
    home = _home_amsl(vehicle)
    return [stop._replace(up=stop.up + home) for stop in way]


def _age(vehicle: Any) -> float:
    age = vehicle.state.age("GLOBAL_POSITION_INT", vehicle.clock())
    return math.inf if age is None else float(age)


def _fastest(vehicle: Any) -> Pace:
    return cruise.mission_paces(vehicle)[0]
