"""Ends the other processes when the launcher cannot, because of SIGKILL or a defect.

It holds the reading end of a pipe whose only writing end is the launcher's, so the pipe always ends with the
launcher. PR_SET_PDEATHSIG reaches direct children only, and ArduPilot's vehicle is a grandchild; it also depends on
the thread that started the child.

    python -m mavproxy_uavapi.launcher.watchdog TAG     (session numbers on stdin, one per line)
"""

from __future__ import annotations

import signal
import sys

from mavproxy_uavapi.launcher.processes import end_members

GRACE_S = 5.0


def main() -> int:
    """Read sessions until the pipe ends, then end the remaining processes of the run."""
    # A service manager may send SIGTERM to all of a service's processes; this one must end after the launcher.
    for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    sessions = {int(line) for line in sys.stdin}
    return 0 if end_members(sys.argv[1], sessions, GRACE_S) else 1


if __name__ == "__main__":
    sys.exit(main())
