"""/: the page from which one flies. Its files are in `mavproxy_uavapi/page`, as the browser gets them."""

from __future__ import annotations

import asyncio
from pathlib import Path

from aiohttp import web

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.http.callers.browser import wants_page
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.handlers import static_files

FOLDER = Path(__file__).parents[2] / "page"
INDEX = "index.html"
KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
FILES = frozenset(file.relative_to(FOLDER).as_posix() for file in FOLDER.rglob("*") if file.suffix in KINDS)
# Only our own files run there, nothing is sent anywhere else, and no text can become HTML or script.
HEADERS = {
    **static_files.headers(
        "script-src 'self'; style-src 'self'; img-src 'self' blob:; require-trusted-types-for 'script'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Vary": "Accept",
}


async def index(call: Call) -> web.StreamResponse:
    """The page."""
    if not wants_page(call.request.headers.get("Accept", "")):
        raise NotFound("no such path")
    return await _answer(call.request, FOLDER / INDEX)


async def asset(call: Call) -> web.StreamResponse:
    """A file of the page."""
    name = "/".join(filter(None, (call.names.get("room"), call.names["file"])))
    if name not in FILES:
        raise NotFound(f"the page has no file {name}")
    return await _answer(call.request, FOLDER / name)


async def _answer(request: web.BaseRequest, file: Path) -> web.StreamResponse:
    """The file, or 304 if the browser has it already."""
    try:
        body = await asyncio.to_thread(file.read_bytes)
    except OSError as error:
        raise NotFound(f"the page has no file {file.name}") from error
    return static_files.answer(request, body, KINDS[file.suffix], HEADERS)
