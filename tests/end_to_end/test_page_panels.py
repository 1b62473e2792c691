"""The page at / in a real browser: every tab and what it promises, areas and tiles on the map, who holds it."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.support.chromium import chromium
from tests.support.page_pilot import Pilot
from tests.support.pictures import grey_png
from tests.support.processes import Rig

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.needs("tmux"), pytest.mark.long]
cv2 = pytest.importorskip("cv2")

SCRIPT = "import time\nprint('the script is up', flush=True)\ntime.sleep(300)\n"

FIELD = {
    "type": "Feature",
    "properties": {"kind": "inclusion", "name": "field"},
    "geometry": {
        "type": "Polygon",
        "coordinates": [[[149.15, -35.37], [149.18, -35.37], [149.18, -35.35], [149.15, -35.35], [149.15, -35.37]]],
    },
}
LABEL = "document.querySelector('top-view canvas').getAttribute('aria-label')"


FENCE = [
    (-35.362, 149.165),
    (-35.36, 149.16),
    (-35.36, 149.17),
    (-35.366, 149.17),
    (-35.36, 149.16),
]  # it returns first
TILES = "[...document.querySelector('top-view').tiles.tiles.values()]"


def map_of(directory: Path, zoom: int = 10) -> Path:
    """A folder with the one tile in which the vehicle is."""
    lat, lon = FENCE[0]
    x = int(2**zoom * (lon + 180) / 360)
    y = int(2**zoom * (1 - math.asinh(math.tan(math.radians(lat))) / math.pi) / 2)
    file = directory / "map" / str(zoom) / str(x) / f"{y}.png"
    file.parent.mkdir(parents=True)
    file.write_bytes(grey_png())
    return directory / "map"


async def see_the_fence(pilot: Pilot) -> None:
    file = pilot.rig.directory / "fence.txt"
    file.write_text("".join(f"{lat:.7f} {lon:.7f}\n" for lat, lon in FENCE))
    pilot.rig.mavproxy.type(f"fence load {file}")
    pilot.rig.until(lambda: len(pilot.rig.ok(pilot.rig.get("/mission/fence"))["fence"]["features"]) == 1)
    await pilot.click("Mission")
    await pilot.page.until(f"{LABEL}.includes('2 areas of fences')")


async def hold_and_release(pilot: Pilot) -> None:
    await pilot.sees("vehicle-hold", "Held by nobody")
    await pilot.hold("Take it")
    await pilot.page.until("/Held by (?!nobody)/.test(document.querySelector('vehicle-hold').innerText)")
    assert pilot.rig.ok(pilot.rig.get("/authority"))["vehicles"][0]["held_by"] is not None
    await pilot.click("Give it back")
    await pilot.sees("vehicle-hold", "Held by nobody")


async def download_a_log(pilot: Pilot) -> None:
    await pilot.click("Logs")
    await pilot.click("List the logs")
    await pilot.sees("log-list", "holds")
    await pilot.page.until("document.querySelectorAll('log-list li').length > 0")
    await pilot.click("Download")
    await pilot.sees("log-list", "The log is on MAVProxy's machine")
    await pilot.sees("log-list li", "Save")


async def see_readings(pilot: Pilot) -> None:
    tab = "[...document.querySelectorAll('[role=tab]')].find(tab => tab.textContent === 'Gradys')"
    await pilot.page.until(f"!{tab}.hidden")
    await pilot.click("Gradys")
    for value in (20.5, 21.5):
        assert pilot.rig.post("/gradys/readings", quantity="temperature", value=value).status_code == 200
    await pilot.sees("reading-curves", "temperature")
    await pilot.sees("reading-curves", "21.50")


async def set_a_setting(pilot: Pilot) -> None:
    await pilot.click("Settings")
    await pilot.sees("setting-list", "s after which telemetry is stale")
    await pilot.page.evaluate(
        """{const input = document.querySelector('setting-list input[aria-label^=max_age]');
           input.value = '4'; input.dispatchEvent(new Event('input'))}"""
    )
    await pilot.hold_the(
        "[...document.querySelectorAll('setting-list input')].find(i => "
        "i.ariaLabel.startsWith('max_age')).nextSibling"
    )
    await pilot.sees("setting-list .answer", "max_age is 4.0")
    assert any(
        one["value"] == 4 for one in pilot.rig.ok(pilot.rig.get("/settings"))["settings"] if one["name"] == "max_age"
    )
    assert await pilot.page.evaluate("!document.querySelector('setting-list [aria-label^=port]')")
    await pilot.sees("setting-list", "The module gradys")
    await pilot.sees("setting-list", "ground stations, HOST:PORT by comma")


async def run_a_script(pilot: Pilot) -> None:
    file = pilot.rig.directory / "waits.py"
    file.write_text(SCRIPT)
    await pilot.click("Scripts")
    await pilot.sees("script-list", "No script was uploaded yet.")
    await pilot.page.choose_file("document.querySelector('script-list input')", file)
    await pilot.sees("script-list .answer", "waits.py is uploaded")
    await pilot.hold("Run")
    await pilot.sees("script-list .log", "the script is up")
    await pilot.sees("script-list .running", "waits.py")
    await pilot.finds_it_accessible()
    await pilot.page.click("document.querySelector('script-list .stop')")
    await pilot.sees("script-list .log", "ended, exit status")
    await pilot.page.until("!document.querySelector('script-list .running')")
    assert pilot.rig.ok(pilot.rig.get("/mission/running-scripts"))["scripts"] == []


async def try_a_script_first(pilot: Pilot) -> None:
    file = pilot.rig.directory / "says.py"
    file.write_text("print('nothing to fly')\n")
    await pilot.click("Scripts")
    await pilot.page.choose_file("document.querySelector('script-list input')", file)
    await pilot.sees("script-list .answer", "says.py is uploaded")
    row = "[...document.querySelectorAll('script-list li')].find(row => row.innerText.includes('says.py'))"
    await pilot.page.until(f"Boolean({row})")
    await pilot.page.click(f"[...{row}.querySelectorAll('button')].find(b => b.textContent === 'Try it first')")
    await pilot.sees("script-list .answer", "says.py is tried on a simulated vehicle")
    await pilot.sees("script-list .answer", "says.py went well on the simulated vehicle", 240.0)


async def set_a_parameter(pilot: Pilot) -> None:
    await pilot.click("Parameters")
    await pilot.page.until("document.querySelectorAll('parameter-list dt').length > 0")
    await pilot.page.evaluate(
        """{const input = document.querySelector('parameter-list input');
           input.value = 'PILOT_SPD_UP'; input.dispatchEvent(new Event('change'))}"""
    )
    value = "document.querySelector('parameter-list [aria-label=PILOT_SPD_UP]')"
    await pilot.page.until(f"{value}.value === '2.5'")
    await pilot.page.evaluate(f"{value}.value = '2'; {value}.dispatchEvent(new Event('input'))")
    await pilot.hold("Set")
    await pilot.sees("parameter-list .answer", "PILOT_SPD_UP is 2")
    assert pilot.rig.ok(pilot.rig.get("/parameters", match="PILOT_SPD_UP"))["parameters"] == {"PILOT_SPD_UP": 2}
    await pilot.finds_it_accessible()


async def land_on_the_tag(pilot: Pilot) -> None:
    pilot.rig.in_the_air(5)
    pilot.rig.ok(pilot.rig.post("/movement/go_to_ned_wait", x=7, y=-4, z=-5))
    await pilot.click("Vision")
    await pilot.page.until("document.querySelector('vision-view img').naturalWidth === 480")
    await pilot.finds_it_accessible()
    await pilot.hold("Land on the tag")
    await pilot.sees("vision-view .answer", "Landed on tag 0", 180)
    assert pilot.rig.control.ask("state")["position"][:2] == pytest.approx([8, -5], abs=0.4)


def load_vision(rig: Rig) -> None:
    """With the simulated camera, which looks at a tag 8 m north and 5 m west of home."""
    settings = {"directory": str(rig.directory), "source": "sim", "fps": 12, "width": 480, "height": 360}
    rig.mavproxy.ask(f"module load vision:{json.dumps(settings, separators=(',', ':'))}", "Loaded module vision")


async def look(rig: Rig, directory: Path) -> list[str]:
    settings = json.dumps({"sink": "http://127.0.0.1:9/", "spool": f"{directory}/spool.db"}, separators=(",", ":"))
    rig.mavproxy.ask(f"module load gradys:{settings}", "Loaded module gradys")
    load_vision(rig)
    envelope = {"type": "FeatureCollection", "features": [FIELD]}
    assert rig.call("PUT", "/envelope", json=envelope).status_code == 200
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await page.visit(rig.url + "/")
        await pilot.sees_live()
        await page.until(f"{LABEL}.includes('1 area of fences')")
        await page.until(f"{TILES}.some(tile => tile instanceof ImageBitmap)")
        await see_the_fence(pilot)
        await hold_and_release(pilot)
        await download_a_log(pilot)
        await pilot.finds_it_accessible()
        await set_a_setting(pilot)
        await pilot.finds_it_accessible()
        await see_readings(pilot)
        await pilot.finds_it_accessible()
        await run_a_script(pilot)
        await try_a_script_first(pilot)
        await set_a_parameter(pilot)
        await land_on_the_tag(pilot)
        return page.complaints


@pytest.fixture
def rig(harness: ModuleType, tmp_path: Path) -> Iterator[Any]:
    """A vehicle that has a log, because it was armed once."""
    folders = {"vehicle_logs": "logs", "scripts_path": "scripts", "script_logs": "script-logs"}
    settings = {name: str(tmp_path / folder) for name, folder in folders.items()}
    made = harness.embedded(tmp_path, tiles=str(map_of(tmp_path)), **settings)
    try:
        harness.eventually(lambda: made.status()["ready_to_arm"], 60, what="getting ready to arm")
        made.ok(made.get("/command/arm"))
        made.ok(made.get("/command/disarm"))
        made.speed_up(1)  # the rendered camera runs on the wall clock, and a landing ends without it
        yield made
    finally:
        made.stop()


def test_the_panels_show_what_they_promise(rig: Rig, tmp_path: Path) -> None:
    assert asyncio.run(look(rig, tmp_path)) == []
