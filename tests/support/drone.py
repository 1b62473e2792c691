"""A small scripted copter at the other end of the host's link: quicker, and more obedient, than the simulator."""

from __future__ import annotations

import asyncio
import math
from collections import defaultdict, deque
from collections.abc import Callable
from itertools import count
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.link.messages import FORCE_DISARM, POSITION_IGNORED, VELOCITY_IGNORED
from tests.support.drone_parameters import PARAMETERS
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink

LATENCY = 0.02  # s, each way together
HOME = (-35.0, 149.0)  # degrees
METRES_PER_DEGREE = 111318.84502145034
MODES = mavutil.mode_mapping_byname(mavlink.MAV_TYPE_QUADROTOR)
NAMES = {number: name for name, number in MODES.items()}
ALL_GOOD = 0x7FFFFFFF
EKF_GOOD = mavlink.EKF_ATTITUDE | mavlink.EKF_POS_HORIZ_ABS | mavlink.EKF_POS_VERT_ABS
SPEEDS = {"horizontal": 10.0, "up": 2.5, "down": 1.5}
STATES, MOTION = ("HEARTBEAT", "EXTENDED_SYS_STATE"), ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ATTITUDE")
OFTEN = (*STATES, "EKF_STATUS_REPORT", *MOTION)
ALL = (*STATES, "SYS_STATUS", "EKF_STATUS_REPORT", "GPS_RAW_INT", *MOTION, "VFR_HUD")
SELDOM = 4  # of so many rounds one tells all
BOOT_TIME = 1.0  # s from a reboot to the first word
MISSION_SPEED = 2.0  # m/s northwards, in AUTO


