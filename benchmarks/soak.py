"""A chaos run: random clients, faults, a pilot, module reloads; at the end nothing may be left over.

    python benchmarks/soak.py --minutes 10 [--seed N]

Real processes throughout: the embedded vehicle with its faults, a MAVProxy, and clients by TCP. It fails when a
request was not answered within its bound, when an answer names a defect of ours, when MAVProxy's log holds a
traceback, or when MAVProxy keeps jobs, threads, descriptors, child processes or memory.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from figures import machine
from rig import harness
from soak_clients import MODES, Clients
from soak_notes import RSS_ALLOWED, Notes, Usage, look_for_bad_words

from tests.support.ports import free_port

SPEEDUP = 10
WARM_UP = 120.0  # s of chaos before memory counts
QUIET = 90.0  # s in which everything must come to rest


class Trouble:
    """The vehicle's faults, a pilot at MAVProxy's prompt, and somebody who reloads the module."""

    def __init__(self, rig: Any, notes: Notes, dice: random.Random) -> None:
        self._rig, self._notes, self._dice = rig, notes, dice

    def _some_fault(self) -> dict[str, Any]:
        """A fault; its times are simulated ones, ten times as fast as ours."""
        dice = self._dice
        count = dice.randrange(1, 4)
        acks = {"command": "all", "count": count}
        return dice.choice(
            [
                {"name": "silence", "seconds": dice.choice((5, 20, 80)), "receiving": dice.random() < 0.5},
                {"name": "lose_acks", **acks},
                {"name": "delay_acks", **acks, "seconds": dice.uniform(1, 30)},
                {"name": "foreign_ack", **acks, "result": 0},
                {"name": "refuse", **acks, "result": dice.choice((1, 2, 4)), "text": "PreArm: soaked"},
                {"name": "in_progress", **acks, "seconds": dice.uniform(1, 30)},
                {"name": "freeze_gps", "seconds": dice.uniform(1, 50)},
                {"name": "pilot_mode", "mode": dice.choice(("LOITER", "ALT_HOLD", "LAND", "GUIDED"))},
                {"name": "pilot_disarm"},
                {"name": "ekf_bad", "seconds": dice.uniform(1, 50)},
                {"name": "reboot"},
            ]
        )

    async def faults(self) -> None:
        """A fault every second or so, and relief now and then."""
        while True:
            fault = self._some_fault()
            with contextlib.suppress(AssertionError):  # the vehicle refuses some modes at some times
                self._rig.control.fault(**fault)
                self._notes.events[fault["name"]] += 1
            await asyncio.sleep(self._dice.uniform(0.5, 5))
            if self._dice.random() < 0.4:
                self._rig.control.ask("clear")

    async def pilot(self) -> None:
        """Somebody at the prompt."""
        lines = [f"mode {mode}" for mode in MODES] + ["uavapi status", "uavapi log 3", "uavapi config", "uavapi x"]
        while True:
            self._rig.mavproxy.type(self._dice.choice(lines))
            self._notes.events["lines typed"] += 1
            await asyncio.sleep(self._dice.uniform(1, 8))

    async def reloads(self) -> None:
        """Somebody who reloads, unloads, loads, stops, starts and sets."""
        ways = [("module reload uavapi",), ("module unload uavapi", "module load uavapi")]
        ways += [("uavapi stop", "uavapi start"), ("uavapi set max_age 4", "uavapi set max_age 5")]
        while True:
            await asyncio.sleep(self._dice.uniform(5, 25))
            way = self._dice.choice(ways)
            for line in way:
                self._rig.mavproxy.type(line)
                await asyncio.sleep(self._dice.uniform(0.5, 2))
            self._notes.events[way[0]] += 1


class Soak:
    """The run: warm up, measure, chaos, measure."""

    def __init__(self, rig: Any, notes: Notes, seed: int) -> None:
        self._rig, self._notes = rig, notes
        self._dice = random.Random(seed)

    async def run(self, seconds: float) -> None:
        """All of it."""
        print(f"  at the start: {self._usage()}", flush=True)
        await self._chaos(WARM_UP)
        before = await self._at_rest()
        print(f"  warm: {before}", flush=True)
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            await self._chaos(min(left, 60.0))
            print(f"  {left:4.0f} s to go: {self._usage()}, {len(self._notes.failures)} failures", flush=True)
        after = await self._at_rest()
        print(f"  at the end: {after}", flush=True)
        self._compare(before, after)

    def _usage(self) -> Usage:
        return Usage.of(self._rig.mavproxy.pid)

    async def _chaos(self, seconds: float) -> None:
        for line in ("module load uavapi", "uavapi start"):  # whoever reloads may have been stopped half-way
            self._rig.mavproxy.type(line)
        trouble = Trouble(self._rig, self._notes, self._dice)
        troubles = [asyncio.ensure_future(one()) for one in (trouble.faults, trouble.pilot, trouble.reloads)]
        await Clients(self._rig.port, self._notes, self._dice).run(seconds)
        for task in troubles:
            if task.done():
                task.result()
            task.cancel()
        await asyncio.gather(*troubles, return_exceptions=True)

    async def _at_rest(self) -> Usage:
        """What MAVProxy holds when nobody asks for anything: faults over, module freshly loaded, no job running."""
        self._rig.control.ask("clear")
        self._rig.mavproxy.ask("module unload uavapi", "module uavapi", QUIET)
        self._rig.mavproxy.ask("module load uavapi", "listening on", QUIET)
        with contextlib.suppress(AssertionError):
            harness.eventually(lambda: self._running() == [], QUIET, "the end of all jobs")
        if self._running() != []:
            self._notes.fail(f"jobs are left over: {self._running()}")
        await asyncio.sleep(12)  # idle connections and slow headers run into their time limits
        return self._usage()

    def _running(self) -> list[dict[str, Any]] | None:
        try:
            jobs = self._rig.ok(self._rig.get("/jobs"))["jobs"]
        except OSError:  # nobody listens
            return None
        return [job for job in jobs if job["state"] == "running"]

    def _compare(self, before: Usage, after: Usage) -> None:
        if after.rss > before.rss + RSS_ALLOWED:
            self._notes.fail(f"memory grew by {after.rss - before.rss:.1f} MB")
        for name in ("threads", "descriptors", "children"):
            if getattr(after, name) > getattr(before, name):
                self._notes.fail(f"{name}: {getattr(before, name)} before, {getattr(after, name)} after")


def start(directory: Path) -> Any:
    """The vehicle, and a MAVProxy whose module finds its port in the environment, however it is loaded."""
    rig = harness.Rig(directory, free_port())
    try:
        instance = harness.start_embedded(rig, speedup=SPEEDUP)
        command = harness.mavproxy_command(instance, "--cmd=module load uavapi", logs=True)
        environment = {"UAVAPI_PORT": str(rig.port), "UAVAPI_MAX_RATE": "5000"}
        rig.mavproxy = rig.start("mavproxy", command, environment)
        rig.wait_until_up()
    except BaseException:
        rig.stop()
        raise
    return rig


def main() -> int:
    """Run, print a summary, and say whether all was well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 30))
    parser.add_argument("--keep", type=Path, help="a new folder, which keeps MAVProxy's log")
    options = parser.parse_args()
    if options.keep is not None and options.keep.exists():
        parser.error(f"{options.keep} is there already")
    print(f"soak: {options.minutes:g} min, seed {options.seed}; {machine()}", flush=True)
    notes = Notes()
    with tempfile.TemporaryDirectory(prefix="uavapi-soak-") as temporary:
        directory = options.keep or Path(temporary)
        directory.mkdir(parents=True, exist_ok=options.keep is None)
        rig = start(directory)
        try:
            asyncio.run(Soak(rig, notes, options.seed).run(options.minutes * 60))
            if rig.mavproxy.popen.poll() is not None:
                notes.fail("MAVProxy ended")
        finally:
            rig.stop()
            look_for_bad_words(rig.mavproxy.output(), notes)
            print(notes.summary())
    print(f"{len(notes.failures)} failures" if notes.failures else "all is well")
    return 1 if notes.failures else 0


if __name__ == "__main__":
    sys.exit(main())
