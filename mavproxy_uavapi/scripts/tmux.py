"""tmux, by argument lists only: no name ever reaches a shell."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from mavproxy_uavapi.core.errors import ToolFailed
from mavproxy_uavapi.tools import Outcome, run_tool

TIMEOUT = 10.0  # s for one call
RECORD = "@uavapi_record"  # the session's option that says where its run's record is
ENDING = "server exited"  # it ends with its last session, which may be just now
NOBODY = ("no server running", "error connecting to", "no sessions", ENDING)  # how tmux says that it has no session


async def start(session: str, command: Sequence[str], record: Path) -> None:
    """Run a command in a new, detached session, which ends with it.

    Args:
        session: its name.
        command: two words or more; tmux gives a single one to a shell.
        record: what the session is to remember.

    Raises:
        ToolFailed: there is no tmux, or it could not.
    """
    assert len(command) > 1
    beginning = ["new-session", "-d", "-s", session, "-x", "200", "-y", "50", *command]
    remembering = ["set-option", "-t", f"={session}:", RECORD, str(record)]
    told = await _tmux(*beginning, ";", *remembering)
    if ENDING in told.stderr:
        told = await _tmux(*beginning, ";", *remembering)
    # An option that comes too late for a run that is over already is no failure of the run.
    if told.status and "no such session" not in told.stderr and "can't find" not in told.stderr:
        raise ToolFailed(f"tmux could not start session {session}", told.stderr.strip())


async def kill(session: str) -> None:
    """End a session if there is one."""
    with contextlib.suppress(ToolFailed):
        await _tmux("kill-session", "-t", f"={session}")


async def sessions(prefix: str) -> dict[str, Path | None]:
    """The sessions whose names begin with `prefix`, and the record that each remembers.

    Raises:
        ToolFailed: there is no tmux, or it could not tell.
    """
    told = await _tmux("list-sessions", "-F", f"#{{session_name}} #{{{RECORD}}}")
    if told.status:
        if any(words in told.stderr for words in NOBODY):
            return {}
        raise ToolFailed("tmux could not list its sessions", told.stderr.strip())
    found: dict[str, Path | None] = {}
    for line in told.stdout.splitlines():
        name, _, record = line.partition(" ")
        if name.startswith(prefix):
            found[name] = Path(record) if record else None
    return found


async def _tmux(*arguments: str) -> Outcome:
    try:
        return await run_tool(["tmux", "-u", *arguments], TIMEOUT)
    except ToolFailed as error:
        raise ToolFailed(f"scripts run in tmux: {error}") from error
