"""/tiles: the tiles of the user's own map, for the page."""

from __future__ import annotations

import asyncio
from typing import Any

from aiohttp import web

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.files.tile_store import TileStore
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.handlers import static_files

HEADERS = static_files.headers("sandbox")  # a picture, and nothing else


async def show(call: Call) -> dict[str, Any]:
    """The least and the greatest zoom level; null for both without tiles."""
    levels = await asyncio.to_thread(_store(call).zooms)
    return {"result": "success", "least": levels and levels[0], "most": levels and levels[1]}


async def tile(call: Call) -> web.StreamResponse:
    """One tile; x counts from the west, y from the north."""
    texts = [call.names[name] for name in ("z", "x", "y")]
    if not all(text.isascii() and text.isdigit() and len(text) < 9 for text in texts):
        raise NotFound("a tile is /tiles/ZOOM/X/Y, with whole numbers")
    zoom, x, y = map(int, texts)
    tile = await asyncio.to_thread(_store(call).read, zoom, x, y)
    return static_files.answer(call.request, tile.body, tile.kind, HEADERS)


def _store(call: Call) -> TileStore:
    return TileStore(call.service.settings.tiles)
