"""The page's map from a source that the owner allows, and an area of it that is kept for the field."""

from __future__ import annotations

import asyncio
import sqlite3
from contextlib import closing
from pathlib import Path
from types import ModuleType

import pytest

from tests.support.chromium import chromium
from tests.support.page_pilot import Pilot
from tests.support.processes import Rig
from tests.support.tile_server import TileServer, tile_server

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.long]
VIEW = "document.querySelector('top-view')"
SHOWN = f"[...{VIEW}.tiles.tiles.values()].some(tile => tile instanceof ImageBitmap)"


def made(folder: Path) -> Path:
    folder.mkdir()
    return folder


async def keep_it(pilot: Pilot, source: TileServer) -> None:
    """What is in sight, from the source."""
    page = pilot.page
    await page.until(SHOWN)
    assert source.asked
    await pilot.click("keep")
    await pilot.sees("keep-area .where", f"of 127.0.0.1:{source.server_address[1]} (by-a-test)")
    await pilot.finds_it_accessible()
    count = await page.evaluate("document.querySelector('keep-area').tiles.length")
    source.lacks.add(source.asked[-1])
    await pilot.click("Keep")
    await pilot.sees("keep-area .answer", f"{count} of {count}")
    await pilot.sees("keep-area .answer", "1 are missing")


async def look(rig: Rig, source: TileServer, directory: Path) -> list[str]:
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await page.visit(rig.url + "/")
        await pilot.sees_live()
        await keep_it(pilot, source)
        return page.complaints


async def look_again(rig: Rig, directory: Path) -> list[str]:
    """Where nothing but MAVProxy's machine answers."""
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await page.visit(rig.url + "/")
        await pilot.sees_live()
        await page.until(SHOWN)
        await page.until(f"!{VIEW}.tiles.isOnline")
        return page.complaints


def test_map_comes_from_the_source_and_what_was_kept_of_it_is_there_without_internet(
    harness: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    rig = None
    try:
        with tile_server() as source:
            rig = harness.embedded(tmp_path, tile_source=source.source, tile_licence="by-a-test")
            assert asyncio.run(look(rig, source, made(tmp_path / "first"))) == []
        with closing(sqlite3.connect(tmp_path / "state" / "mavproxy-uavapi" / "kept.mbtiles")) as database:
            kept, zooms = database.execute("SELECT count(*), count(DISTINCT zoom_level) FROM tiles").fetchone()
        assert (kept > 4, zooms > 3) == (True, True)
        assert asyncio.run(look_again(rig, made(tmp_path / "second"))) == []
    finally:
        if rig is not None:
            rig.stop()
