"""A fleet to look at: broker, database, two workers, vehicles; Ctrl-C ends all. `make demo-fleet VEHICLES=100`.

The vehicles have spool, sender and MQTT sink of mavproxy_gradys as they are, and fly circles on paper: no MAVProxy,
no MAVLink. Broker and database listen on the loopback, keep their files in temporary folders, and leave nothing.
"""

from __future__ import annotations

import argparse
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

from rig import ROOT, harness

from tests.support.fleet import MOSQUITTO, Fleet
from tests.support.postgres import program

TOGETHER = 100  # vehicles in a process
SINK = "mqtt://127.0.0.1:{}/fleet/{{device}}/{{quantity}}#ack=station"


def start_vehicles(fleet: Fleet, directory: Path, options: argparse.Namespace) -> list[harness.Process]:
    """Let them fly."""
    flying = []
    for first in range(1, options.vehicles + 1, TOGETHER):
        place = directory / f"vehicles-{first}"
        place.mkdir()
        count = min(TOGETHER, options.vehicles + 1 - first)
        command = [sys.executable, "-m", "tests.support.fleet_vehicles", SINK.format(fleet.broker.port)]
        command += [f"--first={first}", f"--count={count}", f"--rate={options.rate}"]
        command += [f"--directory={place}", f"--ledger={place / 'sampled.csv'}"]
        flying.append(harness.Process(command, place / "log", ROOT))
    return flying


def run(options: argparse.Namespace) -> None:
    """Start all, and wait for Ctrl-C."""
    flying: list[harness.Process] = []
    with tempfile.TemporaryDirectory(prefix="uavapi-fleet-") as name:
        print("== a broker, a database and two workers start", flush=True)
        fleet = Fleet(Path(name), 2)
        try:
            fleet.start()
            flying = start_vehicles(fleet, Path(name), options)
            for process in flying:
                process.says("vehicles fly")
            pages = " and ".join(f"{worker.url}/" for worker in fleet.workers)
            print(f"== {options.vehicles} vehicles, {options.rate:g} readings/s each; the fleet is at {pages}")
            print(f"== psql {fleet.database.url} -c 'SELECT count(*) FROM readings'")
            print("== Ctrl-C ends all", flush=True)
            while all(process.popen.poll() is None for process in flying):
                time.sleep(0.5)
            print("the vehicles have ended: " + flying[0].output()[-2000:])
        except KeyboardInterrupt:
            print("== all ends")
        finally:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            for process in flying:
                process.stop()
            fleet.stop()


def main() -> int:
    """Run it until Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=100, help="(%(default)s)")
    parser.add_argument("--rate", type=float, default=5.0, help="readings/s of each; five quantities (%(default)g)")
    options = parser.parse_args()
    if MOSQUITTO is None or shutil.which(program("initdb")) is None:
        print("it needs Mosquitto and PostgreSQL: apt-get install mosquitto postgresql", file=sys.stderr)
        return 1
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    run(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
