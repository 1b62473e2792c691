"""Missions and scripts on ArduPilot's SITL, and the same rehearsed: duration, way, battery, end.

    ARDUPILOT_HOME=~/ardupilot python benchmarks/twin_sitl.py [--missions 10] [--vehicles copter,rover,plane,scripts]
                                              [--winds 0,5,10] [--seed 1] [--keep DIR] [--only-sitl] [--speedup 10]

Each is flown by `mavproxy-uavapi run`, once on SITL and once on the embedded vehicle, with SITL's parameters, every
second one with some that are not SITL's own, and the same wind. A row for each: the durations from arming to
disarming (s), how far the rehearsed way is from the flown one (m, for 95 % of its places, and at most), what of the
battery is used (%), and where both end (m apart, modes). At the end the shares within 5 % of the duration, 2 m of the
way (plane 10), 10 % of the battery (or 1 % of its capacity), and the same end. What is in DIR is not flown again.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.rehearse_examples import EXAMPLES, FILES

HOME = (-35.363261, 149.165230)
LOCATION = "-35.363261,149.165230,584,353"
METRES = 1 / 111_319.5  # degrees
EAST = METRES / math.cos(math.radians(HOME[0]))
WITHIN = {"copter": 2.0, "rover": 2.0, "plane": 10.0}  # m
REACH = {"copter": 80.0, "rover": 50.0, "plane": 300.0}  # m of home
OTHERS: dict[str, dict[str, tuple[float, float]]] = {  # parameters that are not SITL's own, by chance in between
    "copter": {"WPNAV_SPEED": (300, 800), "WPNAV_ACCEL": (100, 400), "LAND_SPEED": (30, 80), "RTL_ALT": (1000, 4000)},
    "rover": {"CRUISE_SPEED": (2, 6), "WP_SPEED": (2, 6), "WP_RADIUS": (1, 4)},
    "plane": {"AIRSPEED_CRUISE": (18, 26), "WP_RADIUS": (40, 100), "ROLL_LIMIT_DEG": (35, 60)},
}
OF_SCRIPTS = 5.0  # times real time: what they compute takes its time on SITL's clock
LAT, LON, HEIGHT, MODE, BATTERY = 1, 2, 3, 6, 9  # columns of a report's samples
RUN = [sys.executable, "-c", "from mavproxy_uavapi.commands import main; raise SystemExit(main())", "run"]
TELL_PARAMETERS = """
import json, os, urllib.request
known = json.load(urllib.request.urlopen(os.environ["UAVAPI_URL"] + "/parameters"))["parameters"]
with open("parameters.json", "w") as file:
    json.dump(known, file)
"""
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Flight:
    """What is flown twice: its name, the type, the file, the wind (m/s, degrees) and other parameters."""

    name: str
    kind: str
    file: Path
    wind: str
    others: dict[str, float]


def missions(kind: str, seeds: range, winds: list[str], folder: Path) -> Iterator[Flight]:
    for seed in seeds:
        chance = random.Random(f"others {kind} {seed}")
        others = {name: round(chance.uniform(*of), 2) for name, of in OTHERS[kind].items()} if seed % 2 else {}
        file = folder / f"{kind}-{seed}.json"
        file.write_text(json.dumps({"items": mission(kind, seed)}))
        yield Flight(f"{kind} {seed}", kind, file, f"{winds[seed % len(winds)]},{seed * 50 % 360}", others)


def scripts(winds: list[str], folder: Path) -> Iterator[Flight]:
    copy = shutil.copytree(EXAMPLES, folder / "examples")  # they write logs beside themselves
    for number, name in enumerate(FILES):
        yield Flight(name, "copter", copy / name, f"{winds[number % len(winds)]},{number * 50 % 360}", {})


def mission(kind: str, seed: int) -> list[dict[str, Any]]:
    """A few waypoints around home, and a return or a landing."""
    chance = random.Random(f"{kind} {seed}")
    reach = REACH[kind]

    def waypoint(north: float, east: float, alt: float, command: str = "NAV_WAYPOINT") -> dict[str, Any]:
        place = {"lat": HOME[0] + north * METRES, "long": HOME[1] + east * EAST}
        return {"command": command, **place, "alt": alt}

    height = 50.0 if kind == "plane" else 0.0 if kind == "rover" else chance.uniform(8, 30)
    climbs = [] if kind == "rover" else [waypoint(0, 0, height, "NAV_TAKEOFF") | {"param1": 15}]
    way = [
        waypoint(
            chance.uniform(-reach, reach),
            chance.uniform(-reach, reach),
            height if kind == "rover" else height + chance.uniform(0, 15),
        )
        for _ in range(chance.randint(3, 6))
    ]
    ends: list[dict[str, Any]] = [{"command": "NAV_RETURN_TO_LAUNCH"}]
    if kind == "plane":
        ends = [waypoint(-400, 0, 40), waypoint(-200, 0, 20), waypoint(0, 0, 0, "NAV_LAND")]
    elif kind == "copter" and chance.random() < 0.3:
        ends = [{"command": "NAV_LAND"}]
    return climbs + way + ends


def flown(flight: Flight, parameters: dict[str, float], report: Path, *options: str) -> dict[str, Any]:
    """What came of it, by the report of `run`."""
    given = report.with_suffix(".param")
    given.write_text("".join(f"{name} {value:.9g}\n" for name, value in {**parameters, **flight.others}.items()))
    command = [*RUN, str(flight.file), f"--vehicle={flight.kind}", f"--wind={flight.wind}", f"--location={LOCATION}"]
    command += [f"--parameters={given}", f"--report={report}", *options]
    done = subprocess.run(command, cwd=flight.file.parent, check=False, capture_output=True, text=True)
    if not report.exists():
        raise RuntimeError(done.stdout + done.stderr)
    return seen(report)


def seen(report: Path) -> dict[str, Any]:
    flight = json.loads(report.read_text(encoding="utf-8"))["flights"][0]
    samples = flight["vehicles"]["1"]["samples"]
    used = samples[0][BATTERY] - samples[-1][BATTERY]
    way = [(one[LAT], one[LON], one[HEIGHT]) for one in samples]
    return {"way": way, "duration": flight["duration_s"], "used": used, "mode": samples[-1][MODE]}


def sitls_own(kind: str, folder: Path, *options: str) -> dict[str, float]:
    """The parameters with which SITL boots; those of the simulation itself are no vehicle's."""
    kept = folder / f"parameters-{kind}.json"
    if not kept.exists():
        with tempfile.TemporaryDirectory(prefix="twin-") as name:
            script = Path(name, "tell.py")
            script.write_text(TELL_PARAMETERS)
            subprocess.run([*RUN, str(script), f"--vehicle={kind}", *options], check=True, capture_output=True)
            shutil.copy(Path(name, "parameters.json"), kept)
    known = json.loads(kept.read_text())
    return {name: value for name, value in known.items() if not name.startswith(("SIM_", "STAT_"))}


