"""The console script `mavproxy-uavapi`: MAVProxy with our modules, or one of the commands in the table."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

from mavproxy_uavapi.core.platform import LINUX, NEEDED
from mavproxy_uavapi.core.terminal import say

COMMANDS = {
    "run": "rehearsal.run",  # a rehearsal of a file
    "flights": "flights.commands",
    "setup": "companion.setup",
    "token": "companion.token",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the console script; each command imports what it needs.

    Args:
        argv: the arguments after the program's name; those of the process by default.

    Returns:
        The exit status, as `launcher.main` or the command's `run` has it.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if not LINUX:
        say(f"mavproxy-uavapi: {NEEDED}", file=sys.stderr)
        return 1
    if arguments and arguments[0] in COMMANDS:
        status: int = importlib.import_module(f"mavproxy_uavapi.{COMMANDS[arguments[0]]}").run(arguments[1:])
        return status
    from mavproxy_uavapi.launcher import main as launch  # noqa: PLC0415

    return launch(arguments)
