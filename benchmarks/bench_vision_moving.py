"""Landings on pads that move, in lock step: how they end, how far from the tag, and how fast.

    python benchmarks/bench_vision_moving.py [--landings 10]

Each begins 5 m above the pad, which speeds up from rest by 0.75 m/s/s, in wind of up to 4 m/s, with a camera latency
of 50 to 150 ms of which the module is told the mean, and anywhere in the swell. `landed` stands on the pad, disarmed;
`told` has not touched it, and says why; `wrong` is all else. Offset, sink and slip are relative to it, at contact.
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
from mavproxy_vision.errors import LandingFailed
from tests.support.moving_pads import CROSS_SEA, RISES, SWELL, TAG, Contact, at_sea, contact, straight, turning
from tests.support.vision_world import VisionWorld

BESIDE = 0.6  # m from the tag within which it stands on the pad
STRAIGHT = {f"straight, {speed:g} m/s": straight(speed) for speed in (0.0, 1.0, 2.0, 3.0)}
TURNING = {
    f"turning, {speed:g} m/s, {radius:g} m": turning(speed, radius) for speed, radius in ((1, 5), (2, 10), (3, 15))
}
PADS = STRAIGHT | TURNING
SEA = {f"at sea, {speed:g} m/s": (speed, SWELL) for speed in (0.0, 1.0, 2.0, 3.0)}
SEA["a cross sea, 1 m/s"] = 1.0, CROSS_SEA


def fly(name: str, seed: int) -> tuple[Contact | None, str]:
    """One landing: the contact, and how it ended."""
    chance = random.Random(seed)
    latency = chance.uniform(50, 150)
    world = VisionWorld(
        seed=seed,
        wind=(chance.uniform(0, 4), chance.uniform(0, 360)),
        heading=chance.uniform(0, 360),
        sim_tags=f"0:0.30@{TAG[0]},{TAG[1]},{chance.uniform(0, 360):.0f}",
        sim_latency=latency,
        latency=latency,
        target="moving",
        ground=RISES if name in SEA else 0.0,
    )
    walk = at_sea(*SEA[name], since=chance.uniform(0, 30)) if name in SEA else PADS[name]
    try:
        world.start(5.0)
        world.pass_time(1.0)
        touched, outcome = contact(world, walk)
        copter = world.copter
        if touched is None:
            return None, "told" if isinstance(outcome, LandingFailed) else "wrong"
        stands = copter.body.on_ground and not copter.armed and touched.offset < BESIDE
        return touched, "landed" if stands and not isinstance(outcome, Exception) else f"wrong ({seed}: {outcome})"
    finally:
        world.close()


def main() -> int:
    """Print a line for each kind of pad."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--landings", type=int, default=10, help="on each pad")
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    print(f"{'':24}   n  landed  told  wrong   offset: median, most   sink: median, most   slip: median, most")
    for name in (*PADS, *SEA):
        flown = [fly(name, seed) for seed in range(1, chosen.landings + 1)]
        touched = [one for one, _ in flown if one is not None]
        ends = [end for _, end in flown]
        wrong = [end for end in ends if end.startswith("wrong")]
        columns = [[one.offset for one in touched], [one.sink for one in touched], [one.slip for one in touched]]
        values = [
            part
            for column in columns
            for part in (statistics.median(column or [math.nan]), max(column, default=math.nan))
        ]
        counts = f"{len(ends):3}  {ends.count('landed'):6}  {ends.count('told'):4}  {len(wrong):5}"
        print(f"{name:24} {counts}   " + "   ".join(f"{value:6.2f}" for value in values), *wrong, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
