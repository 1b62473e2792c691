"""A wire as a process: `python -m tests.support.tcp_relay FROM TO`.

While it is stopped (SIGSTOP), nothing passes. Connections stay open and nobody is told: a radio link that fades.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys

CHUNK = 65536


async def pour(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
    """Pass on what comes until it ends."""
    with contextlib.suppress(OSError):
        while part := await source.read(CHUNK):
            sink.write(part)
            await sink.drain()
    sink.close()


async def serve(near: int, far: int) -> None:
    """Join connections to port `near` with port `far`, both on the loopback."""

    async def join(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            to_reader, to_writer = await asyncio.open_connection("127.0.0.1", far)
        except OSError:
            writer.close()
            return
        await asyncio.gather(pour(reader, to_writer), pour(to_reader, writer))

    server = await asyncio.start_server(join, "127.0.0.1", near)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1]), int(sys.argv[2])))
