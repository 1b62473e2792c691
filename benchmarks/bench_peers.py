"""Reads per second of the original uav_api, of ours and of a bare aiohttp handler, in turns.

One simulated vehicle serves both; MAVProxy forwards its messages to the original, which comes from the package index,
or from `--venv`, where it is installed already.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request
import venv
from collections.abc import Mapping
from pathlib import Path

from bench_reads import BARE, OURS, Case, Reads, read, reads_table
from figures import machine, put_first
from http_clients import Bare, Clients
from rig import fly, harness, rig

from tests.support.ports import free_port

ORIGINAL = "uav_api 0.3.1"
REQUIREMENT = "uav-api==0.3.1"
CASES = [Case(server, clients) for clients in (1, 16) for server in (BARE, OURS, ORIGINAL)]
STREAMRATE = 4  # Hz, as MAVProxy asks for by default


def install(folder: Path) -> Path:
    """The original's command, in a virtual environment that is made if it is not there."""
    command = folder / "bin" / "uav-api"
    if not command.exists():
        venv.create(folder, with_pip=True)
        subprocess.run([folder / "bin" / "pip", "install", "--quiet", REQUIREMENT], check=True)
    return command


def serves(port: int) -> bool:
    """Whether it has a position to show."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/telemetry/gps", timeout=1) as answer:
            return bool(answer.status == 200)
    except (urllib.error.URLError, OSError):
        return False


def measure(ports: Mapping[str, int], clients: Clients, rounds: int, seconds: float) -> dict[Case, Reads]:
    """The reads of all cases, which take turns."""
    cases = {case: Reads() for case in CASES}
    for _ in range(rounds):
        read(clients, ports, cases, seconds)
    return cases


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--venv", type=Path, help="a virtual environment with uav-api 0.3.1, or a folder for one")
    parser.add_argument("--seconds", type=float, default=2.0, help="of each case in each round")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--first", action="store_true", help="run before the machine's other work (root)")
    options = parser.parse_args()
    print(f"peers: {machine()}")
    link, port = free_port(), free_port()
    with tempfile.TemporaryDirectory(prefix="uavapi-peer-") as folder:
        command = [str(install(options.venv or Path(folder) / "venv")), "start", f"--uav_connection=127.0.0.1:{link}"]
        command += ["--connection_type=udpin", f"--port={port}", "--sysid=1", f"--root_dir={folder}"]
        command += [f"--mavlink_streamrate={STREAMRATE}"]
        clients, bare = Clients(), Bare()
        try:
            with rig(outs=(f"127.0.0.1:{link}",), streamrate=STREAMRATE, max_rate=100000) as (made, _):
                made.start("original", command)
                harness.eventually(lambda: serves(port), 60, "the original's first position")
                if options.first:
                    put_first(*(process.pid for process in made.processes))
                fly(made)
                cases = measure(
                    {BARE: bare.port, OURS: made.port, ORIGINAL: port}, clients, options.rounds, options.seconds
                )
        finally:
            clients.close()
            bare.close()
    print(reads_table(cases))
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main())
