"""Other programs end with their children."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import TimedOut
from mavproxy_uavapi.tools import run_tool


def is_gone(pid: int) -> bool:
    """Whether that process has ended, reaped or not."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except FileNotFoundError:
        return True
    return stat.rpartition(")")[2].split()[0] == "Z"


@pytest.mark.parametrize("last", ["exit", "wait"], ids=["program has ended", "program waits"])
def test_a_child_that_holds_the_output_ends_with_the_time(tmp_path: Path, last: str) -> None:
    note = tmp_path / "child"
    script = f"sleep 60 & echo $! > {note}; {last}"

    async def run() -> None:
        with pytest.raises(TimedOut):
            await run_tool(["sh", "-c", script], 0.5)
        for _ in range(500):
            if is_gone(int(note.read_text())):
                return
            await asyncio.sleep(0.01)
        os.kill(int(note.read_text()), 9)
        pytest.fail("the child lives on")

    asyncio.run(run())
