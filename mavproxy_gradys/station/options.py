"""The options of `python -m mavproxy_gradys.station`."""

from __future__ import annotations

import argparse
import os
import socket
from pathlib import Path

POSTGRES = ("postgresql://", "postgres://")
MOST_SESSION = 2**32 - 1  # s: for ever


def parser() -> argparse.ArgumentParser:
    """All of them; addresses may hold passwords, so the environment may have them instead."""
    made = argparse.ArgumentParser(
        prog="python -m mavproxy_gradys.station",
        description="Keeps the readings of a fleet, and shows it.",
        epilog="STATION_DATABASE, STATION_BROKER and STATION_TOKEN in the environment stand for the options.",
    )
    made.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    made.add_argument("--port", type=int, default=8080, help="TCP port (%(default)s)")
    database = os.environ.get("STATION_DATABASE", "station.db")
    made.add_argument("--database", default=database, help="SQLite file, or postgresql://… (station.db)")
    made.add_argument("--watched", action="store_true", help="answer as if a browser always watched")
    token = os.environ.get("STATION_TOKEN", "")
    made.add_argument("--token", default=token, help="bearer token that senders must know")
    made.add_argument("--certificate", type=Path, help="TLS certificate and key, PEM")
    made.add_argument("--silent", type=positive, default=10.0, help="alarm after s without a reading (%(default)g)")
    made.add_argument("--battery", type=positive, default=20.0, help="alarm below %% of the battery (%(default)g)")
    add_broker(made.add_argument_group("readings from an MQTT 5 broker"))
    return made


def add_broker(group: argparse._ArgumentGroup) -> None:
    """The options of a worker that consumes."""
    broker = os.environ.get("STATION_BROKER", "")
    group.add_argument("--broker", default=broker, help="mqtt(s)://[USER:PASSWORD@]HOST[:PORT]")
    group.add_argument("--topic", default="fleet/#", help="filter of the readings' topics (%(default)s)")
    group.add_argument("--group", default="station", help="of the workers that share them (%(default)s)")
    group.add_argument(
        "--name", default="", help="of this worker and its session, always the same (station-HOST-PORT)"
    )
    group.add_argument("--batch", type=size, default=1000, help="readings in a transaction, at most (%(default)s)")
    group.add_argument("--batch-seconds", type=positive, default=0.1, help="s that it waits for more (%(default)g)")
    group.add_argument(
        "--session", type=session, default=86400, help="s that the broker keeps for a worker away (%(default)s)"
    )
    group.add_argument("--ca-file", default="", help="certificates that the broker is checked by, PEM")


def is_postgres(database: str) -> bool:
    """Whether that is no file."""
    return database.startswith(POSTGRES)


def worker_name(options: argparse.Namespace) -> str:
    """The worker's name: as it was chosen, or of host and port, which stay when it is started again."""
    return str(options.name or f"station-{socket.gethostname()}-{options.port}")


def positive(text: str) -> float:
    """A number that is not negative."""
    number = float(text)
    if not 0 <= number < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is no such number")
    return number


def size(text: str) -> int:
    """How many messages; the receive maximum is twice that, and 65535 at most."""
    number = int(text)
    if not 1 <= number <= 32767:
        raise argparse.ArgumentTypeError("it is from 1 to 32767")
    return number


def session(text: str) -> int:
    """A session's length."""
    number = int(text)
    if not 0 <= number <= MOST_SESSION:
        raise argparse.ArgumentTypeError(f"it is from 0 to {MOST_SESSION} s")
    return number
