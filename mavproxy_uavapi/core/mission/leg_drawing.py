"""Draws the legs of a mission: straight ones, and those around a circle. Pure.

Between two places an autopilot flies straight; a plane turns into the next leg, which carries it beside that.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace.forecast import Pace
from mavproxy_uavapi.core.airspace.time_limits import landing_time, limits
from mavproxy_uavapi.core.mission.item_places import place_of, polygon
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import Leg, PathPoint, Setting, refusal
from mavproxy_uavapi.core.mission.plane_turns import WIDER, turned

mavlink = mavutil.mavlink

AMSL = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT, mavlink.MAV_FRAME_MISSION)
TERRAIN = (mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT)
SLOWEST = 0.1  # m/s


class At(NamedTuple):
    """Where the walk is: the place (NaN where it is not known), speeds, and what an item before has left behind."""

    here: PathPoint
    fastest: Pace
    slowest: Pace
    margin: float = 0.0
    circle: float = 0.0  # m, the radius of a copter's last circle
    waits_for: bool = False  # whether a condition stands before the next speed
    circles: PathPoint | None = None  # the middle of the circle that a copter goes on with in a delay
    course: float | None = None  # rad, of a plane; NaN where nobody knows; None where `margin` says how it turns
    on_circle: bool = False  # whether a plane circles, `margin` m around here, and leaves it towards what follows
    passes: bool = False  # whether it has come here without stopping, already on its way to the next item's place


class LegDrawing:
    """Where an item leads, and the legs on the way there.

    Attributes:
        legs: in order, each once.
    """

    def __init__(self, setting: Setting) -> None:
        self.legs: dict[Leg, None] = {}
        self._setting = setting

    def _place(self, seq: int, item: MissionItem, at: At, *, keeps_zero: bool) -> PathPoint:
        """Where an item leads: without a place, and with `keeps_zero` without a height, it is as it is."""
        lat_lon = place_of(item)
        lat, lon = at.here[:2] if lat_lon is None else lat_lon
        is_plane = self._setting.kind == "plane"
        keeps = int(item.z * 100) == 0 and (lat_lon is None if is_plane and not keeps_zero else keeps_zero)
        if is_plane and keeps_zero and item.frame in AMSL:
            keeps = False
        height = self._height(seq, item)
        return PathPoint(lat, lon, at.here.up if keeps else height)

    def _height(self, seq: int, item: MissionItem) -> float:
        """Metres above home."""
        setting = self._setting
        if setting.kind == "rover":
            return 0.0
        if item.frame in TERRAIN and setting.heights_matter:
            raise refusal(seq, item, "its height is above the terrain, not above home")
        if item.frame in TERRAIN:
            return 0.0
        if item.frame in AMSL and setting.home_amsl is None and setting.heights_matter:
            raise refusal(seq, item, "its height is AMSL, and that of home is not known")
        return item.z - (setting.home_amsl or 0.0 if item.frame in AMSL else 0.0)

    def _sinking(self, at: At, height: float) -> At:
        """As fast and as slow as a copter sinks to land, from so many m above home; 0 to place a payload."""
        if self._setting.kind != "copter":
            return at
        parameters = self._setting.parameters
        known = limits(parameters, {})
        speed, most = parameters.get("PLDP_SPEED_DN") or known.land, 0.0
        if height > 0:
            speed, most = height / landing_time(known, height), known.land_high
        slowest = at.slowest._replace(descent=min(at.slowest.descent, max(speed, SLOWEST)))
        return at._replace(fastest=at.fastest._replace(descent=max(at.fastest.descent, most)), slowest=slowest)

    def _fly(
        self,
        seq: int,
        at: At,
        to: PathPoint,
        *,
        waits: float = 0.0,
        lands: bool = False,
        is_last: bool = False,
    ) -> At:
        """A leg to a place; with an unknown beginning only its end counts."""
        begin = to if any(map(math.isnan, at.here)) else at.here
        if not any(map(math.isnan, to)):
            leg = Leg(begin, to, seq, at.fastest, at.slowest, at.margin, waits, lands, is_last)
            if self._setting.kind == "plane":
                legs, course = turned(leg, at.course, self._setting)
                self.legs.update(dict.fromkeys(legs))
                at = at._replace(course=course)
            else:
                self.legs[leg] = None
        return at._replace(here=to, margin=at.margin if to[:2] == at.here[:2] else 0.0)

    def _round(
        self, seq: int, at: At, centre: PathPoint, radius: float, *, drift: float = 0.0, seconds: float = 0.0
    ) -> None:
        """The legs of a polygon around a circle, whose centre may be `drift` m beside; all rounds take so many s."""
        if any(map(math.isnan, centre)) or not radius:
            return
        beside = drift + ((WIDER - 1) * radius if self._setting.kind == "plane" else 0.0)
        corners, slowest = polygon(centre, radius), at.slowest
        if seconds > 0:
            slowest = slowest._replace(level=min(slowest.level, 2 * math.pi * radius / seconds))
        for begin, end in zip(corners, corners[1:], strict=False):
            self.legs[Leg(begin, end, seq, at.fastest, slowest, beside, circles=True)] = None
