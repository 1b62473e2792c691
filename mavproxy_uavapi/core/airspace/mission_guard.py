"""Whether a vehicle may fly its mission: the whole of it, from where it is, and from the item at which it begins."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace.envelope_check import (
    Checked,
    EnvelopeCheck,
    MissionAnswer,
    MissionQuestion,
    Spaces,
    answer,
)
from mavproxy_uavapi.core.airspace.forecast import Way
from mavproxy_uavapi.core.airspace.traffic import Traffic
from mavproxy_uavapi.core.errors import Busy, OutsideEnvelope, Stale
from mavproxy_uavapi.core.geodesy import from_deg_e7, offset
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import PathPoint
from mavproxy_uavapi.core.mission.table import (
    conditions_before_jumps,
    is_navigation,
    return_starts,
    takes_off_behind,
)
from mavproxy_uavapi.core.shared_tasks import LONG, in_thread_if_long

mavlink = mavutil.mavlink

REACH = 200_000.0  # m from the vehicle: no target lies farther, with or without an envelope
UNKNOWN_PLACE = (0.0, 0.0)  # degrees, of a vehicle until its estimator has an origin
SHOWN_WITHIN = 1.0  # s in which MISSION_CURRENT shows the item that was selected
CHECKED_FOR = 30.0  # s for which a checked mission may be started
MOVED, CLIMBED = 100.0, 1.0  # m that a vehicle may move while its mission is checked, over the ground and up or down
AUTO_BY_ITSELF = (
    "at the takeoff behind its landing sequence it changes from AUTO_RTL to AUTO by itself, and nobody can tell that "
    "from its pilot's switch"
)
NOT_CHECKED = "the vehicle's mission was not checked against the envelope; start it by the API"
LANDS_WITHIN = 5.0  # m over the ground from its landing place, at which a vehicle sinks
SINKS_BELOW = 1.0  # m/s over the ground, of a vehicle that lands where it is
FLARES_WITHIN, FLARES_BELOW = 100.0, 10.0  # m from there, or above home where it sinks, at which nobody stops a plane
SINKS, ROLLS_BELOW = 0.2, 3.0  # m/s downwards from which a plane sinks, and m above home below which it need not


class MissionGuard:
    """Checks the missions of one vehicle.

    Attributes:
        check: holds ways against the envelopes.
        traffic: keeps it away from other vehicles; None where nobody does.

    Args:
        vehicle: which.
        spaces: gives the envelopes in force for it.
    """

    def __init__(self, vehicle: Checked, spaces: Spaces) -> None:
        self.check = EnvelopeCheck(vehicle, spaces)
        self.traffic: Traffic | None = None
        self._vehicle = vehicle
        self._looked_at: MissionAnswer | None = None  # what a thread has found
        self._checked_mission: tuple[MissionAnswer, float] | None = None  # and when (s)
        self._selected: tuple[int, float] = (0, -math.inf)  # the item that we told it to begin at, and when (s)
        self._changed_at: int | None = None  # the item that it flew, or was to fly, when its mission was changed

    @property
    def in_force(self) -> bool:
        """Whether there is an envelope for it, or other vehicles are to be kept away from."""
        return bool(self.check.spaces) or (self.traffic is not None and self.traffic.in_force)

    @property
    def basis(self) -> object:
        """The envelopes in force, and whether others are kept away from. Any thread."""
        return self.check.spaces, self.in_force

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
        here = self._vehicle.state.position
        if from_here or here is None or here.place != UNKNOWN_PLACE:  # it may be uploaded before the first fix
            await in_thread_if_long(len(items), self.require_reach, _places(items))
        if self.in_force:
            question = self._question(items, from_here, starts)
            self._looked_at = found = await asyncio.to_thread(answer, question)
            if from_here and self.traffic is not None:
                await self.traffic.look_at_mission(self._vehicle, found.way)

    def require_mission(self, items: Sequence[MissionItem], *, from_here: bool, starts: Sequence[int] = (1,)) -> None:
        """Raise OutsideEnvelope unless the whole mission stays inside. With `from_here` it may then be flown.

        For a long mission call `look_at_mission` first.

        Raises:
            TooNear: from here it leads too near to another vehicle.
            Busy: it is long, and the vehicle was elsewhere when `look_at_mission` was called.
        """
        if not self.in_force:
            return
        question = self._question(items, from_here, starts)
        flown = self._looked_at
        if flown is None or not _is_answered(question, flown.question):
            if len(items) > LONG and flown is not None and flown.question.items == items:
                raise Busy("the vehicle or its envelope has changed while its mission was checked; try again")
            flown = answer(question)
        elif from_here and flown.way is not None:
            path, here = flown.way[0], self.check.here()
            first = (path.begins == flown.question.setting.start).all(axis=1)
            self.check.require_way([[here, PathPoint(*map(float, end))] for end in path.ends[first]])
        self.check.require_limits(flown)
        if from_here:
            self._require_apart_on(flown.way)
            self._checked_mission = flown, self._vehicle.clock()

    def _question(self, items: Sequence[MissionItem], from_here: bool, starts: Sequence[int]) -> MissionQuestion:
        apart = from_here and self.traffic is not None and self.traffic.in_force
        return self.check.question(items, from_here=from_here, starts=starts, apart=apart)

    def starts(self, items: Sequence[MissionItem], mode: str) -> list[int]:
        """The items at which the autopilot may begin its mission when it is switched to that mode.

        Raises:
            OutsideEnvelope: it may leave the mode by itself.
        """
        everywhere = list(range(1, len(items) + 1))
        if mode == "AUTO_RTL":
            returns = return_starts(items)
            if returns and takes_off_behind(items, min(returns)):
                raise OutsideEnvelope(AUTO_BY_ITSELF)
            return returns or everywhere
        current = self._vehicle.state.newest("MISSION_CURRENT")
        restarts = self._vehicle.state.parameters.get("MIS_RESTART")
        if restarts == 1 and not return_starts(items):  # else AUTO_RTL may have it resumed once
            return [1]
        if current is None or not 0 <= current.message.seq <= len(items):
            return everywhere
        # It goes on at what was pending beside its item, by the number that this had before the change: `resume`.
        pending = range(1, current.message.seq) if current.message.seq == self._changed_at else ()
        is_over = current.message.mission_state == mavlink.MISSION_STATE_COMPLETE
        goes_on = {1 if is_over else max(current.message.seq, 1), *conditions_before_jumps(items), *pending}
        selected, at = self._selected
        if current.at < at + SHOWN_WITHIN + self._vehicle.state.trip.deadline:
            goes_on = {selected}
        return sorted(goes_on if restarts == 0 else {1, *goes_on})

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
        try:
            here, place = self.check.here(), landings[current]
        except Stale:
            return True
        north, east, down = self._vehicle.position().velocity
        is_plane = self._vehicle.kind == "plane"
        if is_plane and here.up < (FLARES_BELOW if down > SINKS else ROLLS_BELOW):
            return True
        if place is None:  # where it is; another station may have put another item there, to which it flies
            return not is_plane and math.hypot(north, east) <= SINKS_BELOW
        within = FLARES_WITHIN if is_plane else LANDS_WITHIN
        return math.hypot(*offset(here.lat, here.lon, *place)) <= within

    def _require_checked_mission(self, mode: str, begin: int | None = None) -> None:
        """Raise OutsideEnvelope unless the stored mission was checked from the item on at which it begins."""
        self.forget_old()
        if self._checked_mission is None:
            raise OutsideEnvelope(NOT_CHECKED)
        checked, _ = self._checked_mission
        question = checked.question
        if question.spaces != tuple(self.check.spaces):
            raise OutsideEnvelope(NOT_CHECKED)
        starts = self.starts(question.items, mode) if begin is None else [max(begin, 1)]
        if not set(question.starts).issuperset(starts):
            self.require_mission(question.items, from_here=True, starts=starts)
        else:
            self._require_apart_on(checked.way)

    def forget_old(self) -> None:
        """Let go of a mission that may not be started any more: each collection goes through thousands of objects."""
        if self._checked_mission is not None and self._vehicle.clock() - self._checked_mission[1] > CHECKED_FOR:
            self._checked_mission = self._looked_at = None

    def _require_apart_on(self, way: Way | None) -> None:
        if self.traffic is not None:
            self.traffic.require_mission(self._vehicle, way)

    def require_reach(self, places: Iterable[tuple[str, float, float]]) -> None:
        """Raise OutsideEnvelope if a place lies too far away for any vehicle, with or without an envelope.

        Args:
            places: what is there, latitude and longitude.
        """
        here = self._vehicle.state.position
        if here is None:
            return
        for what, lat, lon in places:
            require_distance(math.hypot(*offset(*here.place, lat, lon)), what)


def require_distance(distance: float, what: str) -> None:
    """Raise OutsideEnvelope if that (m) is farther than any vehicle goes."""
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
    near = (
        math.hypot(*offset(here.lat, here.lon, there.lat, there.lon)) <= MOVED and abs(here.up - there.up) <= CLIMBED
    )
    settings = [replace(one.setting, start=None, heading=None) for one in (question, by)]
    return near and settings[0] == settings[1]
