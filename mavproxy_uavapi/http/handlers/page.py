"""/: the page from which one flies. Its files are in `mavproxy_uavapi/page`; few compressed ones are made of them."""

from __future__ import annotations

import asyncio
import functools
import gzip
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from aiohttp import web

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.files import tile_store
from mavproxy_uavapi.http.callers.browser import wants_page
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.handlers import page_bundle, static_files

FOLDER = Path(__file__).parents[2] / "page"
INDEX = "index.html"
KINDS = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".json": "application/json",
    ".svg": "image/svg+xml",
}
FILES = frozenset(file.relative_to(FOLDER).as_posix() for file in FOLDER.rglob("*") if file.suffix in KINDS)
# Only our own files run there, nothing is sent anywhere else, and no text can become HTML or script.
HEADERS = {
    **static_files.headers(
        "script-src 'self'; style-src 'self'; img-src 'self' blob:; require-trusted-types-for 'script'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Vary": "Accept, Accept-Encoding",
}


def headers_with(origin: str) -> dict[str, str]:
    """The page's headers where its browser may fetch tiles from another origin, too."""
    policy = HEADERS["Content-Security-Policy"].replace("connect-src 'self'", f"connect-src 'self' {origin}")
    return {**HEADERS, "Content-Security-Policy": policy}


START, APP, REST, REPLAY = "start.js", "app.js", "rest.js", "replay.js"
SHEETS = ("theme.css", "layout.css", "parts.css")
LANGUAGES = sorted(name for name in FILES if name.startswith("languages/"))  # tables of texts
ALL = "all"  # the room of what is made of several files


class Made(NamedTuple):
    """A file as it is sent: its bytes, and the same by gzip."""

    plain: bytes
    compressed: bytes


async def index(call: Call) -> web.StreamResponse:
    """The page."""
    if not wants_page(call.request.headers.get("Accept", "")):
        raise NotFound("no such path")
    origin = tile_store.origin_of(call.service.settings.tile_source)
    return await _answer(call.request, INDEX, headers_with(origin) if origin else HEADERS)


async def asset(call: Call) -> web.StreamResponse:
    """A file of the page, or one that is made of several of them."""
    return await _answer(call.request, "/".join(filter(None, (call.names.get("room"), call.names["file"]))))


async def _answer(request: web.BaseRequest, name: str, head: Mapping[str, str] = HEADERS) -> web.StreamResponse:
    """The file, or 304 if the browser has it already."""
    try:
        made = (await asyncio.to_thread(_all_made)).get(name)
        plain = made.plain if made else await asyncio.to_thread((FOLDER / name).read_bytes) if name in FILES else None
    except OSError as error:
        raise NotFound(f"a file of the page is missing: {name}") from error
    if plain is None:
        raise NotFound(f"the page has no file {name}")
    kind = KINDS[Path(name).suffix]
    if made and "gzip" in request.headers.get("Accept-Encoding", ""):
        return static_files.answer(request, made.compressed, kind, {**head, "Content-Encoding": "gzip"})
    return static_files.answer(request, plain, kind, head)


def _all_made() -> dict[str, Made]:
    return _made(max((FOLDER / name).stat().st_mtime_ns for name in FILES))


@functools.lru_cache(maxsize=1)
def _made(_changed: int) -> dict[str, Made]:
    """The index and what it loads, made anew when a file of the page has changed."""

    def read(name: str) -> str:
        return (FOLDER / name).read_text(encoding="utf-8")

    first = frozenset(page_bundle.closure(read, APP))
    texts = {
        INDEX: page_bundle.index(read(INDEX)),
        f"{ALL}/style.css": "".join(map(read, SHEETS)),
        f"{ALL}/{START}": page_bundle.bundle(read, START),
        f"{ALL}/{APP}": page_bundle.bundle(read, APP),
        f"{ALL}/{REST}": page_bundle.bundle(read, REST, first),
        f"{ALL}/{REPLAY}": page_bundle.bundle(read, REPLAY),
        **{name: read(name) for name in LANGUAGES},
    }
    return {name: Made(text.encode(), gzip.compress(text.encode(), mtime=0)) for name, text in texts.items()}
