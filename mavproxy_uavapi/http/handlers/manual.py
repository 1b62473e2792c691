"""/manual: the documentation as a site, where its manual.zip lies, which `make docs` makes. It needs no internet."""

from __future__ import annotations

import asyncio
import functools
import re
import zipfile
import zlib
from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path, PurePosixPath

from aiohttp import web
from pydantic import ConfigDict

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.core.text import reason_of
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.requests import Request
from mavproxy_uavapi.http.handlers import static_files

NAME = "manual.zip"
OWN = Path(__file__).parents[2] / NAME  # a bundle's
ROOM = "manual/"  # the folder in it
INDEX = "index.html"
KINDS = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".jpg": "image/jpeg",
}
INLINE = re.compile(rb"<script>(.*?)</script>", re.DOTALL)  # a line of the theme's, which nothing of a request enters


class ReadByTheSite(Request):
    """What the query has for the site's own scripts: the words of a search, a number for the browser's cache."""

    model_config = ConfigDict(extra="ignore")


async def page(call: Call) -> web.StreamResponse:
    """The manual's first page. Its links are relative, and it may be below a path of a proxy."""
    if call.request.path.endswith("/"):
        return await _answer(call.request, INDEX)
    await asyncio.to_thread(_contents)
    return web.Response(status=307, headers={"Location": "manual/"})


async def asset(call: Call) -> web.StreamResponse:
    """A file of the manual."""
    rooms = (call.names.get(name) for name in ("room", "inner"))
    return await _answer(call.request, "/".join([*filter(None, rooms), call.names["file"]]))


async def _answer(request: web.BaseRequest, name: str) -> web.StreamResponse:
    body = (await asyncio.to_thread(_contents)).get(name)
    if body is None:
        raise NotFound(f"the manual has no file {name}")
    return static_files.answer(request, body, KINDS[PurePosixPath(name).suffix], _headers(body))


def _headers(body: bytes) -> dict[str, str]:
    """Only its own scripts run; it has a form, the search's."""
    inline = "".join(f" 'sha256-{b64encode(sha256(text).digest()).decode()}'" for text in INLINE.findall(body))
    head = static_files.headers(
        f"script-src 'self'{inline}; style-src 'self' 'unsafe-inline'; img-src 'self' data:; font-src 'self'"
    )
    policy = head["Content-Security-Policy"].replace("form-action 'none'", "form-action 'self'")
    return {**head, "Content-Security-Policy": policy}


def _contents() -> Mapping[str, bytes]:
    """The files by their names.

    Raises:
        NotFound: there is no manual, or it cannot be read.
    """
    places = (OWN, state_directory() / NAME)
    try:
        file = next((one for one in places if one.is_file()), None)
        if file is None:
            raise NotFound(f"there is no manual here: {places[1]} of a release is missing")
        return _read(file, file.stat().st_mtime_ns)
    except (OSError, zipfile.BadZipFile, zlib.error) as error:
        raise NotFound(f"the manual cannot be read: {reason_of(error)}") from error


@functools.lru_cache(maxsize=1)  # 3 MB: a copy for each reader would be more
def _read(file: Path, _changed: int) -> Mapping[str, bytes]:
    with zipfile.ZipFile(file) as packed:
        names = [name for name in packed.namelist() if PurePosixPath(name).suffix in KINDS]
        return {name.removeprefix(ROOM): packed.read(name) for name in names}
