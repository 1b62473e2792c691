"""A fleet under faults: workers, broker and database are killed, links fade; then SQL counts what became of it."""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from tests.support.fleet import Fleet
from tests.support.network_namespace import NetworkNamespace
from tests.support.ports import free_port
from tests.support.processes import Process, eventually

ROOT = Path(__file__).parents[2]
AUDIT = """
SELECT (SELECT count(*) FROM sampled),
    (SELECT count(*) FROM sampled JOIN readings USING (device, seq)
        WHERE round(extract(epoch FROM time) * 1000) = ms),
    (SELECT count(*) FROM readings),
    (SELECT count(*) FROM (SELECT 1 FROM readings GROUP BY device, seq HAVING count(*) > 1) AS doubled),
    (SELECT count(*) FROM readings LEFT JOIN sampled USING (device, seq) WHERE ms IS NULL),
    (SELECT sum(repeats) FROM workers),
    (SELECT percentile_disc(0.5) WITHIN GROUP (ORDER BY extract(epoch FROM received - time)) FROM readings),
    (SELECT percentile_disc(0.99) WITHIN GROUP (ORDER BY extract(epoch FROM received - time)) FROM readings),
    (SELECT extract(epoch FROM max(received - time)) FROM readings)
"""


class Audit(NamedTuple):
    """What SQL says.

    Attributes:
        sampled: readings that the vehicles have sampled.
        kept: of these, which are a row.
        rows: all rows.
        doubled: readings that are more than one row.
        strange: rows that nobody sampled.
        repeats: readings that came again and made no row.
        p50, p99, longest: s from sampling to row.
        dropped: readings that the vehicles' own limits dropped.
        drained: s from the end of the sampling until the spools were empty.
    """

    sampled: int
    kept: int
    rows: int
    doubled: int
    strange: int
    repeats: int
    p50: float
    p99: float
    longest: float
    dropped: int
    drained: float

    @property
    def lost(self) -> int:
        """Readings that are no row, and that nobody counted as dropped."""
        return self.sampled - self.kept - self.dropped

    @property
    def is_good(self) -> bool:
        """Whether each reading is one row, or was counted as dropped."""
        return self.sampled > 0 and not (self.lost or self.doubled or self.strange)


