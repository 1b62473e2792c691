"""`uavapi why [SYSID …]` at the prompt: what happened to a vehicle last, and why."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone

from mavproxy_uavapi.core.audit import COMMAND, Entry
from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.text import joined

STORY = 30.0  # s before what happened last
MOST_LINES = 12  # of one vehicle
QUIET = ("text", "lease", "authority")  # kinds that tell what led to it, and end nothing


async def command(host: Host, args: Sequence[str]) -> str:
    """Run the command, for every known vehicle if none is named.

    Raises:
        BadRequest: a word is no system id.
        NoVehicle: none such was heard.
    """
    if not all(word.isdecimal() for word in args):
        raise BadRequest("why takes system ids, or nothing for all vehicles")
    systems = [host.registry.find(int(word)).state.system for word in args] or sorted(host.fleet.vehicles)
    lines = [line for system in systems for line in _story(list(host.audit.newest), system)]
    return joined(["why", *lines]) if lines else "nothing has happened yet"


def _story(entries: Sequence[Entry], system: int) -> list[str]:
    """What happened to a vehicle last, and what led to it; each with its time here and in UTC."""
    own = [(_moment(entry), entry) for entry in entries if entry.system == system]
    turns = [at for at, entry in own if _is_turn(entry)]
    if not turns:
        return [f"  nothing has happened to vehicle {system} yet"]
    told = sorted((one for one in own if (turns[-1] - one[0]).total_seconds() <= STORY), key=lambda one: one[0])
    return [f"  {at.astimezone():%H:%M:%S} ({at:%H:%M:%S} UTC) {entry.sentence}" for at, entry in told[-MOST_LINES:]]


def _is_turn(entry: Entry) -> bool:
    """Whether it changed what the vehicle does: an event, or a command that failed."""
    return entry.outcome not in ("ok", "partly") if entry.kind == COMMAND else entry.kind not in QUIET


def _moment(entry: Entry) -> datetime:
    return datetime.fromisoformat(entry.time).astimezone(timezone.utc)
