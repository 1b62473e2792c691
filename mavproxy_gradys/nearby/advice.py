"""Which vehicle of another MAVProxy is near one of ours. Pure: the clock is an argument.

Positions that come by a broker are seconds old and count heights from homes that nobody tells. So this is advice for
people, over the ground only; no command depends on it.
"""

from __future__ import annotations

import json
import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from mavproxy_gradys.bounded import Bounded
from mavproxy_gradys.forwarding.quantities import POSITION
from mavproxy_gradys.station.fleet import place_of
from mavproxy_gradys.station.reading_row import LONGEST_NAME, finite, text
from mavproxy_uavapi.core.airspace.model import Place
from mavproxy_uavapi.core.geodesy import METRES_PER_DEGREE, moved, offset

AHEAD = 5.0  # s in which both keep their velocity
OLD = 10.0  # s after its measurement from which a position says nothing any more
APART_AGAIN = 1.5  # times the separation, beyond which a pair is warned of anew
FASTEST = 100.0  # m/s; two positions that are farther apart are no movement
SHORTEST = 0.1  # s between two measurements that give a velocity
MOST = 5000  # vehicles of others
DATE_LINE = 170.0  # degrees of longitude; who is beyond is compared from both sides
NOBODY: frozenset[str] = frozenset()
decode = json.JSONDecoder().decode  # `json.loads` guesses an encoding first


class Track(NamedTuple):
    """Where a vehicle is, how it moves over the ground, and when that was.

    Attributes:
        place: latitude and longitude, degrees.
        velocity: m/s north and east.
        at: when that was measured, s.
    """

    place: Place
    velocity: tuple[float, float]
    at: float

    def moved_to(self, now: float) -> Track:
        """The same vehicle at `now`, if it keeps its velocity."""
        (north, east), seconds = self.velocity, now - self.at
        return Track(moved(*self.place, north * seconds, east * seconds), self.velocity, now)


class Heard(NamedTuple):
    """A position of another MAVProxy's vehicle.

    Attributes:
        device: its name.
        place: latitude and longitude, degrees.
        time: when that was measured, s since 1970 by its own clock.
    """

    device: str
    place: Place
    time: float


def heard_in(payload: bytes) -> Heard | None:
    """The position in a reading as our sinks publish it; None if it is something else."""
    try:
        reading = decode(payload.decode())
        if reading["quantity"] != POSITION:
            return None
        lat, lon, _ = place_of(reading["value"])
        device, measured = text(reading["device"], LONGEST_NAME), finite(reading["time"])
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return None
    return None if lat is None or lon is None else Heard(device, (lat, lon), measured)


class OurTracks:
    """Our vehicles in the air, so arranged that most are passed over quickly.

    Args:
        tracks: by name.
        now: s.
    """

    def __init__(self, tracks: Mapping[str, Track], now: float) -> None:
        self._tracks = {name: track.moved_to(now) for name, track in tracks.items() if now - track.at < OLD}
        self._fastest = max((math.hypot(*track.velocity) for track in self._tracks.values()), default=0.0)
        self._now = now
        places = [(*track.place, name) for name, track in self._tracks.items()]
        beyond = [(lat, lon - math.copysign(360.0, lon), name) for lat, lon, name in places if abs(lon) > DATE_LINE]
        self._places = sorted(places + beyond)
        self._latitudes = [lat for lat, *_ in self._places]

    def near(self, other: Track, limit: float) -> dict[str, float]:
        """Our vehicles to which the other one comes nearer than `limit` m in the next AHEAD s, and how near (m)."""
        lat, lon = other.place
        seconds = AHEAD + abs(self._now - other.at)
        north = (limit + seconds * (self._fastest + math.hypot(*other.velocity))) / METRES_PER_DEGREE
        east = north / max(math.cos(math.radians(lat)), 1e-6)
        among = self._places[bisect_left(self._latitudes, lat - north) : bisect_right(self._latitudes, lat + north)]
        names = [name for _, x, name in among if -east <= x - lon <= east]
        if not names:
            return {}
        there = other.moved_to(self._now)
        gaps = {name: nearest(self._tracks[name], there) for name in names}
        return {name: gap for name, gap in gaps.items() if gap < limit}


class Advice:
    """The vehicles of others, and which of ours they were warned of."""

    def __init__(self) -> None:
        self._others: Bounded[str, tuple[Track, frozenset[str]]] = Bounded(MOST)  # by name

    def hear(self, other: Heard, at: float, ours: OurTracks, separation: float, now: float) -> Sequence[str]:
        """A sentence for each of our vehicles to which that one will be nearer than `separation` m.

        A pair is warned of once, until it is apart again or one of the two lands or falls silent. Two others of one
        name are a vehicle that leaps from one place to the other: it is not apart by a leap.

        Args:
            other: a position of another vehicle; one that is older than the last changes nothing.
            at: when it was measured, s; later than `now` by a clock that is ahead, and then taken for `now`.
            ours: our vehicles in the air.
            separation: m over the ground.
            now: s.
        """
        name, at = other.device, min(at, now)
        before, warned = self._others.get(name, (None, NOBODY))
        if before is not None and at <= before.at:
            return ()
        moves: tuple[float, float] | None = (0.0, 0.0)
        if before is None or at - before.at > OLD:
            warned = NOBODY  # who has fallen silent is warned of anew
        else:
            moves = velocity(before, other.place, at)
        track = Track(other.place, moves or (0.0, 0.0), at)
        gaps = ours.near(track, APART_AGAIN * separation)
        close = frozenset(mine for mine, gap in gaps.items() if gap < separation)
        self._others[name] = track, (warned if moves is None else warned & gaps.keys()) | close
        return [
            f"{name} of another MAVProxy comes within {gaps[mine]:.0f} m of {mine}, over the ground"
            for mine in sorted(close - warned)
        ]


def velocity(before: Track, place: Place, at: float) -> tuple[float, float] | None:
    """m/s north and east of a vehicle that is at `place` at `at` (s); None if no vehicle is so fast."""
    seconds = at - before.at
    north, east = offset(*before.place, *place)
    if math.hypot(north, east) > FASTEST * max(seconds, SHORTEST):
        return None
    return (north / seconds, east / seconds) if seconds >= SHORTEST else before.velocity


def nearest(one: Track, other: Track) -> float:
    """Metres over the ground to which two come near in the next AHEAD s, if both keep their velocity."""
    north, east = offset(*one.place, *other.place)
    vn, ve = other.velocity[0] - one.velocity[0], other.velocity[1] - one.velocity[1]
    speed = vn * vn + ve * ve
    when = min(max(-(north * vn + east * ve) / speed, 0.0), AHEAD) if speed > 1e-9 else 0.0
    return math.hypot(north + vn * when, east + ve * when)
