"""Keeps the vehicles of one MAVProxy apart: no command leads nearer to another than the setting `separation`.

The way of each command is checked against where the others will be: on their allowed ways, at their speeds, with
slack; or where they stand, for as long as they stand. The asyncio thread only.
"""

from __future__ import annotations

import asyncio
import math
import weakref
from collections.abc import Awaitable, Callable, Iterable, Sequence
from typing import Any

from mavproxy_uavapi.core.airspace import cruise
from mavproxy_uavapi.core.airspace.expected_way import (
    expected,
    home_amsl,
    path_of,
    position_of,
    swung,
    to_amsl,
    velocity_of,
)
from mavproxy_uavapi.core.airspace.forecast import (
    Box,
    Forecast,
    NearMiss,
    Path,
    Slack,
    Way,
    along_path,
    common_box,
    near_miss,
)
from mavproxy_uavapi.core.airspace.local_frame import LocalFrame
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Busy, Superseded, TooNear
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.mission.mission_legs import PathPoint
from mavproxy_uavapi.core.shared_tasks import LONG
from mavproxy_uavapi.core.telemetry.flight_modes import flies_mission

PLANNED = Slack(ahead=1.0, behind=4.0, share=0.15)
WATCHED = Slack(ahead=0.3, behind=0.5, share=0.1)
MARGIN = 1.0  # m more than the separation, for errors of the forecast
CERTAIN = 1.0  # s for which a vehicle that nobody commands through us keeps its velocity
LOOKED_AHEAD = 5.0  # s, likewise, before a command is sent
RETRY, LONGEST_WAIT = 0.5, 120.0  # s between two looks of a command that waits, and until it is refused
OLD = 3.0  # s; a vehicle with an older position may be anywhere on its way
CLEARED_FOR = 3.0  # s for which a mission that was compared in a thread is known to be free
SAME_MOMENT = 0.05  # s in which a question has the answer that it had


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
        # By system id where it was expected to go, by what, and when (s).
        self._ways: dict[int, tuple[Way, tuple[Any, ...], float]] = {}
        # By system id the mission that was found to be free, when (s), and what the others were ordered then.
        self._cleared: dict[int, tuple[Callable[[], Path | None], float, dict[int, Any]]] = {}

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
        ours = path_of(vehicle, swung(vehicle, to_amsl(vehicle, way))), False
        self._require_path(vehicle, ours, others)
        self._free[vehicle.state.system] = asked, vehicle.clock()

    async def look_at_mission(self, vehicle: Any, way: Way | None) -> None:
        """As `require_mission`, in a thread. What it finds holds for `require_mission` for a while.

        Raises:
            TooNear, Stale: as `require`.
        """
        if not self.in_force or way is None:
            return
        others, (path, loops) = self._others(vehicle), way
        ours = path.raised(home_amsl(vehicle)), loops
        theirs, orders = [(other, expected(other, LOOKED_AHEAD)) for other in others], _orders(others)
        found = await asyncio.to_thread(self._first_near_miss, ours, theirs, PLANNED)
        if found is not None:
            raise self._too_near(vehicle, *found, _frame_of(ours))
        self._cleared[vehicle.state.system] = weakref.ref(path), vehicle.clock(), orders

    def require_mission(self, vehicle: Any, way: Way | None) -> None:
        """As `require`, for a mission, from its beginning on. For a long one call `look_at_mission` before.

        Args:
            vehicle: whose.
            way: with m above home; None where it moves nothing.

        Raises:
            Busy: it is long, and another vehicle has begun a long way since `look_at_mission`.
        """
        if not self.in_force or way is None:
            return
        others, (path, loops) = self._others(vehicle), way
        cleared, at, orders = self._cleared.get(vehicle.state.system, (lambda: None, -math.inf, {}))
        if cleared() is path and vehicle.clock() - at <= CLEARED_FOR:
            others = [other for other in others if orders.get(other.state.system) != _order(other)]
        self._require_path(vehicle, (path.raised(home_amsl(vehicle)), loops), others)

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
        reach = _reach(vehicle, seconds)
        others = [
            other for other in self._others(vehicle) if self._meets(vehicle, other, reach + _reach(other, seconds))
        ]
        if not others:
            return None
        theirs = [(other, self._soon(other, seconds)) for other in others]
        return self._first_near_miss(self._soon(vehicle, seconds), theirs, WATCHED, seconds)

    def _soon(self, vehicle: Any, seconds: float) -> Way:
        """Where a vehicle goes in so many s. Many vehicles are looked at in one moment, each beside all others."""
        position, within = vehicle.state.messages["GLOBAL_POSITION_INT"], math.ceil(seconds)
        asked = position.message, vehicle.guard.ordered, vehicle.mode, vehicle.next_mode, within
        way, of, at = self._ways.get(vehicle.state.system, (None, (), -math.inf))
        if (
            way is None
            or vehicle.clock() - at > SAME_MOMENT
            or any(a is not b for a, b in zip(asked, of, strict=True))
        ):
            way, at = expected(vehicle, CERTAIN, within=within), vehicle.clock()
            self._ways[vehicle.state.system] = way, asked, at
        return way

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
        is_short = math.isfinite(seconds) and not ours[1]
        whole = self._forecast((mine, False), slack, seconds) if is_short else None
        for other, way in others:
            theirs = way[0].in_frame(frame)
            box = common_box(mine, theirs, self._kept)
            if box is None:
                continue
            forecast = self._forecast((theirs, way[1]), slack, seconds, box)
            if _age(other) > OLD:
                forecast = forecast.at_any_time()
            ahead = whole or self._forecast((mine, ours[1]), slack, seconds, box)
            found = near_miss(ahead, forecast, self._kept)
            if found is not None:
                return other, found
        return None

    def _forecast(self, way: Way, slack: Slack, seconds: float, box: Box | None = None) -> Forecast:
        path, at_any_time = way
        if not at_any_time:
            return along_path(path, slack, self._kept, seconds=seconds, box=box)
        fastest = float(path.fastest.max()) * (1 + slack.share)
        return along_path(path, slack, self._kept, box=box).at_any_time().reached(fastest, seconds + slack.ahead)

    def _meets(self, vehicle: Any, other: Any, reach: float) -> bool:
        """Whether two may come near each other, if both together come so many m far; cheap."""
        a, b = position_of(vehicle), position_of(other)
        return math.hypot(*offset(a.lat, a.lon, b.lat, b.lon), a.up - b.up) <= 2 * self.separation + reach

    def _too_near(self, vehicle: Any, other: Any, near_miss: NearMiss, frame: LocalFrame) -> TooNear:
        lat, lon = frame.degrees(near_miss.at)
        system, age = other.state.system, _age(other)
        when = f"in {near_miss.seconds:.0f} s" if age <= OLD else f"whose position is {age:.0f} s old"
        sentence = (
            f"it would come within {near_miss.gap:.1f} m of vehicle {system}, {when}; {self.separation:g} m are kept"
        )
        home = home_amsl(vehicle)
        at = {"lat": round(lat, 7), "long": round(lon, 7), "alt": round(near_miss.at.up - home, 2)}
        return TooNear(sentence, {"vehicle": system, "in_s": round(near_miss.seconds, 1), "at": at})


def _orders(vehicles: Iterable[Any]) -> dict[int, Any]:
    """By system id, what each was ordered last, and its mode."""
    return {vehicle.state.system: _order(vehicle) for vehicle in vehicles}


def _order(vehicle: Any) -> Any:
    return vehicle.guard.ordered, vehicle.mode


def _frame_of(way: Way) -> LocalFrame:
    lat, lon, _ = map(float, way[0].begins[0])
    return LocalFrame((lat, lon))


def _counts(vehicle: Any) -> bool:
    """Whether it is in the air, or on its way there."""
    state = vehicle.state
    if state.position is None or state.armed is False:
        return False
    if vehicle.guard.check.drives or not state.landed:
        return True
    ordered = vehicle.guard.path_ahead() is not None or bool(vehicle.guard.remaining())
    return ordered or flies_mission(vehicle.mode)


def _age(vehicle: Any) -> float:
    age = vehicle.state.age("GLOBAL_POSITION_INT", vehicle.clock())
    return math.inf if age is None else float(age)


def _reach(vehicle: Any, seconds: float) -> float:
    """How many m it comes at most in so many s."""
    return (math.hypot(*velocity_of(vehicle)) + max(cruise.mission_paces(vehicle)[0])) * seconds
