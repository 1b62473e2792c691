"""The console script `mavproxy-uavapi`: MAVProxy with our modules, `run FILE`, a rehearsal, or `flights`."""

from __future__ import annotations

import sys
from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run the console script; each command imports what it needs.

    Args:
        argv: the arguments after the program's name; those of the process by default.

    Returns:
        The exit status, as `launcher.main`, `rehearsal.run.run` or `flights.commands.run` have it.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments[:1] == ["run"]:
        from mavproxy_uavapi.rehearsal.run import run  # noqa: PLC0415

        return run(arguments[1:])
    if arguments[:1] == ["flights"]:
        from mavproxy_uavapi.flights.commands import run as show_flights  # noqa: PLC0415

        return show_flights(arguments[1:])
    from mavproxy_uavapi.launcher import main as launch  # noqa: PLC0415

    return launch(arguments)
