"""A fleet under faults: workers, broker and database are killed, links fade; then SQL counts what became of it."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import random
import shutil
import signal
import socket
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
    (SELECT count(*) FROM sampled WHERE EXISTS (SELECT FROM rows WHERE (rows.device, rows.seq, rows.ms)
        = (sampled.device, sampled.seq, sampled.ms))),
    (SELECT count(*) FROM rows),
    (SELECT count(*) FROM (SELECT 1 FROM rows GROUP BY device, seq, ms, source HAVING count(*) > 1) AS doubled),
    (SELECT count(*) FROM (SELECT 1 FROM rows GROUP BY device, seq, ms HAVING count(DISTINCT source) > 1) AS again),
    (SELECT count(*) FROM rows LEFT JOIN sampled USING (device, seq, ms) WHERE sampled.device IS NULL),
    (SELECT sum(repeats) FROM workers),
    (SELECT percentile_disc(0.5) WITHIN GROUP (ORDER BY delay) FROM rows WHERE delay < 3600),
    (SELECT percentile_disc(0.99) WITHIN GROUP (ORDER BY delay) FROM rows WHERE delay < 3600),
    (SELECT max(delay) FROM rows WHERE delay < 3600)
"""
ROWS = """
SELECT device, seq, round(extract(epoch FROM time) * 1000)::bigint AS ms,
    extract(epoch FROM received - time) AS delay, '{0}' AS source FROM {0}
"""
DAY = 86400
TWINS = ("restored", "cloned")  # two vehicles with one name
DAYS = 25  # before today, of which a vehicle's clock may be; they get partitions


