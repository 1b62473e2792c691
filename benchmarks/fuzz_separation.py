"""Copters that fly across each other's ways at random: how near do two of them come?

    python benchmarks/fuzz_separation.py [--vehicles 10] [--hours 1] [--separation 8] [--wait] [--off] [--seed N]

In virtual time: the real API, host and bridge, the embedded copters. Each flies to random places of a square field of
120 m, 8 to 16 m high, and at random velocities. Their true positions are looked at 50 times a second. It fails where
two came nearer than the separation. With --off nobody keeps them apart: how often would they have come too near?
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.support.crossing_flights import Fleet
from tests.support.virtual_time import FastLoop

HALF = 60.0  # m
REPORT_EVERY = 300.0  # s of the vehicles' clock


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=10)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--separation", type=float, default=8.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--wait", action="store_true", help="a command waits for its turn, and is not refused")
    parser.add_argument("--off", action="store_true", help="nobody keeps them apart")
    options = parser.parse_args()
    loop = FastLoop()
    asyncio.set_event_loop(loop)
    loop.set_default_executor(AtOnce())
    settings = {
        "separation": 0.0 if options.off else options.separation,
        "on_conflict": "wait" if options.wait else "refuse",
    }
    fleet = Fleet(loop, options.vehicles, settings, options.separation)
    fleet.fly_at_random(HALF, options.seed)
    began, end = time.monotonic(), loop.time() + 3600 * options.hours
    while loop.time() < end:
        loop.pass_time(min(REPORT_EVERY, end - loop.time()))
        outcomes = ", ".join(f"{code}: {count}" for code, count in sorted(fleet.outcomes.items()))
        print(
            f"{options.vehicles} vehicles, {loop.time() - end + 3600 * options.hours:.0f} s of flight in "
            f"{time.monotonic() - began:.0f} s: nearest {fleet.nearest:.2f} m, nearer than {options.separation:g} m "
            f"{fleet.breaches} times, stopped in flight {fleet.stops}; answers {outcomes}",
            flush=True,
        )
    defects = loop.defects
    fleet.close()
    for defect in defects[:3]:
        print(f"DEFECT: {defect['message']}: {defect.get('exception')!r}")
    return 0 if (options.off or not fleet.breaches) and not defects else 1


if __name__ == "__main__":
    sys.exit(main())
