"""Keeps the vehicles of one MAVProxy apart: no command leads nearer to another than the setting `separation`.

The way of each command is checked against where the others will be: on their allowed ways, at their speeds, with
slack; or where they stand, for as long as they stand. The asyncio thread only.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Iterable, Sequence
from typing import Any

from mavproxy_uavapi.core.envelope import braking
from mavproxy_uavapi.core.envelope.forecast import Forecast, Hop, Meeting, Pace, Slack, along_hops, meeting
from mavproxy_uavapi.core.envelope.space import LocalFrame
from mavproxy_uavapi.core.errors import Stale, Superseded, TooNear
from mavproxy_uavapi.core.geodesy import moved, offset
from mavproxy_uavapi.core.mavlink.flight_modes import LANDING_MODES, RETURN_MODES, flies_mission
from mavproxy_uavapi.core.vehicle import cruise
from mavproxy_uavapi.core.vehicle.jobs import Job
from mavproxy_uavapi.core.vehicle.mission_way import Leg, MissionRoute, Stop, polygon, return_height

Vector = tuple[float, float, float]
Way = tuple[list[Leg], bool]  # legs with m above sea level, and whether each may be flown at any time
PLANNED = Slack(ahead=1.0, behind=4.0, share=0.15)
WATCHED = Slack(ahead=0.3, behind=0.5, share=0.1)
MARGIN = 1.0  # m more than the separation, for errors of the forecast
CERTAIN = 1.0  # s for which a vehicle that nobody commands through us keeps its velocity
LOOKED_AHEAD = 5.0  # s, likewise, before a command is sent
STOPPED = {"BRAKE", "HOLD"}
RETRY, LONGEST_WAIT = 0.5, 120.0  # s between two looks of a command that waits, and until it is refused
OLD = 3.0  # s; a vehicle with an older position may be anywhere on its way
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

    @property
    def in_force(self) -> bool:
        """Whether vehicles are kept apart."""
        return self.separation > 0

    def require(self, vehicle: Any, way: Sequence[Stop]) -> None:
        """Raise unless a way (m above home) keeps away from all others, from now until it is flown.

        Raises:
            TooNear: it does not.
            Stale: the vehicle's position is not known.
        """
        if not self.in_force or not way:
            return
        self._require_legs(vehicle, _legs(vehicle, _swung(vehicle, _to_amsl(vehicle, way))), at_any_time=False)

    def require_route(self, vehicle: Any, route: MissionRoute) -> None:
        """As `require`, for a mission, from its beginning on."""
        if self.in_force and route.legs:
            self._require_legs(vehicle, _legs_to_amsl(vehicle, route.legs), at_any_time=route.loops)

    def _require_legs(self, vehicle: Any, ours: list[Leg], *, at_any_time: bool) -> None:
        for other in self._others(vehicle):
            meeting = self._meeting(vehicle, (ours, at_any_time), other, PLANNED, math.inf)
            if meeting is not None:
                raise self._too_near(vehicle, other, meeting, ours[0].begin)

    def nearing(self, vehicle: Any, seconds: float) -> tuple[Any, Meeting] | None:
        """The vehicle that it will come too near to within that many s, and where; None if there is none."""
        if not self.in_force:
            return None
        for other in self._others(vehicle):
            if self._apart_for(vehicle, other, seconds):
                continue
            meeting = self._meeting(vehicle, expected(vehicle, CERTAIN, within=seconds), other, WATCHED, seconds)
            if meeting is not None:
                return other, meeting
        return None

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
            await vehicle.hear_again()
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

    def _meeting(self, vehicle: Any, ours: Way, other: Any, slack: Slack, seconds: float) -> Meeting | None:
        begin = ours[0][0].begin
        frame = LocalFrame((begin.lat, begin.lon))
        planned = slack is PLANNED
        others = expected(other, LOOKED_AHEAD if planned else CERTAIN, within=seconds)
        theirs = self._forecast(frame, others, slack, seconds)
        if _age(other) > OLD:
            theirs = theirs.at_any_time()
        return meeting(self._forecast(frame, ours, slack, seconds), theirs, self._kept)

    def _forecast(self, frame: LocalFrame, way: Way, slack: Slack, seconds: float) -> Forecast:
        legs, at_any_time = way
        hops = [
            Hop(frame.spot(leg.begin[:2], leg.begin.up), frame.spot(leg.end[:2], leg.end.up), *leg[3:5], leg.waits)
            for leg in legs
        ]
        if not at_any_time:
            return along_hops(hops, slack, self._kept, seconds=seconds)
        fastest = max(max(hop.fastest) for hop in hops) * (1 + slack.share)
        return along_hops(hops, slack, self._kept).at_any_time().reached(fastest, seconds + slack.ahead)

    def _apart_for(self, vehicle: Any, other: Any, seconds: float) -> bool:
        """Whether two are too far apart to come near each other in that time; cheap."""
        a, b = _place(vehicle), _place(other)
        reach = sum(math.hypot(*_velocity(one)) + max(_fastest(one)) for one in (vehicle, other)) * seconds
        return math.hypot(*offset(a.lat, a.lon, b.lat, b.lon), a.up - b.up) > 2 * self.separation + reach

    def _too_near(self, vehicle: Any, other: Any, meeting: Meeting, here: Stop) -> TooNear:
        lat, lon = LocalFrame((here.lat, here.lon)).degrees(meeting.at)
        system, age = other.state.system, _age(other)
        when = f"in {meeting.seconds:.0f} s" if age <= OLD else f"whose position is {age:.0f} s old"
        sentence = (
            f"it would come within {meeting.gap:.1f} m of vehicle {system}, {when}; {self.separation:g} m are kept"
        )
        home = _home_amsl(vehicle)
        at = {"lat": round(lat, 7), "long": round(lon, 7), "alt": round(meeting.at.up - home, 2)}
        return TooNear(sentence, {"vehicle": system, "in_s": round(meeting.seconds, 1), "at": at})


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
        ahead = vehicle.guard.legs_ahead()
        if ahead:
            return _mission_from(vehicle, here, ahead, within)
    return _legs(vehicle, _expected_stops(vehicle, here, seconds)), False


def _expected_stops(vehicle: Any, here: Stop, seconds: float) -> list[Stop]:
    if vehicle.mode in LANDING_MODES:
        return [here, here._replace(up=_home_amsl(vehicle))]
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
    return [here, Stop(*moved(here.lat, here.lon, north, east), here.up + up)]


def _mission_from(vehicle: Any, here: Stop, ahead: Sequence[Leg], within: float) -> Way:
    """The legs of a mission that are ahead, the first from here; a plane circles at its end."""
    loops = vehicle.guard.ordered.loops
    legs = _legs_to_amsl(vehicle, ahead if loops else _soon(ahead, 2 * within))
    if loops:
        return [legs[0]._replace(begin=here, end=here), *legs], True
    first = legs[0]
    stops = _swung(vehicle, [here, first.end])
    begins = [first._replace(begin=a, end=b, waits=0.0) for a, b in zip(stops, stops[1:], strict=False)]
    begins[-1] = begins[-1]._replace(waits=first.waits)
    end = _rounded(vehicle, [legs[-1].end])
    return [*begins, *legs[1:], *_legs(vehicle, end)[: len(end) - 1]], False


def _soon(legs: Sequence[Leg], seconds: float) -> Sequence[Leg]:
    """The first legs, until so many s are flown at the fastest, and one more."""
    if math.isinf(seconds):
        return legs
    left = seconds
    for number, (a, b, _, fastest, *_) in enumerate(legs, 1):
        left -= math.hypot(*offset(a.lat, a.lon, b.lat, b.lon), b.up - a.up) / math.hypot(*fastest)
        if left < 0:
            return legs[: number + 1]
    return legs


def _legs(vehicle: Any, stops: Sequence[Stop]) -> list[Leg]:
    """The legs between places, at the speeds at which it flies to them; a single place is one, too."""
    pace = cruise.pace(vehicle.kind, vehicle.state.parameters, vehicle.speeds)
    pairs = list(zip(stops, stops[1:], strict=False)) or [(stops[0], stops[0])]
    return [Leg(a, b, 0, pace, pace) for a, b in pairs]


def _legs_to_amsl(vehicle: Any, legs: Sequence[Leg]) -> list[Leg]:
    home = _home_amsl(vehicle)
    return [
        leg._replace(begin=leg.begin._replace(up=leg.begin.up + home), end=leg.end._replace(up=leg.end.up + home))
        for leg in legs
    ]


def _swung(vehicle: Any, stops: list[Stop]) -> list[Stop]:
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
    return [here, Stop(*moved(here.lat, here.lon, north, east), here.up + up), *stops[1:]]


def _gently_to_rest(vehicle: Any, velocity: Vector) -> Vector:
    """Metres north, east, up that it needs to come to rest in GUIDED."""
    stopping = braking.of_rover if vehicle.kind == "rover" else braking.of_guided
    return stopping(vehicle.state.parameters).to_rest(velocity, 0.0)


def _rounded(vehicle: Any, stops: list[Stop]) -> list[Stop]:
    """The way, with the circle that a plane flies at its end."""
    radius, end = vehicle.guard.check.circle, stops[-1]
    if not radius:
        return stops
    return [*stops, *polygon(end, radius)]


def _way_home(vehicle: Any, here: Stop) -> list[Stop]:
    home = vehicle.state.messages.get("HOME_POSITION")
    if home is None:
        return [here]
    ground = _home_amsl(vehicle)
    at = home.message.latitude / 1e7, home.message.longitude / 1e7
    up = ground + return_height(vehicle.state.parameters, here._replace(up=here.up - ground), at)
    above = Stop(*at, up)
    return [here, here._replace(up=up), above, above._replace(up=ground)]


def _counts(vehicle: Any) -> bool:
    """Whether it is in the air, or on its way there."""
    state = vehicle.state
    if "GLOBAL_POSITION_INT" not in state.messages or state.armed is False:
        return False
    if vehicle.kind == "rover" or not state.landed:
        return True
    return bool(vehicle.guard.remaining()) or flies_mission(vehicle.mode)


def _place(vehicle: Any) -> Stop:
    at = vehicle.state.messages["GLOBAL_POSITION_INT"].message
    return Stop(at.lat / 1e7, at.lon / 1e7, at.alt / 1000.0)


def _velocity(vehicle: Any) -> Vector:
    """m/s north, east, up."""
    at = vehicle.state.messages["GLOBAL_POSITION_INT"].message
    return at.vx / 100.0, at.vy / 100.0, -at.vz / 100.0


def _home_amsl(vehicle: Any) -> float:
    received = vehicle.state.messages.get("GLOBAL_POSITION_INT")
    if received is None:
        raise Stale(f"vehicle {vehicle.state.system} does not report its position (GLOBAL_POSITION_INT)")
    return float(received.message.alt - received.message.relative_alt) / 1000.0


def _to_amsl(vehicle: Any, way: Sequence[Stop]) -> list[Stop]:
    home = _home_amsl(vehicle)
    return [stop._replace(up=stop.up + home) for stop in way]


def _age(vehicle: Any) -> float:
    age = vehicle.state.age("GLOBAL_POSITION_INT", vehicle.clock())
    return math.inf if age is None else float(age)


def _fastest(vehicle: Any) -> Pace:
    return cruise.mission_paces(vehicle)[0]
