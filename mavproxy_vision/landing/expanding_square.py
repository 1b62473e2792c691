"""The expanding square. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

OVERLAP = 0.7  # share of the footprint: the largest distance of two tracks
LEGS_PER_RING = 4


@dataclass(frozen=True)
class Waypoint:
    """A corner of the search: m north and east of where it began, and the ring that it belongs to (from 1)."""

    north: float
    east: float
    ring: int


def step_for(footprint: float, tag_size: float) -> float:
    """The distance of tracks (m), for a footprint whose shorter side is `footprint` m.

    A tag must be completely in view, so that its size is lost at the edge.
    """
    return max(OVERLAP * footprint - tag_size, 0.2 * footprint)


def expanding_square(step: float, leash: float) -> Iterator[Waypoint]:
    """Corners at growing distance: north 1, east 1, south 2, west 2, north 3 … steps, up to `leash` m away."""
    north = east = 0.0
    leg = 0
    while True:
        length = step * (leg // 2 + 1)
        direction = leg % 4
        north += length * (1, 0, -1, 0)[direction]
        east += length * (0, 1, 0, -1)[direction]
        if math.hypot(north, east) > leash:
            return
        leg += 1
        yield Waypoint(north, east, (leg - 1) // LEGS_PER_RING + 1)
