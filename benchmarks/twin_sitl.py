"""Missions on ArduPilot's SITL, and the same rehearsed: duration, way, battery, end.

    ARDUPILOT_HOME=~/ardupilot python benchmarks/twin_sitl.py [--missions 10] [--vehicles copter,rover,plane]
                                                              [--winds 0,5,10] [--seed 1]

Each mission flies on SITL through the API, and then `mavproxy-uavapi run` rehearses it with SITL's parameters and the
same wind. A line for each: the durations from arming to disarming (s), how far the rehearsed way is from the flown
one (m, for 95 % of its places, and at most), what of the battery is used (%), and where both end (m apart, modes).
At the end the shares within 5 % of the duration, 2 m of the way (plane 10), 10 % of the battery, and the same end.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import aiohttp
import requests

from tests.support.sitl_types import ardupilot_type

HOME = (-35.363261, 149.165230)
LOCATION = "-35.363261,149.165230,584,353"
METRES = 1 / 111_319.5  # degrees
EAST = METRES / math.cos(math.radians(HOME[0]))
WITHIN = {"copter": 2.0, "rover": 2.0, "plane": 10.0}  # m
REACH = {"copter": 80.0, "rover": 50.0, "plane": 300.0}  # m of home
LAT, LON, HEIGHT, ARMED, MODE, BATTERY = 1, 2, 3, 7, 6, 9  # columns of a report's samples
Point = tuple[float, float, float]


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


def flown_on_sitl(kind: str, items: list[dict[str, Any]], wind: str, folder: Path) -> dict[str, Any]:
    """The flight, and the file of its parameters."""
    rig = ardupilot_type(folder, kind)
    try:
        speed, direction = wind.split(",")
        for name, value in (("SIM_WIND_SPD", speed), ("SIM_WIND_DIR", direction)):
            rig.ok(requests.put(f"{rig.url}/parameters/{name}", json={"value": float(value)}, timeout=60))
        rig.ok(rig.post("/mission/waypoints", items=items))
        known = rig.ok(rig.get("/parameters"))["parameters"]
        names = [name for name in known if not name.startswith("SIM_")]
        (folder / "real.param").write_text("".join(f"{name} {known[name]:.9g}\n" for name in names))
        return asyncio.run(_watched(rig.url))
    finally:
        rig.stop()


async def _watched(url: str) -> dict[str, Any]:
    """Start the mission, and note the way until it is disarmed."""
    way: list[Point] = []
    seen: dict[str, Any] = {"battery": [], "armed": None, "disarmed": None, "at": 0.0, "mode": ""}
    async with aiohttp.ClientSession(url, timeout=aiohttp.ClientTimeout(None)) as session:
        names = "GLOBAL_POSITION_INT,SYS_STATUS,HEARTBEAT"
        async with session.ws_connect(f"/telemetry/stream?names={names}&events=mode") as stream:
            await _done(session.get("/command/arm"))
            await _done(session.post("/mission/start", json={}))
            async for message in stream:
                event = json.loads(message.data)
                if event.get("event") == "mode":
                    seen["mode"] = event["info"]["mode"]
                    continue
                fields = event["fields"]
                if event["name"] == "GLOBAL_POSITION_INT":
                    seen["at"] = fields["time_boot_ms"] / 1000
                    way.append((fields["lat"] / 1e7, fields["lon"] / 1e7, fields["relative_alt"] / 1000))
                elif event["name"] == "SYS_STATUS":
                    seen["battery"].append(fields["battery_remaining"])
                elif fields["base_mode"] & 128:
                    seen["armed"] = seen["armed"] or seen["at"]
                elif seen["armed"]:
                    break
    used = seen["battery"][0] - seen["battery"][-1]
    return {"way": way, "duration": seen["at"] - seen["armed"], "used": used, "mode": seen["mode"]}


async def _done(request: Any) -> None:
    async with request as response:
        assert response.status == 200, await response.text()


def rehearsed(kind: str, items: list[dict[str, Any]], wind: str, folder: Path) -> dict[str, Any]:
    """The same, by `run` with SITL's parameters."""
    (folder / "m.json").write_text(json.dumps({"items": items}))
    command = [sys.executable, "-c", "from mavproxy_uavapi.commands import main; raise SystemExit(main())", "run"]
    command += [str(folder / "m.json"), f"--vehicle={kind}", f"--wind={wind}", f"--location={LOCATION}"]
    command += [f"--parameters={folder / 'real.param'}", f"--report={folder / 'report.json'}"]
    done = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True)
    assert (folder / "report.json").exists(), done.stdout + done.stderr
    flight = json.loads((folder / "report.json").read_text())["flights"][0]
    samples = flight["vehicles"]["1"]["samples"]
    used = samples[0][BATTERY] - samples[-1][BATTERY]
    way = [(one[LAT], one[LON], one[HEIGHT]) for one in samples]
    return {
        "way": way,
        "duration": flight["duration_s"],
        "used": used,
        "mode": samples[-1][MODE],
        "said": done.stdout,
    }


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


def compared(kind: str, seed: int, wind: str) -> dict[str, bool]:
    items = mission(kind, seed)
    with tempfile.TemporaryDirectory(prefix="twin-") as name:
        folder = Path(name)
        real, twin = flown_on_sitl(kind, items, wind, folder), rehearsed(kind, items, wind, folder)
    apart = sorted(beside(twin["way"], real["way"]))
    most = apart[int(len(apart) * 0.95)]
    end = math.hypot(*metres(real["way"][-1], twin["way"][-1])[:2])
    print(
        f"{kind} {seed} wind {wind}: {real['duration']:.0f} and {twin['duration']:.0f} s, beside {most:.1f} m "
        f"(at most {apart[-1]:.1f}), battery {real['used']} and {twin['used']:.0f} %, "
        f"ends {end:.1f} m apart in {real['mode']} and {twin['mode']}",
        flush=True,
    )
    return {
        "duration": abs(twin["duration"] - real["duration"]) <= 0.05 * real["duration"],
        "way": most <= WITHIN[kind],
        "battery": abs(twin["used"] - real["used"]) <= max(1.0, 0.1 * real["used"]),
        "end": end <= WITHIN[kind] and real["mode"] == twin["mode"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--missions", type=int, default=10)
    parser.add_argument("--vehicles", default="copter,rover,plane")
    parser.add_argument("--winds", default="0,5,10")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    assert "ARDUPILOT_HOME" in os.environ, "ARDUPILOT_HOME names a copy of ArduPilot with built SITL"
    winds = given.winds.split(",")
    for kind in given.vehicles.split(","):
        outcomes = [
            compared(kind, seed, f"{winds[seed % len(winds)]},{seed * 50 % 360}")
            for seed in range(given.seed, given.seed + given.missions)
        ]
        shares = {what: sum(one[what] for one in outcomes) for what in outcomes[0]}
        print(kind, ", ".join(f"{what} {count} of {len(outcomes)}" for what, count in shares.items()))


if __name__ == "__main__":
    main()
