"""The console script `mavproxy-uavapi`: MAVProxy with our modules and, on request, a simulated vehicle."""

from __future__ import annotations

from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run the console script.

    Args:
        argv: the arguments after the program's name; those of the process by default.

    Returns:
        0 after a clean shutdown, 1 if something did not start or crashed, 2 for a wrong option; 128 plus the signal's
        number if MAVProxy was killed by a signal that we did not send.
    """
    # The watchdog is a module of this package too; it must not import argparse and asyncio.
    from mavproxy_uavapi.launcher.cli import run  # noqa: PLC0415

    return run(argv)
