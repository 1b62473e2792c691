"""Reads the one file of a multipart form."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from aiohttp import BodyPartReader, MultipartReader, StreamReader, web
from aiohttp.base_protocol import BaseProtocol
from aiohttp.http_exceptions import HttpProcessingError

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.http.bodies import in_time

CHUNK = 65536  # bytes
WRAPPING = 65536  # bytes of a form in addition to its file
FIELD = "file"
MOST_PARTS = 100  # before the file; tens of thousands would delay the event loop


def any_name(name: str) -> str:
    """A check that accepts all names."""
    return name


async def file_of(
    request: web.BaseRequest, limit: int, checked: Callable[[str], str] = any_name
) -> tuple[str, bytes]:
    """Name and contents of the form's field `file`.

    Args:
        request: the request.
        limit: bytes; reading stops there.
        checked: checks the name before anything is read; an error that it raises refuses the file.

    Raises:
        BadRequest: there is no file, it is too large, it does not arrive in time, or too many other parts or a nested
        form come before it.
    """
    if request.content_type != "multipart/form-data":
        raise BadRequest(f"the file goes into field `{FIELD}` of a multipart/form-data body")
    try:
        form = MultipartReader(request.headers, _stream_of(await _body(request, limit)))
        for _ in range(MOST_PARTS):
            part = await form.next()
            if part is None:
                raise BadRequest(f"the form has no file in its field `{FIELD}`")
            if not isinstance(part, BodyPartReader):
                raise BadRequest("a part of the form is multipart itself")
            if part.name == FIELD and part.filename is not None:
                return checked(part.filename), await _contents(part, limit)
    except (ValueError, LookupError, AssertionError, RuntimeError) as error:
        raise BadRequest("the body is not a multipart form, or a damaged one") from error
    except HttpProcessingError as error:
        raise BadRequest(f"a part of the form has bad headers: {error.message}") from error
    raise BadRequest(f"the form has {MOST_PARTS} parts before its file")


async def _body(request: web.BaseRequest, limit: int) -> bytes:
    """The whole form."""
    try:
        return await in_time(request.clone(client_max_size=limit + WRAPPING).read())
    except web.HTTPRequestEntityTooLarge as error:
        raise BadRequest(f"the form is larger than {limit // 1024} kB") from error


def _stream_of(body: bytes) -> StreamReader:
    """The kind of stream from which aiohttp reads forms."""
    loop = asyncio.get_running_loop()
    stream = StreamReader(BaseProtocol(loop), limit=len(body) + 1, loop=loop)
    stream.feed_data(body)
    stream.feed_eof()
    return stream


async def _contents(part: BodyPartReader, limit: int) -> bytes:
    data = bytearray()
    while chunk := await part.read_chunk(CHUNK):
        data += chunk
        if len(data) > limit:
            raise BadRequest(f"{part.filename} is larger than {limit // 1024} kB")
    return bytes(data)
