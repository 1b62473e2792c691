"""`uav-api`, and the functions of the same module of uav_api that gradysim calls."""

from __future__ import annotations

import multiprocessing
from collections.abc import Sequence

from mavproxy_uavapi.launcher import main as launch


def run_with_args(raw_args: Sequence[str] | None = None) -> None:
    """Run MAVProxy with the API until SIGTERM or Ctrl-C; returns after a clean end.

    Args:
        raw_args: options of `mavproxy-uavapi`; those of the command line by default.

    Raises:
        SystemExit: with the launcher's status, if something did not start or crashed.
    """
    status = launch(raw_args)
    if status:
        raise SystemExit(status)


def spawn_with_args(raw_args: Sequence[str] | None = None) -> multiprocessing.Process:
    """Start the same in a process of its own; `terminate` and `join` end it, and all that it started."""
    process = multiprocessing.Process(target=run_with_args, args=(raw_args,))
    process.start()
    return process


def main() -> None:
    """Run the command `uav-api`."""
    run_with_args()


if __name__ == "__main__":
    main()
