"""A sensor that is a command: it prints its value and ends."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import time
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path

from mavproxy_gradys.errors import NoReading
from mavproxy_gradys.forwarding.quantities import LONGEST_TEXT
from mavproxy_gradys.forwarding.sensor_file import Measured
from mavproxy_uavapi.core.timeout import wait_with_timeout

LONGEST_RUN = 10.0  # s
LONGEST_DEATH = 1.0  # s that a killed command may take to end
MOST_OUTPUT = 4 * LONGEST_TEXT  # bytes; the longest text in UTF-8
LONGEST_COMPLAINT = 200  # characters
ROUNDS = 20  # looks for a family: one that begins children faster than they are killed must not hold up MAVProxy
MARK = "GRADYS_SENSOR"  # variable in the environment of a command and of all that it starts


class SensorCommand:
    """Runs a command, without a shell, in a process group of its own.

    Its family is what it has started, in whatever group or session: all inherit MARK in their environment.

    Args:
        command: the program and its arguments.
        longest: s that it may take.
        wall: s since 1970.
    """

    def __init__(
        self, command: Sequence[str], longest: float = LONGEST_RUN, wall: Callable[[], float] = time.time
    ) -> None:
        self._command, self._longest, self._wall = command, longest, wall
        self._name = os.path.basename(command[0])

    async def read(self) -> Measured:
        """What it printed, with the time of its end.

        However this ends, the command and its family are killed then.

        Raises:
            NoReading: it cannot be started, fails, prints too much, or takes too long.
        """
        others, mark = processes(), uuid.uuid4().hex
        try:
            transport, output = await asyncio.get_running_loop().subprocess_exec(
                _Output,
                *self._command,
                stdin=asyncio.subprocess.DEVNULL,
                start_new_session=True,
                env={**os.environ, MARK: mark},
            )
        except OSError as error:
            raise NoReading("start", f"{self._name}: {error.strerror}") from error
        try:
            await wait_with_timeout(self._longest, output.complete)
        except asyncio.TimeoutError:
            raise NoReading("slow", f"{self._name} did not end within {self._longest:g} s") from None
        finally:
            await kill(transport, output)
            kill_family(f"{MARK}={mark}".encode(), others)
        self._check(transport.get_returncode(), output)
        return Measured(output.printed[1], self._wall())

    def _check(self, status: int | None, output: _Output) -> None:
        if output.is_too_long:
            raise NoReading("long", f"{self._name} prints more than {MOST_OUTPUT} bytes")
        if status:
            words = output.printed[2].decode(errors="replace").split()
            complaint = " ".join([f"{self._name} ended with status {status}:", *words])
            raise NoReading("status", complaint[:LONGEST_COMPLAINT].rstrip(":"))


class _Output(asyncio.SubprocessProtocol):
    """What a command prints.

    Attributes:
        printed: by file descriptor, the beginning of what it wrote.
        complete: done when all is written, or too much.
        ended: done when the command itself has ended.
    """

    def __init__(self) -> None:
        loop = asyncio.get_running_loop()
        self.printed = {1: b"", 2: b""}
        self.complete: asyncio.Future[None] = loop.create_future()
        self.ended: asyncio.Future[None] = loop.create_future()

    @property
    def is_too_long(self) -> bool:
        return any(len(printed) > MOST_OUTPUT for printed in self.printed.values())

    def pipe_data_received(self, fd: int, data: bytes) -> None:
        self.printed[fd] += data[: MOST_OUTPUT + 1 - len(self.printed[fd])]
        if self.is_too_long:
            _settle(self.complete)

    def process_exited(self) -> None:
        _settle(self.ended)

    def connection_lost(self, exc: Exception | None) -> None:
        """The command has ended, and nobody has its output open any more."""
        _settle(self.complete)


def _settle(future: asyncio.Future[None]) -> None:
    if not future.done():
        future.set_result(None)


async def kill(transport: asyncio.SubprocessTransport, output: _Output) -> None:
    """Kill the command's process group; wait a moment for its end."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(transport.get_pid(), signal.SIGKILL)
    try:
        with contextlib.suppress(asyncio.TimeoutError):
            await wait_with_timeout(LONGEST_DEATH, output.ended)
    finally:
        transport.close()


def processes() -> set[str]:
    """The process ids of this machine; none where the system does not list them."""
    with contextlib.suppress(OSError):
        return {name for name in os.listdir("/proc") if name.isdigit()}
    return set()


def kill_family(mark: bytes, others: set[str]) -> None:
    """Kill all processes with that variable in their environment, until none is left, or ROUNDS times.

    Args:
        mark: the variable and its value.
        others: processes that were there before; they are not looked at.
    """
    killed = set(others)
    for _ in range(ROUNDS):
        family = {pid for pid in processes() - killed if is_marked(pid, mark)}
        if not family:
            return
        for pid in family:
            with contextlib.suppress(OSError):
                os.kill(int(pid), signal.SIGKILL)
        killed |= family


def is_marked(pid: str, mark: bytes) -> bool:
    """Whether the process was started with that variable; False if it has ended, or belongs to somebody else."""
    with contextlib.suppress(OSError):
        return mark in Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    return False
