"""What the modes of all vehicles have in common."""

from __future__ import annotations

from typing import ClassVar

from .geodesy import Ned


class VehicleMode:
    """A mode of a vehicle: MANUAL, GUIDED and so on. Each type of vehicle adds how it moves in it."""

    name: ClassVar[str] = ""
    number: ClassVar[int] = -1
    needs_position: ClassVar[bool] = True
    armable: ClassVar[bool] = True

    def enter(self, checked: bool) -> bool:
        """Prepare; False refuses the mode. checked is False while disarmed."""
        del checked
        return True

    def leave(self) -> None:
        """Called when another mode takes over."""

    @property
    def reported(self) -> int:
        """The number that the heartbeat tells."""
        return self.number

    @property
    def target(self) -> Ned | None:
        """Where the vehicle is going, metres NED from the EKF origin, or None."""
        return None


class MissionMode(VehicleMode):
    """A mode that flies the mission."""

    def jump_to(self, seq: int) -> None:
        """Take up another current item, which the ground station chose while the mission runs."""
        raise NotImplementedError

    @property
    def holding_mission(self) -> bool:
        """Whether the mission is paused, which MISSION_CURRENT reports."""
        return False
