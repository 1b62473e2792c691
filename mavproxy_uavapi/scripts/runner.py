"""The program in a script's tmux session: runs the script, logs it, stops it, and records how it ended.

It is started by its path and uses the standard library only, so that it runs in any environment. Its one argument is
the run's record (see `runs.py`); from then on only the runner writes the record. It holds a lock on the output log
while it lives. So the API, even one started later, knows without a process id whether the run goes on.

SIGTERM (or the end of the tmux session) stops the script. Ctrl-C comes first, so that `finally` blocks land the
vehicle; if the script has not ended after the grace period, it is killed. The end of the API changes nothing here.

A script's whole family ends with it: its children, theirs, and those that have left its session (`setsid`, a daemon).
The runner is their subreaper, so the kernel keeps all of them below it, whatever they are called and whichever of
them dies. That needs neither systemd nor root, as a control group would, and no child can get rid of it, as it can of
a tag in its environment. What another program starts for the script (a tmux server, systemd, docker) is not of it.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import json
import os
import selectors
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, BinaryIO

CHUNK = 65536  # bytes
LOG_LIMIT = 50 * 1024 * 1024  # bytes of each log; an endless script must not fill a companion computer's card
LAST_OUTPUT = 0.5  # s for the output of the script's children after its end
LOOK_EVERY = 0.1  # s between looks at the family that a script has left behind
UNKILLABLE = 5.0  # s after the kill in which a process must be gone; one that hangs in the kernel is given up
CANNOT_START = 127  # as in a shell
SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of prctl(2)


class Terminal:
    """The tmux pane. It shows only what it can take at once, so that Ctrl-S there does not stop a flying script."""

    def __init__(self) -> None:
        try:
            self._fd = os.open(os.ttyname(1), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        except OSError:  # there is none: the runner was started by hand with redirected output
            self._fd = 1

    def show(self, data: bytes) -> None:
        """Write to the terminal; output that it does not take is in the log."""
        with contextlib.suppress(OSError):  # the session is gone; the script goes on
            os.write(self._fd, data)


class RunLog:
    """One output stream of the script: written to its file and to the terminal."""

    def __init__(self, path: str, terminal: Terminal) -> None:
        self.file: BinaryIO = open(path, "ab", buffering=0)  # noqa: SIM115  open until the runner ends
        self._terminal = terminal
        self._remaining = LOG_LIMIT

    def write(self, data: bytes) -> None:
        """Write output of the script."""
        self._terminal.show(data)
        if self._remaining <= 0:
            return
        self._remaining -= len(data)
        try:
            self.file.write(data)
            if self._remaining <= 0:
                self.file.write(b"\n[the log is full]\n")
        except OSError as error:  # a full disk must not end a script in flight
            self._remaining = 0
            self._terminal.show(f"\n[no more log: {error.strerror}]\n".encode())


class ScriptProcess:
    """One run of a script, from its record."""

    def __init__(self, record: Path) -> None:
        self._path = record
        self._record: dict[str, Any] = json.loads(record.read_text(encoding="utf-8"))
        self._terminal = Terminal()
        self._out = RunLog(self._record["out_log"], self._terminal)
        self._err = RunLog(self._record["err_log"], self._terminal)
        self._child: subprocess.Popen[bytes] | None = None
        self._stop_wanted = False
        self._deaf: list[int] = []  # the processes that have ignored its Ctrl-C
        self._kill_at: float | None = None

    def run(self) -> int:
        """Run the script to its end; returns its exit status."""
        fcntl.flock(self._out.file, fcntl.LOCK_EX)
        with selectors.DefaultSelector() as selector:
            self._listen_to_signals(selector)
            try:
                self._start()
            except OSError as error:
                sentence = f"cannot start {self._record['script']}: {error}"
                self._err.write(sentence.encode() + b"\n")
                return self._end(CANNOT_START, error=sentence)
            self._pump(selector)
            self._end_family(selector)
        assert self._child is not None
        return self._end(self._child.wait())

    def _start(self) -> None:
        environment = self._path.with_name(self._path.name.removesuffix("_run.json") + "_env.json")
        variables: dict[str, str] = json.loads(environment.read_text(encoding="utf-8"))
        environment.unlink()  # it may hold a token
        ctypes.CDLL(None).prctl(SUBREAPER, 1, 0, 0, 0)
        self._child = subprocess.Popen(
            self._record["command"],
            cwd=self._record["cwd"],
            env={**variables, **{name: os.environ[name] for name in os.environ if name.startswith(("TERM", "TMUX"))}},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            preexec_fn=_be_in_front,  # noqa: PLW1509  this process has no threads
        )
        self._note(pid=os.getpid())

    def _listen_to_signals(self, selector: selectors.BaseSelector) -> None:
        reader, writer = os.pipe()
        os.set_blocking(reader, False)
        os.set_blocking(writer, False)
        signal.set_wakeup_fd(writer)
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_stop)
        for number in (signal.SIGCHLD, signal.SIGINT):
            signal.signal(number, lambda *_: None)
        signal.signal(signal.SIGTTOU, signal.SIG_IGN)  # the script owns the terminal, and we also write to it
        selector.register(reader, selectors.EVENT_READ)

    def _on_stop(self, *_: object) -> None:
        self._stop_wanted = True

    def _pump(self, selector: selectors.BaseSelector) -> None:
        """Pass on the script's output until it has ended."""
        child = self._child
        assert child is not None and child.stdout is not None and child.stderr is not None
        for stream, log in ((child.stdout, self._out), (child.stderr, self._err)):
            os.set_blocking(stream.fileno(), False)
            selector.register(stream, selectors.EVENT_READ, log)
        ended_at: float | None = None
        while any(key.data is not None for key in selector.get_map().values()):
            _reap(child)
            if child.poll() is not None:
                ended_at = ended_at or time.monotonic()
            if ended_at is not None and time.monotonic() > ended_at + LAST_OUTPUT:
                return  # a child of the script keeps its output open
            self._stop_if_requested(child)
            for key, _ in selector.select(self._select_timeout(ended_at)):
                self._pass_on(selector, key)
        while child.poll() is None:  # it has closed its outputs, but still runs
            _reap(child)
            self._stop_if_requested(child)
            for key, _ in selector.select(self._select_timeout(None)):
                self._pass_on(selector, key)

    def _end_family(self, selector: selectors.BaseSelector) -> None:
        """End what the script has left behind, and pass on its output meanwhile.

        Each process is asked once. Those that begin later land the vehicle: Ctrl-C would end that.
        """
        child = self._child
        assert child is not None
        asked = _family(child) if self._kill_at is None else self._deaf
        if self._kill_at is None:
            self._kill_at = time.monotonic() + self._record["grace"]
        for pid in set(asked) & set(_family(child)):
            _signal(pid, signal.SIGTERM if _ignores_ctrl_c(pid) else signal.SIGINT)
        while family := _family(child):
            late = time.monotonic() - self._kill_at
            if late >= 0 and not self._record.get("killed"):
                self._note(killed=True)
            if late >= UNKILLABLE:
                self._err.write(f"[processes {family} cannot be killed]\n".encode())
                return
            for pid in family if late >= 0 else []:
                _signal(pid, signal.SIGKILL)
            for key, _ in selector.select(LOOK_EVERY):
                self._pass_on(selector, key)
        self._pass_on_the_rest(selector)

    def _pass_on_the_rest(self, selector: selectors.BaseSelector) -> None:
        """What the family has written while it was looked for; a stranger who keeps writing does not keep us."""
        deadline = time.monotonic() + LAST_OUTPUT
        while (ready := [key for key, _ in selector.select(0) if key.data]) and time.monotonic() < deadline:
            for key in ready:
                self._pass_on(selector, key)

    def _select_timeout(self, ended_at: float | None) -> float | None:
        if ended_at is not None:
            return LAST_OUTPUT
        if self._kill_at is None or self._record.get("killed"):
            return None
        return max(self._kill_at - time.monotonic(), 0.0)

    def _pass_on(self, selector: selectors.BaseSelector, key: selectors.SelectorKey) -> None:
        try:
            data = os.read(key.fd, CHUNK)
        except BlockingIOError:
            return
        if key.data is None:
            return  # a signal woke us
        if data:
            key.data.write(data)
        else:
            selector.unregister(key.fileobj)

    def _stop_if_requested(self, child: subprocess.Popen[bytes]) -> None:
        if self._stop_wanted and self._kill_at is None:
            self._kill_at = time.monotonic() + self._record["grace"]
            self._note(stopping_at=time.time())
            self._deaf = [pid for pid in _family(child) if _ignores_ctrl_c(pid)]
            for number in (signal.SIGINT, signal.SIGCONT):  # a suspended script (Ctrl-Z) gets no other signal
                _send(child, number)
        if self._kill_at is not None and time.monotonic() >= self._kill_at and not self._record.get("killed"):
            self._note(killed=True)
            _send(child, signal.SIGKILL)

    def _end(self, status: int, **more: Any) -> int:
        self._note(exit_status=status, ended_at=time.time(), **more)
        self._terminal.show(f"\n[{self._record['script']} ended with status {status}]\n".encode())
        return status

    def _note(self, **values: Any) -> None:
        """Write values into the record; readers always find a complete record."""
        self._record.update(values)
        written = self._path.with_suffix(".tmp")
        try:
            written.write_text(json.dumps(self._record), encoding="utf-8")
            written.replace(self._path)
        except OSError as error:  # a full disk must not end a script in flight
            self._terminal.show(f"\n[cannot write {self._path.name}: {error.strerror}]\n".encode())


