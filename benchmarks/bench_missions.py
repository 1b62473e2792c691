"""How long the check of a large mission holds the asyncio thread, and how long it takes.

    python benchmarks/bench_missions.py [--items 5000] [--areas 200] [--vehicles 10]

Nobody's `stop` is heard while the thread is held. A watch in its loop sleeps a millisecond at a time and measures how
late it wakes; on a machine that has other work it is late without any check, which is printed first. The mission is
checked as before a start, in real time, and compared with vehicles above it that fly missions as large.
"""

from __future__ import annotations

import argparse
import asyncio
import resource
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.envelope_check import MissionQuestion, answer
from mavproxy_uavapi.core.airspace.forecast import Path as Legs
from mavproxy_uavapi.core.airspace.forecast import Slack, along_path, meeting
from mavproxy_uavapi.core.airspace.space import LocalFrame, Space, Spot
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_way import PathPoint, Setting

ORIGIN = (-35.36, 149.16)
FRAME = LocalFrame(ORIGIN)
NAP = 0.001  # s


def survey(count: int, east: float) -> list[MissionItem]:
    """A survey of as many items, 3 km wide."""
    places = [FRAME.degrees(Spot(-1500 + 3000 * n / count, east + (-1) ** n * 1500, 0)) for n in range(count)]
    return [MissionItem(16, 3, (0.0,) * 4, round(lat * 1e7), round(lon * 1e7), 50.0) for lat, lon in places]


def envelope(areas: int) -> Space:
    """A field, and masts beside the survey in it."""

    def feature(kind: str, geometry: dict[str, Any], **properties: Any) -> dict[str, Any]:
        return {"type": "Feature", "properties": {"kind": kind, **properties}, "geometry": geometry}

    ring = [list(FRAME.degrees(Spot(n, e, 0))[::-1]) for n, e in ((-2e3, -2e3), (2e3, -2e3), (2e3, 2e3), (-2e3, 2e3))]
    features = [feature("inclusion", {"type": "Polygon", "coordinates": [[*ring, ring[0]]]})]
    for number in range(areas - 1):
        lat, lon = FRAME.degrees(Spot(-1900 + 3800 * number / areas, 1900, 0))
        features.append(feature("exclusion", {"type": "Point", "coordinates": [lon, lat]}, radius=3))
    return Space(formats.of_geojson({"type": "FeatureCollection", "features": features}, "the envelope"))


class Watch:
    """The longest time that the loop was held, s."""

    def __init__(self) -> None:
        self.longest = 0.0
        self._task = asyncio.create_task(self._look())

    async def _look(self) -> None:
        while True:
            before = time.perf_counter()
            await asyncio.sleep(NAP)
            self.longest = max(self.longest, time.perf_counter() - before - NAP)

    def take(self) -> float:
        """The longest until now, in ms; it begins anew."""
        longest, self.longest = self.longest, 0.0
        return 1000 * longest


async def measure(chosen: argparse.Namespace) -> None:
    watch, space, items = Watch(), envelope(chosen.areas), survey(chosen.items, 0.0)
    setting = Setting("copter", PathPoint(*FRAME.degrees(Spot(-1500, 0, 0)), 50.0), ORIGIN, 584.0)
    await asyncio.sleep(1.0)
    print(f"without a check, in 1 s: held for {watch.take():.1f} ms")
    before, memory = time.perf_counter(), peak()
    found = await asyncio.to_thread(answer, MissionQuestion(items, setting, (1,), (space,)))
    took = time.perf_counter() - before
    print(f"checked in {took:.2f} s; the loop was held for {watch.take():.1f} ms; {peak() - memory:+.0f} MB")
    path = await asyncio.to_thread(lambda: found.route.path)
    others = [path.raised(20.0 * number) for number in range(1, chosen.vehicles)]
    watch.take()
    before, memory = time.perf_counter(), peak()
    await asyncio.to_thread(compare, path, others)
    took = time.perf_counter() - before
    held = f"the loop was held for {watch.take():.1f} ms"
    print(f"compared with {len(others)} others in {1000 * took:.1f} ms; {held}; {peak() - memory:+.0f} MB")


def compare(path: Legs, others: list[Legs]) -> None:
    """As `Traffic.look_at_route`."""
    slack = Slack(1.0, 4.0, 0.15)
    for other in others:
        ours, theirs = (along_path(one.in_frame(FRAME), slack, 9.0) for one in (path, other))
        assert meeting(ours, theirs, 9.0) is None


def peak() -> float:
    """The most memory so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--items", type=int, default=5000)
    parser.add_argument("--areas", type=int, default=200)
    parser.add_argument("--vehicles", type=int, default=10)
    asyncio.run(measure(parser.parse_args()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
