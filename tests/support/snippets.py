"""The blocks of code in the pages, and somebody who does what they say.

A block is not run if `<!-- not run: REASON -->` stands before it; `<!-- file: NAME -->` makes it a file,
`<!-- body: METHOD PATH -->` sends it. `text` is what programs print, and drawings.
"""

from __future__ import annotations

import contextlib
import os
import pty
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import threading
from pathlib import Path
from typing import NamedTuple

from tests.support.ports import free_port
from tests.support.processes import Process

ROOT = Path(__file__).parents[2]
FOLDERS = ("docs", "examples", "packaging")
PAGES = [
    *("README.md", "CONTRIBUTING.md", "SECURITY.md"),
    *sorted(str(page.relative_to(ROOT)) for folder in FOLDERS for page in (ROOT / folder).rglob("*.md")),
]
MARK = r"(?:<!-- (not run|file|body): (.+?) -->\n\n?)?"
BLOCK = re.compile(rf"{MARK}^( *)```(\S*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
COMMENT = re.compile(r"(^|\s\s)\s*#.*")
PORT = re.compile(r"\b(80\d\d|14550|14580)\b")
TIMEOUT = 400  # s for a command
SPEEDUP = 1  # of simulations, whatever a page says: the machine may be busy
API = "8000"
DEMO = f"mavproxy-uavapi --simulated --location CMAC --module vision --module gradys --port {API}"
# What goes on until it is ended: how it begins, what it says once it is there, and its port if it names none.
SERVERS = {
    "make demo ": (":{port}/", API),
    "mavproxy-uavapi --": (":{port}/", API),
    "python -m mavproxy_gradys.station": (":{port}", "8080"),
    "python -m mavproxy_uavapi.aerpaw.zmq_proxy": ("", "the proxy"),
    "python -m mavproxy_uavapi.aerpaw.safety_server": ("", "the safety server"),
}
LAUNCHERS = tuple(SERVERS)[:2]
REFUSED = re.compile(
    r"Unknown command|no command|no setting|Failed to load|defect|Traceback|cannot|must be|comes first|expected"
    r"|takes `|No such file|is none|is not a|unknown"
)
# The brokers and stations of the examples; the file that the first `token add` makes.
UNREACHABLE = re.compile(r"does not answer|not known|tokens cannot be read")
# A benchmark takes minutes: its options are read.
OPTIONS_ONLY = """
import argparse, runpy, sys
del sys.argv[0]
sys.path.insert(0, "benchmarks")
parse = argparse.ArgumentParser.parse_args
argparse.ArgumentParser.parse_args = lambda *args, **kwargs: sys.exit(parse(*args, **kwargs) is None)
runpy.run_path(sys.argv[0], run_name="__main__")
"""
WITH_AWAIT = """
import ast, asyncio, inspect, sys
code = compile(open("snippet.py").read(), "snippet.py", "exec", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)
done = eval(code)
if inspect.iscoroutine(done):
    asyncio.run(done)
"""
IN_A_TERMINAL = (
    "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execvp(sys.argv[1], sys.argv[1:])"
)


class Block(NamedTuple):
    """One of them, with its place."""

    page: str
    line: int
    language: str
    text: str
    mark: str  # `not run`, `file`, `body` or nothing
    about: str  # the reason, the file's name, or method and path

    @property
    def commands(self) -> list[str]:
        """Its commands, without what is said about them; a line that ends in a backslash goes on."""
        lines = re.sub(r" *\\\n *", " ", self.text).splitlines()
        return [bare for line in lines if (bare := COMMENT.sub("", line).strip())]


def blocks(page: str) -> list[Block]:
    """Those of a page."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return [
        Block(page, text.count("\n", 0, found.start()) + 1, language, body, mark or "", about or "")
        for found in BLOCK.finditer(text)
        for mark, about, _, language, body in [found.groups()]
    ]


class Terminal(Process):
    """A program in a terminal of its own, as a reader has it."""

    def __init__(self, command: str, log: Path, cwd: Path, env: dict[str, str]) -> None:
        self.log = log
        log.touch()
        ours, its = pty.openpty()
        words = [sys.executable, "-c", IN_A_TERMINAL, "bash", "-c", f"exec {command}"]
        with open(its, "r+b", buffering=0) as terminal:
            self.popen = subprocess.Popen(
                words, stdin=terminal, stdout=terminal, stderr=terminal, cwd=cwd, env=env, start_new_session=True
            )
        self.popen.stdin = os.fdopen(os.dup(ours), "wb", buffering=0)
        threading.Thread(target=self._copy, args=(ours,), daemon=True).start()

    def _copy(self, terminal: int) -> None:
        with (
            contextlib.suppress(OSError),  # the end of a terminal is an error
            open(terminal, "rb", buffering=0) as shown,
            self.log.open("ab", buffering=0) as log,
        ):
            while some := shown.read(65536):
                log.write(some)


class Reader:
    """Does what the pages say, in a folder and at ports of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._ports: dict[str, str] = {}
        self._written: set[str] = set()
        self._servers: dict[str, Process] = {}
        self._behind: list[Process] = []
        programs = folder / "bin"
        programs.mkdir()
        for name, line in {
            "curl": f"{shutil.which('curl')} --fail-with-body --silent --show-error --retry 5 --max-time {TIMEOUT}",
            "python": sys.executable,
            "make": f"{shutil.which('make')} VENV={sys.prefix}",
        }.items():
            (programs / name).write_text(f'#!/bin/sh\nexec {line} "$@"\n', encoding="utf-8")
            (programs / name).chmod(0o755)
        path = os.pathsep.join([str(programs), sysconfig.get_path("scripts"), os.environ["PATH"]])
        home = {"HOME": str(folder), "XDG_STATE_HOME": str(folder / "state"), "TERM": "dumb", "UAVAPI_FLIGHTS": ""}
        self._env = {**os.environ, **home, "PATH": path, "PYTHONUNBUFFERED": "1", "PYTHONPATH": str(ROOT)}

    def do(self, block: Block) -> None:
        """Do what a block says.

        Raises:
            AssertionError: something fails, or is refused.
        """
        if block.mark == "file":
            self.write(block.about, block.text)
        elif block.mark == "body":
            method, path = block.about.split()
            body = f"-H 'Content-Type: application/json' -d {shlex.quote(block.text)}"
            self.run(f"curl -X {method} {body} http://127.0.0.1:{API}{path}")
        elif block.language == "bash":
            if block.text.startswith(LAUNCHERS):
                self.close()  # a reader ends what an earlier block has started
            for command in block.commands:
                self.run(command)
        elif block.language == "mavproxy":
            for command in block.commands:
                self.type(command)
        elif block.language == "python":
            while self._behind:  # it may fly the vehicle
                self._behind.pop().popen.wait(TIMEOUT)
            if f":{API}" in block.text:
                self._need_api()
            self._written.discard("snippet.py")
            self.write("snippet.py", block.text)
            self.run(f"python -c {shlex.quote(WITH_AWAIT)}")

    def write(self, name: str, text: str) -> None:
        """Make a file, or go on with one that the page has begun."""
        with (self.folder / name).open("a" if name in self._written else "w", encoding="utf-8") as file:
            file.write(self._here(text))
        self._written.add(name)

    def run(self, command: str) -> None:
        """Run a command of the shell to its end, or start a server."""
        self._make_checkout(command)
        for beginning in SERVERS:
            if f"{command} ".startswith(beginning):
                self._serve(beginning, command)
                return
        if command.endswith("&"):
            self._behind += [self._start(command, f"env UAVAPI_URL=http://127.0.0.1:{API} {command.rstrip('& ')}")]
            return
        if command.startswith("make "):  # CI's jobs make them
            command = f"make --dry-run {command.removeprefix('make ')}"
        elif command.startswith("python benchmarks/"):
            command = f"python -c {shlex.quote(OPTIONS_ONLY)} {re.sub(r'[][]', '', command.removeprefix('python '))}"
        elif f":{API}" in command:
            self._need_api()
        done = subprocess.run(
            ["bash", "-ec", self._here(command)],
            cwd=self.folder,
            env={**self._env, "UAVAPI_URL": self._here(f"http://127.0.0.1:{API}")},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=TIMEOUT,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}"

    def type(self, line: str) -> None:
        """Type a line at MAVProxy's prompt."""
        self._need_api()
        self._servers[API].type(self._here(line))
        self._servers[API].ask("uavapi set max_age", "max_age  ")
        self.require_nothing_refused()

    def require_nothing_refused(self) -> None:
        """Look at what the prompt has said; some of its answers come later."""
        said = self._servers[API].output() if API in self._servers else ""
        refused = [line for line in said.splitlines() if REFUSED.search(line) and not UNREACHABLE.search(line)]
        assert not refused, refused

    def close(self) -> None:
        """End all that was started."""
        for process in self._servers.values():
            process.stop()
        self._servers.clear()

    def _here(self, text: str) -> str:
        """With ports that are free here."""
        on_this_machine = text.replace("http://uav:", "http://127.0.0.1:")
        return PORT.sub(lambda found: self._ports.setdefault(found[0], str(free_port())), on_this_machine)

    def _make_checkout(self, command: str) -> None:
        """Have here what the command needs of one."""
        needed = [name for name in ("examples", "benchmarks") if f"{name}/" in command]
        if command.startswith("make "):
            needed += ["Makefile", "pyproject.toml", "setup.py", "requirements"]
        for name in needed:
            if not (self.folder / name).exists():
                (self.folder / name).symlink_to(ROOT / name)

    def _need_api(self) -> None:
        if API not in self._servers:
            self._serve("mavproxy-uavapi --", DEMO)

    def _serve(self, beginning: str, command: str) -> None:
        """Start a server, in the place of the one that has its port, and wait until it is there."""
        says, port = SERVERS[beginning]
        more = ""
        if named := re.search(r"--port[ =](\d+)", command):
            port = named[1]
        elif port.isdecimal():
            more += f" --port {port}"
        if beginning in LAUNCHERS:
            command = re.sub(r" --speedup \d+", "", command)
            more += f" --speedup {SPEEDUP}"
        if beginning.startswith("make"):
            command, more = command.rstrip('"'), f'{more}"' if "ARGS" in command else f' ARGS="{more}"'
        if earlier := self._servers.pop(port, None):
            earlier.stop()
        self._start(port, command + more).says(self._here(says.format(port=port)))

    def _start(self, key: str, command: str) -> Process:
        log = self.folder / f"server{len(list(self.folder.glob('server*.log')))}.log"
        self._servers[key] = Terminal(self._here(command), log, self.folder, self._env)
        return self._servers[key]
