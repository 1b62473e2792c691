"""The options of `python -m mavproxy_gradys.station`."""

from __future__ import annotations

import argparse
import os
import socket
from pathlib import Path

from mavproxy_gradys.net.topics import checked_filter
from mavproxy_uavapi.core.errors import SettingError

POSTGRES = ("postgresql://", "postgres://")
MOST_SESSION = 2**32 - 1  # s; in MQTT this means without end


def parser() -> argparse.ArgumentParser:
    """The parser; addresses may have passwords, so the environment can give them instead."""
    made = argparse.ArgumentParser(
        prog="python -m mavproxy_gradys.station",
        description="Keeps the readings of a fleet, and shows it.",
        epilog="The variables STATION_DATABASE, STATION_BROKER and STATION_TOKEN set the options, too.",
    )
    made.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    made.add_argument("--port", type=int, default=8080, help="TCP port (%(default)s)")
    database = os.environ.get("STATION_DATABASE", "station.db")
    made.add_argument("--database", default=database, help="SQLite file, or postgresql://… (station.db)")
    made.add_argument("--watched", action="store_true", help="answer as if a browser always watched")
    token = os.environ.get("STATION_TOKEN", "")
    made.add_argument("--token", default=token, help="bearer token that senders must send")
    made.add_argument("--public-name", default="", help="a host name of it, besides its own and its addresses")
    made.add_argument("--certificate", type=Path, help="TLS certificate and key, PEM")
    made.add_argument("--silent", type=positive, default=10.0, help="alarm after s without a reading (%(default)g)")
    made.add_argument("--battery", type=positive, default=20.0, help="alarm below %% of the battery (%(default)g)")
    add_broker(made.add_argument_group("readings from an MQTT 5 broker"))
    return made


def add_broker(group: argparse._ArgumentGroup) -> None:
    """The options of a worker that consumes messages."""
    broker = os.environ.get("STATION_BROKER", "")
    group.add_argument("--broker", default=broker, help="mqtt(s)://[USER:PASSWORD@]HOST[:PORT]")
    group.add_argument(
        "--topic", type=topic_filter, default="fleet/#", help="topic filter of the readings (%(default)s)"
    )
    group.add_argument("--group", default="station", help="name of the group of workers (%(default)s)")
    group.add_argument("--name", default="", help="fixed name of this worker and its session (station-HOST-PORT)")
    group.add_argument("--batch", type=size, default=1000, help="most readings in a transaction (%(default)s)")
    group.add_argument(
        "--batch-seconds", type=positive, default=0.1, help="s that a batch waits for more readings (%(default)g)"
    )
    group.add_argument(
        "--session",
        type=session,
        default=86400,
        help="s that the broker keeps messages for a disconnected worker (%(default)s)",
    )
    group.add_argument("--ca-file", default="", help="certificates to check the broker with, PEM")


def is_postgres(database: str) -> bool:
    """Whether it is a PostgreSQL URL, not a file."""
    return database.startswith(POSTGRES)


def worker_name(options: argparse.Namespace) -> str:
    """The worker's name: the option, or one made of host and port, which a restart does not change."""
    return str(options.name or f"station-{socket.gethostname()}-{options.port}")


def positive(text: str) -> float:
    """A finite number of 0 or more."""
    number = float(text)
    if not 0 <= number < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number of 0 or more")
    return number


def topic_filter(text: str) -> str:
    """A topic filter."""
    try:
        return checked_filter(text)
    except SettingError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def size(text: str) -> int:
    """A number of messages; the receive maximum is twice that, and at most 65535."""
    number = int(text)
    if not 1 <= number <= 32767:
        raise argparse.ArgumentTypeError("it must be from 1 to 32767")
    return number


def session(text: str) -> int:
    """The duration of a session (s)."""
    number = int(text)
    if not 0 <= number <= MOST_SESSION:
        raise argparse.ArgumentTypeError(f"it must be from 0 to {MOST_SESSION} s")
    return number
