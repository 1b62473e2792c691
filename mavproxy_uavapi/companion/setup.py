"""`mavproxy-uavapi setup`: asks what it must, says what it will do, and does it; `--remove` undoes it."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Collection, Sequence
from pathlib import Path, PurePosixPath
from typing import TypeVar

from mavproxy_uavapi.companion import autopilot, plan, token
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.terminal import say
from mavproxy_uavapi.core.text import reason_of
from mavproxy_uavapi.launcher import values
from mavproxy_uavapi.launcher.options import HIGHEST_SYSTEM

OWNER = "owner"  # of the first token
NETWORKS = ("udpin", "udpout", "tcp")  # the launcher's
Ask = Callable[[str], str]
T = TypeVar("T")


class SetupError(Exception):
    """It cannot be set up; the text says why."""


def run(argv: Sequence[str], ask: Ask = input) -> int:
    """Set the machine up, or undo that; the exit status: 0, 1 where it cannot be done or is not wanted.

    Args:
        argv: the options.
        ask: asks a question at the terminal.
    """
    options = _arguments().parse_args(argv)
    try:
        setup = Setup(options.root, ask if sys.stdin.isatty() and not options.yes else None)
        return setup.remove() if options.remove else setup.install(options)
    except (SetupError, UavApiError) as error:
        say(f"mavproxy-uavapi setup: {error}", file=sys.stderr)
    except OSError as error:
        say(f"mavproxy-uavapi setup: {reason_of(error)}", file=sys.stderr)
    except (EOFError, KeyboardInterrupt):
        say("", "mavproxy-uavapi setup: broken off", file=sys.stderr)
    return 1


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "mavproxy-uavapi setup",
        description="have MAVProxy and the API start at boot, on a computer beside the autopilot",
    )
    parser.add_argument(
        "--device", help="the serial port, with ,BAUD or without; or udpin:HOST:PORT (found by itself)"
    )
    parser.add_argument("--sysid", type=int, help="the vehicle's system id (heard by itself)")
    parser.add_argument(
        "--network", action=argparse.BooleanOptionalAction, help="whether other machines may call, with a token"
    )
    parser.add_argument("--yes", action="store_true", help="ask nothing, and do it")
    parser.add_argument("--remove", action="store_true", help="undo it; records and logs stay")
    parser.add_argument("--root", type=Path, default=Path("/"), help="of another system: files only, no commands (/)")
    return parser


class Setup:
    """Does it, below `root`.

    Args:
        root: `/`, or the root of another system, in which only files are written.
        ask: asks a question; None to take what is likely.
    """

    def __init__(self, root: Path, ask: Ask | None) -> None:
        self._root, self._ask = root, ask
        self._is_here = root == Path("/")
        if self._is_here and os.geteuid() != 0:
            raise SetupError("it writes to /etc: run it with sudo")

    def install(self, options: argparse.Namespace) -> int:
        """Set it up; files of settings and tokens that are there already stay as they are."""
        os.umask(0o022)  # the service's user reads them
        companion = self._companion(options)
        files = plan.files(companion)
        fresh = {path: text for path, text in files.items() if path != plan.CONFIG or not self._at(path).exists()}
        say("this is what setup does:", *(f"  {line}" for line in self._deeds(companion, fresh)))
        if not self._agreed("go on?"):
            return 1
        if self._is_here:
            self._make_user(companion.program)
        for path, text in fresh.items():
            self._write(path, text)
        if self._needs_token(companion, fresh):
            self._first_token()
        self._commands([plan.RELOAD, *([plan.RELOAD_RULES] if plan.RULE in fresh else []), *plan.START])
        return 0

    def remove(self) -> int:
        """Undo it. What the vehicle has recorded stays, and so does the user that owns it."""
        there = [path for path in (plan.UNIT, plan.RULE, plan.CONFIG) if self._at(path).exists()]
        if not there:
            say("nothing is set up here")
            return 0
        say("this is removed:", *(f"  {path}" for path in there), f"{plan.STATE} stays: records, logs, tokens")
        if not self._agreed("go on?"):
            return 1
        if plan.UNIT in there:
            self._commands([plan.STOP])
        for path in there:
            self._at(path).unlink()
        folder = self._at(plan.CONFIG).parent
        if folder.exists() and not any(folder.iterdir()):  # /etc/mavproxy-uavapi/environment is somebody's own
            folder.rmdir()
        self._commands([plan.RELOAD, *([plan.RELOAD_RULES] if plan.RULE in there else [])])
        return 0

    # -- questions ----------------------------------------------------------------------------------------

    def _companion(self, options: argparse.Namespace) -> plan.Companion:
        def link(text: str) -> tuple[str, int | None, autopilot.Autopilot | None]:
            device, rate = _port(text)
            return device, rate, None if options.sysid and rate else self._heard(device, rate)

        if options.sysid is not None:
            _system(str(options.sysid))
        if options.device:
            device, rate, heard = link(options.device)
        else:
            device, rate, heard = self._chosen("the autopilot's serial port", link, *autopilot.ports())
        system = options.sysid or (heard.system if heard else self._chosen("the vehicle's system id", _system, "1"))
        rate = rate or (heard.baud if heard else autopilot.BAUDS[0])
        on_network = options.network
        if on_network is None:
            on_network = self._agreed("may other machines call it, with a token?", unasked=False)
        return plan.Companion(_program(), device, rate, system, on_network, autopilot.usb_ids(device))

    def _heard(self, device: str, rate: int | None) -> autopilot.Autopilot | None:
        say(f"listening at {device} …")
        try:
            heard = autopilot.hear(device, [rate] if rate else autopilot.BAUDS)
        except OSError as error:
            raise SetupError(f"{device}: {reason_of(error)}") from error
        if heard is None:
            say("  nothing is heard; is the autopilot on, and SERIALn_PROTOCOL 2?")
        else:
            at = f", at {heard.baud} baud" if heard.baud else ""
            say(f"  vehicle {heard.system}, a {heard.kind}{at}")
        return heard

    def _chosen(self, what: str, read: Callable[[str], T], *likely: str) -> T:
        """What `read` makes of the answer; one that it refuses is asked for again."""
        for other in likely[1:]:
            say(f"  there is also {other}")
        first = likely[0] if likely else ""
        while self._ask is not None:
            try:
                return read(self._ask(f"{what} [{first}]: ").strip() or first)
            except SetupError as error:
                say(f"  {error}")
        return read(first)

    def _agreed(self, question: str, *, unasked: bool = True) -> bool:
        """The answer; `unasked` is what counts where nobody is asked."""
        while self._ask is not None:
            answer = self._ask(f"{question} [y/N] ").strip().lower()
            if answer in ("y", "yes", "n", "no", ""):
                return answer.startswith("y")
            say("  y or n")
        return unasked

    # -- deeds --------------------------------------------------------------------------------------------

    def _deeds(self, companion: plan.Companion, fresh: dict[PurePosixPath, str]) -> list[str]:
        where = "every network, with a token" if companion.on_network else "this machine only"
        said = {
            plan.CONFIG: f"vehicle {companion.system} at {companion.device}, the API on {where}",
            plan.UNIT: f"{companion.program} starts at boot, as {plan.USER}",
            plan.RULE: "ModemManager leaves the autopilot alone",
        }
        deeds = [] if not self._is_here or _has_user() else [f"make the user {plan.USER}"]
        deeds += [f"write {path}: {said[path]}" for path in fresh]
        if plan.CONFIG not in fresh:
            deeds.append(f"keep {plan.CONFIG}, which is there already: remove it to have it written anew")
        if self._needs_token(companion, fresh):
            deeds.append(f"write {plan.TOKENS}: a token for {OWNER!r}, who may do everything")
        return deeds + ([f"run {' '.join(command)}" for command in plan.START] if _has_systemd(self._is_here) else [])

    def _make_user(self, program: str) -> None:
        """Make the user that flies, and its folder; it must be able to run the program before the rest is written."""
        if not _has_user():
            _call(plan.MAKE_USER)
        self._at(plan.STATE).mkdir(mode=0o750, exist_ok=True)
        shutil.chown(plan.STATE, plan.USER, plan.USER)
        try:
            _call(["runuser", "-u", plan.USER, "--", program, "--version"])
        except SetupError as error:
            why = f"the user {plan.USER} may not run it: install it below /opt, as docs/deploy.md says"
            raise SetupError(f"{program}: {why}") from error

    def _write(self, path: PurePosixPath, text: str) -> None:
        file = self._at(path)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        file.chmod(0o644)

    def _first_token(self) -> None:
        file = self._at(plan.TOKENS)
        file.parent.mkdir(parents=True, exist_ok=True)
        with token.as_owner(file):
            say(*token.add(file, OWNER, "admin", (), self._at(plan.CONFIG)))

    def _needs_token(self, companion: plan.Companion, fresh: Collection[PurePosixPath]) -> bool:
        """Whether the settings that are written name a file of tokens, and it is missing."""
        return companion.on_network and plan.CONFIG in fresh and not self._at(plan.TOKENS).exists()

    def _commands(self, commands: Sequence[Sequence[str]]) -> None:
        if _has_systemd(self._is_here):
            for command in commands:
                _call(command)
        elif self._is_here:
            say("systemd does not run here: nothing is started or stopped")

    def _at(self, path: PurePosixPath) -> Path:
        return self._root / path.relative_to("/")


def _number(what: str, text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 9):
        raise SetupError(f"{what}: {text!r:.20} is no number")
    return int(text)


def _system(text: str) -> int:
    system = _number("the system id", text)
    if not 1 <= system <= HIGHEST_SYSTEM:
        raise SetupError(f"system ids are 1 to {HIGHEST_SYSTEM}, not {system}")
    return system


def _port(text: str) -> tuple[str, int | None]:
    """The device, and its baud rate if it says one.

    Raises:
        SetupError: it is none, by its form.
    """
    device, _, baud = text.partition(",")
    if not device:
        raise SetupError("no serial port is found: connect the autopilot, or name it with --device")
    kind, _, address = device.partition(":")
    if address and kind not in NETWORKS:
        raise SetupError(f"{device}: a link over the network is {', '.join(NETWORKS)}, as udpin:0.0.0.0:14550")
    if address:
        try:
            values.host_port(address)
        except ValueError as error:
            raise SetupError(f"{device}: {address} is not HOST:PORT, with a port from 1 to 65535") from error
    elif re.search(r"\s", device):
        raise SetupError(f"{device!r} is no device")
    return device, _number("the baud rate", baud) if baud else None


def _program() -> str:
    """The command that is running, with its path: of an environment, or the one file of a bundle."""
    return str(Path(os.environ.get("PEX") or sys.argv[0]).resolve())


def _has_user() -> bool:
    return subprocess.run(["id", plan.USER], capture_output=True, check=False).returncode == 0


def _has_systemd(is_here: bool) -> bool:
    return is_here and Path("/run/systemd/system").is_dir()


def _call(command: Sequence[str]) -> None:
    """Run a command; what it says is its own.

    Raises:
        SetupError: it failed, or is missing.
    """
    if shutil.which(command[0]) is None:
        raise SetupError(f"{command[0]} is missing")
    if subprocess.run(command, check=False).returncode != 0:
        raise SetupError(f"`{' '.join(command)}` failed")
