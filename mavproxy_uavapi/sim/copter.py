"""The vehicle without its radio: modes, arming, failsafes and the control loop of one ArduCopter."""

from __future__ import annotations

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from . import arming
from .aircraft import Aircraft
from .events import Broadcast
from .failsafes import Failsafes
from .mission import Mission, State
from .modes import Guided, Mode, build
from .options import Options
from .parameters import ParameterStore

FIRMWARE = "ArduCopter V4.6.0 (embedded)"


class SimulatedCopter(Aircraft):
    """An aircraft with its flight modes and what chooses among them: the ground, the pilot's switch, failsafes."""

    def __init__(self, options: Options, parameters: ParameterStore, mission: Mission, seed: int) -> None:
        super().__init__(options, parameters, mission, seed)
        self.failsafes = Failsafes(self)
        self._idle_since = 0.0
        self._last_report = -arming.REPORT_INTERVAL + 1.0
        self._switch: int | None = None
        self._boot_texts = deque(_BOOT_TEXTS)
        self.modes = build(self)
        self.mode: Mode = self.modes[0]
        self.mode.enter(checked=False)

    def say_banner(self) -> None:
        """The firmware and frame, as at boot."""
        self.say(mavlink.MAV_SEVERITY_INFO, FIRMWARE)
        self.say(mavlink.MAV_SEVERITY_INFO, "Frame: QUAD/PLUS")

    @property
    def guided(self) -> Guided:
        """The GUIDED mode, current or not."""
        mode = self.modes[Guided.number]
        assert isinstance(mode, Guided)
        return mode

    def set_mode(self, number: int) -> bool:
        """Change the flight mode; False with a STATUSTEXT that says why. While disarmed nothing is checked."""
        if number == self.mode.number:
            return True
        mode = self.modes.get(number)
        if mode is None:
            self.say(mavlink.MAV_SEVERITY_WARNING, f"No such mode {number}")
            return False
        reason = self._mode_refusal(mode)
        if reason is not None:
            self.say(mavlink.MAV_SEVERITY_WARNING, f"Mode change to {mode.name} failed: {reason}")
            return False
        self.mode.leave()
        if not self.mode.positions:
            self.relax()
        self.mode = mode
        self.tell(Broadcast("HEARTBEAT"))
        return True

    def _mode_refusal(self, mode: Mode) -> str | None:
        if self.armed:
            throttle = self.sticks.throttle(self.now)
            if self.landed and mode.manual_throttle and not self.mode.manual_throttle and throttle > 0.2:
                return "throttle too high"
            if mode.needs_position and not self.estimator.ready:
                return "requires position"
        return None if mode.enter(checked=self.armed) else "init failed"

    def arm(self, *, forced: bool) -> bool:
        """Arm the motors; False with STATUSTEXTs that say why not."""
        if self.armed:
            return True
        if not (forced and not arming.mandatory_failures(self, self.mode)):
            failures = arming.prearm_failures(self, self.mode) or arming.arm_failures(self, self.mode)
            for failure in failures:
                self.say(mavlink.MAV_SEVERITY_CRITICAL, f"Arm: {failure}")
            if failures:
                return False
        self.arm_motors()
        self._idle_since = self.now
        return True

    def disarm(self, *, forced: bool) -> bool:
        """Disarm for the ground station; refused (False) in the air unless forced."""
        if self.armed and not self.landed and not forced:
            return False
        self.disarm_landed()
        return True

    def report_prearm(self) -> None:
        """Tell the ground what keeps the vehicle from arming."""
        for failure in arming.prearm_failures(self, self.mode):
            self.say(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {failure}")

    # The control loop.

    def step(self, dt: float) -> None:
        """Advance the vehicle by dt seconds. Call it with the same dt always: time is counted in steps."""
        self.sense(dt)
        self._housekeeping()
        self.failsafes.update(dt)
        self._update_auto_armed()
        self.obey(self.mode.step(dt), dt)
        self._disarm_when_forgotten()

    def _housekeeping(self) -> None:
        """Boot texts, origin and home, the periodic pre-arm report, the mode switch."""
        while self._boot_texts and self.now >= self._boot_texts[0][0] * self.estimator.ready_after:
            self.say(mavlink.MAV_SEVERITY_INFO, self._boot_texts.popleft()[1])
        if self.estimator.origin is None and self.estimator.ready:
            self.estimator.origin = self.estimator.start
            self.set_home_here(lock=False)
            self.say(mavlink.MAV_SEVERITY_INFO, f"Field Elevation Set: {self.home_altitude:.0f}m")
        if self.now - self._last_report >= arming.REPORT_INTERVAL:
            self._last_report = self.now
            self.report_prearm()
        position = self.sticks.mode_switch(int(self.parameters["FLTMODE_CH"]), self.now)
        if self._switch is not None and position is not None and position != self._switch:
            self.set_mode(int(self.parameters[f"FLTMODE{position}"]))
        self._switch = position

    def _update_auto_armed(self) -> None:
        throttle = self.sticks.throttle(self.now)
        if not self.armed:
            self.auto_armed = False
        elif throttle > 0:
            self.auto_armed = True
        elif self.mode.manual_throttle and self.landed:
            self.auto_armed = False

    def _disarm_when_forgotten(self) -> None:
        """DISARM_DELAY: armed, on the ground, motors at idle and the throttle stick down."""
        delay = self.parameters["DISARM_DELAY"]
        waiting = self.armed and self.landed and self.spooled_down and self.sticks.throttle(self.now) == 0
        if not waiting or delay <= 0:
            self._idle_since = self.now
        elif self.now - self._idle_since >= delay:
            self.disarm_landed()

    def current_item(self, seq: int) -> bool:
        """Make seq the current mission item, at once when the mission is being flown."""
        if not self.mission.select(seq):
            return False
        auto = self.modes[3]
        if self.mode is auto and self.armed and self.mission.state is State.RUNNING:
            auto.jump_to(seq)  # type: ignore[attr-defined]
        return True


_BOOT_TEXTS = (
    # Share of the time until the estimator is ready, and what SITL says then.
    (0.05, FIRMWARE),
    (0.05, "Frame: QUAD/PLUS"),
    (0.1, "EKF3 IMU0 initialised"),
    (0.3, "AHRS: EKF3 active"),
    (0.4, "EKF3 IMU0 tilt alignment complete"),
    (0.4, "EKF3 IMU0 MAG0 initial yaw alignment complete"),
    (0.8, "GPS 1: detected u-blox"),
    (1.0, "EKF3 IMU0 origin set"),
    (1.0, "EKF3 IMU0 is using GPS"),
)
