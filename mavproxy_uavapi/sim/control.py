"""The control protocol for tests: a JSON object per line in, one per line out.

Operations::

    {"op": "fault", "name": NAME, ...}   NAME and its fields below
    {"op": "clear"}                      end all faults
    {"op": "state"}                      the truth about the vehicle
    {"op": "received", "since": N}       what ground links have sent, after index N
    {"op": "parameter", "name": NAME, "value": X}   set a parameter; ground stations are not told

Faults: `silence` (seconds, sending, receiving), `lose_acks` (command, count), `delay_acks` (command, count,
seconds), `foreign_ack` (command, count, result, system, component), `refuse` (command, count, result, text),
`in_progress` (command, count, seconds), `drop` (message, command, count), `nan` (message, fields, seconds),
`freeze_gps` (seconds), `radio_loss` (seconds; copters), `low_battery` (voltage), `pilot_mode` (mode),
`pilot_sticks` (roll, pitch, throttle, yaw in microseconds), `pilot_arm` (throttle in microseconds), `pilot_disarm`,
`other_station` (position or velocity), `reboot`, `ekf_bad` (seconds).
`command` is a MAV_CMD number or "all", `message` a MAVLink name; seconds are simulated ones and default to "until
cleared". `drop` loses messages on their way to the vehicle. `nan` sends NaN in the named fields of a message, or in
all of its float fields. `pilot_arm` arms by radio in the present mode, with all checks off that can be, and raises
the throttle. `other_station` is a GUIDED setpoint of another ground station, [north, east, down] in metres from the
EKF origin or in m/s.

Every answer has "ok"; if it is false, "error" says why. "received" does not list what is sent while the vehicle hears
nothing, what is dropped, nor what the other station sends. As in ArduPilot, a low battery that has triggered its
failsafe stays low until a reboot.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from .channels import MOTOR_FUNCTIONS
from .faults import FaultError
from .geodesy import Ned, from_ned
from .simulator import ReceivedMessage, Simulator

_IDLE = dict.fromkeys(MOTOR_FUNCTIONS, 1000)
LOW_VOLTAGE = 9.9
CLIMBING_THROTTLE = 1700
"""Microseconds of the throttle stick that climb in STABILIZE, ALT_HOLD and LOITER."""


class Control:
    """Executes the operations on one simulator."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._operations: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "fault": self._fault,
            "clear": self._clear,
            "state": self._state,
            "received": self._received,
            "parameter": self._parameter,
        }
        self._faults: dict[str, Callable[[Mapping[str, Any]], None]] = {
            "silence": self._silence,
            "freeze_gps": self._freeze_gps,
            "radio_loss": self._radio_loss,
            "low_battery": self._low_battery,
            "pilot_mode": self._pilot_mode,
            "pilot_sticks": self._pilot_sticks,
            "pilot_arm": self._pilot_arm,
            "pilot_disarm": self._pilot_disarm,
            "other_station": self._other_station,
            "nan": self._nan,
            "reboot": self._reboot,
            "ekf_bad": self._ekf_bad,
        }

    def handle_line(self, line: str) -> str:
        """Answer one line (without its end); no content of a line makes it raise."""
        try:
            request = json.loads(line)
        except ValueError as error:
            return json.dumps({"ok": False, "error": f"{type(error).__name__}: {error}"})
        return json.dumps(self.handle(request), default=_as_json)

    def handle(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Do one operation; no content of it makes it raise."""
        try:
            return {"ok": True, **self._operations[request["op"]](request)}
        except (KeyError, TypeError, ValueError) as error:
            return {"ok": False, "error": f"{type(error).__name__}: {error}"}

    def _fault(self, request: Mapping[str, Any]) -> dict[str, Any]:
        name = request["name"]
        if name in self._faults:
            self._faults[name](request)
        else:
            self._simulator.faults.add(name, request)
        return {}

    def _clear(self, request: Mapping[str, Any]) -> dict[str, Any]:
        self._simulator.faults.clear()
        self._simulator.vehicle.battery.forced_voltage = None
        self._simulator.vehicle.estimator.blind_until = -math.inf
        self._simulator.vehicle.radio_lost_until = -math.inf
        return {}

    def _silence(self, request: Mapping[str, Any]) -> None:
        self._simulator.faults.silence(
            self._simulator.vehicle.now,
            _seconds(request),
            sending=bool(request.get("sending", True)),
            receiving=bool(request.get("receiving", True)),
        )

    def _freeze_gps(self, request: Mapping[str, Any]) -> None:
        self._simulator.faults.freeze_gps(self._simulator.vehicle.now, _seconds(request))

    def _radio_loss(self, request: Mapping[str, Any]) -> None:
        vehicle = self._simulator.vehicle
        if not vehicle.misses_radio:
            raise FaultError("this type has no failsafe for the radio here")
        vehicle.radio_lost_until = vehicle.now + _seconds(request)

    def _low_battery(self, request: Mapping[str, Any]) -> None:
        self._simulator.vehicle.battery.forced_voltage = float(request.get("voltage", LOW_VOLTAGE))

    def _pilot_mode(self, request: Mapping[str, Any]) -> None:
        vehicle = self._simulator.vehicle
        mode_name = str(request["mode"]).upper()
        numbers = [number for number, mode in vehicle.modes.items() if mode.name == mode_name]
        if not numbers:
            raise FaultError(f"no mode is called {mode_name}")
        vehicle.take_sticks()
        if not vehicle.set_mode(numbers[0]):
            raise FaultError(f"the vehicle refused {mode_name}")

    def _pilot_sticks(self, request: Mapping[str, Any]) -> None:
        for channel, name in enumerate(("roll", "pitch", "throttle", "yaw"), start=1):
            if name in request:
                self._simulator.vehicle.sticks.move(channel, int(request[name]))

    def _pilot_arm(self, request: Mapping[str, Any]) -> None:
        vehicle, throttle = self._simulator.vehicle, int(request.get("throttle", CLIMBING_THROTTLE))
        if not vehicle.arm_by_radio(throttle):
            raise FaultError(f"the vehicle does not arm by radio in {vehicle.mode.name} now")

    def _other_station(self, request: Mapping[str, Any]) -> None:
        position = Ned(*map(float, request["position"])) if "position" in request else None
        velocity = Ned(*map(float, request["velocity"])) if position is None else None
        if not self._simulator.vehicle.obey_other_station(position, velocity):
            raise FaultError("setpoints are for GUIDED only")

    def _nan(self, request: Mapping[str, Any]) -> None:
        simulator, name = self._simulator, str(request["message"])
        if not simulator.telemetry.knows(name):
            raise FaultError(f"the vehicle sends no {name}")
        fields = [str(field) for field in request.get("fields", ())]
        simulator.faults.spoil(name, fields, simulator.vehicle.now, _seconds(request))

    def _pilot_disarm(self, request: Mapping[str, Any]) -> None:
        self._simulator.vehicle.disarm_now()

    def _reboot(self, request: Mapping[str, Any]) -> None:
        self._simulator.reboot_soon()

    def _ekf_bad(self, request: Mapping[str, Any]) -> None:
        vehicle = self._simulator.vehicle
        vehicle.estimator.blind_until = vehicle.now + _seconds(request)

    def _state(self, request: Mapping[str, Any]) -> dict[str, Any]:
        vehicle = self._simulator.vehicle
        body = vehicle.body
        place = from_ned(vehicle.estimator.start, body.position)
        home = vehicle.home
        return {
            "mode": vehicle.mode.name,
            "armed": vehicle.armed,
            "landed": vehicle.on_ground,
            "ready": vehicle.estimator.ready,
            "position": body.position,
            "velocity": body.velocity,
            "latitude": place.latitude,
            "longitude": place.longitude,
            "altitude_amsl": place.altitude,
            "altitude_above_home": place.altitude - vehicle.home_altitude,
            "yaw_degrees": math.degrees(body.yaw) % 360,
            "time_boot_ms": round(vehicle.now * 1000),
            "speedup": self._simulator.speedup,
            "battery": {
                "voltage": vehicle.battery.voltage,
                "current": vehicle.battery.current,
                "remaining": vehicle.battery.remaining,
            },
            "home": None if home is None else home._asdict(),
            "servos": vehicle.servos.driven(_IDLE),
            "mission": {"items": len(vehicle.mission.items), "current": vehicle.mission.current},
        }

    def _parameter(self, request: Mapping[str, Any]) -> dict[str, Any]:
        if self._simulator.parameters.set(str(request["name"]), float(request["value"])) is None:
            raise FaultError(f"the vehicle has no parameter {request['name']}")
        return {}

    def _received(self, request: Mapping[str, Any]) -> dict[str, Any]:
        since, heartbeats = int(request.get("since", 0)), bool(request.get("heartbeats", False))
        entries = [entry for entry in self._simulator.received if entry.index > since]
        last = entries[-1].index if entries else since
        shown = [entry for entry in entries if heartbeats or entry.message.get_type() != "HEARTBEAT"]
        return {"last": last, "messages": [_describe(entry) for entry in shown]}


def _describe(entry: ReceivedMessage) -> dict[str, Any]:
    fields = entry.message.to_dict()
    name = fields.pop("mavpackettype")
    return {
        "index": entry.index,
        "time": entry.time,
        "wall": entry.wall,
        "link": entry.link,
        "system": entry.message.get_srcSystem(),
        "component": entry.message.get_srcComponent(),
        "name": name,
        "fields": fields,
    }


def _seconds(request: Mapping[str, Any]) -> float:
    seconds = float(request.get("seconds", math.inf))
    if math.isnan(seconds) or seconds < 0:
        raise FaultError("seconds must not be negative")
    return seconds


def _as_json(value: Any) -> Any:
    if isinstance(value, (bytes, bytearray)):
        return list(value)
    raise TypeError(f"cannot write {type(value).__name__} as JSON")
