"""The command line: aerpawlib's options and ours; all other arguments are the script's."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from mavproxy_uavapi.core.errors import BadRequest, UavApiError
from mavproxy_uavapi.core.file_text import read_text
from mavproxy_uavapi.core.strict_json import json_of

VEHICLES = ("drone", "rover", "generic", "none")
ON_EXIT = ("rtl", "land", "hold", "nothing")
DEFAULT_URL = "http://127.0.0.1:8000"
LARGEST = 1024 * 1024  # bytes of a file of options


def parser() -> argparse.ArgumentParser:
    """The parser of all options except the script's own."""
    made = argparse.ArgumentParser(
        prog="python -m mavproxy_uavapi.aerpaw",
        description="Fly a script of aerpawlib by the HTTP API. Other arguments than these go to the script.",
        allow_abbrev=False,
    )
    add = made.add_argument
    add("--script", required=True, help="the script: a file, or a dotted name")
    add("--vehicle", choices=VEHICLES, help="the vehicle's class; by default the type that the API reports")
    add("--conn", "--connection", default=os.environ.get("UAVAPI_URL", DEFAULT_URL), help="the API (%(default)s)")
    add("--on-exit", choices=ON_EXIT, default="rtl", help="what a flying vehicle does when the script ends or fails")
    add("--real", action="store_true", help="run even if aerpawlib is installed, with its own util")
    add("--config", action="append", default=[], metavar="FILE", help="JSON file with options; may be repeated")
    add("--skip-init", action="store_true", help="do not wait until the vehicle is ready to arm")
    add("--skip-rtl", action="store_true", help="as --on-exit nothing")
    add("--conn-timeout", "--connection-timeout", type=float, default=30.0, help="s until it must be connected")
    add("--heartbeat-timeout", type=float, default=5.0, help="s without a heartbeat after which the script ends")
    add("--zmq-identifier", help="this runner's name among others")
    add("--zmq-proxy-server", help="the address of the runners' proxy")
    add("-v", "--verbose", action="store_true", help="log debug messages, too")
    add("-q", "--quiet", action="store_true", help="log warnings only")
    add("--log-file", help="write the log to this file, too")
    add("--structured-log", help="write events to this file as lines of JSON")
    add("--no-aerpawlib-stdout", action="store_true", help="log nothing to the terminal")
    add("--no-status-bar", action="store_true", help="ignored: there is no status bar")
    add("--no-aerpaw-environment", action="store_true", help="do not use AERPAW's platform")
    add("--api-version", choices=["v1", "v2"], help="of aerpawlib; by default what the script imports")
    add("--safety-checker-ip", help="the address of the safety checker that v2's can_… methods ask")
    add("--safety-checker-port", type=int, help="its TCP port")
    add("--mavsdk-port", help=argparse.SUPPRESS)
    return made


def parse(arguments: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    """The options, and the script's own arguments in order. The command line overrides files.

    Raises:
        SystemExit: an option is invalid, or --help.
    """
    before = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    before.add_argument("--config", action="append", default=[])
    made = parser()
    files = before.parse_known_args(arguments)[0].config
    try:
        from_files = [one for file in files for one in _from_file(file)]
    except UavApiError as error:
        made.error(f"--config: {error}")
    return made.parse_known_args([*from_files, *arguments])


def _from_file(file: str) -> list[str]:
    options = json_of(read_text(Path(file), LARGEST), file)
    if not isinstance(options, dict):
        raise BadRequest(f"{file}: a file of options must be a JSON object")
    arguments = []
    for name, value in options.items():
        if value is True:
            arguments.append(f"--{name}")
        elif value is not False and value is not None:
            arguments += [f"--{name}={one}" for one in (value if isinstance(value, list) else [value])]
    return arguments
