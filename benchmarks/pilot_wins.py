"""Does anything that we send a second time undo what the pilot has done?

    python benchmarks/pilot_wins.py --runs 200 [--loss 0.3] [--verb arm] [--seed N]

In virtual time: the real API and host, the embedded copter, and a link that takes 0, 0.3, 0.9 or 2 s each way and up
to as much more by chance, so that messages overtake each other. In each run a client asks for a verb; up to 3 s after
its effect the pilot switches to ALT_HOLD or back, or disarms (after `disarm`: arms). A run counts where that does not
last. It fails if one does. `--loss`: the share of messages that are lost each way while the verb is on its way.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import random
import sys
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))
os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

from tests.support.at_once import AtOnce
from tests.support.mavproxy import mavproxy_state
from tests.support.slow_links import delay, lose
from tests.support.virtual_time import TimeTravellingLoop
from tests.support.world import LEGS, PLACE, World, item_at

LINKS = (0.0, 0.3, 0.9, 2.0)  # s each way
SETTLED = 6.0  # s in which the link is measured
ARM = 400  # MAV_CMD_COMPONENT_ARM_DISARM


class Verb(NamedTuple):
    """How it is asked for, and the mode in which the vehicle is before; "ground": disarmed, in GUIDED."""

    method: str
    path: str
    before: str


VERBS = {
    "guided": Verb("GET", "/command/guided", "LOITER"),
    "set_mode": Verb("GET", "/command/set_mode?mode=AUTO", "GUIDED"),
    "rtl": Verb("GET", "/command/rtl", "GUIDED"),
    "land": Verb("GET", "/command/land", "GUIDED"),
    "brake": Verb("GET", "/command/brake", "GUIDED"),
    "mission start": Verb("POST", "/mission/start", "GUIDED"),
    "arm": Verb("GET", "/command/arm?timeout=60", "ground"),
    "disarm": Verb("GET", "/command/disarm", "armed"),
    "takeoff": Verb("GET", "/command/takeoff?alt=8", "armed"),
}


def stage(world: World, before: str) -> None:
    """Bring it to where the verb begins."""
    if before == "ground":
        world.boot()
        world.in_mode("GUIDED")
    elif before == "armed":
        world.armed()
    else:
        world.flying(mode=before)
    world.copter.mission.items[:] = [item_at(*PLACE), *(item_at(PLACE[0] + north, PLACE[1]) for north in LEGS)]


def run(name: str, seconds: float, loss: float, seed: int) -> str | None:
    """One run; what is wrong, None for nothing."""
    verb, chance = VERBS[name], random.Random(f"{name} {seconds} {loss} {seed}")
    loop = TimeTravellingLoop()
    asyncio.set_event_loop(loop)
    loop.set_default_executor(AtOnce())
    world = World(loop, mavproxy_state(), {})
    stage(world, verb.before)
    world.go_live()
    delay(world, seconds, seconds, seed)
    share = lose(world, seed)
    loop.pass_time(SETTLED)
    share(loss)
    wire = world.begin(verb.method, verb.path)
    try:
        return _meet(world, name, wire, chance) if _begins(world, name, wire) else None
    finally:
        share(0.0)
        wire.hang_up()
        world.close()
        world.host.bridge._calls.close()
        loop.close()


def _state(world: World) -> tuple[str, bool]:
    return world.vehicle.mode.name, world.vehicle.armed


def _begins(world: World, name: str, wire: Any) -> bool:
    """Wait for the verb's effect on the vehicle; False if there is none."""
    before = _state(world)
    lifts_off = name == "takeoff"
    deadline = world.loop.time() + 40.0
    while world.loop.time() < deadline:
        if (world.at[2] < -0.3) if lifts_off else _state(world) != before:
            return True
        if wire.reply.done():
            return False
        world.loop.pass_time(0.02)
    return False


def _meet(world: World, name: str, wire: Any, chance: random.Random) -> str | None:
    """The pilot does something; what undoes it."""
    world.loop.pass_time(chance.uniform(0.0, 3.0))
    if name in ("arm", "disarm"):
        if world.vehicle.armed != (name == "arm"):
            return None
        world.by_hand(ARM, float(name == "disarm"))
    else:
        backs = ["ALT_HOLD"] if name == "takeoff" else ["ALT_HOLD", VERBS[name].before]
        world.in_mode(chance.choice(backs))
    wanted = _state(world)
    until = world.loop.time() + 20.0
    while world.loop.time() < until and (wanted[1] or name == "arm"):
        world.loop.pass_time(0.1)
        mode, armed = _state(world)
        if (armed and not wanted[1]) or (name != "arm" and mode != wanted[0]) or (name == "disarm" and not armed):
            return f"{wanted} became {(mode, armed)}; {wire.reply.result().outcome if wire.reply.done() else 'open'}"
    return None


def main() -> int:
    """Run; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200, help="for each verb and link")
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--verb", choices=VERBS)
    parser.add_argument("--link", type=float, help="s each way; all of them by default")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    undone = 0
    for name in [options.verb] if options.verb else VERBS:
        for seconds in LINKS if options.link is None else [options.link]:
            seeds = range(options.seed, options.seed + options.runs)
            wrong = {seed: what for seed in seeds if (what := run(name, seconds, options.loss, seed))}
            undone += len(wrong)
            first = "" if not wrong else "  e.g. seed {}: {}".format(*next(iter(wrong.items())))
            print(f"{name:14} {seconds:3.1f} s each way: {len(wrong):4} of {options.runs} undone{first}", flush=True)
    return 1 if undone else 0


if __name__ == "__main__":
    sys.exit(main())
