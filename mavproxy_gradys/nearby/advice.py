"""Which vehicle of another MAVProxy is near one of ours. Pure: the clock is an argument.

Positions that come by a broker are seconds old and count heights from homes that nobody tells. So this is advice for
people, over the ground only; no command depends on it.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

from mavproxy_uavapi.core.airspace.space import LocalFrame

AHEAD = 5.0  # s in which both keep their velocity
OLD = 10.0  # s after which a position says nothing any more
APART_AGAIN = 1.5  # times the separation, beyond which a pair is warned of anew
FASTEST = 100.0  # m/s; two positions that are farther apart are no movement


@dataclass(frozen=True)
class Track:
    """Where a vehicle is, how it moves over the ground, and when that was.

    Attributes:
        place: latitude and longitude, degrees.
        velocity: m/s north and east.
        at: s.
    """

    place: tuple[float, float]
    velocity: tuple[float, float]
    at: float


class Advice:
    """The vehicles of others, by name, and the pairs that were warned of."""

    def __init__(self) -> None:
        self._others: dict[str, Track] = {}
        self._warned: set[tuple[str, str]] = set()

    def take(self, payload: bytes | str, now: float) -> str:
        """Take a reading as our sinks publish it; the device's name, or empty where it is no position."""
        try:
            reading = json.loads(payload)
            name, (lat, lon) = str(reading["device"]), map(float, reading["value"][:2])
        except (ValueError, TypeError, KeyError, RecursionError):
            return ""
        if not (abs(lat) <= 90 and abs(lon) <= 180):
            return ""
        self._others[name] = Track((lat, lon), self._velocity(name, (lat, lon), now), now)
        return name

    def _velocity(self, name: str, place: tuple[float, float], now: float) -> tuple[float, float]:
        before = self._others.get(name)
        if before is None or not 0.1 < now - before.at < OLD:
            return 0.0, 0.0
        north, east = (metres / (now - before.at) for metres in LocalFrame(before.place).metres(place))
        return (north, east) if math.hypot(north, east) < FASTEST else (0.0, 0.0)

    def warnings(self, ours: dict[str, Track], names: set[str], separation: float, now: float) -> list[str]:
        """A sentence for each pair that will be nearer than `separation` m.

        A pair is warned of once, until it is apart again or one of the two lands or falls silent.

        Args:
            ours: our vehicles in the air, by name.
            names: of all our vehicles; the broker has their positions, too.
            separation: m over the ground; 0 for no advice.
            now: s.
        """
        self._others = {name: track for name, track in self._others.items() if now - track.at < OLD}
        self._warned = {(one, other) for one, other in self._warned if one in ours and other in self._others}
        sentences = []
        for name, track in ours.items():
            for other in self._others.keys() - names:
                gap, pair = nearest(track, self._others[other]), (name, other)
                if gap >= APART_AGAIN * separation:
                    self._warned.discard(pair)
                elif gap < separation and pair not in self._warned:
                    self._warned.add(pair)
                    sentences.append(
                        f"{other} of another MAVProxy comes within {gap:.0f} m of {name}, over the ground"
                    )
        return sentences


def nearest(one: Track, other: Track) -> float:
    """Metres over the ground to which two come near in the next AHEAD s, if both keep their velocity."""
    north, east = LocalFrame(one.place).metres(other.place)
    vn, ve = other.velocity[0] - one.velocity[0], other.velocity[1] - one.velocity[1]
    speed = vn * vn + ve * ve
    when = min(max(-(north * vn + east * ve) / speed, 0.0), AHEAD) if speed > 1e-9 else 0.0
    return math.hypot(north + vn * when, east + ve * when)
