"""The page at / in a real browser: a flight by its buttons, keys and top view, and what it says when cut off."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.support.chromium import chromium
from tests.support.page_pilot import BUTTON, Pilot
from tests.support.processes import SILENCE, Rig

RIG_SPEEDUP = 5  # so that the page counts no number as old on a busy machine
pytestmark = [pytest.mark.needs("chromium"), pytest.mark.long]

# Both strips and HOLD ALL are wholly in the viewport, and what one sees there is they.
ALARMS_IN_SIGHT = """['#trouble', '#hold-result', 'hold-all button'].every(name => {
  const one = document.querySelector(name), {left, top, right, bottom} = one.getBoundingClientRect();
  const seen = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  return left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight && one.contains(seen); })"""
# However slow the machine is, it is too short.
SHORT_PRESS = """for (const [kind, detail] of [['pointerdown', 0], ['pointerup', 0], ['click', 1]])
  {button}.dispatchEvent(new PointerEvent(kind, {{bubbles: true, button: 0, detail}}))"""
CANVAS = "document.querySelector('top-view canvas')"


async def take_off(pilot: Pilot) -> None:
    await pilot.sees("flight-status", "Ready to arm.")
    assert pilot.rig.ok(pilot.rig.get("/jobs"))["jobs"] == []  # to open the page has commanded nothing
    await pilot.page.evaluate(SHORT_PRESS.format(button=BUTTON.format(tag="button", label="Arm")))
    await pilot.hold("Arm")
    await pilot.sees("flight-status", "ARMED")
    for height, refused in (("", "true"), ("501", "true"), ("10", "false")):
        await pilot.page.evaluate(f"document.querySelector('flight-actions input').value = '{height}'")
        button = BUTTON.format(tag="hold-button", label="Take off")
        await pilot.page.until(f"{button}.button.disabled === {refused}")
    await pilot.hold("Take off")
    await pilot.sees("flight-actions", "Takeoff successful")
    assert [job["verb"] for job in pilot.rig.ok(pilot.rig.get("/jobs"))["jobs"]] == [
        "/command/arm",
        "/command/takeoff",
    ]


async def go_to_a_click(pilot: Pilot, right: float, down: float) -> None:
    """As fast as a real one, so that it is on its way for long."""
    pilot.rig.speed_up(1)
    await pilot.page.click(CANVAS, right, down)
    await pilot.sees("go-to", "m away")
    assert pilot.rig.ok(pilot.rig.get("/jobs"))["jobs"][-1]["state"] != "running"  # a click alone sends nothing
    await pilot.hold("Go there")
    await pilot.sees("flight-status", "Commanded by go to a place, asked by 127.0.0.1")


async def fly_a_drawn_mission(pilot: Pilot) -> None:
    await pilot.click("Mission")
    await pilot.sees("mission-plan", "holds no items")
    await pilot.click("Draw")
    await pilot.sees("mission-plan", "Drawing")
    for right, down in ((-120, -90), (120, -90)):
        await pilot.page.click(CANVAS, right, down)
    for key, code in (("ArrowUp", 38), ("ArrowUp", 38), ("Enter", 13)):  # only Enter places
        await pilot.page.key("keyDown", key, code)
        await pilot.page.key("keyUp", key, code)
    await pilot.page.until("document.querySelectorAll('.waypoints li').length === 5")
    await pilot.hold("Upload draft")
    await pilot.sees("mission-plan", "Mission of 5 items uploaded")
    await pilot.sees("mission-plan", "holds 5 items")
    pilot.rig.speed_up(1)  # it may not be over before its pilot takes it
    await pilot.hold("Start mission")
    await pilot.sees("flight-status", "AUTO")


async def see_the_link_lost(pilot: Pilot) -> None:
    pilot.rig.set("link_timeout", "5.0")
    pilot.rig.control.fault("silence", sending=True, receiving=True)
    await pilot.sees("#trouble", "LINK LOST: vehicle 1")
    await pilot.page.until("[...document.querySelectorAll('.tile')].every(tile => tile.classList.contains('old'))")
    await pilot.sees("flight-status", "Not known: this is old.")
    await pilot.click("HOLD ALL")
    await pilot.sees("#hold-result", "0 of 1 hold")
    await pilot.sees("#hold-result", "vehicle 1: no heartbeat")
    pilot.rig.control.ask("clear")
    await pilot.sees_live()
    pilot.rig.set("link_timeout", f"{SILENCE:.1f}")


async def give_the_token(pilot: Pilot) -> None:
    pilot.rig.mavproxy.ask("uavapi set token sesame", "listening on")  # anew
    await pilot.page.visit(pilot.rig.url + "/")
    await pilot.page.until("document.querySelector('dialog').open")
    await pilot.sees("#trouble", "this API needs its token")
    await pilot.click("HOLD ALL")  # the dialog is not in its way
    await pilot.sees("#hold-result", "HOLD ALL WAS NOT DELIVERED")
    await pilot.page.evaluate("document.querySelector('dialog input').focus()")
    await pilot.page.ask("Input.insertText", text="sesame")
    await pilot.click("Use it")
    await pilot.sees_live()
    await pilot.page.evaluate("sessionStorage.clear()")
    await pilot.page.visit(pilot.rig.url + "/?#token=sesame")  # the link of a phone
    await pilot.sees_live()
    assert "sesame" not in await pilot.page.evaluate("location.href")
    assert await pilot.page.evaluate("JSON.stringify(localStorage).includes('sesame') || document.cookie") in (
        False,
        "",
    )


async def see_the_api_gone(pilot: Pilot) -> None:
    pilot.rig.mavproxy.type("module unload uavapi")
    await pilot.sees("#trouble", "NO LIVE DATA")
    await pilot.page.until("document.querySelector('flight-status').classList.contains('old')")
    await pilot.click("HOLD ALL")
    await pilot.sees("#hold-result", "HOLD ALL WAS NOT DELIVERED")
    await pilot.page.until(ALARMS_IN_SIGHT)
    await pilot.page.resize(390, 844)
    await pilot.page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")
    await pilot.page.until("scrollY > 100")
    assert await pilot.page.evaluate(ALARMS_IN_SIGHT)


async def open_the_page(pilot: Pilot, dropped: str) -> None:
    """While the browser drops one of its files, as when the network changes; later it comes."""
    await pilot.page.ask("Network.enable")
    await pilot.page.ask("Network.setCacheDisabled", cacheDisabled=True)  # what is in the cache cannot be dropped
    await pilot.page.ask("Network.setBlockedURLs", urls=[f"*/{dropped}"])
    await pilot.page.visit(pilot.rig.url + "/")
    await pilot.sees("#trouble", "Parts of this page did not arrive")
    await pilot.page.ask("Network.setBlockedURLs", urls=[])
    await pilot.sees_live()


async def flight(rig: Rig, directory: Path) -> list[str]:
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await open_the_page(pilot, "style.css")
        await open_the_page(pilot, "app.js")
        await take_off(pilot)
        rig.control.fault("pilot_sticks", throttle=1500)
        await go_to_a_click(pilot, 150, -90)
        rig.speed_up(RIG_SPEEDUP)
        await pilot.sees("flight-actions", "Arrived at coord")
        await fly_a_drawn_mission(pilot)
        rig.control.fault("pilot_mode", mode="LOITER")
        await pilot.sees("flight-status", "Commanded by its pilot (LOITER)")
        await pilot.finds_it_accessible()
        await pilot.hold("Guided")
        await pilot.sees("flight-status", "GUIDED")
        await go_to_a_click(pilot, -200, 100)
        await pilot.hold_all_by_key()
        await pilot.sees("#hold-result", "every vehicle held")
        await pilot.sees("flight-status", "BRAKE")
        await pilot.sees("flight-actions", "was superseded")
        rig.speed_up(RIG_SPEEDUP)
        await see_the_link_lost(pilot)
        await page.evaluate("document.documentElement.dataset.theme = 'dark'")
        await page.resize(390, 844)
        await page.until("document.documentElement.scrollWidth <= innerWidth")
        await pilot.finds_it_accessible()
        await pilot.hold("Land")
        await pilot.sees("flight-actions", "Landed")
        await give_the_token(pilot)
        await see_the_api_gone(pilot)
        return page.complaints


def test_a_whole_flight_from_the_page(embedded_rig: Rig, tmp_path: Path) -> None:
    assert asyncio.run(flight(embedded_rig, tmp_path)) == []
