"""A fleet's readings through all that happens to one: is each a row, once?

Worker, broker and database die by `kill -9`, links are cut, days are detached, clocks go back by an hour, and to days
without a partition while somebody reads in one long transaction; downloads are not read on. Two vehicles have one
name, and the spools of both are restored from one image again and again.

Real Mosquitto, real PostgreSQL, real workers. The vehicles have spool, sender and MQTT sink of mavproxy_gradys as
they are, without MAVProxy; see tests/support/fleet_vehicles.py. Half of them are in a network namespace whose cable
is cut; where none can be made, they are behind a relay that is stopped. In the end SQL counts what was sampled and
the rows.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from figures import machine, table

from tests.support.fleet_faults import Audit, FaultyFleet
from tests.support.network_namespace import NetworkNamespace

TIMEOUT = 600.0  # s


def report(audit: Audit, ack: str) -> str:
    """The table."""
    headings = ["acknowledged by", "sampled", "rows", "dropped", "lost", "doubled", "again", "strange", "repeats"]
    headings += ["p50 s", "p99 s", "longest s", "drained s"]
    counts = [audit.sampled, audit.rows, audit.dropped, audit.lost, audit.doubled, audit.again]
    counts += [audit.strange, audit.repeats]
    delays = [f"{seconds:.1f}" for seconds in (audit.p50, audit.p99, audit.longest, audit.drained)]
    return table(headings, [[f"the {ack}", *map(str, counts), *delays]])


def network_namespace() -> NetworkNamespace | None:
    """A namespace for half of the vehicles; None, and a sentence, where it cannot be made."""
    try:
        return NetworkNamespace()
    except OSError as error:
        print(f"soak: {error}; the link is a relay that is stopped")
        return None


def main() -> int:
    """Run it; 0 when each reading is a row, once, or was counted as dropped."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="of faults (%(default)g)")
    parser.add_argument("--vehicles", type=int, default=20, help="(%(default)s)")
    parser.add_argument("--rate", type=float, default=5.0, help="readings/s of each (%(default)g)")
    parser.add_argument("--workers", type=int, default=3, help="(%(default)s)")
    parser.add_argument("--longest", type=float, default=12.0, help="s of a fault, and of a rest (%(default)g)")
    parser.add_argument("--ack", choices=("station", "broker"), default="station", help="whose word counts")
    parser.add_argument("--seed", type=int, default=1, help="(%(default)s)")
    parser.add_argument("--relay", action="store_true", help="a relay that is stopped, not a network namespace")
    options = parser.parse_args()
    print(f"soak: {machine()}")
    namespace = None if options.relay else network_namespace()
    with tempfile.TemporaryDirectory(prefix="uavapi-fleet-") as name:
        fleet = FaultyFleet(Path(name), options.workers, options.vehicles, options.rate, options.ack, namespace)
        try:
            fleet.start()
            began = time.monotonic()
            fleet.suffer(random.Random(options.seed), options.minutes * 60, options.longest)
            took = time.monotonic() - began
            audit = fleet.audit(TIMEOUT)
        finally:
            fleet.stop()
            if namespace is not None:
                namespace.remove()
    faults = ", ".join(f"{count} of the {kind}" for kind, count in sorted(fleet.faults.items()))
    print(f"{options.vehicles} vehicles, {options.workers} workers, {took:.0f} s of faults: {faults}")
    print(report(audit, options.ack))
    return int(not audit.is_good)


if __name__ == "__main__":
    sys.exit(main())
