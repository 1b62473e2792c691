"""What a vehicle reports of itself, and what a verb may ask of that."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import REBOOTED, ModeChanged, NotArmed, Stale
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.telemetry.flight_modes import kind_of, mode_name, mode_names
from mavproxy_uavapi.core.telemetry.readings import GlobalPosition, LocalPosition, VehicleAttitude
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

mavlink = mavutil.mavlink

HOLDING_MODES = ("LOITER", "HOLD", "POSHOLD", "ALT_HOLD", "STOP", "RTL")  # what comes first in a vehicle's mode map
FRESH = 3.0  # s; no verb uses an older position


class ReportingVehicle:
    """One vehicle, as its telemetry shows it.

    Args:
        state: its state, which the host keeps up to date.
        clock: monotonic seconds, the clock of arrivals.
    """

    def __init__(self, state: VehicleState, clock: Callable[[], float]) -> None:
        self.state = state
        self.clock = clock

    @property
    def address(self) -> Address:
        """Its autopilot's MAVLink address."""
        return Address(self.state.system, self.state.component)

    @property
    def kind(self) -> str:
        """`copter`, `plane`, `rover` or `other`, by its own heartbeat."""
        return kind_of(self.state.vehicle_type)

    @property
    def mode(self) -> str:
        """The name of its flight mode; UNKNOWN before a heartbeat since the last boot."""
        return mode_name(self.state.vehicle_type, self.state.mode)

    @property
    def is_ready_to_arm(self) -> bool:
        """Whether its pre-arm checks pass, by SYS_STATUS; without a report of them it counts as ready."""
        present = self.state.recent_field("SYS_STATUS", "onboard_control_sensors_present")
        health = self.state.recent_field("SYS_STATUS", "onboard_control_sensors_health")
        if present is None:
            return False
        return not present & mavlink.MAV_SYS_STATUS_PREARM_CHECK or bool(health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)

    @property
    def has_position(self) -> bool:
        """Whether its estimator has an absolute horizontal position, by EKF_STATUS_REPORT.

        Without that report the pre-arm bit decides. With it, the bit alone is not enough: in STABILIZE ArduCopter
        sets the bit 20 s before its position is good enough for GUIDED.
        """
        flags = self.state.recent_field("EKF_STATUS_REPORT", "flags")
        if flags is None:
            return self.is_ready_to_arm
        return bool(flags & mavlink.EKF_POS_HORIZ_ABS) and not flags & mavlink.EKF_CONST_POS_MODE

    @property
    def height(self) -> float:
        """Metres above home; 0 while unknown."""
        position = self.state.position
        return 0.0 if position is None else position.alt

    def distance_home(self) -> float | None:
        """Horizontal metres to home; None while either place is unknown."""
        home, here = self.state.home, self.state.position
        return None if home is None or here is None else math.hypot(*offset(*here.place, *home.place))

    def position(self) -> GlobalPosition:
        """Where it is. Raises Stale as `fresh`."""
        return GlobalPosition.of(self.fresh("GLOBAL_POSITION_INT"))

    def local_position(self) -> LocalPosition:
        """Where it is in the EKF's frame. Raises Stale as `fresh`."""
        return LocalPosition.of(self.fresh("LOCAL_POSITION_NED"))

    def attitude(self) -> VehicleAttitude:
        """How it is turned. Raises Stale as `fresh`."""
        return VehicleAttitude.of(self.fresh("ATTITUDE"))

    def fresh(self, name: str) -> Any:
        """The newest message of that name, if it is good enough for flight.

        Raises:
            Stale: there is none, or it is older than FRESH.
        """
        age = self.state.age(name, self.clock())
        if age is None or age > FRESH:
            age_text = "never received" if age is None else f"{age:.1f} s old"
            raise Stale(f"vehicle {self.state.system} does not report its position ({name}: {age_text})")
        return self.state.messages[name].message

    @property
    def holding_mode(self) -> str:
        """The mode in which a vehicle of its type stays where it is, by itself."""
        names = mode_names(self.state.vehicle_type)
        return next((mode for mode in HOLDING_MODES if mode in names), self.mode)

    @property
    def holding_modes(self) -> Collection[str]:
        """The modes that can be its holding mode."""
        return {self.holding_mode}

    @property
    def circles(self) -> bool:
        """Whether it circles in its holding mode, and does not stand."""
        return False

    @property
    def stands(self) -> bool:
        """Whether it is on the ground, and stays there unless somebody commands it."""
        return bool(self.state.landed)

    @property
    def is_under_way(self) -> bool:
        """Whether it is armed and flies, whoever commands it."""
        return bool(self.state.armed and not self.state.landed)

    def require_armed(self) -> None:
        """Raise NotArmed unless the vehicle is armed."""
        if not self.state.armed:
            raise NotArmed("the vehicle is not armed; `arm` it first")

    def require_mode(self, mode: str) -> None:
        """Raise ModeChanged unless the vehicle is in that mode."""
        if self.mode != mode:
            raise ModeChanged(f"the vehicle is in {self.mode}, not in {mode}; `{mode.lower()}` gets it there")

    def held_by(self, mode: str) -> None:
        """Raise NotArmed if the vehicle was disarmed, ModeChanged if the pilot or a failsafe switched its mode."""
        if self.state.armed is None:
            raise NotArmed(REBOOTED)
        if not self.state.armed:  # the mode comes second: a reboot changes both
            raise NotArmed("the vehicle was disarmed meanwhile" + ("" if self.mode == mode else f", in {self.mode}"))
        if self.mode != mode:
            raise ModeChanged(f"the vehicle left {mode}: the pilot or a failsafe switched it to {self.mode}")
