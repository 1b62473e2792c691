"""/: the page from which one flies. Its files are in `mavproxy_uavapi/page`, as the browser gets them."""

from __future__ import annotations

import asyncio
import hashlib
from pathlib import Path

from aiohttp import web

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.http.call import Call

FOLDER = Path(__file__).parents[1] / "page"
INDEX = "index.html"
KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
# Only our own files run there, nothing is sent anywhere else, and no text can become HTML or script.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",  # its own calls must say which page they come from (`security.check_page`)
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-cache",  # asked again each time, and answered 304 where nothing has changed
    "Vary": "Accept",
}


def wants_page(accept: str) -> bool:
    """Whether an Accept header is that of a browser that opens a page; programs get at `/` what they always got."""
    return "text/html" in accept


async def index(call: Call) -> web.StreamResponse:
    """The page."""
    if not wants_page(call.request.headers.get("Accept", "")):
        raise NotFound("no such path")
    return await _answer(call.request, FOLDER / INDEX)


async def asset(call: Call) -> web.StreamResponse:
    """A file of the page."""
    name = call.names["file"]
    if not name.replace("_", "").replace(".", "", 1).isalnum():
        raise NotFound(f"the page has no file {name}")
    return await _answer(call.request, FOLDER / name)


async def _answer(request: web.BaseRequest, file: Path) -> web.StreamResponse:
    """The file, or 304 if the browser has it already."""
    kind = KINDS.get(file.suffix)
    try:
        if kind is None:
            raise FileNotFoundError(file)
        body = await asyncio.to_thread(file.read_bytes)
    except OSError as error:
        raise NotFound(f"the page has no file {file.name}") from error
    headers = {**HEADERS, "ETag": f'"{hashlib.sha256(body).hexdigest()[:32]}"'}
    if request.headers.get("If-None-Match") == headers["ETag"]:
        return web.Response(status=304, headers=headers)
    return web.Response(body=body, content_type=kind, charset="utf-8", headers=headers)
