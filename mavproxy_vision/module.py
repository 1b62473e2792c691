"""The MAVProxy module `vision`: commands and hooks; a thin adapter, no logic."""

from __future__ import annotations

from typing import Any

from mavproxy_uavapi.host.member import HostedModule

NAME = "vision"
ABOUT = "vision: camera, AprilTags, search and precise landing on a tag. This version has no camera source yet."
HELP = """\
vision status    what the module sees
vision help      this"""


class VisionModule(HostedModule):
    """`module load vision`."""

    def __init__(self, mpstate: Any) -> None:
        actions = {"status": lambda _: print(ABOUT), "help": lambda _: print(HELP)}
        super().__init__(mpstate, NAME, "AprilTags and precise landing", actions, ["<status|help>"])


def init(mpstate: Any) -> VisionModule:
    """MAVProxy calls this on `module load vision`."""
    return VisionModule(mpstate)
