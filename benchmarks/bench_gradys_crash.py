"""Readings through `kill -9` and through power cuts: what was sent, answered, delivered, doubled and lost.

Kills: a real MAVProxy samples the position and takes posted readings; a real HTTP receiver and a real Mosquitto get
them; MAVProxy is killed at a random moment and started again. In the end every number that a 200 promised must have
reached both.

Power cuts (root only): the spool lies on an ext4 file system in a file, by way of a loop device. At a random moment
MAVProxy is stopped (SIGSTOP) and the file copied: the copy holds what the file system had handed to its disk and
nothing that was only in the page cache, which is what a power cut leaves of a disk that loses nothing it was handed.
(A disk that forgets its own cache although it was told to flush it is not simulated.) The copy is mounted, which
replays the file system's journal, and opened as the spool; every number that a 200 promised before the cut must be
in it, or have been in the receiver's own file by then.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import requests
from figures import machine, table
from rig import harness

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.sink_address import sink_address
from mavproxy_gradys.forwarding.spool import Spool
from tests.support.ports import free_port

MOSQUITTO = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin")
SHORTEST, LONGEST = 0.2, 2.0  # s from MAVProxy's start, or the cut before, to the next
AT_ONCE = 5  # readings in a request
PAUSE = 0.01  # s between requests
IMAGE = 64 * 1024 * 1024  # bytes of the file system


class Poster:
    """Posts readings in a thread of its own.

    Attributes:
        sent: readings in requests that reached MAVProxy, answered or not.
        promised: numbers that a 200 named.
    """

    def __init__(self, url: str) -> None:
        self._url = f"{url}/gradys/readings"
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self.sent = 0
        self.promised: list[int] = []

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def _run(self) -> None:
        with requests.Session() as session:
            while not self._over.wait(PAUSE):
                one = {"quantity": "temperature", "value": self.sent, "representation": "degC"}
                self.sent += AT_ONCE
                try:
                    answer = session.post(self._url, json={"readings": [one] * AT_ONCE}, timeout=10)
                except requests.RequestException as error:  # it was killed meanwhile, or has not started yet
                    self.sent -= AT_ONCE if "refused" in str(error) else 0
                    continue
                if answer.status_code == requests.codes.ok:
                    self.promised += answer.json()["seq"]

    def stop(self) -> None:
        """End."""
        self._over.set()
        self._thread.join()


class Subscriber:
    """Counts each number that comes from the broker."""

    def __init__(self, port: int) -> None:
        from paho.mqtt import client as mqtt  # noqa: PLC0415  an extra

        self.heard: Counter[int] = Counter()
        self._ready = threading.Event()
        self._client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        self._client.on_message = self._take
        self._client.on_connect = lambda *_: self._client.subscribe("fleet/#", qos=1)
        self._client.on_subscribe = lambda *_: self._ready.set()
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        assert self._ready.wait(10)

    def _take(self, _client: Any, _data: Any, message: Any) -> None:
        if not message.topic.endswith("/status") and not message.retain:
            self.heard[json.loads(message.payload)["seq"]] += 1

    def stop(self) -> None:
        """Leave."""
        self._client.disconnect()
        self._client.loop_stop()


class Bench:
    """The processes that are not killed, and MAVProxy, which is."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.database = directory / "station.db"
        self.rig = harness.Rig(directory, free_port())
        self._instance = harness.start_embedded(self.rig, "--sysid=10", speedup=1)
        self.port = free_port()
        self.sink = f"http://127.0.0.1:{self.port}/readings"

    def start_receiver(self) -> None:
        """Begin to listen."""
        command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={self.port}"]
        self.rig.start("station", [*command, f"--database={self.database}"]).says("listening on")

    def start_broker(self) -> int:
        """Start a Mosquitto; its port."""
        port = free_port()
        config = self.directory / "mosquitto.conf"
        queues = "max_queued_messages 0\nmax_inflight_messages 0"
        config.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n{queues}\n", encoding="ascii")
        process = self.rig.start("mosquitto", [str(MOSQUITTO), "-c", str(config), "-v"])
        process.says("running")
        return int(port)

    def start_mavproxy(self, spool: Path, sink: str) -> Any:
        """Start MAVProxy; it serves when this returns."""
        settings = {"sink": sink, "spool": str(spool), "quantities": "position@0.1"}
        load = "--cmd=module load gradys:" + json.dumps(settings, separators=(",", ":"))
        process = self.rig.start(
            "mavproxy", harness.mavproxy_command(self._instance, harness.load(self.rig.port), load, logs=True)
        )
        harness.eventually(lambda: self.report() is not None, 60, "the API")
        return process

    def kill(self, process: Any) -> None:
        """`kill -9` MAVProxy with all its children."""
        os.killpg(process.pid, signal.SIGKILL)
        process.popen.wait()
        process.popen.stdin.close()
        self.rig.processes.remove(process)

    def report(self) -> dict[str, Any] | None:
        """What gradys says of itself; None while it does not."""
        with contextlib.suppress(requests.RequestException):
            answer = self.rig.get("/gradys/status", timeout=2)
            if answer.status_code == requests.codes.ok:
                status: dict[str, Any] = answer.json()["info"]
                return status
        return None

    def is_delivered(self) -> bool:
        """Whether all that the spool holds is new."""
        report = self.report()
        return report is not None and report["spooled"] is not None and report["spooled"] < 2 * AT_ONCE

    def received(self) -> set[int]:
        """The numbers that are in the receiver's file."""
        if not self.database.exists():
            return set()
        with contextlib.closing(sqlite3.connect(self.database)) as db:
            return {seq for (seq,) in db.execute("SELECT seq FROM readings")}

    def repeats(self) -> int:
        """Readings that came to the receiver again."""
        answer = requests.get(self.sink, params={"limit": 1}, timeout=30).json()
        return int(answer["repeats"])


