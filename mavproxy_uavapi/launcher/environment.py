"""The path of MAVProxy, and the environment variables of the processes."""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path

import mavproxy_uavapi
from mavproxy_uavapi.core.settings import CONFIG_VARIABLE
from mavproxy_uavapi.launcher.command_lines import WINDOW_VARIABLES
from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.launcher.options import VARIABLES


def mavproxy_program() -> list[str]:
    """The command for MAVProxy: the one in this Python's environment, which may not be in PATH, else the one in PATH.

    Raises:
        LaunchError: there is none.
    """
    for directory in (sysconfig.get_path("scripts"), os.path.dirname(sys.executable)):
        script = Path(directory, "mavproxy.py")
        if script.is_file():
            return [sys.executable, str(script)]
    program = shutil.which("mavproxy.py")
    if program is None:
        raise LaunchError("mavproxy.py is neither beside this Python nor in PATH (pip install MAVProxy)")
    return [program]


def ardupilot_python() -> str:
    """The Python for sim_vehicle.py: this one if it has the packages of ArduPilot's tools, else the one in PATH."""
    return sys.executable if importlib.util.find_spec("pexpect") else "python3"


def for_python(environ: Mapping[str, str]) -> dict[str, str]:
    """The environment for the embedded vehicle and the watchdog, and most of MAVProxy's.

    In a checkout that is not installed they would not find our modules. Their output must reach their logs at once,
    because we look there for the line that the vehicle is ready.
    """
    env = {**environ, "PYTHONUNBUFFERED": "1"}
    root = Path(mavproxy_uavapi.__file__).resolve().parent.parent
    if (root / "setup.py").is_file():
        env["PYTHONPATH"] = os.pathsep.join(filter(None, (str(root), environ.get("PYTHONPATH"))))
    return env


def for_mavproxy(environ: Mapping[str, str]) -> dict[str, str]:
    """The environment for MAVProxy, without the settings that we have read and hand over.

    Otherwise the module would take them from its environment and ignore the command line.
    """
    own_names = {*VARIABLES, CONFIG_VARIABLE}
    return {name: value for name, value in for_python(environ).items() if name not in own_names}


def for_sim_vehicle(environ: Mapping[str, str], run_dir: Path) -> dict[str, str]:
    """The environment for sim_vehicle.py: no windows, and a `pkill` that does nothing.

    Without psutil, sim_vehicle.py cleans up with `pkill arducopter`, which kills the vehicles of all users. We end
    its processes ourselves.
    """
    env = {name: value for name, value in environ.items() if name not in WINDOW_VARIABLES}
    tools = run_dir / "bin"
    tools.mkdir(exist_ok=True)
    (tools / "pkill").write_text("#!/bin/sh\nexit 1\n", encoding="ascii")
    (tools / "pkill").chmod(0o755)
    env["PATH"] = os.pathsep.join((str(tools), environ.get("PATH", os.defpath)))
    env["PYTHONUNBUFFERED"] = "1"
    return env
