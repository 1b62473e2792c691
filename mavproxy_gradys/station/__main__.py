"""`python -m mavproxy_gradys.station`: the receiver as a program."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import ssl
import sys
from pathlib import Path

from aiohttp import web

from mavproxy_gradys.station.app import Station
from mavproxy_gradys.station.store import PositionStore
from mavproxy_uavapi.core.timeout import wait_with_timeout


def main(arguments: list[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM; the exit status (1 when it cannot listen)."""
    chosen = parser().parse_args(arguments)
    store = PositionStore(chosen.database)
    try:
        asyncio.run(serve(chosen, store))
    except OSError as error:
        print(f"station: cannot listen on {chosen.host}:{chosen.port}: {error.strerror or error}", file=sys.stderr)
        return 1
    finally:
        store.close()
    return 0


def parser() -> argparse.ArgumentParser:
    """The options."""
    made = argparse.ArgumentParser(
        prog="python -m mavproxy_gradys.station", description="A receiver to try gradys with."
    )
    made.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    made.add_argument("--port", type=int, default=8080, help="TCP port (%(default)s)")
    made.add_argument("--database", type=Path, default=Path("station.db"), help="SQLite file (%(default)s)")
    made.add_argument("--watched", action="store_true", help="answer as if a browser always watched")
    made.add_argument("--token", default="", help="bearer token that senders must know")
    made.add_argument("--certificate", type=Path, help="TLS certificate and key, PEM")
    return made


async def serve(chosen: argparse.Namespace, store: PositionStore) -> None:
    """Serve until told to end.

    Raises:
        OSError: the port is taken, there is no such address, or the certificate cannot be read.
    """
    context = None
    if chosen.certificate is not None:
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        context.load_cert_chain(chosen.certificate)
    runner = web.AppRunner(Station(store, chosen.watched, chosen.token).app(), access_log=None, shutdown_timeout=1.0)
    await runner.setup()
    try:
        await web.TCPSite(runner, chosen.host, chosen.port, ssl_context=context, reuse_address=True).start()
        scheme = "http" if context is None else "https"
        print(f"station: listening on {scheme}://{chosen.host}:{chosen.port}", flush=True)
        over = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, over.set)
        await over.wait()
    finally:
        with contextlib.suppress(asyncio.TimeoutError):
            await wait_with_timeout(5.0, runner.cleanup())


if __name__ == "__main__":
    sys.exit(main())
