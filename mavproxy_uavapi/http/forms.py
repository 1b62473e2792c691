"""The one file of a multipart form."""

from __future__ import annotations

from collections.abc import Callable

from aiohttp import BodyPartReader, web

from mavproxy_uavapi.errors import BadRequest

CHUNK = 65536  # bytes
FIELD = "file"


def any_name(name: str) -> str:
    """A check of names that lets all pass."""
    return name


async def file_of(request: web.Request, limit: int, checked: Callable[[str], str] = any_name) -> tuple[str, bytes]:
    """Name and contents of the form's field `file`.

    Args:
        request: whose body it is.
        limit: bytes; reading stops there.
        checked: looks at the name before anything is read; what it raises refuses the file.

    Raises:
        BadRequest: there is none, or it is too large.
    """
    if request.content_type != "multipart/form-data":
        raise BadRequest(f"the file goes into field `{FIELD}` of a multipart/form-data body")
    try:
        form = await request.multipart()
        while (part := await form.next()) is not None:
            if isinstance(part, BodyPartReader) and part.name == FIELD and part.filename is not None:
                return checked(part.filename), await _contents(part, limit)
    except (ValueError, LookupError, AssertionError, RuntimeError) as error:
        raise BadRequest(f"the body is no multipart form: {error}") from error
    raise BadRequest(f"the form has no file in its field `{FIELD}`")


async def _contents(part: BodyPartReader, limit: int) -> bytes:
    data = bytearray()
    while chunk := await part.read_chunk(CHUNK):
        data += chunk
        if len(data) > limit:
            raise BadRequest(f"{part.filename} is larger than {limit // 1024} kB")
    return bytes(data)