def metres(a: Point, b: Point) -> tuple[float, float, float]:
    return (b[0] - a[0]) / METRES, (b[1] - a[1]) / EAST, b[2] - a[2]


def beside(way: list[Point], other: list[Point]) -> list[float]:
    """m from each place of the first way to the nearest part of the other."""
    return [min(_from_leg(place, a, b) for a, b in zip(other, other[1:], strict=False)) for place in way[::4]]


def _from_leg(place: Point, a: Point, b: Point) -> float:
    along, there = metres(a, b), metres(a, place)
    square = sum(one * one for one in along)
    share = 0.0 if not square else max(0.0, min(1.0, sum(x * y for x, y in zip(along, there, strict=True)) / square))
    return math.dist(there, [share * one for one in along])


def compared(flight: Flight, real: dict[str, Any], twin: dict[str, Any]) -> dict[str, bool]:
    apart = sorted(beside(twin["way"], real["way"]))
    most = apart[int(len(apart) * 0.95)]
    end = math.hypot(*metres(real["way"][-1], twin["way"][-1])[:2])
    within = WITHIN[flight.kind]
    print(
        f"| {flight.name}{' others' * bool(flight.others)} | {flight.wind} | {real['duration']:.0f}, "
        f"{twin['duration']:.0f} | {most:.1f} ({apart[-1]:.1f}) | {real['used']:.0f}, {twin['used']:.0f} | "
        f"{end:.1f} {real['mode']} {twin['mode']} |",
        flush=True,
    )
    return {
        "duration": abs(twin["duration"] - real["duration"]) <= 0.05 * real["duration"],
        "way": most <= within,
        "battery": abs(twin["used"] - real["used"]) <= max(1.0, 0.1 * real["used"]),
        "end": end <= within and real["mode"] == twin["mode"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--missions", type=int, default=10)
    parser.add_argument("--vehicles", default="copter,rover,plane,scripts")
    parser.add_argument("--winds", default="0,5,10")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="where SITL's flights are kept")
    parser.add_argument("--only-sitl", action="store_true", help="rehearse nothing")
    parser.add_argument("--speedup", type=float, default=10, help="of SITL; scripts have 5 at most")
    given = parser.parse_args()
    ardupilot = f"--ardupilot-path={os.environ['ARDUPILOT_HOME']}"
    with tempfile.TemporaryDirectory(prefix="twin-") as name:
        keep, winds = given.keep or Path(name, "kept"), given.winds.split(",")
        keep.mkdir(exist_ok=True)
        for what in given.vehicles.split(","):
            seeds = range(given.seed, given.seed + given.missions)
            flights = scripts(winds, Path(name)) if what == "scripts" else missions(what, seeds, winds, Path(name))
            outcomes = []
            for flight in flights:
                parameters = sitls_own(flight.kind, keep, ardupilot)
                report = keep / f"{flight.name.replace('/', '-').replace(' ', '-')}.json"
                if not report.exists():
                    speedup = min(given.speedup, OF_SCRIPTS) if what == "scripts" else given.speedup
                    flown(flight, {}, report, ardupilot, f"--speedup={speedup}")
                if not given.only_sitl:
                    twin = flown(flight, parameters, Path(name, "twin.json"))
                    outcomes.append(compared(flight, seen(report), twin))
            if outcomes:
                shares = {what: sum(one[what] for one in outcomes) for what in outcomes[0]}
                print(what, ", ".join(f"{name} {count} of {len(outcomes)}" for name, count in shares.items()))


if __name__ == "__main__":
    main()
