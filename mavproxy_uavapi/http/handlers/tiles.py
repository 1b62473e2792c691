"""/tiles: the tiles of the user's own map and of an area that was kept, for the page."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Any

from aiohttp import web

from mavproxy_uavapi.core.errors import Forbidden, NotFound
from mavproxy_uavapi.files import tile_store
from mavproxy_uavapi.files.tile_store import KINDS, Tile, TileStore
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.route import BINARY
from mavproxy_uavapi.http.handlers import static_files
from mavproxy_uavapi.http.wire.bodies import in_time

PICTURES = dict.fromkeys(KINDS.values(), BINARY)
HEADERS = static_files.headers("sandbox")  # a picture, and nothing else


async def show(call: Call) -> dict[str, Any]:
    """The least and the greatest zoom level, null for both without tiles; and the source of others, if any."""
    levels, settings = await asyncio.to_thread(_levels, call), call.service.settings
    more = {"source": settings.tile_source, "licence": settings.tile_licence} if settings.tile_source else {}
    return {"result": "success", "least": min(levels, default=None), "most": max(levels, default=None), **more}


async def tile(call: Call) -> web.StreamResponse:
    """One tile; x counts from the west, y from the north."""
    zoom, x, y = _place(call)
    tile = await asyncio.to_thread(_read, call, zoom, x, y)
    return static_files.answer(call.request, tile.body, tile.kind, HEADERS)


async def keep(call: Call) -> dict[str, Any]:
    """Keep a tile that the page has fetched from `tile_source`, for where there is no internet."""
    zoom, x, y = _place(call)
    settings = call.service.settings
    if not settings.tile_source:
        raise Forbidden("no tile_source is set: nothing is kept")
    body = await in_time(call.request.read())
    await asyncio.to_thread(tile_store.kept().keep, zoom, x, y, body, settings.tile_licence)
    return {"result": "success"}


def _place(call: Call) -> tuple[int, int, int]:
    texts = [call.names[name] for name in ("z", "x", "y")]
    if not all(text.isascii() and text.isdigit() and len(text) < 9 for text in texts):
        raise NotFound("a tile is /tiles/ZOOM/X/Y, with whole numbers")
    zoom, x, y = map(int, texts)
    return zoom, x, y


def _stores(call: Call) -> tuple[TileStore, ...]:
    """The owner's own map, then what was kept; that is one only where there is a source."""
    own, kept = TileStore(call.service.settings.tiles), tile_store.kept()
    return (own, kept) if call.service.settings.tile_source and kept.exists else (own,)


def _levels(call: Call) -> list[int]:
    return [level for store in _stores(call) for level in store.zooms() or ()]


def _read(call: Call, zoom: int, x: int, y: int) -> Tile:
    *others, last = _stores(call)
    for store in others:
        with suppress(NotFound):
            return store.read(zoom, x, y)
    return last.read(zoom, x, y)
