"""AUTO of a QuadPlane: take-off and landing on the lift motors."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...frames import item_target
from ...mission import Item
from ..demand import Demand
from ..modes.auto import Auto, AutoSubmode
from .frame import LiftFrame
from .landing import VtolLanding


class QuadAuto(Auto):
    """NAV_VTOL_TAKEOFF climbs by its altitude where it stands; the rest is flown on the wing."""

    _climb_to: float | None = None
    """The height of a take-off, metres NED."""
    _vtol_landing: VtolLanding | None = None

    def __init__(self, plane: LiftFrame) -> None:
        super().__init__(plane)
        self.quadplane = plane

    def enter(self, checked: bool) -> bool:
        self._climb_to = self._vtol_landing = None
        return super().enter(checked)

    def begin_item(self, item: Item) -> bool:
        plane = self.quadplane
        self._climb_to = self._vtol_landing = None
        if item.command == mavlink.MAV_CMD_NAV_VTOL_TAKEOFF:
            plane.mission.in_landing_sequence = False
            plane.hover.start()
            self.submode = AutoSubmode.HOLD
            self._climb_to = plane.estimator.position.down - item.z
            plane.navigator.go_to(plane.estimator.position._replace(down=self._climb_to))
            return True
        if item.command == mavlink.MAV_CMD_NAV_VTOL_LAND:
            target = item_target(plane, item)
            plane.mission.in_landing_sequence = True
            self.submode = AutoSubmode.HOLD
            height = plane.estimator.position.down
            self._vtol_landing = VtolLanding(plane, target._replace(down=height), target.down)
            return True
        return super().begin_item(item)

    def item_done(self, item: Item) -> bool:
        if item.command == mavlink.MAV_CMD_NAV_VTOL_TAKEOFF:
            climbed = self._climb_to is not None and self.plane.estimator.position.down <= self._climb_to + 0.1
            return self.plane.armed and climbed
        if item.command == mavlink.MAV_CMD_NAV_VTOL_LAND:
            return False
        return super().item_done(item)

    def _fly_item(self, dt: float) -> Demand:
        plane = self.quadplane
        if self._climb_to is not None:
            if not plane.armed:
                self._climb_to = plane.estimator.position.down - self.runner.item.z
            if not plane.lift_ready:
                return plane.hover.relax()
            plane.throttle_suppressed = False
            # A little higher, so that the height is passed and not only approached.
            return plane.hover.climb_to(self._climb_to - 1.0, dt)
        if self._vtol_landing is not None:
            return self._vtol_landing.step(dt) if plane.armed else plane.hover.relax()
        return super()._fly_item(dt)

    @property
    def taking_off(self) -> bool:
        return self._climb_to is not None or super().taking_off

    @property
    def landing(self) -> bool:
        return super().landing or (self._vtol_landing is not None and self._vtol_landing.descending)
