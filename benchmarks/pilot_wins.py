"""Does the pilot win on slow links? Counts what a second sending, a late answer or a closing command undoes.

    python benchmarks/pilot_wins.py [--runs 250] [--loss 0.3] [--verb arm] [--link 0.9] [--seed N]

In virtual time: the real API and host, the embedded copter, and a link that takes 0, 0.3, 0.9 or 2 s each way and up
to as much more by chance, so that messages overtake each other. In each run a client asks for a verb; up to 3 s after
its effect the pilot switches to ALT_HOLD or back, or disarms (after `disarm`: arms). A run counts where that does not
last. It fails if one does. `--loss`: the share of messages that are lost each way while the verb is on its way.
"""

from __future__ import annotations

import argparse
import gc
import os
import random
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))
os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.support.envelopes import field, place
from tests.support.faulty_link import by_chance, nothing
from tests.support.world import LEGS, PLACE, World, item_at

LINKS = (0.0, 0.3, 0.9, 2.0)  # s each way
SETTLED = 6.0  # s in which the link is measured
ARM = 400  # MAV_CMD_COMPONENT_ARM_DISARM
QUIET, LONGEST = 1.0, 30.0  # s without a job after which nothing more is sent, and s in any case
TICK = 0.05  # s; coarser than the tests', and as good for this
ENDS_LATER = ("deleted rtl", "hung up", "lease over")  # after the answer
ALT_HOLD_ONLY = ("takeoff", "deleted rtl", "track's return", "vision's landing")
CAMERA = {"sim_tags": "0:0.6@300,0", "tags": "0:0.6"}  # a tag that is nowhere near


class Verb(NamedTuple):
    """How it is asked for, and in which mode the vehicle is before; "ground": disarmed, in GUIDED.

    Attributes:
        act: what then brings the effect about, if the request does not; it gets its connection, and returns one.
        sees: whether it needs a camera.
    """

    method: str
    path: str
    before: str
    body: Any = None
    act: Callable[[World, Any], Any] | None = None
    sees: bool = False


def _delete(world: World, wire: Any) -> Any:
    if wire.reply.done():
        return wire
    return world.begin("DELETE", f"/jobs/{world.host.jobs.running()[-1].id}")


def _hang_up(world: World, wire: Any) -> Any:
    world.host.endings.on_disconnect = Policy.RTL
    wire.hang_up()
    return wire


def _late(world: World, _wire: Any) -> Any:
    """It asks for home first: an envelope has come, and home is not known."""
    assert world.ask("PUT", "/envelope", field(300.0, 600)).outcome == "200"
    world.host.registry.find(1).state.messages.pop("HOME_POSITION", None)
    return world.begin("GET", "/command/guided")


def _line(north: float) -> str:
    lat, lon = place(north, 0)
    return f"(1, {round(lat * 1e7)}, {round(lon * 1e7)}, {(584 + 8) * 1000}, 0, 65535, 0, 0, 3, 10)"


GO, FAR = "/movement/go_to_ned", {"x": 300, "y": 0, "z": -8}
TRACK = {"track": _line(0) + "\n" + _line(4), "ground": 584}
BLIND = {"alt": 8, "north": 3, "east": 0, "tag": False}
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
    "fleet land": Verb("POST", "/fleet/land", "GUIDED", {"vehicles": [1], "all_or_none": True}),
    "late guided": Verb("GET", "/telemetry/gps", "LOITER", act=_late),
    "deleted rtl": Verb("GET", "/command/rtl", "GUIDED", act=_delete),
    "hung up": Verb("POST", GO + "_wait", "GUIDED", FAR, act=_hang_up),
    "lease over": Verb("POST", GO + "?lease=5&client=mission", "GUIDED", FAR),
    "track's return": Verb("POST", "/mission/fly-track", "GUIDED", TRACK),
    "vision's landing": Verb("POST", "/vision/mission", "GUIDED", BLIND, sees=True),
}


def stage(world: World, before: str) -> None:
    """Bring it to where the verb begins."""
    world.simulator.parameters.set("DISARM_DELAY", 0.0)  # it would disarm by itself
    if before == "ground":
        world.boot()
        world.in_mode("GUIDED")
    elif before == "armed":
        world.armed()
    else:
        world.flying(mode=before)
    world.copter.mission.items[:] = [item_at(*PLACE), *(item_at(PLACE[0] + north, PLACE[1]) for north in LEGS)]


