"""The page at / in a real browser: who holds the vehicle, its logs, areas on the map, readings, settings."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.chromium import chromium
from tests.support.page_pilot import Pilot

pytestmark = pytest.mark.needs("chromium")

FIELD = {
    "type": "Feature",
    "properties": {"kind": "inclusion", "name": "field"},
    "geometry": {
        "type": "Polygon",
        "coordinates": [[[149.15, -35.37], [149.18, -35.37], [149.18, -35.35], [149.15, -35.35], [149.15, -35.37]]],
    },
}
LABEL = "document.querySelector('top-view canvas').getAttribute('aria-label')"


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


async def look(rig: Any, directory: Path) -> list[str]:
    settings = json.dumps({"sink": "http://127.0.0.1:9/", "spool": f"{directory}/spool.db"}, separators=(",", ":"))
    rig.mavproxy.ask(f"module load gradys:{settings}", "Loaded module gradys")
    envelope = {"type": "FeatureCollection", "features": [FIELD]}
    assert rig.call("PUT", "/envelope", json=envelope).status_code == 200
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await page.visit(rig.url + "/")
        await pilot.sees_live()
        await page.until(f"{LABEL}.includes('1 area of fences')")
        await hold_and_release(pilot)
        await download_a_log(pilot)
        await pilot.finds_it_accessible()
        await see_readings(pilot)
        await pilot.finds_it_accessible()
        return page.complaints


@pytest.fixture
def rig(harness: Any, tmp_path: Path) -> Iterator[Any]:
    """A vehicle that has a log, because it was armed once."""
    made = harness.embedded(tmp_path, speedup=2, vehicle_logs=str(tmp_path / "logs"))
    try:
        harness.eventually(lambda: made.status()["ready_to_arm"], 60, what="getting ready to arm")
        made.ok(made.get("/command/arm"))
        made.ok(made.get("/command/disarm"))
        yield made
    finally:
        made.stop()


def test_the_panels_show_what_they_promise(rig: Any, tmp_path: Path) -> None:
    assert asyncio.run(look(rig, tmp_path)) == []
