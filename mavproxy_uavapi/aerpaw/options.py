"""The command line: aerpawlib's own options and ours; what is left is the script's."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

VEHICLES = ("drone", "rover", "generic", "none")
ON_EXIT = ("rtl", "land", "hold", "nothing")
DEFAULT_URL = "http://127.0.0.1:8000"
IGNORED = ("--mavsdk-port", "--safety-checker-port", "--safety-checker-ip")


def parser() -> argparse.ArgumentParser:
    """All options that are not the script's."""
    made = argparse.ArgumentParser(
        prog="python -m mavproxy_uavapi.aerpaw",
        description="Fly a script of aerpawlib by the HTTP API. What is not listed here is the script's own.",
        allow_abbrev=False,
    )
    add = made.add_argument
    add("--script", required=True, help="the script: a file, or a dotted name")
    add("--vehicle", choices=VEHICLES, help="what the script gets; by default what the API says that it is")
    add("--conn", "--connection", default=os.environ.get("UAVAPI_URL", DEFAULT_URL), help="the API (%(default)s)")
    add("--on-exit", choices=ON_EXIT, default="rtl", help="what a flying vehicle does when the script ends, or dies")
    add("--real", action="store_true", help="fly here though aerpawlib is installed, with its own util")
    add("--config", action="append", default=[], metavar="FILE", help="JSON with options; several add up")
    add("--skip-init", action="store_true", help="do not wait until the vehicle could be armed")
    add("--skip-rtl", action="store_true", help="as --on-exit nothing")
    add("--conn-timeout", "--connection-timeout", type=float, default=30.0, help="s until it must be connected")
    add("--heartbeat-timeout", type=float, default=5.0, help="s without a heartbeat that end the script")
    add("--zmq-identifier", help="this runner's name among others")
    add("--zmq-proxy-server", help="the address of their proxy")
    add("-v", "--verbose", action="store_true", help="say more")
    add("-q", "--quiet", action="store_true", help="say warnings only")
    add("--log-file", help="a file that gets all that is said")
    add("--structured-log", help="a file that gets what happens as lines of JSON")
    add("--no-aerpawlib-stdout", action="store_true", help="say nothing")
    add("--no-status-bar", action="store_true", help="there is none")
    add("--no-aerpaw-environment", action="store_true", help="have nothing to do with AERPAW's platform")
    add("--api-version", default="v1", choices=["v1"], help="v1, whatever")
    for name in IGNORED:
        add(name, help=argparse.SUPPRESS)
    return made


def parse(arguments: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    """The options, and the script's own arguments, in their order. The command line goes before files.

    Raises:
        SystemExit: they make no sense, with a sentence; or --help.
    """
    before = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    before.add_argument("--config", action="append", default=[])
    made = parser()
    files = before.parse_known_args(arguments)[0].config
    try:
        given = [one for file in files for one in _from_file(json.loads(Path(file).read_text(encoding="utf-8")))]
    except (OSError, ValueError) as error:
        made.error(f"--config: {error}")
    return made.parse_known_args([*given, *arguments])


def _from_file(options: Any) -> list[str]:
    if not isinstance(options, dict):
        raise ValueError("a file of options holds a JSON object")
    given = []
    for name, value in options.items():
        if value is True:
            given.append(f"--{name}")
        elif value is not False and value is not None:
            given += [f"--{name}={one}" for one in (value if isinstance(value, list) else [value])]
    return given
