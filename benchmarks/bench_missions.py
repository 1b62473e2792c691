"""How long a large mission holds the asyncio thread, how long its answer takes, and the memory.

    python benchmarks/bench_missions.py [--items 5000] [--areas 200] [--vehicles 10]

Nobody's `stop` is heard while the thread is held. `calls` asks the real API, in virtual time, for what a client may
ask with such a mission: upload, start, the flight, a position for another vehicle, a read. Each callback of the loop
is measured by the processor time of its own thread, so that another load of the machine does not count; the vehicles'
own steps are left out, and what is given to threads runs in one. `threads` measures the rest: how late a loop in real
time wakes while a thread does the check, beside the same for a thread that only counts.
"""

from __future__ import annotations

import argparse
import asyncio
import concurrent.futures
import gc
import json
import os
import resource
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

from mavproxy_uavapi.core.airspace import formats, mission_guard
from mavproxy_uavapi.core.airspace.envelope_check import MissionQuestion, answer
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.memory import keep_what_is_loaded
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import PathPoint, Setting
from tests.support.crossing_flights import APART, Fleet
from tests.support.envelopes import METRES, feature, place, square
from tests.support.virtual_time import FastLoop
from tests.support.wire import Wire
from tests.support.world import Item

NAP = 0.001  # s
HALF = 1500.0  # m: a survey is twice as wide
SEPARATION = 8.0  # m
COUNTED = 1_000_000  # additions of the yardstick


def survey(count: int, up: float, east: float = 0.0) -> list[MissionItem]:
    """A survey of as many items around home."""
    places = [place(-HALF + 2 * HALF * n / count, east + (-1) ** n * HALF) for n in range(count)]
    return [MissionItem(16, 3, (0.0,) * 4, round(lat * 1e7), round(lon * 1e7), up) for lat, lon in places]


def envelope(areas: int) -> dict[str, Any]:
    """A field, and masts beside the survey in it."""
    masts = [
        feature(f"mast {number}", square(3, -1900 + 3800 * number / areas, 1900), "exclusion")
        for number in range(areas - 1)
    ]
    return {"type": "FeatureCollection", "features": [feature("field", square(2000)), *masts]}


class Collector:
    """The pauses of the garbage collector, which goes through the objects of the vehicles, too.

    Attributes:
        seconds: of all since it was set to 0.
        longest: s.
    """

    def __init__(self) -> None:
        self.seconds = self.longest = self._began = 0.0
        gc.callbacks.append(self._collects)

    def _collects(self, phase: str, _info: dict[str, int]) -> None:
        now = time.thread_time()
        if phase == "stop":
            self.seconds += now - self._began
            self.longest = max(self.longest, now - self._began)
        self._began = now

    def __str__(self) -> str:
        return f"the garbage collector: {1000 * self.longest:.1f} ms at most, {len(gc.get_objects())} objects"


class OwnTime:
    """The processor time of the loop's thread, for each callback that is ours.

    Attributes:
        longest: s of one callback without the garbage collector, and what it was, since `take`.
        collector: the pauses.
        not_ours: the task that steps the vehicles and carries their messages.
    """

    def __init__(self) -> None:
        self.longest, self.collector = (0.0, ""), Collector()
        self.not_ours: asyncio.Task[None] | None = None
        loop_thread, run = threading.get_ident(), asyncio.Handle._run

        def timed(handle: asyncio.Handle) -> None:
            owner = getattr(handle._callback, "__self__", None)  # type: ignore[attr-defined]
            before, self.collector.seconds = time.thread_time(), 0.0
            run(handle)
            seconds = time.thread_time() - before - self.collector.seconds
            ours = threading.get_ident() == loop_thread and owner is not self.not_ours and not isinstance(owner, Wire)
            if ours and seconds > self.longest[0]:
                self.longest = seconds, f"{owner.get_coro() if isinstance(owner, asyncio.Task) else handle}"

        asyncio.Handle._run = timed  # type: ignore[method-assign]

    def take(self) -> tuple[float, str]:
        """The longest until now, in ms, and what it was; it begins anew."""
        (longest, what), self.longest = self.longest, (0.0, "")
        return 1000 * longest, what.split(" at 0x")[0]


class Waited(concurrent.futures.ThreadPoolExecutor):
    """Threads whose work is over before virtual time goes on; `seconds` of their processor."""

    seconds = 0.0

    def submit(self, call: Callable[..., Any], /, *args: Any, **kwargs: Any) -> concurrent.futures.Future[Any]:
        def measured() -> Any:
            before = time.thread_time()
            try:
                return call(*args, **kwargs)
            finally:
                self.seconds += time.thread_time() - before

        done = super().submit(measured)
        concurrent.futures.wait([done])
        return done


