"""A station of several processes: broker, database, workers. Each can be killed and started again."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import sys
from pathlib import Path
from typing import Any

import requests

from tests.support.ports import free_port
from tests.support.postgres import PostgresCluster
from tests.support.processes import Process, eventually

MOSQUITTO = shutil.which("mosquitto", path=os.environ["PATH"] + ":/usr/sbin")
CONFIG = Path(__file__).parents[2] / "packaging" / "mosquitto.conf"


def kill(process: Process) -> None:
    """`kill -9` a process with all its children."""
    os.killpg(process.pid, signal.SIGKILL)
    process.popen.wait()
    if process.popen.stdin is not None:
        process.popen.stdin.close()


class Broker:
    """A Mosquitto with persistence, of the configuration that we ship.

    Attributes:
        port: TCP port on the loopback.

    Args:
        directory: for its files.
        also: a further address at which it listens; empty for none.
        settings: further settings of its configuration.
    """

    def __init__(self, directory: Path, also: str = "", **settings: str) -> None:
        assert MOSQUITTO is not None, "apt-get install mosquitto"
        self.port = free_port()
        self._directory = directory / "mosquitto"
        self._directory.mkdir()
        self._config = directory / "mosquitto.conf"
        ours = {"listener": f"{self.port} 127.0.0.1", "persistence_location": f"{self._directory}/"}
        if os.geteuid() == 0:
            ours["user"] = "root"
        shipped = (line.split(maxsplit=1) for line in CONFIG.read_text(encoding="utf-8").splitlines())
        lines = {words[0]: words[1] for words in shipped if words and words[0] != "#"}
        del lines["password_file"]
        merged = {**lines, **ours, "allow_anonymous": "true", **settings}
        text = "".join(f"{name} {value}\n" for name, value in merged.items())
        self._config.write_text(text + (f"listener {self.port} {also}\n" if also else ""), encoding="ascii")
        self._process: Process | None = None

    @property
    def url(self) -> str:
        """What a worker connects to."""
        return f"mqtt://127.0.0.1:{self.port}"

    @property
    def pid(self) -> int:
        """Its process."""
        assert self._process is not None
        return self._process.pid

    def start(self) -> None:
        """Start it; it listens when this returns."""
        command = [str(MOSQUITTO), "-c", str(self._config)]
        self._process = Process(command, self._directory.parent / "mosquitto.log", self._directory)
        eventually(self.listens, what="the broker's start")

    def listens(self) -> bool:
        """Whether it takes connections."""
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1):
            return True
        return False

    def kill(self) -> None:
        """`kill -9` it."""
        assert self._process is not None
        kill(self._process)

    def stop(self) -> None:
        """End it; it writes down what it has."""
        if self._process is not None:
            self._process.stop()


class Worker:
    """One worker of the station.

    Attributes:
        port: TCP port of its page on the loopback; its name stays with it.
    """

    def __init__(self, directory: Path, database: str, broker: str, *options: str) -> None:
        self.port = free_port()
        self._directory = directory
        self._command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={self.port}"]
        self._command += [f"--database={database}", f"--broker={broker}", *options]
        self.process: Process | None = None

    @property
    def url(self) -> str:
        """Where its page is."""
        return f"http://127.0.0.1:{self.port}"

    @property
    def pid(self) -> int:
        """Its process."""
        assert self.process is not None
        return self.process.pid

    def start(self) -> None:
        """Start it."""
        root = str(Path(__file__).parents[2])
        self.process = Process(
            self._command, self._directory / f"worker-{self.port}.log", self._directory, {"PYTHONPATH": root}
        )

    def wait(self) -> None:
        """Wait until broker and database are there."""
        eventually(lambda: self.health().get("status") == "ok", what=f"the health of {self.url}")

    def health(self) -> dict[str, Any]:
        """What it says of itself; nothing while it does not."""
        with contextlib.suppress(requests.RequestException):
            report: dict[str, Any] = requests.get(f"{self.url}/health", timeout=5).json()
            return report
        return {}

    def metrics(self) -> dict[str, float]:
        """Its metrics, by name and labels."""
        lines = requests.get(f"{self.url}/metrics", timeout=10).text.splitlines()
        return {
            name: float(value) for name, _, value in (line.rpartition(" ") for line in lines if line[:1] not in "#")
        }

    def kill(self) -> None:
        """`kill -9` it."""
        assert self.process is not None
        kill(self.process)

    def stop(self) -> None:
        """End it."""
        if self.process is not None:
            self.process.stop()


class Fleet:
    """Broker, database and workers in one temporary folder.

    Args:
        directory: for configurations and logs.
        workers: how many.
        options: of each worker.
        also: a further address at which the broker listens; empty for none.
    """

    def __init__(self, directory: Path, workers: int, *options: str, also: str = "") -> None:
        self.broker = Broker(directory, also)
        self.database = PostgresCluster(free_port(), "max_connections = 100")
        self.workers = [Worker(directory, self.database.url, self.broker.url, *options) for _ in range(workers)]

    def start(self) -> None:
        """Start all; they work when this returns."""
        self.database.start()
        self.broker.start()
        for worker in self.workers:
            worker.start()
        for worker in self.workers:
            worker.wait()

    def stop(self) -> None:
        """End all, and remove the database."""
        for worker in self.workers:
            worker.stop()
        self.broker.stop()
        self.database.remove()
