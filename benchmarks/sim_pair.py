"""The same sequence on ArduPilot's SITL and on the embedded vehicle, and where the results differ."""

from __future__ import annotations

import argparse
import contextlib
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from sim_station import HOME, TIMEOUT, Station

BINARIES = {"copter": "arducopter", "rover": "ardurover", "plane": "arduplane", "quadplane": "arduplane"}
MODELS = {"copter": "+"}  # others are called as their type
DEFAULTS = {
    "copter": "default_params/copter.parm",
    "rover": "default_params/rover.parm",
    "plane": "models/plane.parm",
    "quadplane": "default_params/quadplane.parm",
}
Results = dict[str, tuple[Any, float]]
"""By label the value, and the tolerance of a measured one."""
Sequence = Callable[[Station], Results]


@contextlib.contextmanager
def running(command: list[str], port: int, directory: str) -> Iterator[Station]:
    """The process and a station of it; the process is killed at the end, whatever it does."""
    with subprocess.Popen(command, cwd=directory, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            deadline = time.monotonic() + TIMEOUT
            while True:
                with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
                    break
                assert time.monotonic() < deadline, f"nothing listens on {port}"
                time.sleep(0.5)
            station = Station(port)
            try:
                yield station
            finally:
                station.close()
        finally:
            process.kill()


def fly(sequence: Sequence, command: list[str], port: int) -> Results:
    with (
        tempfile.TemporaryDirectory(prefix="uavapi-types-") as directory,
        running(command, port, directory) as station,
    ):
        return sequence(station)


def differs(sitl: Any, embedded: Any, tolerance: float) -> bool:
    if tolerance and isinstance(sitl, (int, float)) and isinstance(embedded, (int, float)):
        return abs(sitl - embedded) > tolerance
    return bool(sitl != embedded)


def shown(value: Any, other: Any) -> str:
    """The value, of a table or list only what the other has not."""
    if isinstance(value, dict) and isinstance(other, dict):
        return str({key: part for key, part in value.items() if other.get(key) != part} or "same")
    if isinstance(value, list) and value and isinstance(value[0], str):
        return str([part for part in value if part not in other] or "same")
    return str(value)


def compare(description: str | None, sequences: Mapping[str, Sequence]) -> int:
    """The command line of both benchmarks: fly the sequence of each type on both, and print the results."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ardupilot", type=Path, required=True, help="a copy of ArduPilot with SITL built")
    parser.add_argument("--vehicle", choices=list(sequences), action="append", help="all without it")
    parser.add_argument("--speedup", type=int, default=10)
    parser.add_argument("--instance", type=int, default=50, help="of SITL; the embedded one has the next")
    chosen = parser.parse_args()
    for number in (signal.SIGTERM, signal.SIGHUP):  # both end Python at once otherwise, and the vehicle would stay
        signal.signal(number, lambda *_: sys.exit(1))
    options = [f"--home={','.join(map(str, HOME))}", f"--speedup={chosen.speedup}"]
    for kind in chosen.vehicle or sequences:
        home, port = chosen.ardupilot.resolve(), 5760 + 10 * chosen.instance
        defaults = home / "Tools" / "autotest" / DEFAULTS[kind]
        binary = str(home / "build" / "sitl" / "bin" / BINARIES[kind])
        sitl = [binary, f"--model={MODELS.get(kind, kind)}", f"-I{chosen.instance}", f"--defaults={defaults}"]
        embedded = [sys.executable, "-m", "mavproxy_uavapi.sim", f"--vehicle={kind}"]
        theirs = fly(sequences[kind], [*sitl, *options], port)
        ours = fly(sequences[kind], [*embedded, f"--instance={chosen.instance + 1}", *options], port + 10)
        report(kind, theirs, ours)
    return 0


def report(kind: str, theirs: Results, ours: Results) -> None:
    print(f"{kind}: ArduPilot's SITL | embedded")
    for label, (value, tolerance) in theirs.items():
        other = ours[label][0]
        mark = "*" if differs(value, other, tolerance) else " "
        print(f"{mark} {label}: {shown(value, other)} | {shown(other, value)}", flush=True)
