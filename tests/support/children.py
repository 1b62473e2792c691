"""Programs that leave a note with the process id of a child, which holds their output."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.timeout import wait_with_timeout
from tests.support.processes import eventually


def begin_limits_with(monkeypatch: pytest.MonkeyPatch, module: Any, note: Path) -> None:
    """Have the time limits of a module begin with the note: a slow machine takes long to start a program."""

    async def wait(seconds: float, awaited: Awaitable[Any]) -> Any:
        ending = asyncio.ensure_future(awaited)
        await until_noted(note)
        return await wait_with_timeout(seconds, ending)

    monkeypatch.setattr(module, "wait_with_timeout", wait)


async def until_noted(note: Path) -> None:
    """Wait until the program has written its note."""
    await asyncio.to_thread(eventually, lambda: note.exists() and note.read_text(), what="the program's note")


async def until_gone(note: Path) -> None:
    """Wait for the child's end. It closes the pipes, which the loop has to see before its own end."""
    await asyncio.to_thread(eventually, lambda: is_gone(int(note.read_text())), what="the child's end")


def is_gone(pid: int) -> bool:
    """Whether that process has ended, reaped or not."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except (FileNotFoundError, ProcessLookupError):
        return True
    return stat.rpartition(")")[2].split()[0] == "Z"