class Audit(NamedTuple):
    """What SQL says.

    Attributes:
        sampled: readings that the vehicles have sampled.
        kept: of these, which are a row.
        rows: all rows.
        doubled: readings that are more than one row of a table.
        again: readings that are a row of a detached day, and came again after it had been detached.
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
    again: int
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
        """Whether each reading is a row of its own, or was counted as dropped."""
        each = self.rows - self.again == self.kept
        return self.sampled > 0 and each and not (self.lost or self.doubled or self.strange)


class FaultyFleet:
    """A fleet, half of whose vehicles are behind a link that fades; further ones fly with the spool of one image.

    The link is the cable of a network namespace, or a relay as a process. Two vehicles of the image have one name, as
    those of two MAVProxys may have whose setting `device` nobody has changed.

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
        self._twins: list[Process] = []  # the vehicles whose spools are restored
        self._dropped = 0  # by vehicles that have ended
        self._flights = itertools.count(1)
        self._detached: list[str] = []
        self._processes: list[Process] = []
        self.faults: Counter[str] = Counter()

    def _start(self, name: str, log: str, *arguments: str, within: NetworkNamespace | None = None) -> Process:
        command = [sys.executable, "-m", f"tests.support.{name}", *arguments]
        process = Process(command if within is None else within.command(command), self._directory / log, ROOT)
        self._processes.append(process)
        return process

    def _vehicles_of(
        self, name: str, first: int, count: int, address: str, within: NetworkNamespace | None = None, shift: int = 0
    ) -> Process:
        """Start vehicles that send to a broker at `address`; their spools are in a folder of that name."""
        spools = self._directory / f"spools-{name}"
        spools.mkdir(exist_ok=True)
        option = "#ack=station" if self._ack == "station" else ""
        ledger = self._directory / f"ledger-{name}-{next(self._flights)}.csv"
        flown = [f"mqtt://{address}/fleet/{{device}}/{{quantity}}{option}", f"--first={first}", f"--count={count}"]
        flown += [f"--rate={self._rate}", f"--directory={spools}", f"--ledger={ledger}", f"--shift={shift}"]
        return self._start("fleet_vehicles", f"{ledger.stem}.log", *flown, within=within)

    def _land(self, flown: Process, timeout: float = 120.0) -> None:
        """End the sampling of vehicles, and wait until their spools are empty."""
        if flown.popen.poll() is None:
            os.kill(flown.pid, signal.SIGUSR1)
        flown.says("drained", timeout=timeout)
        self._dropped += sum(json.loads(flown.output().splitlines()[-1])["dropped"].values())

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
        self._flying = [
            self._vehicles_of("near", 1, self._vehicles - half, self._near),
            self._vehicles_of("far", self._vehicles - half + 1, half, address, through),
        ]
        self._fly_twins()
        for process in self._flying:
            process.says("vehicles fly")

    def _fly_twins(self) -> None:
        self._twins = [self._vehicles_of(name, 1001, 1, self._near) for name in TWINS]
        for process in self._twins:
            process.says("vehicles fly")

    @property
    def _near(self) -> str:
        return f"127.0.0.1:{self._fleet.broker.port}"

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

    def _restore(self, _chance: random.Random) -> Callable[[], None]:
        """The spools of both twins become what the first one's was at its first landing."""
        image = self._directory / "image"
        for process in self._twins:
            self._land(process)
        if not image.exists():
            shutil.copytree(self._directory / f"spools-{TWINS[0]}", image)
        for name in TWINS:
            shutil.rmtree(self._directory / f"spools-{name}")
            shutil.copytree(image, self._directory / f"spools-{name}")
        return self._fly_twins

    def _set_clocks(self, _chance: random.Random) -> Callable[[], None]:
        """The clocks of the vehicles that are near go back by an hour."""
        (near, *_) = self._flying
        os.kill(near.pid, signal.SIGUSR2)
        return lambda: os.kill(near.pid, signal.SIGUSR2)

    def _pass_midnight(self, chance: random.Random) -> Callable[[], None]:
        """A new day comes, by a vehicle whose clock was set back, while somebody reads in one long transaction."""
        reading = self._fleet.database.session("BEGIN; SELECT count(*) FROM readings;")
        number, shift = 2000 + next(self._flights), -DAY * chance.randint(1, DAYS)
        flown = self._vehicles_of(f"day-{number}", number, 1, self._near, shift=shift)
        flown.says("vehicles fly")

        def end() -> None:
            reading.communicate("ROLLBACK;\n")
            self._land(flown)

        return end

    def _detach(self, chance: random.Random) -> Callable[[], None]:
        """An operator puts a day away, for whose vehicles nothing is on its way any more."""
        today = self._fleet.database.sql("SELECT to_char(now() AT TIME ZONE 'UTC', 'YYYY_MM_DD')")
        children = "SELECT inhrelid::regclass FROM pg_inherits WHERE inhparent = 'readings'::regclass"
        days = [name for name in self._fleet.database.sql(children).split() if "_20" in name and today > name[-10:]]
        if days:
            self._detached.append(chance.choice(days))
            self._fleet.database.sql(f"ALTER TABLE readings DETACH PARTITION {self._detached[-1]}")
        return lambda: None

    def _read_slowly(self, chance: random.Random) -> Callable[[], None]:
        """Downloads that nobody reads on, and everything at once."""
        port = chance.choice(self._fleet.workers).port
        paths = ["/readings.csv?limit=100000000", "/readings?limit=1000000", "/readings.csv?after=0&limit=1000000"]
        readers = []
        for path in paths * 3:
            with contextlib.suppress(OSError):
                readers.append(socket.create_connection(("127.0.0.1", port), 5))
                readers[-1].sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())

        def leave() -> None:
            for reader in readers:
                reader.close()

        return leave

    def suffer(self, chance: random.Random, seconds: float, longest: float) -> None:
        """One fault after the other, in random order, for so long; each lasts up to `longest` s."""
        kinds = {
            "worker": self._kill_worker,
            "broker": self._kill_broker,
            "database": self._kill_database,
            "link": self._cut,
            "spool": self._restore,
            "clock": self._set_clocks,
            "midnight": self._pass_midnight,
            "partition": self._detach,
            "reader": self._read_slowly,
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
        began = time.monotonic()
        for process in (*self._flying, *self._twins):
            self._land(process, timeout)
        return self._dropped, time.monotonic() - began

    def audit(self, timeout: float = 120.0) -> Audit:
        """Drain, and count in SQL, with the days that were put away."""
        dropped, drained = self.drain(timeout)
        self._settle()
        sql = self._fleet.database.sql
        sql("CREATE TABLE sampled (device text, seq bigint, ms bigint)")
        with tempfile.NamedTemporaryFile(dir=self._fleet.database.directory, suffix=".csv") as file:
            for ledger in self._directory.glob("ledger-*.csv"):
                file.write(ledger.read_bytes())
            file.flush()
            os.chmod(file.name, 0o644)
            sql(f"COPY sampled FROM '{file.name}' (FORMAT csv)")
        every = " UNION ALL ".join(ROWS.format(table) for table in ("readings", *self._detached))
        sql(f"CREATE TABLE rows AS {every}; CREATE INDEX ON rows (device, seq, ms)")
        sql("CREATE INDEX ON sampled (device, seq, ms); ANALYZE sampled, rows")
        counts = sql(AUDIT).split("|")
        numbers = [*map(int, counts[:7]), *map(float, counts[7:])]
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
