"""The console script, from its arguments to its exit status."""

from __future__ import annotations

import asyncio
import dataclasses
import os
import sys
import termios
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from mavproxy_uavapi.core.terminal import say_text
from mavproxy_uavapi.core.text import reason_of
from mavproxy_uavapi.launcher import command_lines, directories, instances
from mavproxy_uavapi.launcher.errors import LaunchError, OptionError
from mavproxy_uavapi.launcher.fleet import SimulatedVehicle, fleet, kinds
from mavproxy_uavapi.launcher.locations import resolve
from mavproxy_uavapi.launcher.options import RunOptions, parse
from mavproxy_uavapi.launcher.supervisor import Supervisor

# sim_vehicle.py as instance 0 first kills all vehicles that it takes for its own.
FIRST_SITL_INSTANCE = 1
SETUP_SITL = """Nothing to set up: --simulated flies the embedded vehicle, which needs no ArduPilot.
To fly ArduPilot's SITL, build it (./waf configure --board sitl; ./waf copter) and name its directory:
  --simulated --ardupilot_path ~/ardupilot"""
WITHOUT_IT = "without this option, or this line of the file, the embedded vehicle flies and needs no ArduPilot"


def run(argv: Sequence[str] | None = None) -> int:
    """Start everything, wait, end everything; an error is one line on stderr.

    `start` and `setup-sitl` are the commands of uav_api.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments[:1] == ["setup-sitl"]:
        say_text(SETUP_SITL)
        return 0
    if arguments[:1] == ["start"]:
        del arguments[0]
    try:
        options = prepare(parse(arguments))
        return launch(options)
    except LaunchError as error:
        say_text(f"mavproxy-uavapi: {error}", file=sys.stderr)
        return error.status
    except OSError as error:
        say_text(f"mavproxy-uavapi: {reason_of(error)}", file=sys.stderr)
        return LaunchError.status


def prepare(options: RunOptions) -> RunOptions:
    """Complete the options that depend on the terminal, and refuse those that cannot work on this machine.

    Raises:
        OptionError: the ArduPilot directory is not a copy of ArduPilot, or it is not built.
        LaunchError: the API's port is taken.
    """
    if options.simulated and options.ardupilot_path is not None:
        script = command_lines.sim_vehicle(options.ardupilot_path)
        if not script.is_file():
            raise OptionError(f"--ardupilot_path: there is no {script}; {WITHOUT_IT}")
        for kind in dict.fromkeys(kinds(options)):
            binary = command_lines.sitl_binary(options.ardupilot_path, kind)
            if not binary.is_file():
                raise OptionError(f"--ardupilot_path: {binary} is missing, build it first; {WITHOUT_IT}")
    if not instances.is_free(options.port, options.host):
        raise LaunchError(f"--port: {options.host}:{options.port} is taken by another program")
    return dataclasses.replace(options, headless=options.headless or not has_terminal())


def has_terminal() -> bool:
    """Whether we own a terminal; one that we may not read from, after `&`, does not count."""
    return sys.stdin is not None and sys.stdin.isatty() and os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()


def launch(options: RunOptions) -> int:
    """Give the run its directory and each simulated vehicle a number, and supervise the run to its end."""
    root, log_file = directories.split_log_path(options.log_path, options.sysid)
    options = dataclasses.replace(options, log_path=log_file)
    home = resolve(options.location, options.ardupilot_path) if options.simulated else None
    run_dir = directories.new_run(root, options)
    with ExitStack() as stack:
        vehicles: list[SimulatedVehicle] = []
        if home is not None:
            first = FIRST_SITL_INSTANCE if options.ardupilot_path is not None else 0
            numbers = [stack.enter_context(instances.reserved(first)) for _ in kinds(options)]
            vehicles = fleet(options, home, numbers)
        if not options.headless:
            stack.enter_context(terminal_kept())
        return asyncio.run(Supervisor(options, run_dir, vehicles).run())


@contextmanager
def terminal_kept() -> Iterator[None]:
    """Restore the terminal at the end: a MAVProxy that was killed at its prompt leaves it without echo."""
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    try:
        yield
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
