"""The legs of a mission: straight parts between places, and what they are flown with. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from mavproxy_uavapi.core.airspace.forecast import Pace, Path, Way
from mavproxy_uavapi.core.airspace.local_frame import rows
from mavproxy_uavapi.core.airspace.time_limits import NAMES
from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.table import HABITS


def _alone(names: str) -> list[tuple[str, ...]]:
    """Quantities that have one name."""
    return [(name,) for name in names.split()]


# Quantities that decide where a mission leads, and how fast, each with its names up to 4.6 and since 4.7.
WANTED: dict[str, list[tuple[str, ...]]] = {
    "copter": [
        *(names[:2] for names in NAMES.values()),
        ("RTL_CLIMB_MIN", "RTL_CLIMB_MIN_M"),
        *_alone("CIRCLE_RATE PLDP_SPEED_DN RTL_CONE_SLOPE FENCE_ENABLE FENCE_TYPE FENCE_ALT_MAX FENCE_MARGIN"),
    ],
    "plane": [
        ("AIRSPEED_CRUISE", "TRIM_ARSPD_CM"),
        ("RTL_ALTITUDE", "ALT_HOLD_RTL"),
        ("LIM_ROLL_CD", "ROLL_LIMIT_DEG"),
        *_alone("RTL_RADIUS RTL_AUTOLAND RTL_CLIMB_MIN FLIGHT_OPTIONS WP_LOITER_RAD NAVL1_PERIOD NAVL1_DAMPING"),
        *_alone("Q_ENABLE Q_OPTIONS"),
    ],
    "rover": _alone("WP_SPEED CRUISE_SPEED RTL_SPEED"),
}
for _kind, _quantities in WANTED.items():
    _quantities += [("MIS_RESTART",), *((habit.name,) for habit in HABITS if _kind in habit.kinds)]


class PathPoint(NamedTuple):
    """A place on a way: latitude and longitude in degrees, and m above home."""

    lat: float
    lon: float
    up: float


NOWHERE = PathPoint(math.nan, math.nan, math.nan)


class Leg(NamedTuple):
    """A straight part of a mission's way.

    Attributes:
        begin, end: its ends.
        seq: number of the item that it is flown for; one more than there are for what follows the mission.
        fastest, slowest: the speeds (m/s) that it may be flown at.
        margin: m beside it that the vehicle may be, because it leaves a circle, or turns about.
        waits: s that the vehicle stays at its end; infinite where nobody knows.
        lands: whether it leads to the ground, so that no floor counts.
        is_last: whether it is the vertical part of a landing, which is not held against an envelope.
        circles: whether it is a part of a circle, which is flown round after round, in either direction.
    """

    begin: PathPoint
    end: PathPoint
    seq: int
    fastest: Pace
    slowest: Pace
    margin: float = 0.0
    waits: float = 0.0
    lands: bool = False
    is_last: bool = False
    circles: bool = False


@dataclass(frozen=True)
class Setting:
    """What a mission is flown with.

    Attributes:
        kind: `copter`, `plane` or `rover`.
        start: where it begins; None where that is not known yet, as before an upload.
        home: latitude and longitude; None where it is not known.
        home_amsl: m; None where it is not known.
        radius: m, of a plane's circles whose item has no radius; 0 for a vehicle that stands still there.
        heights_matter: whether the walk fails if a height is not known.
        heading: degrees, of a plane on the ground, which climbs ahead; None where it is not known.
        fastest, slowest: the speeds that it may begin with.
        parameters: those of the vehicle.
        has_rally: whether it has rally points, to which it may return instead of home.
    """

    kind: str
    start: PathPoint | None
    home: tuple[float, float] | None = None
    home_amsl: float | None = None
    radius: float = 0.0
    heights_matter: bool = True
    heading: float | None = None
    fastest: Pace = Pace(10.0, 2.5, 1.5)
    slowest: Pace = Pace(10.0, 2.5, 1.5)
    parameters: Mapping[str, float] = field(default_factory=dict)
    has_rally: bool = False


@dataclass(frozen=True)
class MissionRoute:
    """The legs of a mission.

    Attributes:
        legs: in the order of flight, each from the end of the one before; with `loops` in any order.
        loops: whether a jump leads back, or the mission may begin at several items.
    """

    legs: tuple[Leg, ...]
    loops: bool = False

    def way(self) -> Way | None:
        """The legs as arrays, with m above home; None where there is none.

        Who keeps it keeps no legs: thousands of objects would hold all threads whenever Python collects its garbage.
        """
        if not self.legs:
            return None
        begins, ends, seqs, fastest, slowest, margins, waits, *_, circles = zip(*self.legs, strict=True)
        columns = (np.array(one, dtype=float) for one in (waits, margins, np.multiply(seqs, circles)))
        return Path(rows(begins), rows(ends), rows(fastest), rows(slowest), *columns), self.loops


def refusal(seq: int, item: MissionItem, why: str) -> OutsideEnvelope:
    """The error for an item that nobody can predict."""
    sentence = (
        f"mission item {seq} ({item.name}, command {item.command}): nobody can say whether it stays in the envelope"
    )
    return OutsideEnvelope(f"{sentence}: {why}", {"what": "unpredictable", "item": seq, "command": item.command})
