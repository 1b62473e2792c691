"""The MAVProxy module `gradys`: commands, settings and hooks; a thin adapter, no logic."""

from __future__ import annotations

from typing import Any

from mavproxy_uavapi.host.member import HostedModule

NAME = "gradys"
ABOUT = "gradys: pushes position and readings to a GrADyS ground station."
HELP = """\
gradys status    the ground station, and what was pushed
gradys help      this"""


class GradysModule(HostedModule):
    """`module load gradys`.

    Args:
        mpstate: MAVProxy's state.
        gs: HOST:PORT of the ground station; empty for none.
    """

    def __init__(self, mpstate: Any, gs: str) -> None:
        self._gs = gs
        actions = {"status": lambda _: print(self.about()), "help": lambda _: print(HELP)}
        super().__init__(mpstate, NAME, "GrADyS ground station push", actions, ["<status|help>"])

    def about(self) -> str:
        """What it is, and what it does just now."""
        station = f"ground station {self._gs}" if self._gs else "no ground station is set"
        return f"{ABOUT}\n{station}; this version does not push yet"


def init(mpstate: Any, gs: str = "") -> GradysModule:
    """MAVProxy calls this on `module load gradys`, or `gradys:{"gs":"10.0.0.5:8000"}`."""
    return GradysModule(mpstate, gs)
