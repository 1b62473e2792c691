"""The rover that the modes drive: its state and its reaction to their demands."""

from __future__ import annotations

import math
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..channels import STEERING_FUNCTION, THROTTLE_FUNCTION
from ..geodesy import Location
from ..mission import Mission
from ..options import Options
from ..parameters import ParameterStore
from ..return_path import ReturnPath
from ..vehicle import EmbeddedVehicle
from .body import CarBody
from .drive import COAST, Drive
from .navigator import FASTEST, Navigator, grip

WHEELS_TURN = 10.0
"""rad/s/s; as fast as the wheels can be turned."""
FULL_SPEED, FULL_ACCELERATION = 20.0, 10.0
"""m/s that SITL's rover reaches with full throttle, whatever CRUISE_THROTTLE says, and m/s/s at a stand."""


class Chassis(EmbeddedVehicle):
    """All of a rover but its modes and what chooses among them."""

    body: CarBody

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed, CarBody.at_rest(options.home.heading))
        self.navigator = Navigator(parameters, self.estimator, self.body)
        self.return_path = ReturnPath(parameters)
        self._drive = COAST
        self._faster = 0.0
        """m/s/s of the last step."""

    @property
    def top_speed(self) -> float:
        """m/s at full throttle: SPEED_MAX, or what CRUISE_SPEED at CRUISE_THROTTLE makes of it."""
        parameters = self.parameters
        if parameters["SPEED_MAX"] > 0:
            return min(parameters["SPEED_MAX"], FASTEST)
        share = parameters["CRUISE_THROTTLE"] / 100
        cruise = parameters["CRUISE_SPEED"]
        return max(0.0, min(cruise / share if 0.05 <= share <= 1 else cruise, FASTEST))

    @property
    def throttle_share(self) -> float:
        """Motor output -1..1."""
        if not self.armed or self._drive == COAST:
            return 0.0
        if self._drive.rolls:
            return max(-1.0, min(1.0, self._drive.speed / max(self.top_speed, 0.1)))
        return max(-1.0, min(1.0, self.body.speed / FULL_SPEED + self._faster / FULL_ACCELERATION))

    @property
    def throttle_percent(self) -> int:
        return round(abs(100 * self.throttle_share))

    @property
    def airspeed(self) -> float:
        """Without an airspeed sensor VFR_HUD has the ground speed."""
        return math.hypot(self.estimator.velocity.north, self.estimator.velocity.east)

    def servo_pulses(self) -> list[int]:
        most = grip(self.parameters).turn_rate
        steering = max(-1.0, min(1.0, self._drive.turn_rate / most)) if self.armed else 0.0
        return self.servos.driven(
            {
                STEERING_FUNCTION: 1500 + round(500 * steering),
                THROTTLE_FUNCTION: 1500 + round(500 * self.throttle_share),
            }
        )

    def set_home(self, home: Location, *, lock: bool) -> bool:
        if not super().set_home(home, lock=lock):
            return False
        if not lock:
            return True
        place = f"{home.latitude:.6f} {home.longitude:.6f} at {home.altitude:.2f}m"
        self.say(mavlink.MAV_SEVERITY_INFO, f"Set HOME to {place}")
        return True

    def arm_motors(self) -> None:
        self.armed = True
        self.return_path.begin(self.estimator.position)
        self.say(mavlink.MAV_SEVERITY_INFO, "Throttle armed")

    def disarm_now(self) -> None:
        if not self.armed:
            return
        self.armed = False
        if self.mode is not self.mission_mode:
            self.mission.reset()
        self.say(mavlink.MAV_SEVERITY_INFO, "Throttle disarmed")

    def obey(self, drive: Drive, dt: float) -> None:
        """Drive for dt seconds as the mode demands; disarmed it rolls on."""
        self._drive = drive if self.armed else COAST
        body, limits = self.body, grip(self.parameters)
        before = body.speed
        if self._drive.rolls:
            # Only the steering controller heeds ATC_TURN_MAX_G and ATC_STR_ACC_MAX.
            free = replace(limits, lateral=math.inf, turn_acceleration=WHEELS_TURN)
            body.throttle(self._drive.speed, self._drive.turn_rate, free, dt)
        else:
            body.drive(self._drive.speed, self._drive.turn_rate, limits, dt)
        self._faster = (body.speed - before) / dt
        self.battery.drive(abs(self.throttle_share), dt)

    def remember(self) -> None:
        """Keep the way back, and home while disarmed."""
        if self.armed:
            self.return_path.add(self.estimator.position)
        self.follow_home(standing=self.body.speed == 0)
