"""SMART_RTL: back along the way that the copter came, and land."""

from __future__ import annotations

from ...geodesy import Ned
from .rtl import Rtl, RtlStage

ABOVE_THE_END = 2.0
"""Metres above the end of the way, from where it lands."""


class SmartRtl(Rtl):
    """Returns from point to point of its `ReturnPath`, then lands by RTL_ALT_FINAL_M."""

    name = "SMART_RTL"
    number = 21

    _back: list[Ned]

    def enter(self, checked: bool) -> bool:
        return self.aircraft.return_path.is_known and super().enter(checked)

    def _plan(self) -> None:
        aircraft = self.aircraft
        self._back = aircraft.return_path.points()
        self._target, self.stage, self._planned = aircraft.position.stopping_point, RtlStage.RETURN, True
        aircraft.yaw.by_parameter(int(aircraft.parameters["WP_YAW_BEHAVIOR"]), returning=True)

    def _advance(self) -> None:
        if self.stage is not RtlStage.RETURN or not self.aircraft.arrived(self._target):
            return
        if not self._back:
            self._come_down()
            return
        point = self._back.pop()
        self._target = point if self._back else point._replace(down=point.down - ABOVE_THE_END)

    @property
    def target(self) -> Ned | None:
        return None if self.stage is RtlStage.LAND or not self._planned else self._target