def wait_for(look: Callable[[], bool], seconds: float) -> None:
    """Wait until that holds, or no longer."""
    deadline = time.monotonic() + seconds
    while not look() and time.monotonic() < deadline:
        time.sleep(0.1)


@contextlib.contextmanager
def bench() -> Iterator[Bench]:
    """The processes, and their end."""
    with tempfile.TemporaryDirectory(prefix="uavapi-bench-") as name:
        made = Bench(Path(name))
        try:
            yield made
        finally:
            made.rig.stop()


def kills(rounds: int, chance: random.Random) -> tuple[list[list[str]], int]:
    """So many kills; rows of the table, and how many promised readings are lost."""
    with bench() as made:
        made.start_receiver()
        broker = made.start_broker()
        subscriber = Subscriber(broker)
        poster = Poster(made.rig.url)
        spool, sink = (
            made.directory / "spool.db",
            f"{made.sink},mqtt://127.0.0.1:{broker}/fleet/{{device}}/{{quantity}}",
        )
        poster.start()
        try:
            for _ in range(rounds):
                process = made.start_mavproxy(spool, sink)
                time.sleep(chance.uniform(SHORTEST, LONGEST))
                made.kill(process)
        finally:
            poster.stop()
        made.start_mavproxy(spool, sink)
        harness.eventually(made.is_delivered, 120, "the delivery of all")
        promised = set(poster.promised)
        wait_for(lambda: promised <= set(subscriber.heard), 10)
        http, repeats, mqtt = made.received(), made.repeats(), Counter(subscriber.heard)
        subscriber.stop()
    doubled = sum(count - 1 for count in mqtt.values())
    sent = [str(poster.sent), str(len(poster.promised))]
    rows = [
        ["HTTP receiver", *sent, str(len(promised & http)), str(repeats), str(len(promised - http))],
        ["Mosquitto", *sent, str(len(promised & set(mqtt))), str(doubled), str(len(promised - set(mqtt)))],
    ]
    again = len(poster.promised) - len(promised)  # a number that was given twice
    return rows, len(promised - http) + len(promised - set(mqtt)) + again


