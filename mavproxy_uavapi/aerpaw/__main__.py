"""The command `python -m mavproxy_uavapi.aerpaw`."""

from __future__ import annotations

import sys

from mavproxy_uavapi.aerpaw import host, names, options, script
from mavproxy_uavapi.core.terminal import say


def main() -> int:
    """Run a script; returns the exit status."""
    chosen, rest = options.parse(sys.argv[1:])
    try:
        names.serve(real=chosen.real)
    except names.AlreadyInstalled as error:
        say(str(error), file=sys.stderr)
        return 1
    return host.run(chosen, rest, lambda name: script.runner_of(script.load(name)))


if __name__ == "__main__":
    sys.exit(main())
