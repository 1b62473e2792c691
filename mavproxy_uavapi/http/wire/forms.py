"""Reads the one file of a multipart form."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from aiohttp import BodyPartReader, MultipartReader, StreamReader, web
from aiohttp.base_protocol import BaseProtocol
from aiohttp.http_exceptions import HttpProcessingError

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.text import escaped
from mavproxy_uavapi.http.wire.bodies import in_time

CHUNK = 65536  # bytes
WRAPPING = 65536  # bytes of a form in addition to its file
FIELD = "file"


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
        BadRequest: there is no file, it is too large, it does not arrive in time, or is a nested form.
        Invalid: the form has another field, or a second file.
    """
    if request.content_type != "multipart/form-data":
        raise BadRequest(f"the file goes into field `{FIELD}` of a multipart/form-data body")
    try:
        form = MultipartReader(request.headers, _stream_of(await _body(request, limit)))
        part = await form.next()
        if part is None:
            raise BadRequest(f"the form has no file in its field `{FIELD}`")
        if not isinstance(part, BodyPartReader):
            raise BadRequest("a part of the form is multipart itself")
        if part.name != FIELD or part.filename is None:
            raise Invalid(
                f"the form has no other field than the file `{FIELD}`", "body", escaped(part.name or "")[:64]
            )
        name, data = checked(part.filename), await _contents(part, limit)
        if await form.next() is not None:
            raise Invalid("the form has more than the one file", "body", FIELD)
        return name, data
    except (ValueError, LookupError, AssertionError, RuntimeError) as error:
        raise BadRequest("the body is not a multipart form, or a damaged one") from error
    except HttpProcessingError as error:
        raise BadRequest(f"a part of the form has bad headers: {error.message}") from error


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