@contextlib.contextmanager
def mounted(image: Path, place: Path) -> Iterator[None]:
    """A file system in a file."""
    place.mkdir(exist_ok=True)
    subprocess.run(["mount", "-o", "loop", str(image), str(place)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(place)], check=True)


def copied(image: Path, copy: Path) -> None:
    """Copy the disk as it is at one moment: until two copies in a row are the same."""
    while True:
        content = image.read_bytes()
        if content == image.read_bytes():
            copy.write_bytes(content)
            return


def numbers_on(copy: Path, place: Path, sink: str) -> set[int]:
    """The numbers in the spool on a copy of the disk, as the next start finds them; none if it finds no spool."""
    with mounted(copy, place):
        try:
            with contextlib.closing(Spool(place / "spool.db", 1e12, 1e12)) as spool:
                if spool.set_aside is None:
                    return {stored.seq for stored in spool.batch(sink_address(sink).name, -1, 10_000_000)}
                print("the spool was corrupt")
        except NotStored as error:
            print(error)
    return set()


def cuts(count: int, chance: random.Random) -> tuple[list[list[str]], int]:
    """So many power cuts, the first half without a receiver; rows of the table, and how many are lost."""
    rows, lost = [], 0
    with bench() as made:
        image, copy = made.directory / "disk", made.directory / "copy"
        with image.open("wb") as file:
            file.truncate(IMAGE)
        subprocess.run(["mkfs.ext4", "-q", "-F", str(image)], check=True)
        with mounted(image, made.directory / "mounted"):
            process = made.start_mavproxy(made.directory / "mounted" / "spool.db", made.sink)
            poster = Poster(made.rig.url)
            poster.start()
            try:
                for cut in range(count):
                    if cut == count // 2:
                        made.start_receiver()
                        made.rig.ok(made.rig.post("/gradys/flush"))
                    time.sleep(chance.uniform(SHORTEST, LONGEST))
                    os.killpg(process.pid, signal.SIGSTOP)
                    copied(image, copy)
                    received, promised = made.received(), set(poster.promised)
                    os.killpg(process.pid, signal.SIGCONT)
                    kept = numbers_on(copy, made.directory / "looked at", made.sink)
                    gone = promised - kept - received
                    lost += len(gone)
                    figures = (len(promised), len(promised & kept), len(promised & received), len(kept & received))
                    rows.append([f"cut {cut + 1}", *map(str, figures), str(len(gone))])
            finally:
                poster.stop()
                made.kill(process)
    return rows, lost


def main() -> int:
    """Run it; 0 when nothing that was promised is lost."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    arguments.add_argument("--kills", type=int, default=4, help="kill -9 so often (%(default)s)")
    arguments.add_argument("--cuts", type=int, default=6, help="cut the power so often (%(default)s)")
    arguments.add_argument("--seed", type=int, default=1, help="of the moments (%(default)s)")
    options = arguments.parse_args()
    chance = random.Random(options.seed)
    print(machine())
    lost = 0
    if MOSQUITTO is None:
        print("crash: Mosquitto is not installed (apt install mosquitto)")
    elif options.kills:
        rows, lost = kills(options.kills, chance)
        print(f"{options.kills} kills")
        print(table(["readings", "posted", "answered 200", "of these delivered", "doubled", "lost"], rows))
    if os.geteuid() != 0 or shutil.which("mkfs.ext4") is None:
        print("crash: power cuts need root and mkfs.ext4")
    elif options.cuts:
        rows, gone = cuts(options.cuts, chance)
        lost += gone
        print(f"{options.cuts} power cuts")
        print(table(["", "answered 200", "on the disk", "delivered", "both", "lost"], rows))
    return int(lost > 0)


if __name__ == "__main__":
    sys.exit(main())
