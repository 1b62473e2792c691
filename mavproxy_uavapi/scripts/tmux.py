"""Calls tmux by argument lists only, so that no name ever reaches a shell."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from mavproxy_uavapi.core.errors import ToolFailed
from mavproxy_uavapi.programs.program import Outcome, run_tool

TIMEOUT = 10.0  # s for one call
RECORD = "@uavapi_record"  # the session's option with the path of its run's record
ENDING = "server exited"  # the server ends with its last session
NOBODY = ("no server running", "error connecting to", "no sessions", ENDING)  # tmux's messages for "no session"


async def start(session: str, command: Sequence[str], record: Path) -> None:
    """Run a command in a new, detached session; the session ends with the command.

    Args:
        session: its name.
        command: two words or more; tmux gives a single one to a shell.
        record: the path that the session stores.

    Raises:
        ToolFailed: there is no tmux, or it failed.
    """
    assert len(command) > 1
    beginning = ["new-session", "-d", "-s", session, "-x", "200", "-y", "50", *command]
    remembering = ["set-option", "-t", f"={session}:", RECORD, str(record)]
    result = await _tmux(*beginning, ";", *remembering)
    if ENDING in result.stderr:
        result = await _tmux(*beginning, ";", *remembering)
    # If the run is over already, the option comes too late; that is not a failure.
    if result.status and "no such session" not in result.stderr and "can't find" not in result.stderr:
        raise ToolFailed(f"tmux could not start session {session}", result.stderr.strip())


async def kill(session: str, record: Path) -> None:
    """End the session of that record, if there is one; a session of the same name may be another MAVProxy's."""
    with contextlib.suppress(ToolFailed):
        if (await sessions(session)).get(session) == record:
            await _tmux("kill-session", "-t", f"={session}")


async def sessions(prefix: str) -> dict[str, Path | None]:
    """The sessions whose names begin with `prefix`, and the record path of each.

    Raises:
        ToolFailed: there is no tmux, or it failed.
    """
    result = await _tmux("list-sessions", "-F", f"#{{session_name}} #{{{RECORD}}}")
    if result.status:
        if any(words in result.stderr for words in NOBODY):
            return {}
        raise ToolFailed("tmux could not list its sessions", result.stderr.strip())
    records: dict[str, Path | None] = {}
    for line in result.stdout.splitlines():
        name, _, record = line.partition(" ")
        if name.startswith(prefix):
            records[name] = Path(record) if record else None
    return records


async def _tmux(*arguments: str) -> Outcome:
    try:
        return await run_tool(["tmux", "-u", *arguments], TIMEOUT)
    except ToolFailed as error:
        raise type(error)(f"scripts run in tmux: {error}") from error
