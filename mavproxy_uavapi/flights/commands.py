"""`mavproxy-uavapi flights`: the flights of this machine, without MAVProxy."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.core.terminal import say
from mavproxy_uavapi.flights.flight_export import write_zip
from mavproxy_uavapi.flights.flight_merge import merge
from mavproxy_uavapi.flights.flight_store import Flight, FlightStore

RATE = 5.0  # rows in a second of a table, unless one asks for others


def line_of(flight: Flight) -> str:
    """A flight in a line."""
    vehicles = ", ".join(map(str, flight.vehicles))
    name = f" {flight.name!r}" if flight.name else ""
    until = flight.ended[11:19] or flight.state
    size = f", {flight.bytes / 1e6:.1f} MB" if flight.bytes else ""
    return f"{flight.id}{name}: vehicle {vehicles}, {flight.began[:10]} {flight.began[11:19]} to {until} UTC{size}"


def calm(*arguments: str) -> list[str]:
    """The command line of `flights`, for a process that leaves the processor to whoever flies."""
    return ["nice", "-n", "10", sys.executable, "-m", __name__, *arguments]


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("mavproxy-uavapi flights", description="the flights of this machine")
    parser.add_argument(
        "--folder", type=Path, default=state_directory() / "flights", help="where they are (%(default)s)"
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("list", help="all of them, the newest first")
    show = verbs.add_parser("show", help="what is known of one")
    export = verbs.add_parser("export", help="one as a zip: tables (CSV, Parquet), GPX, KML, what happened, files")
    export.add_argument("--output", type=Path, help="the zip; by default in this folder, named after the flight")
    export.add_argument("--rate", type=float, default=RATE, help="rows in a second of the tables (%(default)g)")
    beside = verbs.add_parser("compare", help="a way beside another one, in figures")
    beside.add_argument("flight", help="its id")
    beside.add_argument(
        "other", help="id of a flight, `mission` for its own, a mission's file, or a rehearsal's JSON"
    )
    beside.add_argument("--vehicle", type=int, help="whose ways (by default the first vehicle's)")
    export.add_argument("--without", default="", help=argparse.SUPPRESS)
    read = verbs.add_parser("import", help="logs of other programs: MAVProxy's .tlog, an autopilot's .bin; a .mcap")
    read.add_argument("file", type=Path, nargs="+")
    merge = verbs.add_parser("merge", help="several records of the same time, perhaps of other machines, into one")
    merge.add_argument("flights", nargs="+", metavar="flight", help="an id, or a .mcap file")
    merge.add_argument("--name", default="merged", help="of the new one (%(default)s)")
    pack = verbs.add_parser("pack", help="compress one that has ended; the module does so by itself")
    for one in (show, export, pack):
        one.add_argument("flight", help="its id")
    return parser


def _compared(store: FlightStore, arguments: argparse.Namespace) -> list[str]:
    from mavproxy_uavapi.flights import flight_comparison as compared  # noqa: PLC0415 - shapely takes its time

    flight, file = store.find(arguments.flight), Path(arguments.other)
    if arguments.other == compared.MISSION:
        return compared.sentences(compared.compare_mission(flight.id, store.file(flight), arguments.vehicle))
    if not file.is_file():
        other = store.find(arguments.other)
        both = ((flight.id, store.file(flight)), (other.id, store.file(other)))
        return compared.sentences(compared.compare_flights(*both, arguments.vehicle))
    return compared.sentences(compared.compare_file(flight.id, store.file(flight), file, arguments.vehicle))


def run(argv: Sequence[str]) -> int:
    """Run the command.

    Returns:
        The exit status: 0, or 1 with the reason in a line.
    """
    arguments = _arguments().parse_args(argv)
    store = FlightStore(arguments.folder.expanduser())
    try:
        if arguments.verb == "list":
            say(*(list(map(line_of, store.all())) or ["no flights yet"]))
        elif arguments.verb == "import":
            from mavproxy_uavapi.flights.flight_import import take  # noqa: PLC0415 - pymavlink takes its time

            for path in arguments.file:
                is_record = path.suffix.lower() == ".mcap"
                say(line_of(merge(store, [str(path)], path.stem) if is_record else take(store, path)))
        elif arguments.verb == "merge":
            say(line_of(merge(store, arguments.flights, arguments.name)))
        elif arguments.verb == "compare":
            say(*_compared(store, arguments))
        elif arguments.verb == "pack":
            store.pack(arguments.flight)
        elif arguments.verb == "show":
            flight = store.find(arguments.flight)
            say(line_of(flight), str(store.file(flight)), *(f"  {k}: {v}" for k, v in flight.about().items()))
        else:
            flight = store.find(arguments.flight)
            target = arguments.output or Path(f"{flight.id}.zip")
            write_zip(flight, store.file(flight), target, arguments.rate, without=arguments.without)
            say(str(target))
    except (UavApiError, OSError) as error:
        say(f"mavproxy-uavapi flights: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(run(sys.argv[1:]))