class Calls:
    """The vehicles, the API over them, and what each call costs."""

    def __init__(self, chosen: argparse.Namespace) -> None:
        self.loop, self.threads = FastLoop(), Waited(1)
        asyncio.set_event_loop(self.loop)
        self.loop.set_default_executor(self.threads)
        self.fleet = Fleet(self.loop, chosen.vehicles + 1, {"separation": SEPARATION}, SEPARATION)
        self.world, self.own_time = self.fleet.world, OwnTime()
        sys.modules[self.world.simulator.missions.__module__].LIMIT = chosen.items + 1  # type: ignore[attr-defined]
        self.missions = [survey(chosen.items, 40.0 + 20.0 * number) for number in range(chosen.vehicles)]
        for simulator, items in zip(self.world.simulators[1:], self.missions[1:], strict=False):
            wire = [Item(i.command, i.frame, *i.params, i.x, i.y, i.z) for i in items]
            simulator.vehicle.mission.items[:] = [wire[0], *wire]
        report = [item.report(number) for number, item in enumerate(self.missions[0], 1)]
        self.body = json.dumps({"items": report}).encode()
        self.world.sent = deque(maxlen=1)  # type: ignore[assignment]  # what the world records is no memory of ours
        for simulator in self.world.simulators:
            simulator.received = deque(maxlen=1)  # type: ignore[assignment]
        keep_what_is_loaded()  # as the module does
        self.memory = peak()
        self.own_time.not_ours = self.world._tasks[0]
        for task in self.fleet._tasks:
            task.cancel()

    @contextmanager
    def measured(self, what: str) -> Iterator[None]:
        self.own_time.take()
        before, self.threads.seconds = time.thread_time(), 0.0
        yield
        (held, by), took = self.own_time.take(), time.thread_time() - before
        cost = f"{self.threads.seconds:.2f} s of threads, {took:.1f} s with the vehicles"
        print(f"{what}: held for {held:.1f} ms at most, by {by}; {cost}; {peak() - self.memory:+.0f} MB", flush=True)

    def ask(self, system: int, verb: str, body: Any = None) -> None:
        answer = self.fleet.ask(system, verb, body)
        if answer.outcome != "200":
            print(f"  {verb}: {answer.outcome}: {answer.body.get('detail')}")

    def run(self, chosen: argparse.Namespace) -> None:
        with self.measured("the envelope"):
            answer = self.world.ask("PUT", "/envelope", envelope(chosen.areas))
            assert answer.outcome == "200", answer.body
        for system in range(2, chosen.vehicles + 1):
            self._send_off(system)
        with self.measured("upload"):
            self.ask(1, "mission/waypoints", self.body)
        with self.measured("start"):
            self.ask(1, "mission/start")
        with self.measured("60 s of flight"):
            self.loop.pass_time(60.0)
        last = chosen.vehicles + 1
        lat, lon = place(-40.0, APART * last)
        with self.measured("go_to of another vehicle"):
            self.ask(last, "movement/go_to_gps_wait", {"lat": lat, "long": lon, "alt": 12})
        with self.measured("guided, and AUTO again"):
            self.ask(1, "command/guided")
            self.ask(1, "command/set_mode?mode=AUTO")
        with self.measured("a read"):
            assert self.world.ask("GET", "/vehicles/1/mission/waypoints").outcome == "200"
        print(self.own_time.collector)
        self.fleet.close()

    def _send_off(self, system: int) -> None:
        """As `mission/start`, without the transfer of thousands of items in virtual time."""
        vehicle, items = self.world.host.registry.find(system), self.missions[system - 1]

        async def download() -> Any:
            return None, items

        vehicle.waypoints.download, kept = download, vehicle.waypoints.download
        sent = (self.world.wired(i.to(vehicle.address, seq)) for seq, i in enumerate((items[0], *items)))
        self.world.host.missions.put(system, list(sent))  # what passes by is kept
        with self.measured(f"start of vehicle {system}"):
            self.ask(system, "mission/start")
        vehicle.waypoints.download = kept


class Watch:
    """The longest time that a loop in real time was held, s."""

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


def count() -> float:
    """The yardstick: how long COUNTED additions take (s)."""
    before, total = time.thread_time(), 0
    for number in range(COUNTED):
        total += number
    return time.thread_time() - before


async def threads(chosen: argparse.Namespace) -> None:
    """How late a loop wakes while a thread checks a mission, beside one that counts as long."""
    collector, watch, space = Collector(), Watch(), Space(formats.of_geojson(envelope(chosen.areas), "the envelope"))
    setting = Setting("copter", PathPoint(*place(-HALF, 0), 50.0), METRES.origin, 584.0)
    question = MissionQuestion(survey(chosen.items, 50.0), setting, (1,), (space,))
    for _ in range(3):
        watch.take()
        before = time.perf_counter()
        await asyncio.to_thread(answer, question)
        took, held = time.perf_counter() - before, watch.take()

        def until(end: float = time.perf_counter() + took) -> None:
            while time.perf_counter() < end:
                count()

        await asyncio.to_thread(until)
        print(f"checked in {took:.2f} s, woken {held:.1f} ms late at most; by counting {watch.take():.1f} ms")
    print(collector)


def peak() -> float:
    """The most memory so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--items", type=int, default=5000)
    parser.add_argument("--areas", type=int, default=200)
    parser.add_argument("--vehicles", type=int, default=10)
    parser.add_argument("--only", choices=["calls", "threads"])
    chosen = parser.parse_args()
    mission_guard.CHECKED_FOR = 1e9  # the transfer of the items takes long in virtual time
    print(f"{COUNTED} additions take {1000 * min(count() for _ in range(5)):.0f} ms")
    if chosen.only != "threads":
        Calls(chosen).run(chosen)
    if chosen.only != "calls":
        asyncio.run(threads(chosen))
    return 0


if __name__ == "__main__":
    sys.exit(main())
