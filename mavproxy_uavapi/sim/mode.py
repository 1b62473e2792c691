"""What the modes of all vehicles have in common."""

from __future__ import annotations

from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .geodesy import Ned
from .mission import Item


class VehicleMode:
    """A mode of a vehicle: MANUAL, GUIDED and so on. Each type of vehicle adds how it moves in it."""

    name: str = ""
    number: int = -1
    needs_position: ClassVar[bool] = True
    armable: ClassVar[bool] = True
    navigates: ClassVar[bool] = False
    """Whether the vehicle finds its way, or holds its place, by itself, as the guided bit of base_mode reports."""
    base_flags: ClassVar[int] = mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED

    def enter(self, checked: bool) -> bool:
        """Prepare; False refuses the mode. checked is False while disarmed."""
        return True

    def leave(self) -> None:
        """Called when another mode takes over."""

    @property
    def reported(self) -> int:
        """The number that the heartbeat tells."""
        return self.number

    @property
    def landing(self) -> bool:
        """Whether the vehicle is on its way to the ground."""
        return False

    @property
    def taking_off(self) -> bool:
        """Whether a takeoff is under way."""
        return False

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

    # What its `MissionRunner` asks.

    def begin_item(self, item: Item) -> bool:
        """Start a navigation item; False where the vehicle cannot, and the next one follows."""
        raise NotImplementedError

    def item_done(self, item: Item) -> bool:
        """Whether the navigation item that was begun last is done; the runner itself counts a delay's seconds."""
        raise NotImplementedError

    def do_item(self, item: Item) -> None:
        """Carry an immediate item out; the runner itself sets servos."""

    def start_condition(self, item: Item) -> None:
        """A condition begins to count."""

    def condition_met(self, item: Item) -> bool:
        """Whether a condition holds that does not count seconds."""
        raise NotImplementedError

    def item_restarts(self) -> bool:
        """Whether a changed mission restarts the current item."""
        return False

    def mission_ended(self) -> None:
        """Nothing is left to do."""
