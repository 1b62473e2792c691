"""Logs of other programs, made into records: MAVProxy's .tlog, and ArduPilot's own .bin. Blocking."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.telemetry.flight_modes import kind_of, mode_name
from mavproxy_uavapi.flights.flight_file import FlightMessage
from mavproxy_uavapi.flights.flight_store import ENDED, Flight, FlightStore, utc
from mavproxy_uavapi.flights.topics import Topics
from mavproxy_uavapi.http.stream.stream_event import Event, When, of_info
from mavproxy_uavapi.http.stream.stream_views import BY_MESSAGE, OF_A_MESSAGE

mavlink = mavutil.mavlink

TOGETHER = 10_000  # messages of one write
ARMED, DISARMED = 10, 11  # ids of EV in logs of before ARM
INFO = mavlink.MAV_SEVERITY_INFO

View = tuple[str, str, Mapping[str, Any]]  # kind, name, info


def take(store: FlightStore, path: Path) -> Flight:
    """Make a record of a log, with its times.

    Args:
        store: where it goes.
        path: a .tlog, or a .bin (or .log) of an autopilot.

    Raises:
        BadRequest: it has nothing that can be read.
        OSError: it, or the folder, refuses.
    """
    reader = _Tlog() if path.suffix.lower() in (".tlog", ".rlog", ".raw") else _Dataflash()
    events = reader.events(path)
    first = next(events, None)
    if first is None:
        raise BadRequest(f"{path.name} has no message of an autopilot")
    flight, file = store.begin([], first.at.time, path.stem, f"imported from {path.name}")
    topics, systems, last = Topics(), set[int](), first.at.time
    messages: list[FlightMessage] = []
    for event in itertools.chain([first], events):
        systems.add(event.system)
        last = max(last, event.at.time)
        messages += topics.records(event)
        if len(messages) >= TOGETHER:
            file.write(messages)
            messages = []
    file.write(messages)
    for system, values in reader.parameters.items():
        text = "".join(f"{name} {value:.9g}\n" for name, value in sorted(values.items()))
        file.attach(f"parameters-{system}.param", "text/plain", text.encode(), round(first.at.time * 1e9))
    flight = replace(flight, vehicles=tuple(sorted(systems)), ended=utc(last), state=ENDED)
    file.close(flight.about())
    store.save(flight)
    return store.pack(flight.id)


class _Log:
    """A log that is read by pymavlink.

    Attributes:
        parameters: values by name, by system id.
    """

    def __init__(self) -> None:
        self.parameters: dict[int, dict[str, float]] = {}

    def events(self, path: Path) -> Iterator[Event]:
        """What is in a log, as events of the stream, in its order."""
        if path.stat().st_size == 0:
            return  # pymavlink cannot open it
        log = mavutil.mavlink_connection(str(path), robust_parsing=True)
        began = math.nan
        try:
            while (message := log.recv_msg()) is not None:
                at = message._timestamp
                began = at if math.isnan(began) else began
                for kind, name, info in self.views(message):
                    yield of_info(kind, name, self.system(message), When(at, at - began), info)
        finally:
            log.close()

    def system(self, message: Any) -> int:
        """Of which vehicle a message is."""
        raise NotImplementedError

    def views(self, message: Any) -> Iterator[View]:
        """What it tells."""
        raise NotImplementedError


class _Tlog(_Log):
    """MAVLink, as it came."""

    def __init__(self) -> None:
        super().__init__()
        self._types: dict[int, int] = {}

    def system(self, message: Any) -> int:
        return int(message.get_srcSystem())

    def views(self, message: Any) -> Iterator[View]:
        name, system = message.get_type(), self.system(message)
        if message.get_srcComponent() != mavlink.MAV_COMP_ID_AUTOPILOT1:
            return
        if name == "HEARTBEAT" and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
            self._types[system] = message.type
            armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            mode = mode_name(message.type, message.custom_mode)
            yield "view", "status", {"vehicle_type": kind_of(message.type), "mode": mode, "armed": armed}
        elif name == "STATUSTEXT":
            yield "event", "statustext", {"severity": message.severity, "text": message.text}
        elif name == "PARAM_VALUE":
            self.parameters.setdefault(system, {})[message.param_id] = message.param_value
        elif system in self._types:
            for view in BY_MESSAGE.get(name, ()):
                yield "view", view, OF_A_MESSAGE[view][1](message)


class _Dataflash(_Log):
    """An autopilot's own log: its names and units, ours."""

    def __init__(self) -> None:
        super().__init__()
        self._system, self._vehicle_type = 1, mavlink.MAV_TYPE_QUADROTOR
        self._velocity: dict[str, float] = {"vx": 0.0, "vy": 0.0, "vz": 0.0}
        self._heading: float | None = None
        self._status = {"mode": "UNKNOWN", "armed": False}
        self._makers: Mapping[str, Callable[[Any], View | None]] = {
            "POS": self._place,
            "ATT": self._attitude,
            "XKF1": self._estimate,
            "NKF1": self._estimate,
            "BAT": self._battery,
            "GPS": self._receiver,
            "MODE": self._mode,
            "ARM": self._arming,
            "EV": self._event,
            "MSG": self._text,
        }

    def system(self, message: Any) -> int:
        return self._system

    def views(self, message: Any) -> Iterator[View]:
        name = message.get_type()
        if name == "PARM":
            self._parameter(message.Name, float(message.Value))
        elif name in self._makers:
            view = self._makers[name](message)
            if view is not None:
                yield view

    def _parameter(self, name: str, value: float) -> None:
        if name in ("SYSID_THISMAV", "MAV_SYSID"):
            self._system = int(value)
        self.parameters.setdefault(self._system, {})[name] = value

    def _place(self, m: Any) -> View:
        place = {"lat": m.Lat, "lon": m.Lng, "alt": m.Alt, "relative_alt": m.RelHomeAlt}
        return "view", "gps", {"position": place, "velocity": dict(self._velocity), "heading": self._heading}

    def _attitude(self, m: Any) -> View:
        self._heading = m.Yaw
        return "view", "attitude", {"roll": m.Roll, "pitch": m.Pitch, "yaw": m.Yaw}

    def _estimate(self, m: Any) -> View | None:
        if getattr(m, "C", 0) != 0:  # of another core
            return None
        self._velocity = {"vx": m.VN, "vy": m.VE, "vz": m.VD}
        return "view", "ned", {"position": {"x": m.PN, "y": m.PE, "z": m.PD}, "velocity": dict(self._velocity)}

    def _battery(self, m: Any) -> View | None:
        if getattr(m, "Inst", getattr(m, "Instance", 0)) != 0:
            return None
        left = getattr(m, "RemPct", None)
        known = {"voltage": round(m.Volt * 1000), "current": round(m.Curr * 100), "battery_remaining": left}
        return "view", "battery", known

    def _receiver(self, m: Any) -> View | None:
        if getattr(m, "I", 0) != 0:
            return None
        place, speed = {"lat": m.Lat, "lon": m.Lng, "alt": m.Alt}, {"ground_speed": m.Spd, "speed_direction": m.GCrs}
        return "view", "gps_raw", {"position": place, "velocity": speed, "satelites": m.NSats, "fix_type": m.Status}

    def _mode(self, m: Any) -> View:
        self._status["mode"] = mode_name(self._vehicle_type, m.ModeNum)
        return self._condition()

    def _arming(self, m: Any) -> View:
        self._status["armed"] = bool(m.ArmState)
        return self._condition()

    def _event(self, m: Any) -> View | None:
        if m.Id not in (ARMED, DISARMED):
            return None
        self._status["armed"] = m.Id == ARMED
        return self._condition()

    def _condition(self) -> View:
        return "view", "status", {"vehicle_type": kind_of(self._vehicle_type), **self._status}

    def _text(self, m: Any) -> View:
        """The autopilot's first texts name its firmware, which tells the vehicle's type."""
        for word, vehicle_type in FIRMWARES.items():
            if m.Message.startswith(word):
                self._vehicle_type = vehicle_type
        return "event", "statustext", {"severity": INFO, "text": m.Message}


FIRMWARES = {
    "ArduCopter": mavlink.MAV_TYPE_QUADROTOR,
    "ArduPlane": mavlink.MAV_TYPE_FIXED_WING,
    "ArduRover": mavlink.MAV_TYPE_GROUND_ROVER,
    "Rover": mavlink.MAV_TYPE_GROUND_ROVER,
}
