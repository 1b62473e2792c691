"""Landings on pads that move, in lock step: how far from the tag and how fast the vehicle touches the pad.

    python benchmarks/bench_vision_moving.py [--landings 10]

Each begins 5 m above the pad, which speeds up from rest by 0.75 m/s/s, in wind of up to 4 m/s, with a camera latency
of 50 to 150 ms of which the module is told the mean. Offset, sink and slip are relative to the pad, at the contact.
"""

from __future__ import annotations

import argparse
import math
import random
import statistics
import sys
from pathlib import Path

import cv2

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.support.lockstep import Lockstep
from tests.support.moving_pads import CROSS_SEA, RISES, TAG, Contact, Walk, at_sea, contact, straight, turning

STRAIGHT = {f"straight, {speed:g} m/s": straight(speed) for speed in (0.0, 1.0, 2.0, 3.0)}
TURNING = {
    f"turning, {speed:g} m/s, {radius:g} m": turning(speed, radius) for speed, radius in ((1, 5), (2, 10), (3, 15))
}
SEA = {f"at sea, {speed:g} m/s": at_sea(speed) for speed in (0.0, 1.0, 2.0)}
SEA["a cross sea, 1 m/s"] = at_sea(1.0, CROSS_SEA)


def fly(walk: Walk, seed: int, ground: float) -> Contact | None:
    """One landing."""
    chance = random.Random(seed)
    latency = chance.uniform(50, 150)
    rig = Lockstep(
        seed=seed,
        wind=(chance.uniform(0, 4), chance.uniform(0, 360)),
        heading=chance.uniform(0, 360),
        sim_tags=f"0:0.30@{TAG[0]},{TAG[1]},{chance.uniform(0, 360):.0f}",
        sim_latency=latency,
        latency=latency,
        target="moving",
        ground=ground,
    )
    try:
        rig.start(5.0)
        rig.pass_time(1.0 + chance.uniform(0, 6))
        return contact(rig, walk)[0]
    finally:
        rig.close()


def main() -> int:
    """Print a line for each kind of pad."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--landings", type=int, default=10, help="on each pad")
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    print(f"{'':24}   n  contacts   offset: median, most   sink: median, most   slip: median, most")
    for name, walk in {**STRAIGHT, **TURNING, **SEA}.items():
        ground = RISES if name in SEA else 0.0
        contacts = [fly(walk, seed, ground) for seed in range(1, chosen.landings + 1)]
        touched = [one for one in contacts if one is not None]
        columns = [[one.offset for one in touched], [one.sink for one in touched], [one.slip for one in touched]]
        values = [
            part
            for column in columns
            for part in (statistics.median(column or [math.nan]), max(column, default=math.nan))
        ]
        print(
            f"{name:24} {len(contacts):3}  {len(touched):8}   " + "   ".join(f"{value:6.2f}" for value in values),
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
