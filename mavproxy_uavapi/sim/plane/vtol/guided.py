"""GUIDED of a QuadPlane: it takes off on its lift motors, and hovers there until it gets a target."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...geodesy import Ned
from ..demand import Demand
from ..modes.guided import Guided
from .frame import LiftFrame


class QuadGuided(Guided):
    """A place is flown to and circled on the wing, as a plane does it."""

    _place: Ned | None = None
    """Where it takes off to and hovers."""
    _climbing = False

    def __init__(self, plane: LiftFrame) -> None:
        super().__init__(plane)
        self.quadplane = plane

    def take_off(self, climb: float) -> bool:
        """MAV_CMD_NAV_TAKEOFF by so many metres; False with a text that says why not."""
        plane = self.quadplane
        refusal = None
        if not plane.armed:
            refusal = "Must be armed for takeoff"
        elif plane.body.airborne:
            refusal = "Already flying - no takeoff"
        if refusal is not None:
            plane.say(mavlink.MAV_SEVERITY_INFO, refusal)
            return False
        here = plane.estimator.position
        plane.hover.start()
        self._place, self._climbing = here._replace(down=here.down - climb), True
        plane.navigator.go_to(self._place)
        plane.throttle_suppressed = False
        plane.say(mavlink.MAV_SEVERITY_INFO, "VTOL Position1 d=0.0")
        return True

    def go_to(self, target: Ned, *, counter_clockwise: bool = False, radius: float = 0.0) -> None:
        self._place, self._climbing = None, False
        super().go_to(target, counter_clockwise=counter_clockwise, radius=radius)

    def step(self, dt: float) -> Demand:
        plane = self.quadplane
        if self._place is None:
            return super().step(dt)
        if not plane.armed:
            self._place = None
            return plane.hover.relax()
        if not plane.lift_ready:
            return plane.hover.relax()
        self._climbing = self._climbing and plane.estimator.position.down > self._place.down + 0.2
        return plane.hover.climb_to(plane.navigator.target.down, dt)

    @property
    def climbing(self) -> bool:
        """Whether a take-off is under way; EXTENDED_SYS_STATE then says "transition"."""
        return self._climbing
