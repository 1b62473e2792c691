"""The page in another language than English: chosen by the browser or by hand, and nothing of it is left out."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

import mavproxy_gradys.errors  # noqa: F401  their codes count, too
import mavproxy_vision.errors  # noqa: F401
from mavproxy_gradys.tracks import flight
from mavproxy_uavapi.core.vehicle.mission_flight import STATES
from mavproxy_uavapi.flights import flight_store
from mavproxy_uavapi.http.openapi import document, leaves
from mavproxy_uavapi.http.routes import ROUTES
from tests.support.chromium import Page, chromium
from tests.support.page_pilot import Pilot
from tests.support.played_api import FOLDER, PlayedApi, played_api, vehicle

TABLES = sorted((FOLDER / "languages").glob("*.json"))
DESK, PHONE = (1440, 900), (390, 844)
OTHERS = [flight.VERB.split("/")[-1], "land", "search", "mission"]  # verbs of the other modules
WORDS = (FOLDER / "model" / "words.js").read_text(encoding="utf-8")
LIVE = "document.querySelectorAll('.chip').length > 2 && Boolean(document.querySelector('tab-bar')?.context)"
CLIENT = "mavproxy_uavapi.client"
TABS = "[...document.querySelectorAll('[role=tab]')].filter(tab => !tab.hidden)"


@pytest.mark.parametrize("file", TABLES, ids=lambda file: file.stem)
def test_table_has_each_word_of_the_api_that_the_page_says(file: Path) -> None:
    table = json.loads(file.read_text(encoding="utf-8"))
    paths = {path.split("/")[-1].removesuffix("_wait") for path in (r.path for r in ROUTES if r.job)}
    landed = document(ROUTES)["components"]["schemas"]["VehicleView"]["properties"]["landed_state"]["enum"]
    stages = re.findall(r'_enter\("(.*?)"\)', Path(flight.__file__).read_text(encoding="utf-8"))
    (verbs,) = re.findall(r"const VERBS = \{(.*?)\};", WORDS, re.DOTALL)
    words = re.findall(r"(\w+): ", verbs)
    wanted = {
        "code": {
            error.code for error in leaves() if not error.__module__.startswith(CLIENT)
        },  # not what a client says
        "landed": set(landed),
        "mission": set(STATES.values()),
        "record": {flight_store.RECORDING, flight_store.ENDED, flight_store.COMPLETE},
        "stage": {"arming", *stages},
        "type": {"copter", "plane", "rover"},
        "verb": {*paths, *OTHERS} - {*words},
    }
    missing = [f"{kind}: {word}" for kind, all_words in wanted.items() for word in sorted(all_words)]
    assert [key for key in missing if key not in table] == [], f"put these into {file.name}"


# What is no text of ours: modes, names and units; what the API has said stands in English elements.
UNTOLD = {"GUIDED", "LOITER", "HOLD", "BRAKE", "GPS", "EKF", "UTC", "MCAP", "km", "min", "kB", "MB"}
UNTOLD |= {"uavapi", "Português", "Brasil", "docs", "manual"}
ALL_BUTTONS = """{const places = '[role=tabpanel]:not([hidden]), .choosing, .map-buttons';
  for (const one of document.querySelectorAll(`:is(${places}) button`)) {
    if (one.checkVisibility() && !one.closest('[lang], hold-button')) one.click(); } }"""
LEFT = """(() => {
  const said = [...window.drawn], walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const isOurs = one => !one.closest('[lang=en], noscript');
  for (let node; (node = walker.nextNode());) if (isOurs(node.parentElement)) said.push(node.data);
  for (const one of document.querySelectorAll('body *')) {
    if (!isOurs(one)) continue;
    for (const name of ['title', 'aria-label', 'placeholder', 'alt', 'label', 'why', 'aria-valuetext']) {
      said.push(one.getAttribute(name) ?? '');
    }
  }
  return said.filter(text => /\\p{L}{2}/u.test(text)); })()"""
SPY = """window.drawn = new Set(); {
  const own = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, ...place) {
    drawn.add(text);
    own.call(this, text, ...place); }; }"""
CLIPPED = """[...document.querySelectorAll('body *')].filter(one => one.checkVisibility()
  && !one.closest('#skip, h1, vehicle-bar, .unseen') && getComputedStyle(one).display !== 'inline'
  && one.scrollWidth > one.clientWidth + 1
  && (one.localName === 'dd' || [...one.childNodes].some(node => node instanceof Text && node.data.trim())))
  .map(one => one.outerHTML)"""
WIDER = "document.documentElement.scrollWidth > innerWidth"


async def open_in(page: Page, api: PlayedApi, language: str, size: tuple[int, int]) -> Pilot:
    """Open the page in a browser that likes that language."""
    await page.ask("Network.setUserAgentOverride", userAgent="a browser", acceptLanguage=language)
    await page.ask("Page.addScriptToEvaluateOnNewDocument", source=SPY)
    await page.visit(f"{api.address}/", *size)
    await page.until(LIVE)
    return Pilot(page, None)


def fleet() -> dict[int, dict[str, dict[str, Any]]]:
    """A copter that flies, one on the ground, and a rover whose battery is low."""
    return {
        1: vehicle(1, 20, -30),
        2: vehicle(2, -20, 30, mode="LOITER", armed=False, landed_state="on_ground", ready_to_arm=False),
        3: vehicle(3, 20, 30, type="rover", mode="HOLD", battery_remaining=12),
    }


def on_the_page(
    directory: Path,
    language: str,
    gestures: Callable[[Page, Pilot, PlayedApi], Awaitable[None]],
    size: tuple[int, int] = DESK,
    folder: Path = FOLDER,
) -> None:
    async def look() -> None:
        with played_api(fleet(), folder) as api:
            api.answers.update(ANSWERS)
            async with chromium(directory) as page:
                pilot = await open_in(page, api, language, size)
                await gestures(page, pilot, api)
                assert page.complaints == []

    asyncio.run(look())


FLIGHT = {"id": "7", "name": "", "began": "2026-11-27T10:00:00Z", "ended": None, "vehicles": [1], "bytes": 2_500_000}
ANSWERS: dict[str, tuple[int, dict[str, Any]]] = {
    "/authority": (200, {"caller": {"name": "ana", "role": "admin"}, "vehicles": []}),
    "/vision/status": (200, {"result": "success"}),
    "/gradys/status": (200, {"info": {"sent": 3, "acknowledged": 2, "stations": [], "sinks": []}}),
    "/gradys/recent": (200, {"series": []}),
    "/vehicles/1/mission/waypoints": (200, {"items": [], "home": None}),
    "/vehicles/1/mission/fence": (200, {"fence": None}),
    "/flights": (200, {"flights": [{**FLIGHT, "state": "recording"}, {**FLIGHT, "id": "8", "state": "complete"}]}),
    "/audit": (200, {"entries": [], "next": None}),
    "/mission/list-scripts": (200, {"scripts": ["7"], "shell_scripts": ["8"]}),
    "/mission/running-scripts": (200, {"scripts": [{"script": "8"}]}),
    "/vehicles/1/parameters": (200, {"parameters": {"P": 1.0}, "about": {}, "documented": False}),
    "/vehicles/1/logs": (200, {"logs": [{"id": 1, "size": 5, "time": None, "downloaded": True}]}),
    "/settings": (200, {"settings": [], "modules": {}}),
    "/vehicles/1/command/land": (409, {"detail": "it is on the ground", "code": "conflict"}),
}


@pytest.mark.needs("chromium")
@pytest.mark.parametrize("table", TABLES, ids=lambda file: file.stem)
def test_nothing_that_the_page_shows_is_left_in_english(tmp_path: Path, table: Path) -> None:
    folder = tmp_path / "page"
    shutil.copytree(FOLDER, folder)
    marked = {key: f"⟦{text}⟧" for key, text in json.loads(table.read_text(encoding="utf-8")).items()}
    (folder / "languages" / table.name).write_text(json.dumps(marked), encoding="utf-8")
    left: dict[str, str] = {}

    async def gestures(page: Page, _pilot: Pilot, _api: PlayedApi) -> None:
        for number in range(await page.evaluate(f"{TABS}.length")):
            await page.evaluate(f"{TABS}[{number}].click()")
            await page.evaluate(ALL_BUTTONS)
            await asyncio.sleep(0.4)
            for text in await page.evaluate(LEFT):
                unmarked = text
                while unmarked != (unmarked := re.sub("⟦[^⟦⟧]*⟧", "", unmarked)):
                    pass
                words = set(re.findall(r"[^\W\d_]{2,}", unmarked)) - UNTOLD
                if words:
                    left[text] = f"tab {number}"

    on_the_page(tmp_path, table.stem, gestures, folder=folder)
    assert left == {}, "each of these needs t() where it is made"


@pytest.mark.needs("chromium")
@pytest.mark.parametrize("size", [DESK, pytest.param(PHONE, marks=pytest.mark.long)], ids=["desk", "phone"])
def test_language_is_changed_in_the_settings_and_kept_and_no_draft_is_lost(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    drawn = "document.querySelector('{}').{}.items.length"

    async def gestures(page: Page, pilot: Pilot, api: PlayedApi) -> None:
        assert await page.evaluate("document.documentElement.lang") == "en"
        await page.evaluate("document.querySelector('mission-draft').beginDraft(), 0")
        await page.evaluate("document.querySelector('border-editor').drawn.addCircle({lat: -35, lon: 149})")
        await page.evaluate("document.querySelector('border-editor').changed()")
        await pilot.click("Settings")
        await page.evaluate("window.isBefore = true")
        await pilot.click("Português (Brasil)")
        await page.until("!window.isBefore")
        await page.until(LIVE)
        assert await page.evaluate("document.documentElement.lang") == "pt-BR"
        assert await page.evaluate("document.title") == "Voar · mavproxy-uavapi"
        await pilot.sees("connection-state", "ao vivo")
        await pilot.click("Missão")
        assert await page.evaluate(drawn.format("mission-draft", "draft")) == 2
        assert await page.evaluate(drawn.format("border-editor", "drawn")) == 1
        await pilot.sees("mission-draft .waypoints", "Decolar 10 m")
        await page.visit(f"{api.address}/", *size)
        await page.until(LIVE)
        assert await page.evaluate("document.documentElement.lang") == "pt-BR"

    on_the_page(tmp_path, "en-GB", gestures, size)


@pytest.mark.needs("chromium")
def test_failure_is_said_by_its_code_with_the_apis_english_below(tmp_path: Path) -> None:
    async def gestures(page: Page, pilot: Pilot, api: PlayedApi) -> None:
        api.answers["/vehicles/1/command/land"] = (409, {"detail": "it is in LAND", "code": "mode_changed"})
        await pilot.hold("Pousar")
        await pilot.sees(
            "flight-actions .answer", "veículo 1: pousar: o veículo não está no modo de que isto precisa"
        )
        below = "document.querySelector('flight-actions .answer small[lang=en]').textContent"
        assert await page.evaluate(below) == "it is in LAND"
        await page.evaluate(VOICE)
        await page.evaluate("document.querySelector('alarm-senses').alarms.look('a\\nb')")
        assert await page.evaluate("spoken[0]") == ["sem dados ao vivo: a", "pt-BR"]  # not what stands below
        await page.until("document.querySelector('.large .value').textContent === '12,0'")
        assert await page.evaluate("document.querySelector('flight-actions input').value") == "10"

    on_the_page(tmp_path, "pt-PT", gestures)  # another country's is better than none


VOICE = """window.spoken = []; {
  document.querySelector('alarm-senses').context.preferences.alarms = {voice: true};
  speechSynthesis.speak = ({text, lang}) => spoken.push([text, lang]); }"""


@pytest.mark.needs("chromium")
@pytest.mark.long
@pytest.mark.parametrize("table", TABLES, ids=lambda file: file.stem)
@pytest.mark.parametrize("size", [DESK, PHONE, (320, 640)], ids=["desk", "phone", "narrow"])
def test_longer_words_have_room_on_every_tab(tmp_path: Path, size: tuple[int, int], table: Path) -> None:
    async def gestures(page: Page, _pilot: Pilot, _api: PlayedApi) -> None:
        for number in range(await page.evaluate(f"{TABS}.length")):
            await page.evaluate(f"{TABS}[{number}].click()")
            await asyncio.sleep(0.4)
            assert await page.evaluate(CLIPPED) == [], number
            assert not await page.evaluate(WIDER), number

    on_the_page(tmp_path, table.stem, gestures, size)