class Run:
    """One run.

    Args:
        name: of the verb.
        seconds: that a message takes each way, and at most so many more by chance.
        loss: the share of messages that are lost each way.
        seed: of all that is by chance.

    Attributes:
        outcome: "not begun" without an effect, "kept" if what the pilot did then lasts, else what became of it.
    """

    def __init__(self, name: str, seconds: float, loss: float, seed: int) -> None:
        self._name, self._seconds, self._verb = name, seconds, VERBS[name]
        self._chance = random.Random(f"{name} {seconds} {loss} {seed}")
        self._world = world = World({}, step=TICK)
        world.directory = Path(tempfile.gettempdir())
        if self._verb.sees:
            world.mount_camera(CAMERA)
            world.listen()
            world.open_eye()
        world.host.endings.on_lease_end = Policy.RTL
        stage(world, self._verb.before)
        world.go_live()
        world.delay(seconds, seconds, seed)
        world.pass_time(SETTLED)
        world.loses = by_chance(loss, seed)
        wire = self._begin()
        try:
            self.outcome = self._meet(wire) if self._begins(wire) else "not begun"
        finally:
            world.loses = nothing
            wire.hang_up()
            world.close()

    def _begin(self) -> Any:
        verb, world = self._verb, self._world
        wire = world.begin(verb.method, verb.path, verb.body)
        if verb.act is not None:
            world.pass_time(2.0 + 4 * self._seconds)
            wire = verb.act(world, wire)
        return wire

    @property
    def _state(self) -> tuple[str, bool]:
        return self._world.vehicle.mode.name, self._world.vehicle.armed

    def _begins(self, wire: Any) -> bool:
        """Wait for the verb's effect on the vehicle; False if there is none."""
        world, before = self._world, self._state
        deadline = world.now + 60.0
        while world.now < deadline:
            if (world.at[2] < -0.3) if self._name == "takeoff" else self._state != before:
                return True
            if wire.reply.done() and self._name not in ENDS_LATER:
                return False
            world.pass_time(0.02)
        return False

    def _meet(self, wire: Any) -> str:
        """The pilot does something; what undoes it."""
        world, name = self._world, self._name
        world.pass_time(self._chance.uniform(0.0, 3.0))
        if name in ("arm", "disarm"):
            if world.vehicle.armed != (name == "arm"):
                return "not begun"
            world.by_hand(ARM, float(name == "disarm"))
        else:
            backs = ["ALT_HOLD"] if name in ALT_HOLD_ONLY else ["ALT_HOLD", self._verb.before]
            world.in_mode(self._chance.choice(backs))
        mode, armed = self._state
        quiet_for, deadline = 0.0, world.now + LONGEST
        while quiet_for < QUIET + 2 * self._seconds and world.now < deadline and (armed or name == "arm"):
            world.pass_time(0.1)
            quiet_for = 0.0 if world.host.jobs.running() else quiet_for + 0.1  # what was sent arrives meanwhile
            now = self._state
            if (now[1] and not armed) or (name != "arm" and now[0] != mode) or (name == "disarm" and not now[1]):
                answer = wire.reply.result() if wire.reply.done() else None
                return f"{(mode, armed)} became {now}; {'no answer yet' if answer is None else answer.outcome}"
        return "kept"


def main() -> int:
    """Run; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=250, help="for each verb and link")
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--verb", choices=VERBS)
    parser.add_argument("--link", type=float, help="s each way; all of them by default")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    gc.set_threshold(50_000, 20, 100)
    undone = 0
    for name in [options.verb] if options.verb else VERBS:
        for seconds in LINKS if options.link is None else [options.link]:
            began = time.process_time()
            seeds = range(options.seed, options.seed + options.runs)
            found = {seed: Run(name, seconds, options.loss, seed).outcome for seed in seeds}
            wrong = {seed: what for seed, what in found.items() if what not in ("kept", "not begun")}
            undone += len(wrong)
            met = options.runs - list(found.values()).count("not begun")
            first = "" if not wrong else "  e.g. seed {}: {}".format(*next(iter(wrong.items())))
            took = (time.process_time() - began) / options.runs
            line = f"{name:16} {seconds:3.1f} s each way: {len(wrong):4} of {met} undone"
            print(f"{line}, {took:.2f} s a run{first}", flush=True)
    return 1 if undone else 0


if __name__ == "__main__":
    sys.exit(main())
