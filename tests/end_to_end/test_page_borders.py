"""The page at / in a real browser: what is drawn there is in force, refuses a mission, and is taken away again."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.support.chromium import chromium
from tests.support.page_pilot import BUTTON, Pilot
from tests.support.processes import Rig

RIG_SPEEDUP = 5
pytestmark = [pytest.mark.needs("chromium"), pytest.mark.long]

CANVAS = "document.querySelector('top-view canvas')"
AROUND = ((-200, -120), (200, -120), (200, 120), (-200, 120))  # px from the middle of the view, where home is about


async def click_the_view(pilot: Pilot, *places: tuple[float, float]) -> None:
    for right, down in places:
        await pilot.page.click(CANVAS, right, down)


async def choose(pilot: Pilot, what: str) -> None:
    await pilot.page.evaluate(
        f"""{{const select = document.querySelector('border-editor select');
        select.value = {what!r}; select.dispatchEvent(new Event('change'))}}"""
    )


async def draw_an_envelope(pilot: Pilot) -> None:
    await pilot.click("Borders")
    await pilot.click("Draw areas")
    await click_the_view(pilot, *AROUND)
    await pilot.click("Done")
    await pilot.page.evaluate(
        """{const input = document.querySelector('border-editor [aria-label^=ceiling]');
        input.value = '30'; input.dispatchEvent(new Event('change'))}"""
    )
    await pilot.hold("Put in force")
    await pilot.sees("border-editor", "Envelope in force: 1 inclusion")
    (area,) = pilot.rig.ok(pilot.rig.get("/vehicles/1/envelope"))["envelopes"][0]["envelope"]["features"]
    assert (area["properties"]["kind"], area["properties"]["ceiling"]) == ("inclusion", 30)
    assert len(area["geometry"]["coordinates"][0]) == 5


async def draw_a_mission(pilot: Pilot, *places: tuple[float, float]) -> None:
    await pilot.click("Mission")
    await pilot.sees("mission-plan", "The vehicle holds")
    await pilot.click("Empty the draft")
    await pilot.click("Draw")
    await click_the_view(pilot, *places)
    await pilot.click("Done")
    await pilot.hold("Upload draft")


async def have_a_mission_refused(pilot: Pilot) -> None:
    await draw_a_mission(pilot, (60, 0), (300, 0))
    await pilot.sees("height-profile", "it leaves where it may fly")
    await pilot.sees("mission-plan > .answer", "envelope")
    await pilot.sees("mission-plan > .answer", "item 3")
    await draw_a_mission(pilot, (60, 0), (90, 40))
    await pilot.sees("mission-plan > .answer", "Mission of 4 items uploaded")
    await pilot.sees("mission-plan", "The vehicle holds 4 items")


async def take_the_envelope_away(pilot: Pilot) -> None:
    await pilot.click("Borders")
    await pilot.click("Edit what is in force")
    await pilot.page.until("document.querySelector('top-view').handles().length === 8")  # with those between them
    await pilot.hold("Take away")
    await pilot.sees("border-editor", "Envelope removed")
    assert pilot.rig.ok(pilot.rig.get("/vehicles/1/envelope"))["envelopes"] == []


async def draw_a_fence_and_rally_points(pilot: Pilot) -> None:
    await choose(pilot, "fence")
    await pilot.click("Draw circles")
    await click_the_view(pilot, (150, 60))
    await pilot.hold("Put in force")
    await pilot.sees("border-editor", "Fence of 1 items uploaded")
    await choose(pilot, "rally")
    await pilot.page.until(f"Boolean({BUTTON.format(tag='button', label='Draw points')})")
    await pilot.click("Draw points")
    await click_the_view(pilot, (-60, 60), (-60, -60))
    await pilot.hold("Put in force")
    await pilot.sees("border-editor", "List of 2 rally points uploaded")
    (circle,) = pilot.rig.ok(pilot.rig.get("/mission/fence"))["fence"]["features"]
    assert (circle["properties"]["kind"], circle["properties"]["radius"]) == ("exclusion", 30)
    assert len(pilot.rig.ok(pilot.rig.get("/mission/rally"))["points"]) == 2
    await pilot.page.until("document.querySelector('top-view').context.fleet.chosen.rally.length === 2")
    await pilot.finds_it_accessible()


async def draw(rig: Rig, directory: Path) -> list[str]:
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await page.visit(rig.url + "/")
        await pilot.sees_live()
        await pilot.page.until("document.querySelector('top-view').context.fleet.chosen?.get('home')")
        await draw_an_envelope(pilot)
        await have_a_mission_refused(pilot)
        await take_the_envelope_away(pilot)
        await draw_a_fence_and_rally_points(pilot)
        return page.complaints


def test_drawn_envelope_refuses_a_mission_and_a_fence_and_rally_points_reach_the_vehicle(
    embedded_rig: Rig, tmp_path: Path
) -> None:
    assert asyncio.run(draw(embedded_rig, tmp_path)) == []