class FaultyFleet:
    """A fleet, half of whose vehicles are behind a link that fades.

    The link is the cable of a network namespace, or a relay as a process.

    Attributes:
        faults: how often each kind happened.

    Args:
        directory: for all that it writes.
        workers, vehicles: how many.
        rate: readings/s of each vehicle.
        ack: `station` or `broker`: whose word takes a reading out of the spool.
        namespace: for the vehicles behind the link; None for a relay.
    """

    def __init__(
        self,
        directory: Path,
        workers: int,
        vehicles: int,
        rate: float,
        ack: str = "station",
        namespace: NetworkNamespace | None = None,
    ) -> None:
        self._directory = directory
        self._fleet = Fleet(directory, workers, also="" if namespace is None else namespace.host)
        self._vehicles, self._rate, self._ack = vehicles, rate, ack
        self._namespace = namespace
        self._flying: list[Process] = []
        self._processes: list[Process] = []
        self.faults: Counter[str] = Counter()

    def _start(self, name: str, log: str, *arguments: str, within: NetworkNamespace | None = None) -> Process:
        command = [sys.executable, "-m", f"tests.support.{name}", *arguments]
        process = Process(command if within is None else within.command(command), self._directory / log, ROOT)
        self._processes.append(process)
        return process

    def _fly(self, name: str, first: int, count: int, address: str, within: NetworkNamespace | None) -> None:
        """Start vehicles that send to a broker at `address`."""
        spools = self._directory / f"spools-{name}"
        spools.mkdir()
        option = "#ack=station" if self._ack == "station" else ""
        flown = [f"mqtt://{address}/fleet/{{device}}/{{quantity}}{option}", f"--first={first}", f"--count={count}"]
        flown += [f"--rate={self._rate}", f"--directory={spools}", f"--ledger={spools}.csv"]
        self._flying.append(self._start("fleet_vehicles", f"{name}.log", *flown, within=within))

    def start(self) -> None:
        """Start all; the vehicles fly when this returns."""
        self._fleet.start()
        port, half, through = self._fleet.broker.port, self._vehicles // 2, self._namespace
        if through is None:
            near = free_port()
            self._relay = self._start("tcp_relay", "relay.log", str(near), str(port))
            address = f"127.0.0.1:{near}"
        else:
            address = f"{through.host}:{port}"
        self._fly("near", 1, self._vehicles - half, f"127.0.0.1:{port}", None)
        self._fly("far", self._vehicles - half + 1, half, address, through)
        for process in self._flying:
            process.says("vehicles fly")

    # -- the faults ---------------------------------------------------------------------------------------

    def _kill_worker(self, chance: random.Random) -> Callable[[], None]:
        worker = chance.choice(self._fleet.workers)
        worker.kill()
        return worker.start

    def _kill_broker(self, _chance: random.Random) -> Callable[[], None]:
        self._fleet.broker.kill()
        return self._fleet.broker.start

    def _kill_database(self, _chance: random.Random) -> Callable[[], None]:
        self._fleet.database.kill()
        return self._fleet.database.start

    def _cut(self, _chance: random.Random) -> Callable[[], None]:
        if self._namespace is not None:
            self._namespace.cut()
            return self._namespace.mend
        os.kill(self._relay.pid, signal.SIGSTOP)
        return lambda: os.kill(self._relay.pid, signal.SIGCONT)

    def suffer(self, chance: random.Random, seconds: float, longest: float) -> None:
        """One fault after the other, in random order, for so long; each lasts up to `longest` s."""
        kinds = {
            "worker": self._kill_worker,
            "broker": self._kill_broker,
            "database": self._kill_database,
            "link": self._cut,
        }
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            order = list(kinds)
            chance.shuffle(order)
            for kind in order:
                mend = kinds[kind](chance)
                time.sleep(chance.uniform(0.2, longest))
                mend()
                self.faults[kind] += 1
                time.sleep(chance.uniform(0.2, longest))

    # -- the end ------------------------------------------------------------------------------------------

    def drain(self, timeout: float) -> tuple[int, float]:
        """End the sampling and wait until the spools are empty; how many were dropped, and how long (s) it took."""
        began, dropped = time.monotonic(), 0
        for process in self._flying:
            os.kill(process.pid, signal.SIGUSR1)
        for process in self._flying:
            process.says("drained", timeout=timeout)
            dropped += sum(json.loads(process.output().splitlines()[-1])["dropped"].values())
        return dropped, time.monotonic() - began

    def audit(self, timeout: float = 120.0) -> Audit:
        """Drain, and count in SQL."""
        dropped, drained = self.drain(timeout)
        self._settle()
        sql = self._fleet.database.sql
        sql("CREATE TABLE sampled (device text, seq bigint, ms bigint)")
        with tempfile.NamedTemporaryFile(dir=self._fleet.database.directory, suffix=".csv") as file:
            for ledger in self._directory.glob("spools-*.csv"):
                file.write(ledger.read_bytes())
            file.flush()
            os.chmod(file.name, 0o644)
            sql(f"COPY sampled FROM '{file.name}' (FORMAT csv)")
        sql("CREATE INDEX ON sampled (device, seq); ANALYZE sampled, readings")
        counts = sql(AUDIT).split("|")
        numbers = [*map(int, counts[:6]), *map(float, counts[6:])]
        return Audit(*numbers, dropped, drained)  # type: ignore[arg-type]

    def _settle(self) -> None:
        """Wait until no worker has anything to store: the broker's own acknowledgement comes before the row."""
        counted = [""]

        def still() -> bool:
            time.sleep(1.5)
            counted.append(self._fleet.database.sql("SELECT sum(stored + repeats) FROM workers"))
            return counted[-1] == counted[-2]

        eventually(still, 120, "the workers' rest")

    def stop(self) -> None:
        """End all."""
        for process in self._processes:
            os.kill(process.pid, signal.SIGCONT) if process.popen.poll() is None else None
            process.stop()
        self._fleet.stop()
