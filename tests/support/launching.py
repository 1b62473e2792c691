"""What the tests of the launcher share: files, ports, vehicles, and how MAVProxy reads a command line."""

from __future__ import annotations

import json
import shlex
import textwrap

from mavproxy_uavapi.launcher import locations
from mavproxy_uavapi.launcher.fleet import SimulatedVehicle


def ini(tmp_path, text):
    file = tmp_path / "uav.ini"
    file.write_text(textwrap.dedent(text), encoding="utf-8")
    return f"--config={file}"


def as_mavproxy_reads(load):
    """MAVProxy 1.8.75: `--cmd` at `;`, then shlex with white space only, then JSON behind the first `:{`."""
    [line] = load.split(";")
    lexer = shlex.shlex(line)
    lexer.quotes, lexer.whitespace_split, lexer.commenters = '"', True, ""
    [_, _, argument] = list(lexer)
    name, _, text = argument.partition(":{")
    return name, json.loads("{" + text)


def simulated(*instances, kind="copter", sysid=10):
    home = locations.BUILT_IN["AbraDF"]
    return [SimulatedVehicle(kind, sysid + number, instance, home) for number, instance in enumerate(instances)]
