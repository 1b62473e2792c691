"""Other programs: run one, without ever blocking the loop, and know how it ended."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mavproxy_uavapi.core.acquire import acquire
from mavproxy_uavapi.core.errors import TimedOut, ToolFailed, ToolMissing
from mavproxy_uavapi.core.forks import apart_from_forks
from mavproxy_uavapi.core.timeout import kept, wait_with_timeout


@dataclass(frozen=True)
class Outcome:
    """How a program ended: its exit status, and what it wrote."""

    status: int
    stdout: str
    stderr: str


async def run_tool(
    command: Sequence[str], timeout: float, cwd: Path | None = None, environment: Mapping[str, str] | None = None
) -> Outcome:
    """Run a program to its end. No shell is involved.

    Whatever ends the wait early (time, a client that hangs up) ends the program and its children too.

    Args:
        command: the program and its arguments.
        timeout: in s.
        cwd: where it runs.
        environment: its own; None for ours.

    Raises:
        ToolMissing: it is not there.
        ToolFailed: it cannot be run.
        TimedOut: it took longer.
    """
    name = command[0]
    try:
        with apart_from_forks():
            process = await acquire(
                asyncio.create_subprocess_exec(
                    *command,
                    cwd=cwd,
                    env=environment,
                    stdin=asyncio.subprocess.DEVNULL,
                    stdout=asyncio.subprocess.PIPE,
                    stderr=asyncio.subprocess.PIPE,
                    start_new_session=True,
                )
            )
    except FileNotFoundError as error:
        raise ToolMissing(f"{name} is not installed on this machine") from error
    except OSError as error:
        raise ToolFailed(f"cannot run {name}: {error.strerror}") from error
    ended = False
    try:
        out, err = await wait_with_timeout(timeout, process.communicate())
        ended = True
    except asyncio.TimeoutError:
        raise TimedOut(f"{name} did not end within {timeout:g} s") from None
    finally:
        if not ended:  # or a child of it holds its output open
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            await kept(process.wait())
    assert process.returncode is not None
    return Outcome(process.returncode, out.decode(errors="replace"), err.decode(errors="replace"))
