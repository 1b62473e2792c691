"""A run of a script, read from its record, logs and lock. Blocking: for an executor, not for the loop."""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from mavproxy_uavapi.scripts import names

RECORD = "_run.json"
ENVIRONMENT = "_env.json"
TAIL = 4096  # bytes of the end of a log in an answer


@dataclass(frozen=True)
class Run:
    """One run, as last read from its record.

    Attributes:
        path: the record's file.
        script, args: the script and its arguments.
        session: its tmux session.
        sysid, port: the vehicle that it flies, and the port of the API that started it.
        started_at, stopping_at, ended_at: s since 1970; None if that has not happened.
        out_log, err_log: its logs.
        grace: s from Ctrl-C to the kill.
        pid: its runner's process; None before the runner has started.
        exit_status: as in a shell, negative for a signal; None while it runs, or if it is unknown.
        killed: whether it was killed after the grace period.
        error: why it could not start.
        alive: whether its runner lives.
        operator: who started it.
        token: the hash of the token by which it calls, in hexadecimal digits; empty if it has none of its own.
    """

    path: Path
    script: str
    args: list[str]
    session: str
    sysid: int
    port: int
    started_at: float
    out_log: Path
    err_log: Path
    grace: float
    pid: int | None = None
    stopping_at: float | None = None
    ended_at: float | None = None
    exit_status: int | None = None
    killed: bool = False
    error: str | None = None
    alive: bool = False
    operator: str = ""
    token: str = ""

    @property
    def running(self) -> bool:
        """Whether it still runs."""
        return self.alive and self.ended_at is None

    @property
    def died(self) -> bool:
        """Whether it ended, but neither with status 0 nor after a stop request."""
        if self.running:
            return False
        asked_to = self.stopping_at is not None and not self.killed and self.exit_status is not None
        return self.exit_status != 0 and not asked_to

    def report(self, now: float) -> dict[str, Any]:
        """The run as clients see it; `now` is in s since 1970."""
        report: dict[str, Any] = {
            "script": self.script,
            "args": self.args,
            "session": self.session,
            "attach": f"tmux attach -t {self.session}",
            "started_at": moment(self.started_at),
            "out_log": str(self.out_log),
            "err_log": str(self.err_log),
            "running": self.running,
        }
        if self.running:
            report["running_for_s"] = round(now - self.started_at, 3)
            report["stopping"] = self.stopping_at is not None
            if self.stopping_at is not None:
                report["kill_in_s"] = round(max(self.stopping_at + self.grace - now, 0.0), 3)
            return report
        report["ended_at"] = None if self.ended_at is None else moment(self.ended_at)
        report["exit_status"] = self.exit_status
        report["killed"] = self.killed
        return report if self.error is None else {**report, "error": self.error}


def moment(at: float) -> str:
    """ISO 8601 with this machine's time zone, whole seconds; `at` in s since 1970."""
    return datetime.fromtimestamp(at).astimezone().isoformat(timespec="seconds")


