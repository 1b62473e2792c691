"""Command line of the simulated vehicle."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TypeVar

from mavproxy_uavapi.core.platform import yield_processor

from .kinds import KINDS
from .options import SITL_BASE_PORT, Home, Options, Wind
from .parameters import FIRMWARES
from .server import Server
from .simulator import Simulator

Value = TypeVar("Value")


def main(arguments: list[str] | None = None) -> int:
    """Run a vehicle until SIGINT or SIGTERM; the exit status (1 when a port is taken)."""
    chosen = _parser().parse_args(arguments)
    options = Options(**{one.name: getattr(chosen, one.name) for one in fields(Options) if hasattr(chosen, one.name)})
    port = chosen.port if chosen.port is not None else SITL_BASE_PORT + 10 * chosen.instance
    server = Server(Simulator(options, epoch=time.time()))
    try:
        port = server.listen(chosen.host, port)
        for host, udp_port in chosen.udp:
            server.add_udp(host, udp_port)
        if chosen.decks is not None:
            server.hear_decks(chosen.host, chosen.decks)
        control = None if chosen.control is None else server.listen_control(chosen.host, chosen.control)
    except OSError as error:
        print(f"sim: cannot listen on {chosen.host}:{port}: {error.strerror or error}", file=sys.stderr)
        return 1
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: server.stop())
    home = options.home
    place = f"{home.latitude:.6f},{home.longitude:.6f},{home.altitude:g}"
    print(
        f"sim: vehicle {options.sysid} ({options.vehicle}) at {place} listening on tcp:{chosen.host}:{port}",
        flush=True,
    )
    if control is not None:
        print(f"sim: control on tcp:{chosen.host}:{control}", flush=True)
    # Where there is too little for all, its time slows down, and no MAVProxy flies on telemetry that waits unread.
    yield_processor()
    server.run()
    server.close()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m mavproxy_uavapi.sim",
        description="A vehicle like ArduPilot's, to try out of the box.",
    )
    add = parser.add_argument
    add("--vehicle", choices=list(KINDS), default="copter", help="its type (default copter)")
    add("--firmware", choices=FIRMWARES, default=FIRMWARES[0], help="whose parameter names it has (default 4.7)")
    add("--instance", type=_natural, default=0, metavar="N", help="TCP port 5760 + 10*N (default 0)")
    add("--sysid", type=_system, default=1, metavar="N", help="MAVLink system id (default 1)")
    add("--speedup", type=_positive, default=1.0, metavar="X", help="simulated seconds per second (default 1)")
    add("--home", type=_parsed(Home.parse), default=Home(), metavar="LAT,LON,ALT,HEADING")
    add("--seed", type=int, default=0, metavar="N", help="seed of all randomness (default 0)")
    add("--wind", type=_parsed(Wind.parse), default=Wind(), metavar="SPEED,DIRECTION", help="m/s, degrees from")
    add("--gps-noise", type=_not_negative, default=0.0, metavar="METRES", help="1 sigma, slowly wandering")
    add("--udp", type=_address, action="append", default=[], metavar="HOST:PORT", help="also send there")
    add("--decks", type=_natural, default=None, metavar="PORT", help="UDP port for the --udp of rovers to land on")
    add("--host", default="127.0.0.1", help="address to listen on (default 127.0.0.1)")
    add("--port", type=_natural, default=None, metavar="PORT", help="TCP port, overrides --instance")
    add("--control", type=_natural, default=None, metavar="PORT", help="TCP port for tests: faults and truth")
    add("--ready-after", type=_not_negative, default=5.0, metavar="SECONDS", help="until armable (default 5)")
    add(
        "--battery", type=_positive, default=0.0, metavar="MAH", help="its capacity (default: it never becomes empty)"
    )
    add("--defaults", type=_defaults, default=(), metavar="FILE", help="parameters to boot with: a NAME VALUE a line")
    return parser


def _parsed(parse: Callable[[str], Value]) -> Callable[[str], Value]:
    def checked(text: str) -> Value:
        try:
            return parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return checked


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError("must be more than 0")
    return value


def _not_negative(text: str) -> float:
    value = float(text)
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError("must not be negative")
    return value


def _natural(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError("must not be negative")
    return value


def _system(text: str) -> int:
    value = int(text)
    if not 1 <= value <= 255:
        raise argparse.ArgumentTypeError("must be between 1 and 255")
    return value


def _defaults(text: str) -> tuple[tuple[str, float], ...]:
    """The parameters in a file; the vehicle leaves out those that it does not have."""
    try:
        lines = [line.split() for line in Path(text).read_text(encoding="utf-8").splitlines()]
        return tuple((name, float(value)) for name, value in filter(None, lines))
    except (OSError, ValueError) as error:
        raise argparse.ArgumentTypeError(f"{text}: {error}") from None


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit():
        raise argparse.ArgumentTypeError("must be HOST:PORT")
    return host, int(port)


if __name__ == "__main__":
    sys.exit(main())
