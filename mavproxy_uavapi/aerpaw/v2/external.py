"""`aerpawlib.v2.external`: programs that a script starts, without a shell."""

from __future__ import annotations

import asyncio

from mavproxy_uavapi.aerpaw import external


class ExternalProcess(external.ExternalProcess):
    """A program; with `stdin` or `stdout` it has the script's own instead of a pipe."""

    async def start(self) -> None:
        """Start it."""
        self.process = await asyncio.create_subprocess_exec(
            self._executable,
            *self._params,
            stdin=None if self._stdin else asyncio.subprocess.PIPE,
            stdout=None if self._stdout else asyncio.subprocess.PIPE,
        )