def create(
    logs: Path,
    script: str,
    args: Sequence[str],
    sysid: int,
    *,
    command: Sequence[str],
    cwd: Path,
    port: int,
    grace: float,
    environment: Mapping[str, str],
    operator: str = "",
    token: str = "",
) -> Run:
    """Create the files of a new run: record, environment (only for the runner) and two empty logs.

    Raises:
        OSError: they cannot be written; none of them is left.
    """
    logs.mkdir(parents=True, exist_ok=True)
    started_at, name = _new_name(logs, script)
    path = logs / f"{name}{RECORD}"
    out_log, err_log = logs / f"{name}_out.log", logs / f"{name}_err.log"
    record = {
        "script": script,
        "args": list(args),
        "session": names.session_name(sysid, name),
        "sysid": sysid,
        "port": port,
        "started_at": started_at,
        "out_log": str(out_log),
        "err_log": str(err_log),
        "grace": grace,
        "command": list(command),
        "cwd": str(cwd),
        "operator": operator,
        "token": token,
    }
    try:
        out_log.touch()
        err_log.touch()
        path.write_text(json.dumps(record), encoding="utf-8")
        secret = os.open(logs / f"{name}{ENVIRONMENT}", os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(secret, "w", encoding="utf-8") as file:
            json.dump(dict(environment), file)
    except OSError:
        discard(path)
        raise
    return load(path)


def _new_name(logs: Path, script: str) -> tuple[float, str]:
    """When a run of the script begins (s since 1970), and its name, which no other has.

    Names hold whole seconds; after an earlier run of the same second it waits for the next.
    """
    while True:
        started_at = time.time()
        name = f"{names.stem(script)}_{datetime.fromtimestamp(started_at):%Y%m%d_%H%M%S}"
        if not (logs / f"{name}{RECORD}").exists():
            return started_at, name
        time.sleep(1.0 - started_at % 1.0)


def discard(record: Path) -> None:
    """Remove the files of a run that did not begin, by the path of its record."""
    for ending in (RECORD, ENVIRONMENT, "_out.log", "_err.log"):
        record.with_name(record.name.removesuffix(RECORD) + ending).unlink(missing_ok=True)


def load(path: Path) -> Run:
    """The run that a record describes.

    Raises:
        OSError, ValueError: there is no valid record.
    """
    out_log = path.with_name(path.name.removesuffix(RECORD) + "_out.log")
    # First, because a run writes its record before it ends.
    alive = _lives(out_log, path, lambda: _read(path).get("pid"))
    record = _read(path)
    fields = {name: record[name] for name in Run.__dataclass_fields__ if name in record}
    try:
        fields |= {"path": path, "out_log": out_log, "err_log": Path(record["err_log"]), "alive": alive}
        return Run(**fields)
    except (TypeError, KeyError) as error:
        raise ValueError(f"{path} is not the record of a run") from error


def refreshed(run: Run) -> Run:
    """The present state of the run."""
    try:
        return load(run.path)
    except (OSError, ValueError):  # the record was removed
        return replace(run, alive=_lives(run.out_log, run.path, lambda: run.pid))


def _read(path: Path) -> dict[str, Any]:
    record = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(record, dict):
        raise ValueError(f"{path} is not the record of a run")
    return record


def _all(logs: Path, pattern: str) -> Iterator[Run]:
    for path in logs.glob(f"{pattern}{RECORD}"):
        with suppress(OSError, ValueError):  # another kind of file, or one just removed
            yield load(path)


def of_script(logs: Path, script: str) -> list[Run]:
    """The runs of a script in the folder `logs`, newest first."""
    own = [run for run in _all(logs, f"{names.stem(script)}_*") if run.script == script]
    return sorted(own, key=lambda run: run.started_at, reverse=True)


def since(logs: Path, at: float) -> list[Run]:
    """The runs in the folder `logs` that run now, or have ended since then (s since 1970), oldest first."""
    found = [run for run in _all(logs, "*") if run.running or (run.ended_at or 0.0) >= at]
    return sorted(found, key=lambda run: run.started_at)


def tail(log: Path, size: int = TAIL) -> str:
    """The end of a log; empty if there is none."""
    try:
        with log.open("rb") as file:
            file.seek(max(file.seek(0, os.SEEK_END) - size, 0))
            return file.read().decode(errors="replace")
    except FileNotFoundError:
        return ""


def _lives(log: Path, record: Path, pid: Callable[[], int | None]) -> bool:
    """Whether the runner of a run lives: it locks its log. Where somebody removed that, its process tells."""
    try:
        with log.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except FileNotFoundError:
        return _is_runner(pid(), record)
    return False


def _is_runner(pid: int | None, record: Path) -> bool:
    """Whether that process is the runner of the record. A log that is removed in flight must not end a script."""
    try:
        command = Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False
    return os.fsencode(record) in command.split(b"\0")
