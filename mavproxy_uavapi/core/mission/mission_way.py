"""The legs of a mission: a walk through its items as the autopilot of the vehicle's type takes them. Pure.

Between two places an autopilot flies straight. What nobody can predict (splines, scripts, unknown items) is refused;
the error says why. A jump may be taken or not, whatever its counter says, until places, heights and speeds repeat: so
the legs are right wherever a mission goes on, and however often it went round before.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from pymavlink import mavutil

from mavproxy_uavapi.core.mission.item_legs import FIXED_WING_LANDING, ItemLegs
from mavproxy_uavapi.core.mission.item_places import place_of
from mavproxy_uavapi.core.mission.leg_drawing import At
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import Leg, MissionRoute, PathPoint, Setting, refusal
from mavproxy_uavapi.core.mission.table import (
    OF_TYPE,
    REASONS,
    UNKNOWN,
    Deed,
    deed_of,
    habit_of,
    is_navigation,
    return_starts,
)

mavlink = mavutil.mavlink

# Items that only a plane with hover motors takes; `DELAY` and others do not part a landing from the next takeoff.
DESCENTS = (mavlink.MAV_CMD_NAV_VTOL_LAND, mavlink.MAV_CMD_NAV_PAYLOAD_PLACE)
APPROACH_BY_WING = 16  # bit of Q_OPTIONS; also param1 of a VTOL_LAND
HOVERING = {mavlink.MAV_CMD_NAV_VTOL_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_LAND, mavlink.MAV_CMD_NAV_PAYLOAD_PLACE}
LANDINGS = (Deed.LAND, Deed.GLIDE, Deed.RETURN_AND_LAND)
JUMPS = (Deed.JUMP, Deed.JUMP_TO_TAG)
STORED = 65_535  # the largest number that AP_Mission stores of a parameter
MOST_STEPS = 40_000  # of a walk; jumps whose heights never repeat end there


def route(items: Sequence[MissionItem], setting: Setting, starts: Iterable[int] = (1,)) -> MissionRoute:
    """The legs of a mission that begins at one of the items `starts` (numbers from 1).

    Raises:
        OutsideEnvelope: nobody can say where an item leads, even one that is not flown.
    """
    any_deed = habit_of(setting.kind, None, setting.parameters, heights_matter=setting.heights_matter)
    for seq, item in enumerate(items, 1):
        if any_deed is not None and is_navigation(item.command):
            raise refusal(seq, item, any_deed)
        deed = deed_of(setting.kind, item)
        if deed is None:
            raise refusal(seq, item, REASONS.get(item.command, UNKNOWN))
        if deed not in (Deed.NOTHING, Deed.SKIP) and not _is_stored(item):
            raise refusal(seq, item, "the autopilot stores a number of it in 16 bits, and there it is another one")
    return _Walk(items, setting).all(list(starts))


def _is_stored(item: MissionItem) -> bool:
    return all(abs(number) <= STORED for number in (*item.params[:3], item.z))  # not so where one is no number


def landing_places(
    items: Sequence[MissionItem], kind: str, home: tuple[float, float] | None
) -> dict[int, tuple[float, float] | None]:
    """By number, where the items land that land a vehicle of that kind; None for one that lands where it is."""
    lands = {command: deed for command, deed in OF_TYPE.get(kind, {}).items() if deed in LANDINGS}
    return {
        seq: home if lands[item.command] is Deed.RETURN_AND_LAND else place_of(item)
        for seq, item in enumerate(items, 1)
        if item.command in lands
    }


class _Walk:
    """One walk through a mission; see `route`."""

    def __init__(self, items: Sequence[MissionItem], setting: Setting) -> None:
        self._items, self._setting = items, setting
        self._flown = ItemLegs(items, setting)
        self._loops = self._may_meet = False
        self._tags = {
            int(i.params[0]): n for n, i in reversed([*enumerate(items, 1)]) if i.command == mavlink.MAV_CMD_JUMP_TAG
        }

    def all(self, starts: list[int]) -> MissionRoute:
        at = self._flown.begin()
        self._flown.branches += [(start, at) for start in reversed(starts)]
        self._loops = len(starts) > 1
        repeats = self._setting.kind == "plane" and bool(return_starts(self._items))  # each return may begin there
        self._may_meet = self._loops or repeats or any(deed_of(self._setting.kind, i) in JUMPS for i in self._items)
        seen: set[tuple[int, At]] = set()
        while self._flown.branches:
            self._follow(*self._flown.branches.pop(), seen)
        legs = tuple(self._flown.legs) if self._loops else tuple(_joined(self._flown.legs))
        return MissionRoute(legs, self._loops)

    def _follow(self, seq: int, at: At, seen: set[tuple[int, At]]) -> None:
        has_flown = True  # since the last jump, if there was one
        while seq <= len(self._items):
            if self._may_meet:
                step = seq, _rounded(at)
                if step in seen:
                    self._loops = True
                    if not has_flown:  # an autopilot ends a mission that only jumps
                        self._flown.end(at)
                    return
                seen.add(step)
            if len(seen) > MOST_STEPS:
                raise refusal(seq, self._items[seq - 1], "the jumps of the mission lead too many ways")
            item = self._items[seq - 1]
            deed = self._deed(seq, item)
            if deed in JUMPS:
                target = self._target(seq, item, deed)
                if target is None:
                    break
                if item.params[1] != -1 and target != seq + 1:
                    self._loops = True
                    self._flown.branches.append((seq + 1, at))
                seq, has_flown = target, False
                continue
            has_flown = has_flown or is_navigation(item.command)
            after = self._flown.do(seq, item, deed, at)
            if after is None:
                return
            seq, at = seq + 1, after
        self._flown.end(at)

    def _target(self, seq: int, item: MissionItem, deed: Deed) -> int | None:
        """Where a jump leads; None where it ends the mission."""
        target, times = int(item.params[0]), int(item.params[1])
        if deed is Deed.JUMP_TO_TAG:
            target = self._tags.get(target, 0)
        if not 0 < target <= len(self._items):
            return None
        return target if times else seq + 1

    def _deed(self, seq: int, item: MissionItem) -> Deed:
        deed = deed_of(self._setting.kind, item)
        assert deed is not None
        hovers = self._setting.parameters.get("Q_ENABLE", 0.0)
        if self._setting.kind == "plane" and item.command in HOVERING and not hovers:
            return Deed.SKIP
        lands_by_wing = item.command == mavlink.MAV_CMD_NAV_VTOL_LAND and item.params[0] == 1
        approaches = lands_by_wing or int(self._setting.parameters.get("Q_OPTIONS", 0.0)) & APPROACH_BY_WING
        if self._setting.kind == "plane" and item.command in DESCENTS and approaches:
            raise refusal(seq, item, "it circles down beside its place first, and comes from where the wind goes")
        if deed is Deed.GLIDE and (hovers == 2 or self._flown.hovers_instead(FIXED_WING_LANDING)):
            return Deed.LAND
        return deed


def _joined(legs: Iterable[Leg]) -> Iterator[Leg]:
    """The legs, with those between them that lead onto circles and off them."""
    before: Leg | None = None
    for leg in legs:
        if before is not None and before.end != leg.begin:
            slowest = before.slowest if leg.circles else leg.slowest  # which is that of all rounds
            yield leg._replace(begin=before.end, end=leg.begin, slowest=slowest, waits=0.0, is_last=False)
        yield leg
        before = leg


def _rounded(at: At) -> At:
    """The same to 0.1 m and 0.01 rad, for a comparison; NaN equals NaN."""
    numbers = (round(at.here.lat, 6), round(at.here.lon, 6), round(at.here.up, 1))
    here = PathPoint(*(math.inf if math.isnan(number) else number for number in numbers))
    course = at.course if at.course is None else math.inf if math.isnan(at.course) else round(at.course, 2)
    return at._replace(here=here, course=course)