class Drone:
    """A scripted copter: obeys commands after LATENCY, flies straight at its target, tells where it is.

    Attributes:
        received: the messages that reached it, oldest first.
        answers: results by MAV_CMD, given one after the other instead of obeying; the last one stays.
            None is silence, a tuple is several acks in one go.
        deaf: MAV_CMDs that it obeys without acknowledging, as if the ack had been lost.
        says: texts by MAV_CMD, said with the ack.
        mute: message names that it does not tell.
        stuck: whether it never gets anywhere.
        disarm_delay: s after which it disarms by itself on the ground.
        mute_requests: whether it does not answer for its target.
    """

    def __init__(self, loop: FastLoop, receive: Callable[[Any], None], system: int = 1) -> None:
        self._loop, self._receive = loop, receive
        self.system = system
        self.received: list[Any] = []
        self.answers: defaultdict[int, list[Any]] = defaultdict(list)
        self.deaf: set[int] = set()
        self.says: dict[int, list[str]] = {}
        self.mute: set[str] = set()
        self.parameters = dict(PARAMETERS)
        self.stuck = self.mute_requests = False
        self.disarm_delay = math.inf
        self.mode, self.armed, self.landed = "STABILIZE", False, mavlink.MAV_LANDED_STATE_ON_GROUND
        self.ready = True
        self.at = [0.0, 0.0, 0.0]
        self.velocity = [0.0, 0.0, 0.0]
        self.yaw = self.yaw_rate = 0.0  # rad, rad/s
        self.home = HOME
        self.target: list[float] | None = None
        self.moving: list[float] | None = None  # the velocity that it was told (m/s)
        self.paused = self.lifting = False
        self._setpoint_at = self._idle_since = self._booted_at = 0.0
        self._sequence = 0
        self._arriving: deque[Any] = deque()
        self._stream: asyncio.Task[None] | None = None

    # -- what a test does with it -----------------------------------------------------------------------

    def power_on(self) -> None:
        """Begin to send telemetry, four times a second, some of it once; the first round, of all, at once."""
        self.tell_all()
        self._stream = self._loop.create_task(self._run())

    def power_off(self) -> None:
        """Fall silent for good."""
        if self._stream is not None:
            self._stream.cancel()

    def fly(self, mode: str = "GUIDED", at: tuple[float, float, float] = (0.0, 0.0, -20.0)) -> None:
        """Be armed in the air, at a place in NED."""
        self.mode, self.armed, self.landed = mode, True, mavlink.MAV_LANDED_STATE_IN_AIR
        self.at = list(at)
        self.tell_all()

    def pilot(self, mode: str) -> None:
        """The pilot switches the mode; the heartbeat that shows it comes at once."""
        self._switch(mode)
        self.tell("HEARTBEAT")

    def reboot(self) -> None:
        """Start anew: disarmed, in STABILIZE, on the ground below."""
        self._switch("STABILIZE")
        self.armed, self.landed = False, mavlink.MAV_LANDED_STATE_ON_GROUND
        self.at[2], self.velocity, self.yaw_rate = 0.0, [0.0, 0.0, 0.0], 0.0
        self._booted_at = self._loop.time() - BOOT_TIME

    def say(self, text: str, **fields: Any) -> None:
        """STATUSTEXT."""
        self.send("statustext", text=text, **fields)

    def send(self, name: str, component: int = 1, **fields: Any) -> None:
        """Send one message."""
        self._sequence += 1
        self._receive(message_of(name, self.system, component, self._sequence, **fields))

    def commands(self, number: int | None = None) -> list[Any]:
        """COMMAND_LONGs that it got, of one MAV_CMD or all."""
        commands = [message for message in self.received if message.get_type() == "COMMAND_LONG"]
        return [message for message in commands if number in (None, message.command)]

    def setpoints(self) -> list[Any]:
        """SET_POSITION_TARGET_* that it got."""
        return [message for message in self.received if message.get_type().startswith("SET_POSITION_TARGET")]

    def orders(self) -> list[Any]:
        """All that it got but for questions: reads of parameters, requests and intervals of messages."""
        asking = {mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL}
        return [
            message
            for message in self.received
            if message.get_type() != "PARAM_REQUEST_READ" and getattr(message, "command", None) not in asking
        ]

    def place(self, at: tuple[float, float]) -> tuple[int, int]:
        """Latitude and longitude (1e-7 degrees) of a place north and east of home."""
        lat = self.home[0] + at[0] / METRES_PER_DEGREE
        lon = self.home[1] + at[1] / METRES_PER_DEGREE / math.cos(math.radians((self.home[0] + lat) / 2))
        return round(lat * 1e7), round(lon * 1e7)

    # -- telemetry --------------------------------------------------------------------------------------

    def tell_all(self) -> None:
        """One round of telemetry."""
        self._tell(ALL)

    def _tell(self, names: tuple[str, ...]) -> None:
        tables = self._telemetry()
        for name in names:
            self.tell(name, tables)

    def tell(self, name: str, tables: dict[str, dict[str, Any]] | None = None) -> None:
        """Send one telemetry message."""
        if name not in self.mute:
            self.send(name, **(tables or self._telemetry())[name])

    def _telemetry(self) -> dict[str, dict[str, Any]]:
        boot_ms = round((self._loop.time() - self._booted_at) * 1000)
        x, y, z = self.at
        vx, vy, vz = self.velocity
        lat, lon = self.place((x, y))
        in_air = self.landed != mavlink.MAV_LANDED_STATE_ON_GROUND
        health = ALL_GOOD if self.ready else ALL_GOOD & ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
        return {
            "HEARTBEAT": {
                "mode": self.mode,
                "armed": self.armed,
                "system_status": mavlink.MAV_STATE_ACTIVE if in_air else mavlink.MAV_STATE_STANDBY,
            },
            "EXTENDED_SYS_STATE": {"landed_state": self.landed},
            "SYS_STATUS": {
                "onboard_control_sensors_present": ALL_GOOD,
                "onboard_control_sensors_enabled": ALL_GOOD,
                "onboard_control_sensors_health": health,
                "voltage_battery": 12600,
                "current_battery": -1,
                "battery_remaining": 87,
            },
            "EKF_STATUS_REPORT": {"flags": EKF_GOOD if self.ready else mavlink.EKF_CONST_POS_MODE},
            "GPS_RAW_INT": {
                "fix_type": 6,
                "lat": lat,
                "lon": lon,
                "alt": 600000,
                "vel": 65535,
                "cog": 9000,
                "satellites_visible": 255,
            },
            "GLOBAL_POSITION_INT": {
                "time_boot_ms": boot_ms,
                "lat": lat,
                "lon": lon,
                "alt": round(584000 - z * 1000),
                "relative_alt": round(-z * 1000),
                "vx": round(vx * 100),
                "vy": round(vy * 100),
                "vz": round(vz * 100),
                "hdg": 65535,
            },
            "LOCAL_POSITION_NED": {
                "time_boot_ms": boot_ms, "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz,
            },
            "ATTITUDE": {
                "time_boot_ms": boot_ms, "yaw": self.yaw, "roll": math.radians(10), "yawspeed": self.yaw_rate,
            },
            "VFR_HUD": {"airspeed": 1.5, "groundspeed": 2.5, "heading": 90, "throttle": 40, "alt": 604.0},
        }  # fmt: skip

    async def _run(self) -> None:
        for number in count(1):
            await asyncio.sleep(0.25)
            self._move(0.25)
            self._tell(ALL if number % SELDOM == 0 else OFTEN)

    def _move(self, seconds: float) -> None:
        before = list(self.at)
        if self.armed and self.mode in ("LAND", "RTL"):
            goal = [0.0, 0.0, 0.0] if self.mode == "RTL" else [self.at[0], self.at[1], 0.0]
            self._towards(goal, seconds)
            if self.at[2] > -0.01:
                self.armed, self.landed = False, mavlink.MAV_LANDED_STATE_ON_GROUND
        elif self.armed and not self.paused:
            self._fly(seconds)
        self.velocity = [(now - then) / seconds for now, then in zip(self.at, before, strict=True)]
        self._disarm_idle()

    def _fly(self, seconds: float) -> None:
        """By its target, its velocity or its mission; from the ground by a takeoff only."""
        stands = self.landed == mavlink.MAV_LANDED_STATE_ON_GROUND and not self.lifting
        if self.mode == "AUTO" and not stands:
            self.at[0] += MISSION_SPEED * seconds
        if self.mode != "GUIDED" or stands:
            return
        if self.target is not None:
            self._towards(self.target, seconds)
        elif self.moving is not None and self._loop.time() - self._setpoint_at < self.parameters["GUID_TIMEOUT"]:
            self.at = [here + speed * seconds for here, speed in zip(self.at, self.moving, strict=True)]
        if self.at[2] >= 0.0 and not self.lifting:
            self.at[2], self.landed = 0.0, mavlink.MAV_LANDED_STATE_ON_GROUND
        elif self.lifting and self.target is not None:
            self.lifting = self.at[2] > self.target[2] + 0.01
            if not self.lifting:
                self.landed = mavlink.MAV_LANDED_STATE_IN_AIR
            elif self.at[2] < -0.2:
                self.landed = mavlink.MAV_LANDED_STATE_TAKEOFF

    def _disarm_idle(self) -> None:
        now = self._loop.time()
        if not self.armed or self.lifting or self.landed != mavlink.MAV_LANDED_STATE_ON_GROUND:
            self._idle_since = now
        elif now - self._idle_since >= self.disarm_delay:
            self.armed = False

    def _towards(self, goal: list[float], seconds: float) -> None:
        if self.stuck:
            return
        north, east = goal[0] - self.at[0], goal[1] - self.at[1]
        distance = math.hypot(north, east)
        share = min(1.0, SPEEDS["horizontal"] * seconds / distance) if distance else 0.0
        down = goal[2] - self.at[2]
        rate = SPEEDS["down"] if down > 0 else SPEEDS["up"]
        self.at[0] += north * share
        self.at[1] += east * share
        self.at[2] += max(-rate * seconds, min(rate * seconds, down))

    # -- what it is told --------------------------------------------------------------------------------

    def on_send(self, message: Any, system: int) -> None:
        """FakeLink's `on_send`."""
        message.pack(mavlink.MAVLink(None, 255, 230))  # whatever is sent must fit into its fields
        if system != self.system:
            return
        if message.get_type() == "TIMESYNC":
            self._loop.call_later(LATENCY, self._tell_clock, message.ts1)
            return
        assert message.target_system == self.system
        self.received.append(message)
        self._arriving.append(message)
        self._loop.call_later(LATENCY, self._take_next)

    def _tell_clock(self, asked_at: int) -> None:
        if self._stream is not None and not self._stream.done():
            self.send("timesync", tc1=round((self._loop.time() - self._booted_at) * 1e9) or 1, ts1=asked_at)

    def _take_next(self) -> None:
        """The messages arrive in their order, also those of one moment: a timer's is not."""
        self._take(self._arriving.popleft())

    def _take(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "COMMAND_LONG":
            self._take_command(message)
        elif kind == "PARAM_REQUEST_READ" and message.param_id in self.parameters:
            self._tell_parameter(message.param_id)
        elif kind == "PARAM_SET" and message.param_id in self.parameters:
            self.parameters[message.param_id] = message.param_value
            self._tell_parameter(message.param_id)
        elif kind.startswith("SET_POSITION_TARGET"):
            self._take_setpoint(message)

    def _tell_parameter(self, name: str) -> None:
        self.send("param_value", param_id=name, param_value=self.parameters[name])

    def _take_setpoint(self, message: Any) -> None:
        if self.mode != "GUIDED" or not self.armed:
            return
        self.yaw_rate, self.lifting, self._setpoint_at = message.yaw_rate, False, self._loop.time()
        if self.landed == mavlink.MAV_LANDED_STATE_TAKEOFF:
            self.landed = mavlink.MAV_LANDED_STATE_IN_AIR
        if message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE:
            self.target, self.moving = None, [message.vx, message.vy, message.vz]
        elif message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            self.target, self.moving = [message.x, message.y, message.z], None
        else:
            north = (message.lat_int / 1e7 - self.home[0]) * METRES_PER_DEGREE
            east = (message.lon_int / 1e7 - self.home[1]) * METRES_PER_DEGREE
            self.target = [north, east * math.cos(math.radians(self.home[0])), -message.alt]
            self.moving = None

    def _take_command(self, message: Any) -> None:
        number = message.command
        for text in self.says.get(number, []):
            self.say(text)
        if self.answers[number]:
            answers = self.answers[number]
            results = answers.pop(0) if len(answers) > 1 else answers[0]
            for result in results if isinstance(results, tuple) else (results,):
                if result is not None:
                    self.acknowledge(number, result)
            return
        obeyed = self._obey(message)
        if number not in self.deaf:
            self.acknowledge(number, mavlink.MAV_RESULT_ACCEPTED if obeyed else mavlink.MAV_RESULT_FAILED)

    def acknowledge(self, number: int, result: int, component: int = 1, target: tuple[int, int] = (255, 230)) -> None:
        """COMMAND_ACK."""
        fields = {"target_system": target[0], "target_component": target[1]}
        self.send("command_ack", component, command=number, result=result, **fields)

    def _obey(self, message: Any) -> bool:
        number = message.command
        if not self._can(message):
            return False
        if number == mavlink.MAV_CMD_DO_SET_MODE:
            self._switch(NAMES[int(message.param2)])
            self.tell("HEARTBEAT")
        elif number == mavlink.MAV_CMD_MISSION_START:
            self._switch("AUTO")
            self.tell("HEARTBEAT")
        elif number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self._arm(bool(message.param1))
        elif number == mavlink.MAV_CMD_CONDITION_YAW:
            self.yaw = math.radians(message.param1)
        elif number == mavlink.MAV_CMD_NAV_TAKEOFF:
            self.target, self.lifting = [self.at[0], self.at[1], -message.param7], True
        elif number == mavlink.MAV_CMD_DO_PAUSE_CONTINUE:
            self.paused = not message.param1
        elif number == mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN:
            self._loop.call_later(BOOT_TIME, self.reboot)
        elif number == mavlink.MAV_CMD_REQUEST_MESSAGE and message.param1 == mavlink.MAVLINK_MSG_ID_HOME_POSITION:
            lat, lon = round(self.home[0] * 1e7), round(self.home[1] * 1e7)
            self.send("home_position", latitude=lat, longitude=lon, altitude=584000)
        elif number == mavlink.MAV_CMD_REQUEST_MESSAGE:
            self._tell_target(int(message.param1))
        return True

    def _can(self, message: Any) -> bool:
        """Whether ArduCopter would do that now."""
        number, on_ground = message.command, self.landed == mavlink.MAV_LANDED_STATE_ON_GROUND
        if number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            return self.ready if message.param1 else on_ground or message.param2 == FORCE_DISARM
        if number == mavlink.MAV_CMD_NAV_TAKEOFF:
            return self.mode == "GUIDED" and self.armed and on_ground
        if number == mavlink.MAV_CMD_DO_PAUSE_CONTINUE:
            return self.mode in ("GUIDED", "AUTO")
        if number == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            return self.mode in ("GUIDED", "AUTO", "RTL")
        return True

    def _arm(self, armed: bool) -> None:
        self.armed = armed
        if not armed:
            self.landed = mavlink.MAV_LANDED_STATE_ON_GROUND
        self.tell("HEARTBEAT")

    def _switch(self, mode: str) -> None:
        if mode != self.mode:
            self.mode, self.target, self.moving, self.paused, self.lifting = mode, None, None, False, False
            if self.landed == mavlink.MAV_LANDED_STATE_TAKEOFF:
                self.landed = mavlink.MAV_LANDED_STATE_IN_AIR

    def _tell_target(self, message_id: int) -> None:
        """What it flies: a place by POSITION_TARGET_GLOBAL_INT, a velocity by POSITION_TARGET_LOCAL_NED."""
        if self.mute_requests:
            return
        if message_id == mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED:
            x, y, z = self.moving or (0.0, 0.0, 0.0)
            mask = VELOCITY_IGNORED if self.moving is None else POSITION_IGNORED
            self.send("position_target_local_ned", coordinate_frame=1, type_mask=mask, vx=x, vy=y, vz=z)
        elif message_id == mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT and self.target is not None:
            lat, lon = self.place((self.target[0], self.target[1]))
            self.send(
                "position_target_global_int",
                coordinate_frame=mavlink.MAV_FRAME_GLOBAL,
                type_mask=VELOCITY_IGNORED,
                lat_int=lat,
                lon_int=lon,
                alt=584.0 - self.target[2],
            )
