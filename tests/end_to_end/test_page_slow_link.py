"""The page at / over a slow radio, by the browser's own throttling: it is live after few requests, and stays so."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.support.chromium import Page, chromium
from tests.support.page_pilot import LIVE, Pilot
from tests.support.processes import Rig

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.long]

TRIP, RATE = 600, 30_000  # ms, and bytes/s each way
STREAM = "document.querySelector('connection-state').context.stream"


async def throttle(page: Page) -> None:
    await page.ask("Network.enable")
    limits = {"latency": TRIP, "downloadThroughput": RATE, "uploadThroughput": RATE}
    await page.ask("Network.emulateNetworkConditions", offline=False, **limits)


async def look(rig: Rig, directory: Path) -> None:
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await throttle(page)
        await page.visit(rig.url + "/")
        await page.until(LIVE)
        before = [one.removeprefix(rig.url) for one in page.requests if "/telemetry/" not in one]
        assert set(before) <= {
            "/",
            "/page/icon.svg",
            "/page/all/app.js",
            "/page/all/start.js",
            "/page/all/style.css",
            "/page/all/rest.js",
            "/tiles",
        }
        await pilot.sees_live()
        await pilot.click("Settings")  # the tabs have come, too
        await pilot.sees("page-preferences", "This browser")
        await asyncio.sleep(5)
        assert await page.evaluate(f"{STREAM}.trouble(performance.now())") == ""
        await pilot.sees_live()
        assert page.complaints == []


def test_page_over_a_slow_radio_is_live_after_few_requests_and_stays_so(embedded_rig: Rig, tmp_path: Path) -> None:
    asyncio.run(look(embedded_rig, tmp_path))
