"""The whole page in a browser, by a pilot's gestures, with an API that the test plays: what is sent and said."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.http.openapi import document
from mavproxy_uavapi.http.routes import ROUTES
from tests.support.chromium import Page, chromium
from tests.support.page_pilot import BUTTON, Pilot
from tests.support.played_api import FOLDER, PlayedApi, played_api, vehicle

pytestmark = pytest.mark.needs("chromium")

DESK, PHONE = (1440, 900), (390, 844)
SHIFT = 8  # of a mouse event's modifiers
CHIP = "[...document.querySelectorAll('.chip')].find(b => b.querySelector('b')?.textContent === '{}')"
PLACE = """{{const view = document.querySelector('top-view'), {{x, y}} = view.canvas.getBoundingClientRect();
  const [right, down] = view.camera.pixels(view.placeOf(view.context.fleet.of({}))); [x + right, y + down]}}"""
MIXED = {
    1: vehicle(1, 20, -30),
    2: vehicle(2, -20, 30, mode="LOITER", armed=False, landed_state="on_ground"),
    3: vehicle(3, 20, 30, type="rover", mode="HOLD", battery_remaining=12),
}

Gestures = Callable[[Page, Pilot, PlayedApi], Awaitable[None]]


def on_the_page(directory: Path, gestures: Gestures, size: tuple[int, int] = DESK, vehicles: Any = None) -> PlayedApi:
    """Make gestures on the page; what the API was asked."""

    async def look() -> PlayedApi:
        with played_api(vehicles or MIXED) as api:
            async with chromium(directory) as page:
                await page.visit(f"{api.address}/", *size)
                pilot = Pilot(page, None)
                await pilot.sees_live()
                await page.until(f"document.querySelectorAll('.chip b').length === {len(api.vehicles)}")
                await gestures(page, pilot, api)
                assert page.complaints == []
                return api

    return asyncio.run(look())


async def click(page: Page, place: list[float], modifiers: int = 0) -> None:
    for kind in ("mousePressed", "mouseReleased"):
        await page.ask(
            "Input.dispatchMouseEvent",
            type=kind,
            x=place[0],
            y=place[1],
            button="left",
            clickCount=1,
            modifiers=modifiers,
        )


async def chosen(page: Page) -> list[str]:
    return await page.evaluate("[...document.querySelectorAll('.chip[aria-pressed=true] b')].map(b => b.textContent)")


async def still(page: Page, system: int) -> list[float]:
    """Where a vehicle is drawn, once the view has come to rest."""
    before: list[float] = []
    while before != (place := await page.evaluate(PLACE.format(system))):
        before = place
        await asyncio.sleep(0.3)
    return before


def test_click_chooses_a_vehicle_shift_adds_it_and_beside_it_is_a_place(tmp_path: Path) -> None:
    async def gestures(page: Page, pilot: Pilot, _api: PlayedApi) -> None:
        place = await still(page, 2)
        await click(page, place)
        await page.until(f"{CHIP.format(2)}.getAttribute('aria-pressed') === 'true'")
        assert await chosen(page) == ["2"]
        assert await page.evaluate("document.querySelector('go-to').hidden")
        await click(page, await still(page, 3), SHIFT)
        await pilot.sees("fleet-actions .where", "To 2 vehicles: 2, 3")
        assert await page.evaluate("document.querySelector('flight-actions').hidden")
        await click(page, await still(page, 3), SHIFT)
        await page.until("document.querySelector('fleet-actions').hidden")
        assert await chosen(page) == ["2"]
        await click(page, [place[0] - 60, place[1]])
        await pilot.sees("go-to .where", "Vehicle 2 to")

    assert on_the_page(tmp_path, gestures).asked == []


@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_order_to_several_goes_to_those_that_can_and_each_answer_is_shown(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    async def gestures(page: Page, pilot: Pilot, api: PlayedApi) -> None:
        api.answers["/fleet/takeoff"] = (
            207,
            {
                "vehicles": {
                    "1": {"status": 202, "job": "7"},
                    "2": {"status": 409, "detail": "not armed: `arm` first"},
                }
            },
        )
        await pilot.click("all")
        await pilot.sees("fleet-actions .where", "To 3 vehicles: 1, 2, 3")
        await pilot.hold("Take off")
        await pilot.sees("fleet-actions .answers", "vehicle 1: take off is under way (job 7)")
        await pilot.sees("fleet-actions .answers", "vehicle 2: take off: not armed: Arm first")
        done = {
            "job": "7",
            "verb": "/command/takeoff",
            "state": "succeeded",
            "result": "Takeoff to 10.00000015 m",
            "seconds": 3,
        }
        api.events.append({"event": "job", "system": 1, "info": done})
        await pilot.sees("fleet-actions .answers", "vehicle 1: take off: Takeoff to 10.0 m")
        await pilot.click("Hold")
        await pilot.click("several")
        await page.click(CHIP.format(1))
        await pilot.sees("fleet-actions .where", "To 2 vehicles: 2, 3")
        await pilot.finds_it_accessible()

    asked = on_the_page(tmp_path, gestures, size).asked
    assert asked == [
        ("POST", "/fleet/takeoff?wait=false", {"vehicles": [1, 2], "alt": 10}),
        ("POST", "/fleet/brake?wait=false", {"vehicles": [1, 2, 3]}),
    ]


async def drag(page: Page, places: list[list[float]]) -> None:
    for number, (x, y) in enumerate(places):
        await page.ask(
            "Input.dispatchMouseEvent",
            type="mouseMoved" if number else "mousePressed",
            x=x,
            y=y,
            button="left",
            buttons=1,
            clickCount=1,
        )
    await page.release(*places[-1])


def test_lasso_chooses_the_vehicles_that_it_is_drawn_around(tmp_path: Path) -> None:
    async def gestures(page: Page, pilot: Pilot, _api: PlayedApi) -> None:
        (x2, y2), (x3, y3) = await still(page, 2), await still(page, 3)
        await pilot.click("lasso")
        await drag(page, [[x2 + 40, y2 + 40], [x2 - 60, y2 + 40], [x3 - 60, y3 - 40], [x3 + 40, y3 - 40]])
        await pilot.sees("fleet-actions .where", "To 2 vehicles: 2, 3")
        assert await page.evaluate("document.querySelector('go-to').hidden")
        assert not await page.evaluate("document.querySelector('top-view').isLassoing")

    assert on_the_page(tmp_path, gestures).asked == []


ROLE = {"result": "success", "caller": {"name": "anna", "role": "fly"}, "vehicles": []}


ALL_PARTS = {"hold-all", "flight-actions", "Mission", "Scripts"}


def test_role_decides_what_is_shown_and_the_page_says_who_one_is(tmp_path: Path) -> None:
    shown = "[...document.querySelectorAll('[role=tab], flight-actions, hold-all')].filter(b => b.checkVisibility())"
    shown += ".map(b => b.role === 'tab' ? b.textContent : b.localName)"

    async def gestures(page: Page, pilot: Pilot, api: PlayedApi) -> None:
        for system, role in ((2, "watch"), (3, "fly"), (1, "admin")):
            api.answers["/authority"] = (200, {**ROLE, "caller": {"name": role, "role": role}})
            await page.click(CHIP.format(system))  # it asks then
            await pilot.sees("vehicle-hold", f"You are {role} and may")
            parts = await page.evaluate(shown)
            wanted = {"watch": {"hold-all"}, "fly": {"hold-all", "flight-actions", "Mission"}, "admin": ALL_PARTS}[
                role
            ]
            assert ALL_PARTS.intersection(parts) == wanted
            await pilot.finds_it_accessible()

    assert on_the_page(tmp_path, gestures, PHONE).asked == []


@pytest.mark.parametrize("size", [DESK, pytest.param(PHONE, marks=pytest.mark.long)], ids=["desk", "phone"])
def test_mission_is_drawn_inserted_into_undone_and_kept_over_a_reload(tmp_path: Path, size: tuple[int, int]) -> None:
    numbers = "[...document.querySelectorAll('.item')].map(b => b.textContent)"

    async def gestures(page: Page, pilot: Pilot, api: PlayedApi) -> None:
        api.answers["/vehicles/1/mission/waypoints"] = (200, {"result": "success", "home": None, "items": []})
        await pilot.click("Mission")
        await pilot.click("Draw")
        await page.evaluate("document.querySelector('top-view').scrollIntoView({block: 'center'})")
        x, y = await page.middle("document.querySelector('top-view')")
        for place in ([x - 100, y], [x + 60, y]):
            await click(page, place)
        await page.until(f"{numbers}.length === 4")
        await drag(page, [[x - 20, y], [x - 20, y + 40], [x - 20, y + 60]])  # the + between them
        await page.until(f"{numbers}.length === 5")
        await page.evaluate("document.querySelector('top-view canvas').focus()")
        await page.key("keyDown", "Delete", 46)  # what was inserted is selected
        await page.until(f"{numbers}.length === 4")
        await pilot.click("Undo")
        await page.until(f"{numbers}.length === 5")
        assert await page.evaluate(numbers) == [
            "1 Take off 10 m",
            *(f"{number} Waypoint 10 m" for number in (2, 3, 4)),
            "5 Return",
        ]
        await pilot.finds_it_accessible()
        await page.visit(f"{api.address}/", *size)
        await pilot.sees_live()
        await pilot.click("Mission")
        await page.until(f"{numbers}.length === 5")
        await pilot.hold("Upload draft")

    ((method, path, body),) = on_the_page(tmp_path, gestures, size).asked
    assert (method, path) == ("POST", "/vehicles/1/mission/waypoints?wait=false")
    assert [item["command"] for item in body["items"]] == [22, 16, 16, 16, 20]
    assert body["items"][2]["params"][4] < body["items"][1]["params"][4]  # it was dragged to the south


def test_type_has_its_own_verbs_and_a_button_that_is_off_says_why_under_it(tmp_path: Path) -> None:
    why = "getComputedStyle(" + BUTTON.format(tag="hold-button", label="{}") + ", '::after').content"

    async def gestures(page: Page, pilot: Pilot, api: PlayedApi) -> None:
        labels = "[...document.querySelectorAll('flight-actions :is(hold-button, .stop)')]"
        labels += ".filter(b => b.checkVisibility()).map(b => b.textContent)"
        await page.click(CHIP.format(3))
        await page.until(f"!({labels}).includes('Take off')")
        assert await page.evaluate(labels) == ["Return", "Guided", "Brake", "Stop"]
        await pilot.sees("flight-actions .meaning", "Brake: mode HOLD. Stop: it waits for Guided.")
        await page.click(CHIP.format(2))
        await page.until(f"({labels}).includes('Take off')")
        assert await page.evaluate(why.format("Take off")) == '"arm it first"'
        await page.click(CHIP.format(1))
        await page.until(why.format("Take off") + " === '\"it is in the air\"'")
        api.vehicles[1]["vehicle"]["paused"] = True
        await pilot.sees("flight-actions .meaning", "It is stopped: Resume or Guided ends that.")
        await pilot.sees("flight-status", "it was stopped; Resume or Guided ends that")

    vehicles = {one: {**views, "vehicle": dict(views["vehicle"])} for one, views in MIXED.items()}
    assert on_the_page(tmp_path, gestures, PHONE, vehicles).asked == []


def test_gamepad_flies_while_its_button_is_held_and_to_let_go_stops(tmp_path: Path) -> None:
    pad = """{const buttons = Array.from({length: 16}, () => ({pressed: false}));
      window.pad = {connected: true, mapping: "standard", axes: [0, 0, 0, -1], buttons};
      navigator.getGamepads = () => [pad]; }"""
    panel, path = "document.querySelector('stick-control')", "/vehicles/1/movement/travel_at_body?lease="

    async def gestures(page: Page, pilot: Pilot, api: PlayedApi) -> None:
        assert await page.evaluate(f"{panel}.hidden")
        await page.evaluate(f"{pad} pad.buttons[4].pressed = true; 0")
        await pilot.sees("stick-control", "it does nothing before this is on")
        await pilot.finds_it_accessible()
        await page.click(f"{panel}.querySelector('input')")
        await pilot.sees("stick-control", "Let the button go, and hold it anew")
        assert api.asked == []
        await page.evaluate("pad.buttons[4].pressed = false; 0")
        await pilot.sees("stick-control", "Hold L1 or R1")
        await page.evaluate("pad.buttons[4].pressed = true; 0")
        await pilot.sees("stick-control .answer", "2.0 m/s to the front")
        await page.until(f"!{panel}.flight?.isSending")
        await page.evaluate("pad.buttons[4].pressed = false; 0")
        await pilot.sees("stick-control .answer", "it stops")

    first, *_, last = on_the_page(tmp_path, gestures).asked
    assert first == ("POST", f"{path}3", {"front": 2, "right": 0, "down": 0, "heading": 40})
    assert last == ("POST", f"{path}0", {"front": 0, "right": 0, "down": 0, "heading": 40})


def test_short_press_says_to_keep_holding_and_sends_nothing(tmp_path: Path) -> None:
    async def gestures(page: Page, _pilot: Pilot, _api: PlayedApi) -> None:
        land = BUTTON.format(tag="hold-button", label="Land")
        place = await page.middle(land)
        await page.press(*place)
        await page.release(*place)
        await page.until(f"{land}.getAttribute('hint') === 'keep holding'")
        assert await page.evaluate(f"getComputedStyle({land}, '::before').content") == '"keep holding"'
        await page.until(f"!{land}.hasAttribute('hint')")

    assert on_the_page(tmp_path, gestures).asked == []


def test_chip_is_red_for_a_vehicle_in_trouble_although_another_is_chosen(tmp_path: Path) -> None:
    async def gestures(page: Page, _pilot: Pilot, api: PlayedApi) -> None:
        red = "[...document.querySelectorAll('.chip.trouble')].map(b => b.innerText.replaceAll('\\n', ' '))"
        await page.until(f"({red}).length === 1")
        assert "battery low" in (await page.evaluate(red))[0]
        text = {"severity": 2, "text": "Crash: disarming"}
        api.events.append({"event": "statustext", "system": 2, "info": text})
        await page.until(f"({red}).some(one => one.includes('Crash: disarming'))")

    on_the_page(tmp_path, gestures)


def test_no_label_of_the_map_lies_under_a_control(tmp_path: Path) -> None:
    fleet = {number: vehicle(number, 50, 5 * number) for number in range(1, 9)}

    async def gestures(page: Page, _pilot: Pilot, _api: PlayedApi) -> None:
        await page.evaluate("""window.labels = []; {
          const own = CanvasRenderingContext2D.prototype.fillText;
          CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
            if (text.includes('·')) labels.push([x, y - 11, this.measureText(text).width, 14]);
            own.call(this, text, x, y); }; }""")
        await page.evaluate("document.querySelector('top-view').camera.zoom(1.6)")
        for north in (0, 10, 20, 30):
            await page.evaluate(f"labels.length = 0; document.querySelector('top-view').camera.north = {north}")
            await page.evaluate("document.querySelector('top-view').touch()")
            await page.until("labels.length >= 8")
            assert (
                await page.evaluate("""(() => {
              const view = document.querySelector('top-view'), {left, top} = view.canvas.getBoundingClientRect();
              return [...view.querySelectorAll('button')].map(b => b.getBoundingClientRect()).flatMap(b =>
                labels.filter(([x, y, w, h]) => x < b.right - left && b.left - left < x + w
                  && y < b.bottom - top && b.top - top < y + h)); })()""")
                == []
            )

    on_the_page(tmp_path, gestures, PHONE, fleet)


LOST = """[...document.querySelectorAll('body :is(button, input, select, a, canvas, summary)')]
  .filter(one => one.checkVisibility() && !one.closest('#skip, .hidden')).flatMap(one => {
    one.scrollIntoView({block: 'center', inline: 'center'});
    const {x, y, width, height} = one.getBoundingClientRect(), hit = document.elementFromPoint(x + width / 2,
      y + height / 2);
    return hit && (one.contains(hit) || hit.contains(one)) ? [] : [one.outerHTML]; })"""
"""The controls that no hand reaches, wherever one scrolls."""
BEGINS = """(({top, bottom}) => top < innerHeight - 40 || bottom <= innerHeight)(
  document.querySelector('[role=tabpanel]:not([hidden])').getBoundingClientRect())"""
WIDER = "document.documentElement.scrollWidth > Math.min(innerWidth, {})"


@pytest.mark.long
@pytest.mark.parametrize("size", [DESK, PHONE, (700, 450), (320, 640)], ids=["desk", "phone", "200 %", "narrow"])
def test_every_tab_is_accessible_with_all_controls_and_links_to_skip(tmp_path: Path, size: tuple[int, int]) -> None:
    tabs = "[...document.querySelectorAll('[role=tab]')].filter(tab => !tab.hidden).map(tab => tab.textContent)"

    async def gestures(page: Page, pilot: Pilot, api: PlayedApi) -> None:
        for path in ("/vision/status", "/gradys/status"):
            api.answers[path] = (200, {"result": "success"})
        await page.click(CHIP.format(1))
        await page.until(f"{tabs}.length === 12")
        for tab in await page.evaluate(tabs):
            await pilot.click(tab)
            assert await page.evaluate(BEGINS), f"{tab} opens below the window's edge"
            await pilot.finds_it_accessible()
            assert await page.evaluate(LOST) == []
            assert not await page.evaluate(WIDER.format(size[0])), tab
        links = await page.evaluate("[...document.querySelectorAll('#skip a')].map(a => a.getAttribute('href'))")
        assert len(links) == 3
        for link in links:
            await page.evaluate(f"document.querySelector('#skip [href=\"{link}\"]').click()")
            await page.until(f"document.activeElement === document.querySelector('{link}')")

    assert on_the_page(tmp_path, gestures, size).asked == []


def test_types_that_have_a_verb_are_those_of_the_api() -> None:
    text = (FOLDER / "model" / "verbs.js").read_text(encoding="utf-8")
    described = document(ROUTES)["paths"]
    for verb, path in {
        "takeoff": "command",
        "land": "command",
        "resume": "movement",
        "travel_at_body": "movement",
    }.items():
        types = described[f"/{path}/{verb}"]["post"]["x-vehicle-types"]
        assert f'"{verb}": [{", ".join(map(repr, types))}]'.replace("'", '"') in text
    for verb in ("arm", "disarm", "rtl", "guided", "brake"):
        types = described[f"/command/{verb}"]["post"].get("x-vehicle-types", ["copter", "plane", "rover"])
        assert types == ["copter", "plane", "rover"]
