"""Random missions under an envelope and a separation: is anybody outside, or too near?

    python benchmarks/fuzz_missions.py --missions 300 [--seed N] [--again 5]

In virtual time: the real API, host and bridge, two embedded copters. One hovers at a random place; the other one
flies the missions of mission_differences.py in a field with a mast, as far as they are accepted. Refused ones are
counted by reason, and one of `--again` of them is flown with nothing in force: would it have been fine? It fails
where an accepted mission came farther out than the bound of the braking model, or nearer to the other copter than
the separation.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import os
import random
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

from fuzz_envelope import bound
from mission_differences import Dice
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.local_frame import Spot
from mavproxy_uavapi.core.airspace.space import Space, outside_by
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.support.crossing_flights import Fleet
from tests.support.envelopes import METRES, field, place
from tests.support.virtual_time import FastLoop
from tests.support.world import TICK

HALF, MAST, SEPARATION = 75.0, 35.0, 8.0  # m
LONGEST = 240.0  # s of a mission
FIELD = field(HALF, MAST)
START = (-50.0, 0.0, 12.0)  # m north, east and up


class Trial:
    """Two copters, and how far one was outside (m) since `begin`."""

    def __init__(self) -> None:
        self.loop = FastLoop()
        asyncio.set_event_loop(self.loop)
        self.loop.set_default_executor(AtOnce())
        self.fleet = Fleet(self.loop, 2, {"separation": SEPARATION}, SEPARATION)
        self.copter = self.fleet.world.simulators[0].copter
        space = Space(formats.of_geojson(FIELD, "the envelope"))
        self._rules = space.rules(None)
        self._shift = space.frame(place(0, 0)).metres(METRES.origin)
        self.outside, self._on = 0.0, False
        self.loop.create_task(self._look())

    def begin(self) -> None:
        self.outside, self.fleet.nearest = 0.0, math.inf

    async def _look(self) -> None:
        while True:
            one = self.fleet.at(self.fleet.world.simulator)
            spot = Spot(one[0] + self._shift[0], one[1] + self._shift[1], one[2])
            self.outside = max(self.outside, outside_by(spot, self._rules))
            await asyncio.sleep(2 * TICK)

    def protect(self, on: bool) -> None:
        """Put envelope and separation in force, or nothing."""
        world = self.fleet.world
        world.host.registry.traffic.separation = SEPARATION if on else 0.0
        if on == self._on:
            return
        self._on = on
        answer = world.ask("PUT", "/envelope", FIELD) if on else world.ask("DELETE", "/envelope")
        assert answer.outcome == "200"

    def prepare(self, dice: random.Random) -> None:
        """Bring both to where a mission begins, freely."""
        self.protect(on=False)
        if not self.copter.armed or self.copter.landed:
            for verb in ("guided", "arm", "takeoff?alt=12"):
                assert self.fleet.ask(1, f"command/{verb}").outcome == "200", verb
        for system in (1, 2):
            while self.fleet.ask(system, "command/guided").outcome == "409 busy":  # it is being stopped
                self.loop.pass_time(1.0)
        elsewhere = dice.uniform(-30, 60), dice.uniform(-60, 60), dice.uniform(8, 20)
        for system, spot in ((1, START), (2, elsewhere)):
            self._carry(system, spot)
            lat, lon = place(*spot[:2])
            body = {"lat": lat, "long": lon, "alt": spot[2]}
            assert self.fleet.ask(system, "movement/go_to_gps_wait", body).outcome == "200"
        self.loop.pass_time(3.0)
        while max(math.hypot(*one.copter.body.velocity) for one in self.fleet.world.simulators) > 0.1:
            self.loop.pass_time(0.5)  # until what was carried hovers
        self.begin()

    def _carry(self, system: int, spot: tuple[float, float, float]) -> None:
        """Put a copter where it would fly to, which takes the longest."""
        body, (north, east) = self.fleet.world.simulators[system - 1].copter.body, self.fleet.starts[system]
        body.north, body.east, body.down = spot[0] - north, spot[1] - east, -spot[2]
        body.velocity_north = body.velocity_east = body.velocity_down = 0.0

    def fly(self, items: list[Any]) -> str:
        """Upload and fly a mission to its end; why it is refused, or nothing."""
        body = {"items": [item.report(number) for number, item in enumerate(items, 1)]}
        for verb, sent in (("mission/waypoints", body), ("mission/start", {})):
            answer = self.fleet.ask(1, verb, sent)
            if answer.outcome != "200":
                outside = answer.body.get("outside") or answer.body.get("near") or {}
                return f"{answer.outcome} {outside.get('what', '')}".strip()
        end = self.loop.time() + LONGEST
        while self.loop.time() < end and self.copter.armed and self.copter.mode.name == "AUTO":
            self.loop.pass_time(1.0)
            mission, still = self.copter.mission, math.hypot(*self.copter.body.velocity) < 0.1
            stays = mission.current == len(items) and items[-1].command == mavlink.MAV_CMD_NAV_LOITER_UNLIM
            if mission.state.name == "COMPLETE" or (stays and still):
                break
        return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--missions", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0, help="of the first; each further mission has the next")
    parser.add_argument("--again", type=int, default=1, help="one of so many refused ones is flown freely")
    options = parser.parse_args()
    trial, began = Trial(), time.monotonic()
    accepted, bad, worst, nearest = 0, 0, 0.0, math.inf
    refused: Counter[str] = Counter()
    fine: Counter[str] = Counter()
    flown: Counter[str] = Counter()
    for seed in range(options.seed, options.seed + options.missions):
        items = Dice(seed).mission("copter")
        trial.prepare(random.Random(seed))
        trial.protect(on=True)
        stops, reason = trial.fleet.stops, trial.fly(items)
        if trial.fleet.stops > stops:
            print(f"seed {seed}: stopped, {'though refused: ' + reason if reason else 'though accepted'}", flush=True)
        if reason:
            refused[reason] += 1
            if sum(refused.values()) % options.again == 0:
                flown[reason] += 1
                trial.prepare(random.Random(seed))
                trial.fly(items)
                fine[reason] += trial.outside <= 0 and trial.fleet.nearest >= SEPARATION
        else:
            accepted += 1
            is_bad = trial.outside > bound() or trial.fleet.nearest < SEPARATION
            bad += is_bad
            worst, nearest = max(worst, trial.outside), min(nearest, trial.fleet.nearest)
            if is_bad:
                print(f"seed {seed}: outside {trial.outside:.2f} m, nearest {trial.fleet.nearest:.2f} m", flush=True)
        if (seed + 1 - options.seed) % 10 == 0:
            counts = "; ".join(
                f"{why}: {count}, fine {fine[why]} of {flown[why]}" for why, count in refused.most_common()
            )
            done, seconds = seed + 1 - options.seed, time.monotonic() - began
            print(
                f"{done} missions in {seconds:.0f} s: {accepted} accepted, stopped "
                f"{trial.fleet.stops}, outside by {worst:.2f} m at most, nearest {nearest:.2f} m; refused: {counts}",
                flush=True,
            )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
