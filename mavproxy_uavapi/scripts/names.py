"""The names of scripts. Pure."""

from __future__ import annotations

import re
from pathlib import PurePath

from mavproxy_uavapi.core.errors import BadRequest

SUFFIXES = (".py", ".sh")
SESSIONS = "uavapi_"  # begins the names of all our tmux sessions
LONGEST = 100  # characters; the name of a log, with its timestamp, must fit into 255 bytes
ALLOWED = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")


def checked(name: str) -> str:
    """`name`, if it is valid.

    Raises:
        BadRequest: it is not a plain file name, or does not end in .py or .sh.
    """
    if not ALLOWED.fullmatch(name) or len(name) > LONGEST:
        raise BadRequest(
            f"{name[:LONGEST]!r} is not a name for a script: letters, digits, '.', '_' and '-' only, not beginning "
            f"with '.' or '-', and at most {LONGEST} of them"
        )
    if PurePath(name).suffix not in SUFFIXES:
        raise BadRequest(f"{name!r} is neither a .py nor a .sh file")
    return name


def resolved(name: str) -> str:
    """The file name that a client means; the client may omit `.py`.

    Raises:
        BadRequest: as `checked`.
    """
    return checked(name if PurePath(name).suffix in SUFFIXES else f"{name}.py")


def stem(script: str) -> str:
    """The file name without its extension; logs are named by it."""
    return PurePath(script).stem


def session_name(sysid: int, run: str) -> str:
    """The tmux session of a run: `run` is `<stem>_<timestamp>`. tmux allows neither '.' nor ':' in a name.

    No other run of the vehicle in the same folder of logs has the same: a script's name has no '+'.
    """
    vehicle = f"{sysid}_" if sysid else ""
    return f"{SESSIONS}{vehicle}{run.replace('.', '+')}"
