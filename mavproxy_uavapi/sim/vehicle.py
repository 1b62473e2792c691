"""The common part of all vehicles: sensors, home, sticks, outputs, modes, arming, and reports to the ground."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Mapping, Sequence
from typing import ClassVar, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .arming import REPORT_INTERVAL, Arming
from .battery import Battery
from .channels import NEUTRAL, Servos, Sticks
from .estimator import Estimator
from .events import Broadcast, Event, StatusTextEvent
from .fence import Fence
from .geodesy import Location, Ned, to_ned
from .mission import ALL_ITEMS, Item, Mission, State, home_item
from .mode import MissionMode, VehicleMode
from .options import Options
from .parameters import ParameterStore
from .physics import Body
from .reports import LocalTarget, Navigation
from .streams import GROUPS, RATE_PARAMETERS, Groups
from .weather import Weather

BOOT_TEXTS = (
    # Share of the time until the estimator is ready, and what SITL says then.
    (0.1, "EKF3 IMU0 initialised"),
    (0.3, "AHRS: EKF3 active"),
    (0.4, "EKF3 IMU0 tilt alignment complete"),
    (0.4, "EKF3 IMU0 MAG0 initial yaw alignment complete"),
    (0.8, "GPS 1: detected u-blox"),
    (1.0, "EKF3 IMU0 origin set"),
    (1.0, "EKF3 IMU0 is using GPS"),
)


VERSIONS = {
    "4.7": (4, 7, 3, mavlink.FIRMWARE_VERSION_TYPE_OFFICIAL),
    "4.6": (4, 6, 3, mavlink.FIRMWARE_VERSION_TYPE_OFFICIAL),
}
"""By `Options.firmware`: major, minor, patch and FIRMWARE_VERSION_TYPE."""
HOME_MOVES_AFTER = 0.5
"""Metres from home at which a disarmed plane or rover takes its new place for home."""


class FailsafeWatch(Protocol):
    """Failsafes of one vehicle."""

    active: bool
    """Whether the heartbeat says MAV_STATE_CRITICAL."""

    def update(self, dt: float) -> None:
        """Check everything; dt seconds have passed."""


class EmbeddedVehicle(Arming):
    """All state of one vehicle between two boots.

    Time is `now`, seconds since boot on the simulated clock. The vehicle reports to the ground through `events`; the
    owner empties it. A type of vehicle sets `modes`, `mode` and `failsafes`.
    """

    mav_type: ClassVar[int]
    firmware: ClassVar[str]
    """ArduPilot's name for it."""
    frame_text: ClassVar[str] = ""
    """What it says of its frame at boot and on request."""
    mission_commands: ClassVar[frozenset[int]] = ALL_ITEMS
    """The MAV_CMDs that a mission may have."""
    fence_storage: ClassVar[int] = 560
    """Bytes for the fence, by StorageManager.cpp; 8 for each item."""
    most_rally_points: ClassVar[int] = 46
    streams: ClassVar[Groups] = GROUPS
    reports_wind: ClassVar[bool] = False
    misses_radio: ClassVar[bool] = False
    """Whether it has a failsafe for the pilot's radio."""
    neutral_sticks: ClassVar[tuple[int, ...]] = NEUTRAL
    """What SITL's radio sends on channels 1 to 8 at first."""

    modes: Mapping[int, VehicleMode]
    mode: VehicleMode
    failsafes: FailsafeWatch

    def __init__(
        self, options: Options, parameters: ParameterStore, mission: Mission, seed: int, body: Body | None = None
    ) -> None:
        self.version = VERSIONS[options.firmware]
        major, minor, patch, _ = self.version
        firmware = f"{self.firmware} V{major}.{minor}.{patch} (embedded)"
        self.banner = (firmware, self.frame_text) if self.frame_text else (firmware,)
        self.parameters = parameters
        self.mission = mission
        self.events: deque[Event] = deque()
        self.now = 0.0
        self.station_heard_at: float | None = None  # the ground station of MAV_GCS_SYSID
        self.radio_lost_until = -math.inf
        self._steps = 0
        home = options.home
        start = Location(home.latitude, home.longitude, home.altitude)
        self.body = Body.at_rest(home.heading) if body is None else body
        self.weather = Weather(parameters)
        self.estimator = Estimator(start, options.ready_after, options.gps_noise, random.Random(seed))
        self.battery = Battery(parameters)
        self.fence = Fence(self)
        self.sticks = Sticks(self.neutral_sticks)
        self.servos = Servos(parameters)
        self.home: Location | None = None
        self.home_locked = False
        self.armed = False
        self._last_report = -REPORT_INTERVAL + 1.0
        self._switch: int | None = None
        banner = [(0.05, text) for text in self.banner]
        self._boot_texts = deque([*banner, *BOOT_TEXTS])
        mission.reset()

    # Reports to the ground station.

    def emit(self, event: Event) -> None:
        """Queue an event for the ground."""
        self.events.append(event)

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT of a MAV_SEVERITY."""
        self.events.append(StatusTextEvent(severity, text))

    def say_banner(self) -> None:
        """The firmware and frame, as at boot."""
        for text in self.banner:
            self.say(mavlink.MAV_SEVERITY_INFO, text)

    def rate_parameter(self, group: int) -> str:
        """The parameter with the rate of a MAV_DATA_STREAM, by its name in 4.7."""
        return "MAV1_" + RATE_PARAMETERS[group]

    # Derived state.

    @property
    def home_offset(self) -> Ned:
        """Home in NED metres from the EKF origin; before home is set, the origin."""
        if self.home is None or self.estimator.origin is None:
            return Ned(0.0, 0.0, 0.0)
        return to_ned(self.estimator.origin, self.home)

    @property
    def home_altitude(self) -> float:
        """Altitude of home in metres AMSL; before home is set, that of the start."""
        return (self.home or self.estimator.start).altitude

    @property
    def altitude(self) -> float:
        """Estimated metres above home."""
        return self.home_offset.down - self.estimator.position.down

    # What each type of vehicle says of itself.

    @property
    def on_ground(self) -> bool:
        """Whether the vehicle itself takes it that it stands on the ground."""
        raise NotImplementedError

    @property
    def base_mode(self) -> int:
        """MAV_MODE_FLAG bits of the heartbeat."""
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | self.mode.base_flags
        base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED if self.mode.navigates else 0
        return int(base | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0))

    @property
    def system_status(self) -> int:
        """MAV_STATE of the heartbeat."""
        if self.failsafes.active:
            return int(mavlink.MAV_STATE_CRITICAL)
        return int(mavlink.MAV_STATE_STANDBY if self.on_ground else mavlink.MAV_STATE_ACTIVE)

    @property
    def landed_state(self) -> int:
        """MAV_LANDED_STATE of EXTENDED_SYS_STATE."""
        if self.on_ground:
            return int(mavlink.MAV_LANDED_STATE_ON_GROUND)
        if self.mode.taking_off:
            return int(mavlink.MAV_LANDED_STATE_TAKEOFF)
        return int(mavlink.MAV_LANDED_STATE_LANDING if self.mode.landing else mavlink.MAV_LANDED_STATE_IN_AIR)

    @property
    def vtol_state(self) -> int:
        """MAV_VTOL_STATE of EXTENDED_SYS_STATE."""
        return int(mavlink.MAV_VTOL_STATE_UNDEFINED)

    @property
    def airspeed(self) -> float:
        """What VFR_HUD reports, m/s."""
        body, velocity = self.body, self.estimator.velocity
        return math.hypot(velocity.north - body.wind_north, velocity.east - body.wind_east)

    @property
    def throttle_percent(self) -> int:
        """What VFR_HUD reports."""
        raise NotImplementedError

    def servo_pulses(self) -> list[int]:
        """Outputs 1..16, microseconds."""
        raise NotImplementedError

    def navigation(self) -> Navigation | None:
        """What NAV_CONTROLLER_OUTPUT reports; None where nothing is sent."""
        raise NotImplementedError

    def local_target(self) -> LocalTarget | None:
        """What POSITION_TARGET_LOCAL_NED reports; None where nothing is sent."""
        return None

    def fly_guided_item(self, item: Item) -> bool:
        """Go to a guided mission item (`current` 2); False where the vehicle does not take it.

        ArduCopter takes a waypoint and a yaw, the others the place of any item.
        """
        raise NotImplementedError

    def take_fence(self, items: Sequence[Item]) -> None:
        """Obey a fence that was stored."""
        self.fence.items = items

    def change_altitude(self, item: Item) -> None:
        """Take a mission item that changes the height (`current` 3)."""

    # The back door for tests.

    def take_sticks(self) -> None:
        """A pilot who takes over in the air holds the throttle in the middle, not at the bottom."""
        if not self.on_ground:
            self.sticks.move(3, 1500)

    def arm_by_radio(self, throttle: int) -> bool:
        """The pilot arms in the present mode and moves the throttle stick (microseconds); False where it cannot."""
        if not self.arms_by_radio or not self.arm(forced=True):
            return False
        self.sticks.move(3, throttle)
        return True

    @property
    def arms_by_radio(self) -> bool:
        """Whether a pilot can arm in the present mode."""
        return not self.mode.navigates

    def obey_other_station(self, position: Ned | None, velocity: Ned | None) -> bool:
        """Take a GUIDED setpoint of another ground station; False outside GUIDED."""
        raise NotImplementedError

    # What the ground station or the vehicle itself can do.

    def set_servo(self, channel: int, pulse: int) -> bool:
        """Drive a free servo output; a STATUSTEXT says when it is not free."""
        if self.servos.set(channel, pulse):
            return True
        self.say(mavlink.MAV_SEVERITY_INFO, f"ServoRelayEvent: Channel {channel} is already in use")
        return False

    def set_home(self, home: Location, *, lock: bool) -> bool:
        """Move home; False before there is an EKF origin. A locked home is not moved by arming."""
        if self.estimator.origin is None:
            return False
        self.home = home
        self.mission.remember_home(home_item(home))
        self.home_locked = self.home_locked or lock
        self.emit(Broadcast("HOME_POSITION"))
        self.emit(Broadcast("GPS_GLOBAL_ORIGIN"))
        return True

    def set_home_here(self, *, lock: bool) -> bool:
        """Make the present position home; False without a position."""
        return self.estimator.ready and self.set_home(self.estimator.location, lock=lock)

    def set_mode(self, number: int) -> bool:
        """Change the mode; False with a STATUSTEXT that says why. While disarmed little is checked."""
        if number == self.mode.number:
            return True
        mode = self.modes.get(number)
        if mode is None:
            self.say(mavlink.MAV_SEVERITY_WARNING, f"No such mode {number}")
            return False
        refusal = self.mode_refusal(mode)
        if refusal is not None:
            self.say(mavlink.MAV_SEVERITY_WARNING, refusal)
            return False
        self.mode.leave()
        self.mode_left()
        self.mode = mode
        self.emit(Broadcast("HEARTBEAT"))
        return True

    def follow_home(self, *, standing: bool) -> None:
        """While disarmed home goes where the vehicle goes and then stands, until the ground station sets it."""
        if self.armed or self.home is None or self.home_locked or not self.estimator.ready:
            return
        if standing and math.dist(self.estimator.position[:2], self.home_offset[:2]) >= HOME_MOVES_AFTER:
            self.set_home_here(lock=False)

    def mode_refusal(self, mode: VehicleMode) -> str | None:
        """Enter the mode; the text that says why it cannot be, or None."""
        raise NotImplementedError

    def mode_left(self) -> None:
        """Called when the present mode has been left, before the new one takes over."""

    @property
    def mission_mode(self) -> MissionMode:
        """AUTO, current or not."""
        return next(mode for mode in self.modes.values() if isinstance(mode, MissionMode))

    def current_item(self, seq: int, *, begins: bool = False) -> bool:
        """Make seq the current mission item, at once while the mission is flown; begins is of `Mission.select`."""
        if not self.mission.select(seq, begins=begins):
            return False
        auto = self.mission_mode
        if self.mode is auto and self.mission.state is State.RUNNING:
            auto.jump_to(seq)
        return True

    # One control step.

    def step(self, dt: float) -> None:
        """Advance the vehicle by dt seconds. Call it with the same dt always: time is counted in steps."""
        self.sense(dt)
        self.housekeeping()
        self.failsafes.update(dt)
        self.move(dt)

    def move(self, dt: float) -> None:
        """Do what the mode says for dt seconds."""
        raise NotImplementedError

    def sense(self, dt: float) -> None:
        """Let dt seconds pass and estimate the state."""
        self._steps += 1
        self.now = self._steps * dt
        self.weather.change(dt)
        self.body.wind_north, self.body.wind_east = self.weather.at(-self.body.down)
        self.estimator.update(self.now, self.body, dt)

    def housekeeping(self) -> None:
        """Boot texts, origin and home, the periodic pre-arm report, the mode switch."""
        while self._boot_texts and self.now >= self._boot_texts[0][0] * self.estimator.ready_after:
            self.say(mavlink.MAV_SEVERITY_INFO, self._boot_texts.popleft()[1])
        if self.estimator.origin is None and self.estimator.ready:
            self.estimator.origin = self.estimator.start
            self.set_home_here(lock=False)
            self.say(mavlink.MAV_SEVERITY_INFO, f"Field Elevation Set: {self.home_altitude:.0f}m")
        if self.now - self._last_report >= REPORT_INTERVAL:
            self._last_report = self.now
            self.report_prearm()
        channel, names = self.mode_switch
        position = self.sticks.mode_switch(int(self.parameters[channel]), self.now)
        if self._switch is not None and position is not None and position != self._switch:
            self.set_mode(int(self.parameters[f"{names}{position}"]))
        self._switch = position

    mode_switch: ClassVar[tuple[str, str]] = ("FLTMODE_CH", "FLTMODE")
    """The parameter with the channel of the mode switch, and the one with the mode of each of its positions."""