def _be_in_front() -> None:
    """In the script's process: make a process group that owns the terminal, so that Ctrl-C there reaches it."""
    os.setpgid(0, 0)
    if os.isatty(0):
        os.tcsetpgrp(0, os.getpgrp())
    signal.signal(signal.SIGTTOU, signal.SIG_DFL)


def _send(child: subprocess.Popen[bytes], number: int) -> None:
    """Signal the script and its family."""
    family = _family(child)  # before, so that nobody is missed who leaves the group now
    with contextlib.suppress(ProcessLookupError):  # it has just ended
        os.killpg(child.pid, number)
    for pid in family:
        with contextlib.suppress(ProcessLookupError):
            if os.getpgid(pid) != child.pid:
                os.kill(pid, number)


def _signal(pid: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):  # it has just ended
        os.kill(pid, number)
        os.kill(pid, signal.SIGCONT)


def _ignores_ctrl_c(pid: int) -> bool:
    """Whether it ignores SIGINT, as the background jobs of a shell do."""
    ignored = next((line for line in _proc(pid, "status").splitlines() if line.startswith("SigIgn:")), "SigIgn: 0")
    return bool(int(ignored.split()[1], 16) >> (signal.SIGINT - 1) & 1)


def _family(child: subprocess.Popen[bytes]) -> list[int]:
    """The processes below this one, of whatever session; those that have ended are reaped."""
    _reap(child)
    children: dict[int, list[int]] = {}
    for pid in [int(name) for name in os.listdir("/proc") if name.isdigit()]:
        state, parent = (_proc(pid, "stat").rpartition(")")[2].split() or ["Z", "0"])[
            :2
        ]  # its name may hold anything
        if state != "Z":
            children.setdefault(int(parent), []).append(pid)
    family: list[int] = []
    below = [os.getpid()]
    while below:
        below = [pid for parent in below for pid in children.get(parent, [])]
        family += below
    return family


def _proc(pid: int, file: str) -> str:
    """A file of a process; empty if it has ended."""
    try:
        return Path(f"/proc/{pid}/{file}").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _reap(child: subprocess.Popen[bytes]) -> None:
    """Take note of every child that has ended; those of the family whose parents ended before them are ours."""
    with contextlib.suppress(ChildProcessError):  # there is none left
        while ended := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            if ended.si_pid == child.pid:
                child.poll()
            else:
                os.waitpid(ended.si_pid, 0)


if __name__ == "__main__":
    sys.exit(ScriptProcess(Path(sys.argv[1])).run() & 0xFF)
