"""`aerpawlib.v1.external`: programs that a script starts."""

from __future__ import annotations

import asyncio
import contextlib
import re
import shlex
from collections.abc import Sequence
from re import Pattern

TERMINATE_TIMEOUT = 5.0  # s from SIGTERM to SIGKILL


class ExternalProcess:
    """A program that the shell runs.

    Args:
        executable: the command.
        params: its arguments; the shell interprets them, too.
        stdin, stdout: files instead of pipes.

    Attributes:
        process: the shell; None before `start`.
    """

    def __init__(
        self,
        executable: str,
        params: Sequence[str] | None = None,
        stdin: str | None = None,
        stdout: str | None = None,
    ) -> None:
        self._executable = executable
        self._params = list(params or [])
        self._stdin, self._stdout = stdin, stdout
        self.process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Start it."""
        line = " ".join([self._executable, *self._params])
        line += f" < {shlex.quote(self._stdin)}" if self._stdin else ""
        line += f" > {shlex.quote(self._stdout)}" if self._stdout else ""
        pipe = asyncio.subprocess.PIPE
        self.process = await asyncio.create_subprocess_shell(
            line, stdin=None if self._stdin else pipe, stdout=None if self._stdout else pipe
        )

    @property
    def _running(self) -> asyncio.subprocess.Process:
        if self.process is None:
            raise RuntimeError(f"{self._executable} was not started")
        return self.process

    async def read_line(self) -> str | None:
        """The next line of its output; None at the end, or if a file gets the output."""
        if self._running.stdout is None:
            return None
        line = await self._running.stdout.readline()
        return line.decode("utf-8", "replace").rstrip() if line else None

    async def send_input(self, data: str) -> None:
        """Write to its input.

        Raises:
            RuntimeError: it reads from a file.
        """
        stdin = self._running.stdin
        if stdin is None:
            raise RuntimeError("Cannot send input: stdin is not available (was it redirected to a file?)")
        stdin.write(data.encode())
        await stdin.drain()

    async def wait_until_terminated(self) -> None:
        """Wait until it has ended."""
        await self._running.wait()

    async def wait_until_output(self, output_regex: str | Pattern[str]) -> list[str]:
        """Its lines up to the first one that matches the expression; all lines if it ends before."""
        lines: list[str] = []
        while (line := await self.read_line()) is not None:
            lines.append(line)
            if re.search(output_regex, line):
                break
        return lines

    async def aclose(self) -> None:
        """End it, if it still runs."""
        if self.process is None or self.process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            self.process.terminate()
        waiting = asyncio.ensure_future(self.process.wait())
        if not (await asyncio.wait({waiting}, timeout=TERMINATE_TIMEOUT))[0]:
            self.process.kill()
            await waiting
