"""Processes of this machine and what they have started, from /proc."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def with_variable(name: str) -> Iterator[int]:
    """The processes of this user that were started with a variable of the environment."""
    begin = f"{name}=".encode()
    for pid in filter(str.isdigit, os.listdir("/proc")):
        with suppress(OSError), open(f"/proc/{pid}/environ", "rb") as environment:  # it has ended, or is not ours
            content = environment.read()
            if begin in content and any(one.startswith(begin) for one in content.split(b"\0")):
                yield int(pid)


def below(pid: int) -> Iterator[int]:
    """What a process has started, and what that has."""
    with suppress(OSError):
        for thread in os.listdir(f"/proc/{pid}/task"):
            with suppress(OSError):
                for child in Path(f"/proc/{pid}/task/{thread}/children").read_text(encoding="ascii").split():
                    yield int(child)
                    yield from below(int(child))
