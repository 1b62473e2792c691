"""Answers with a file of this machine, however large."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from aiohttp import web

from mavproxy_uavapi.core.acquire import acquire
from mavproxy_uavapi.core.streaming import StreamingResponse

PART = 64 * 1024  # bytes that are read and sent at a time


async def send_file(request: web.BaseRequest, path: Path, name: str, kind: str) -> web.StreamResponse:
    """Send a file, part by part.

    Args:
        request: what asks for it.
        path: where it is.
        name: what the client calls it.
        kind: its media type.

    Raises:
        OSError: it cannot be read.
    """
    file, size = await acquire(asyncio.to_thread(_opened, path))
    try:
        response = StreamingResponse(kind)
        response.headers["Content-Disposition"] = f'attachment; filename="{name}"'
        response.content_length = size
        with suppress(ConnectionError):  # the client has gone, or reads no more
            await response.prepare(request)
            while part := await asyncio.to_thread(file.read, min(PART, size)):
                await response.write(part)
                size -= len(part)  # a file that grows meanwhile has no more than it had
    finally:
        await asyncio.to_thread(file.close)
    return response


def _opened(path: Path) -> tuple[BinaryIO, int]:
    file = path.open("rb")
    return file, path.stat().st_size
