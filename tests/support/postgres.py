"""A PostgreSQL of our own: a private cluster in a temporary folder, which its end removes."""

from __future__ import annotations

import contextlib
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import psutil

NOBODY = "nobody"  # PostgreSQL refuses to run as root
TIMEOUT = 30.0  # s


def program(name: str) -> str:
    """A program of PostgreSQL, of the newest version: Debian keeps them apart, and in the PATH a wrapper in Perl."""
    installed = [str(path) for path in sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))]
    return installed[-1] if installed else name


class PostgresCluster:
    """Starts, dies and starts again.

    Attributes:
        port: TCP port on the loopback.

    Args:
        port: as above.
        settings: lines of postgresql.conf.
    """

    def __init__(self, port: int, *settings: str) -> None:
        self.port = port
        self._user = NOBODY if os.geteuid() == 0 else None
        self.directory = Path(tempfile.mkdtemp(prefix="uavapi-postgres-"))
        if self._user is not None:
            owner = pwd.getpwnam(self._user)
            os.chown(self.directory, owner.pw_uid, owner.pw_gid)
        self._data = self.directory / "data"
        self._process: subprocess.Popen[bytes] | None = None
        options = "--auth=trust --username=fleet --encoding=UTF8 --locale=C --no-sync --no-instructions"
        self._run([program("initdb"), *options.split(), f"--pgdata={self._data}"])
        with (self._data / "postgresql.conf").open("a", encoding="ascii") as file:
            lines = (f"port = {port}", "listen_addresses = '127.0.0.1'", "unix_socket_directories = ''", *settings)
            file.write("".join(f"{line}\n" for line in lines))

    @property
    def pid(self) -> int:
        """The process that all others are children of."""
        assert self._process is not None
        return self._process.pid

    @property
    def url(self) -> str:
        """What a client connects to."""
        return f"postgresql://fleet@127.0.0.1:{self.port}/postgres"

    def _run(self, command: list[str]) -> str:
        done = subprocess.run(
            command, user=self._user, cwd=self.directory, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    def start(self) -> None:
        """Start it, and wait until it answers."""
        with (self.directory / "log").open("ab") as log:
            self._process = subprocess.Popen(
                [program("postgres"), "-D", str(self._data)],
                user=self._user,
                cwd=self.directory,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        deadline = time.monotonic() + TIMEOUT
        while subprocess.run(
            [program("pg_isready"), "-q", "-h", "127.0.0.1", "-p", str(self.port)], check=False
        ).returncode:
            assert self._process.poll() is None, self.log()
            assert time.monotonic() < deadline, self.log()
            time.sleep(0.05)

    def log(self) -> str:
        """What it has said."""
        return (self.directory / "log").read_text(encoding="utf-8", errors="replace")

    def sql(self, text: str) -> str:
        """The answer to some SQL, unaligned, without headings."""
        return self._run([program("psql"), self.url, "-qAtX", "-v", "ON_ERROR_STOP=1", "-c", text]).strip()

    def session(self, text: str) -> subprocess.Popen[str]:
        """A session that has got the answer to some SQL, a line, and stays open until more comes, or the end."""
        process = subprocess.Popen(
            [program("psql"), self.url, "-qAtX"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write(f"{text}\n")
        process.stdout.readline()
        return process

    def kill(self) -> None:
        """`kill -9` it with all its children."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)  # it starts no more of them
        children = psutil.Process(self._process.pid).children(recursive=True)  # each in a session of its own
        for process in (self._process, *children):
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        self._process.wait()
        psutil.wait_procs(children, TIMEOUT)  # as long as one lives, none starts again

    def stop(self) -> None:
        """End it."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)  # a fast shutdown
            try:
                self._process.wait(10)
            except subprocess.TimeoutExpired:
                self.kill()

    def remove(self) -> None:
        """End it, and remove its folder."""
        self.stop()
        shutil.rmtree(self.directory)
