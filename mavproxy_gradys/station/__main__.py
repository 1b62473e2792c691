"""`python -m mavproxy_gradys.station`: the station as a program."""

from __future__ import annotations

import argparse
import asyncio
import logging
import sys

from mavproxy_gradys.errors import NotDelivered, NotStored
from mavproxy_gradys.station.options import parser
from mavproxy_gradys.station.worker import ExtraMissing, serve
from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.platform import on_stop
from mavproxy_uavapi.core.terminal import say


def main(arguments: list[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM; returns the exit status (1 if it cannot listen or store)."""
    options = parser().parse_args(arguments)
    logging.basicConfig(format="station: %(message)s", level=logging.INFO)
    try:
        asyncio.run(run(options))
    except OSError as error:
        return failed(f"cannot listen on {options.host}:{options.port}: {error.strerror or error}")
    except (NotStored, NotDelivered, ExtraMissing, SettingError) as error:
        return failed(str(error))
    return 0


def failed(why: str) -> int:
    """Print why it does not start; returns the exit status."""
    say(f"station: {why}", file=sys.stderr)
    return 1


async def run(options: argparse.Namespace) -> None:
    """Serve until a signal arrives.

    Raises:
        OSError, NotStored, ExtraMissing, SettingError: as `serve`.
    """
    stop = asyncio.Event()
    on_stop(stop.set)
    await serve(options, stop)


if __name__ == "__main__":
    sys.exit(main())
