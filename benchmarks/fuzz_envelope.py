"""A hostile client against the envelope: how far does a copter get out of it?

    python benchmarks/fuzz_envelope.py --commands 10000 [--seed N] [--off]

In virtual time: the real API, host and bridge, the embedded copter. Half of the commands are drawn by hypothesis,
half come from a client that hugs the borders (tests/support/hostile.py). The vehicle's true position is looked at 50
times a second. What it does in RTL and LAND, which are never refused, and until it is back inside after them, is
counted apart. It fails where the vehicle was outside by more than the bound of the braking model, docs/safety.md.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import os
import random
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

from hypothesis import HealthCheck, Phase, given, seed, settings

from mavproxy_uavapi.core.airspace import braking, formats
from mavproxy_uavapi.core.airspace.local_frame import Spot
from mavproxy_uavapi.core.airspace.space import Space, outside_by
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.oversight.envelope_watch import CORRIDOR
from tests.support.envelopes import METRES, field, place
from tests.support.hostile import LATER, Attacks, Command, Tally, attacks
from tests.support.world import TICK, World

HALF, MAST = 100.0, 50.0
SPEED, INTERVAL = 12.0, 0.25  # the envelope's own limit, m/s; s between two positions
ACCELERATION = 5.0  # m/s/s, the most that the client sets (WPNAV_ACCEL)
FREE = {"RTL", "LAND"}
REVIVE = ("/command/guided", "/command/arm", "/command/takeoff?alt=15")
SETTINGS = {"max_rate": 100000.0, "max_jobs": 10000}


class Trial:
    """A world with an envelope, and how far outside its vehicle has been, by mode (m)."""

    def __init__(self, in_force: bool) -> None:
        self.world = World(SETTINGS)
        self.loop = self.world.loop
        self.world.flying(height=15.0)
        self.world.go_live()
        body = field(HALF, MAST, speed=SPEED, climb=5, descent=3)
        self._space = Space(formats.of_geojson(body, "the envelope"))
        self._frame = self._space.frame(place(0, 0))
        self._rules = self._space.rules(None)
        self._shift = self._frame.metres(METRES.origin)
        self.worst: dict[str, tuple[float, str]] = {}
        self.newest, self.tally, self.commands = "", Tally(), 0
        self.stops, self.fastest = 0, 0.0
        self._freely_out = False  # whether a mode that nobody refuses has brought it out, and nothing back in yet
        if in_force:
            assert self.world.ask("PUT", "/envelope", body).outcome == "200"
        self.world.host.jobs.on_ended.append(self._ended)
        self._look = self.loop.create_task(self._looking())

    def _ended(self, job: Job) -> None:
        self.stops += job.client == "envelope"
        if job.error is not None:
            self.tally[f"job {job.error.code}"] += 1

    async def _looking(self) -> None:
        while True:
            north, east, down = self.world.at
            by = outside_by(Spot(north + self._shift[0], east + self._shift[1], -down), self._rules)
            mode = self.world.copter.mode.name
            self._freely_out = by > 0.0 and (self._freely_out or mode in FREE)
            mode = f"after {' or '.join(sorted(FREE))}" if self._freely_out and mode not in FREE else mode
            self.fastest = max(self.fastest, math.hypot(*self.world.copter.body.velocity[:2]))
            if by > self.worst.get(mode, (-1.0, ""))[0]:
                self.worst[mode] = (
                    by,
                    f"t={self.loop.time():.1f} at {north:.1f} {east:.1f} {-down:.1f}: {self.newest}",
                )
            await asyncio.sleep(TICK)

    def send(self, command: Command, later: float) -> None:
        """A command, without waiting for what it begins, and the time to the next."""
        method, path, body = command
        self.commands += 1
        self.newest = f"{method} {path} {body}"
        kind = "text/plain" if isinstance(body, str) else "application/json"
        target = path + ("&" if "?" in path else "?") + "wait=false"
        content = body.encode() if isinstance(body, str) else body
        reply = self.world.ask(method, target, content, kind)
        self.tally.note(reply.status, reply.body)
        if later:
            self.loop.pass_time(later)
        if self.world.copter.mode.name != "GUIDED" and self.commands % 4 == 0:
            self.revive()

    def revive(self) -> None:
        """Bring it up and into GUIDED again, by the API."""
        for path in REVIVE[:1] if self.world.at[2] < -1.0 and self.world.copter.armed else REVIVE:
            self.world.ask("GET", path)

    def close(self) -> None:
        """End it."""
        self._look.cancel()
        self.world.close()


def bound() -> float:
    """Metres: the bound of the model for this vehicle."""
    stopping = braking.of_brake({})
    return braking.overshoot(stopping, SPEED, ACCELERATION, INTERVAL + braking.LATENCY, CORRIDOR)


def by_hypothesis(trial: Trial, count: int, number: int) -> None:
    """Commands that hypothesis draws, forty in each example."""

    @seed(number)
    @settings(
        max_examples=max(count // 40, 1), database=None, deadline=None, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(attacks(HALF, MAST))
    def attack(commands: list[tuple[Command, float]]) -> None:
        for command, later in commands:
            trial.send(command, later)

    attack()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--commands", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--off", action="store_true", help="without the envelope: how far out would it be?")
    options = parser.parse_args()
    began, trial = time.monotonic(), Trial(not options.off)
    by_hypothesis(trial, options.commands // 2, options.seed)
    dice = random.Random(options.seed)
    client = Attacks(dice, HALF, MAST)
    while trial.commands < options.commands:
        trial.send(client.command(), dice.choice(LATER))
    print(f"{trial.commands} commands, {trial.loop.time() - 1000:.0f} s of flight, {time.monotonic() - began:.0f} s")
    print("; ".join(f"{name}: {count}" for name, count in sorted(trial.tally.items())))
    print(f"stopped in flight {trial.stops} times; fastest {trial.fastest:.1f} m/s")
    print(f"bound of the braking model: {bound():.1f} m")
    for mode, (by, when) in sorted(trial.worst.items()):
        print(f"{mode}: outside by {by:.2f} m at most; {when[:160]}")
    worst = max((by for mode, (by, _) in trial.worst.items() if not mode.startswith(("after", *FREE))), default=0.0)
    defects = trial.loop.defects
    trial.close()
    for defect in defects[:3]:
        print(f"DEFECT: {defect['message']}: {defect.get('exception')!r}")
    print(f"worst but for RTL and LAND: {worst:.2f} m")
    return 0 if (worst <= bound() or options.off) and not defects else 1


if __name__ == "__main__":
    sys.exit(main())
