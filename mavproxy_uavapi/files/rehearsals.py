"""The newest rehearsal of each script and mission on this machine, by what was flown. Blocking.

`mavproxy-uavapi run` keeps the report of each; a flight's record takes those of the same bytes with it.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_watch import wpl
from mavproxy_uavapi.core.state_directory import state_directory

MOST_KEPT = 100
MOST_BYTES = 4_000_000  # of one report that a record takes
KIND = "application/json"
SIGN = "under-way"  # locked by whoever rehearses; the lock ends with its process


def digest_of(content: bytes) -> str:
    """The digest of a script."""
    return hashlib.sha256(content).hexdigest()


def digest_of_mission(items: Sequence[MissionItem]) -> str:
    """The digest of a mission, home left out: that is where the vehicle stands."""
    return digest_of(wpl(items).encode())


def request_file(path: str, body: Mapping[str, Any], settings: Mapping[str, Any]) -> bytes:
    """A request of the API as a file that `run` flies; the same request always has the same bytes.

    Args:
        path, body: of the request.
        settings: those of the module `vision` that are not as usual.
    """
    return json.dumps({"path": path, "body": body, "vision": settings}, sort_keys=True).encode()


def keep(digest: str, report: str) -> None:
    """Keep a report as JSON; the oldest beyond `MOST_KEPT` go.

    Raises:
        OSError: the disk refuses.
    """
    folder = _folder()
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    (folder / f"{digest}.well").unlink(missing_ok=True)  # until somebody vouches for the newest
    (folder / f"{digest}.json").write_text(report, encoding="utf-8")
    kept = sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime)
    for path in kept[:-MOST_KEPT]:
        path.unlink(missing_ok=True)
        path.with_suffix(".well").unlink(missing_ok=True)


def vouch(digest: str, conditions: str) -> None:
    """Note that what has that digest was rehearsed well under these conditions.

    Raises:
        OSError: the disk refuses.
    """
    (_folder() / f"{digest}.well").write_text(conditions, encoding="ascii")


def vouched(digest: str) -> str:
    """The conditions under which what has that digest was rehearsed well; "" if it was not."""
    with suppress(OSError):
        return (_folder() / f"{digest}.well").read_text(encoding="ascii")
    return ""


def find(digest: str) -> bytes | None:
    """The newest report of what has that digest, as JSON; None if there is none, or it is too large."""
    with suppress(OSError):
        path = _folder() / f"{digest}.json"
        return path.read_bytes() if path.stat().st_size <= MOST_BYTES else None
    return None


@contextmanager
def under_way() -> Iterator[None]:
    """While a rehearsal goes on; our APIs on this machine know by that.

    Raises:
        OSError: the disk refuses.
    """
    _folder().mkdir(mode=0o700, parents=True, exist_ok=True)
    with (_folder() / SIGN).open("w", encoding="ascii") as sign:
        fcntl.flock(sign, fcntl.LOCK_SH)
        yield


def is_under_way() -> bool:
    """Whether a rehearsal of this user goes on, on this machine."""
    try:
        with (_folder() / SIGN).open(encoding="ascii") as sign:
            fcntl.flock(sign, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except FileNotFoundError:  # nobody has rehearsed here
        return False
    except OSError:  # it is locked, or cannot be read: then it is looked for
        return True
    return False


def _folder() -> Path:
    return state_directory() / "rehearsed"
