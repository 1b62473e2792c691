"""The pictures of the page in the documentation: three embedded copters in flight, the first on a mission.

    python benchmarks/page_pictures.py [--folder docs/pictures] [--only-rehearsal]

They are `page-rehearsal.png`, which shows what came of *Try it first*, `page-light.png`, `page-dark.png`,
`page-phone.png`, `page-history.png` and `page-replay.png`: a flight of vehicle 2 beside another one of it.
`bench_page.py --pictures` makes those of ten vehicles.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from bench_page import LIVE, lift, take_pictures
from rig import harness

from tests.support.chromium import chromium
from tests.support.several_vehicles import several_vehicles

HOME = -35.363261, 149.165230  # degrees
METRES_PER_DEGREE, SHRUNK = 111_319.0, 0.8155  # of latitude; cosine of HOME's latitude
SYSTEMS = (1, 2, 3)
CORNERS = ((0, 30), (35, 45), (40, 5), (15, -25))  # m north and east, of the mission
FIRST_LEGS = {2: (40, -15), 3: (-18, 50)}  # m north and east, by vehicle
SECOND_LEGS = {2: (25, -45), 3: (-20, -10)}
LEG = 9.0  # s
TAB = "[...document.querySelectorAll('[role=tab]')].find(tab => tab.textContent === '{}').click()"
SHOWN = "document.querySelector('replay-bar')"
HEIGHT = 12.0  # m; a vehicle is higher by its number
APART = 5.0  # m from one vehicle's home to the next one's


def item(command: str, north: float = 0, east: float = 0) -> dict[str, Any]:
    """An item of the mission."""
    lat, lon = HOME[0] + north / METRES_PER_DEGREE, HOME[1] + east / METRES_PER_DEGREE / SHRUNK
    return {"command": command, "frame": "relative", "lat": lat, "long": lon, "alt": HEIGHT}


def home(number: int) -> str:
    """`--home` of a vehicle: east of the one before."""
    return f"{HOME[0]},{HOME[1] + (number - 1) * APART / METRES_PER_DEGREE / SHRUNK:.7f},584,353"


def plan(rig: Any, *last: dict[str, Any]) -> None:
    """Give vehicle 1 its mission."""
    takeoff = {**item("NAV_TAKEOFF"), "lat": 0, "long": 0}  # where it is
    mission = [takeoff, *(item("NAV_WAYPOINT", *corner) for corner in CORNERS), *last]
    rig.ok(rig.post("/vehicles/1/mission/waypoints", items=mission))


async def rehearse(page: Any, rig: Any, folder: Path) -> None:
    """Take the picture of a mission that was tried first."""
    await asyncio.to_thread(plan, rig, {"command": "NAV_RETURN_TO_LAUNCH"})
    await page.evaluate("document.querySelector('top-view').context.fleet.choose(1)")
    await page.evaluate("document.querySelector('mission-plan').read()")
    await page.evaluate(TAB.format("Mission"))
    await page.until("document.querySelector('mission-plan').vehicle?.mission?.items?.length > 4")
    await page.evaluate("document.querySelector('mission-plan').tryHeld()")
    await page.until("document.querySelector('mission-plan').textContent.includes('simulated vehicle:')", 240.0)
    await asyncio.sleep(3)  # the camera comes to rest
    picture = await page.picture()
    await asyncio.to_thread((folder / "page-rehearsal.png").write_bytes, picture)


def fly(rig: Any) -> None:
    """Begin the flights that the pictures show."""
    rig.ok(rig.get("/vehicles/1/command/guided"))
    plan(rig)
    for number in FIRST_LEGS:
        lift(rig, number)
    rig.ok(rig.post("/vehicles/1/command/arm"))
    rig.ok(rig.post("/vehicles/1/mission/start"))
    for legs in (FIRST_LEGS, SECOND_LEGS):
        time.sleep(LEG)
        for number, (north, east) in legs.items():
            target = {"x": north, "y": east, "z": -HEIGHT - number}
            rig.ok(rig.post(f"/vehicles/{number}/movement/go_to_ned", **target))
    time.sleep(LEG / 3)


def flown(rig: Any, name: str, legs: list[tuple[float, float]]) -> str:
    """Fly vehicle 2 along legs; the id of the record, which is complete."""
    record = rig.ok(rig.post("/flights", name=name, vehicles=[2]))["id"]
    for north, east in legs:
        rig.ok(rig.post("/vehicles/2/movement/go_to_ned_wait", x=north, y=east, z=-HEIGHT))
    rig.ok(rig.post(f"/flights/{record}/end"))
    packed = lambda: rig.ok(rig.get(f"/flights/{record}"))["state"] == "complete"  # noqa: E731
    harness.eventually(packed, 120, "the record's being packed")
    return str(record)


async def replay(page: Any, rig: Any, folder: Path) -> None:
    """Take the picture of a replay, beside another flight."""
    first = await asyncio.to_thread(flown, rig, "survey, calm", [(30, 0), (30, 40), (0, 40), (0, 10)])
    second = await asyncio.to_thread(flown, rig, "survey, again", [(31, 3), (28, 43), (-2, 40), (0, 10)])
    await page.visit(f"{rig.url}/page/icon.svg")  # from the page itself that address would be a place in it
    await page.visit(f"{rig.url}/#replay={second}")
    await page.until(f"{SHOWN}?.context.replay.overview.seconds > 1")
    await page.evaluate(f"{SHOWN}.context.replay.jump({SHOWN}.context.replay.overview.seconds * 0.6)")
    await page.evaluate(f"{SHOWN}.other.value = {first!r}")
    await page.evaluate(f"{SHOWN}.other.dispatchEvent(new Event('change'))")
    await page.until(f"{SHOWN}.answer.textContent.includes('average')")
    await asyncio.sleep(1)
    picture = await page.picture()
    await asyncio.to_thread((folder / "page-replay.png").write_bytes, picture)


async def look(rig: Any, directory: Path, folder: Path, *, only_rehearsal: bool) -> None:
    """Open the page, and take the pictures when the flights have begun."""
    async with chromium(directory) as page:
        await page.visit(f"{rig.url}/")
        await page.until(LIVE)
        await rehearse(page, rig, folder)
        if only_rehearsal:
            return
        await asyncio.to_thread(fly, rig)
        await page.evaluate("document.querySelector('mission-plan').read()")
        await take_pictures(page, folder, "page")
        rig.switch_mode("LOITER")
        await page.evaluate(TAB.format("History"))
        await asyncio.sleep(3)  # the trail has a switch a second later
        await page.evaluate("document.querySelector('history-list').scrollIntoView({block: 'center'})")
        picture = await page.picture()
        await asyncio.to_thread((folder / "page-history.png").write_bytes, picture)
        rig.switch_mode("GUIDED")
        await replay(page, rig, folder)


def main() -> int:
    """Make them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("docs/pictures"), help="(%(default)s)")
    parser.add_argument("--only-rehearsal", action="store_true", help="page-rehearsal.png alone")
    options = parser.parse_args()
    modules = ["--load-module=vision", "--load-module=gradys", "--streamrate=4"]
    with (
        tempfile.TemporaryDirectory(prefix="uavapi-pictures-") as name,
        several_vehicles(Path(name), SYSTEMS, speedup=1, arguments=modules, homes=list(map(home, SYSTEMS))) as (
            rig,
            _,
        ),
    ):
        harness.eventually(lambda: all(one["ready_to_arm"] for one in rig.ok(rig.get("/vehicles"))["vehicles"]))
        asyncio.run(look(rig, Path(name), options.folder, only_rehearsal=options.only_rehearsal))
    return 0


if __name__ == "__main__":
    sys.exit(main())
