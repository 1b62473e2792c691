"""Logs of other programs, made into records: MAVProxy's .tlog, and ArduPilot's own .bin. Blocking."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.telemetry import autopilot
from mavproxy_uavapi.core.telemetry.flight_modes import kind_of, mode_name
from mavproxy_uavapi.flights.flight_file import FlightMessage
from mavproxy_uavapi.flights.flight_store import Flight, FlightStore, utc
from mavproxy_uavapi.flights.topics import Topics
from mavproxy_uavapi.http.contract.requests import HIGHEST_SYSTEM
from mavproxy_uavapi.http.stream.stream_event import Event, When, of_info
from mavproxy_uavapi.http.stream.stream_views import BY_MESSAGE, OF_A_MESSAGE

mavlink = mavutil.mavlink

EARLIEST, LATEST = 315_532_800.0, 4_102_444_800.0  # s since 1970 of the years 1980 and 2100
ARMED, DISARMED = 10, 11  # ids of EV in logs of before ARM
INFO = mavlink.MAV_SEVERITY_INFO

View = tuple[str, str, Mapping[str, Any]]  # kind, name, info


def take(store: FlightStore, path: Path) -> Flight:
    """Make a record of a log, with its times.

    Args:
        store: where it goes.
        path: a .tlog, or a .bin (or .log) of an autopilot.

    What is damaged in it is left out, and the record's notes say so.

    Raises:
        BadRequest: it has nothing that can be read.
        OSError: it, or the folder, refuses.
    """
    with _noise() as is_noisy:
        return _take(store, path, is_noisy)


@contextlib.contextmanager
def _noise() -> Iterator[Callable[[], bool]]:
    """Within the context pymavlink may tell of each damaged byte, by Python and by C; gives whether it has."""
    with tempfile.TemporaryFile("w") as file, contextlib.redirect_stdout(file), contextlib.redirect_stderr(file):

        def is_noisy() -> bool:
            file.flush()
            return os.fstat(file.fileno()).st_size > 0

        kept = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            yield is_noisy
        finally:
            os.dup2(kept, 2)
            os.close(kept)


def _take(store: FlightStore, path: Path, is_noisy: Callable[[], bool]) -> Flight:
    reader = _Tlog() if path.suffix.lower() in (".tlog", ".rlog", ".raw") else _Dataflash()
    events = reader.events(path)
    first = next(events, None)
    if first is None:
        raise BadRequest(f"{path.name} has no message of an autopilot")
    topics, systems, last = Topics(), set[int](), first.at.time

    def messages() -> Iterator[FlightMessage]:
        nonlocal last
        for event in itertools.chain([first], events):
            systems.add(event.system)
            last = max(last, event.at.time)
            yield from topics.records(event)

    with store.making(first.at.time, path.stem) as (flight, file):
        file.write_many(messages())
        for system, values in reader.parameters.items():
            text = "".join(f"{name} {value:.9g}\n" for name, value in sorted(values.items()))
            file.attach(f"parameters-{system}.param", "text/plain", text.encode(), round(first.at.time * 1e9))
        file.note("versions", {f"vehicle-{system}": text for system, text in reader.firmwares.items()})
        notes = [f"imported from {path.name}"]
        if first.at.time < EARLIEST:
            notes.append("its clock was never set: times count from its start")
        if is_noisy() or reader.is_damaged:
            notes.append("parts of it are damaged, and left out")
        known = {"vehicles": tuple(sorted(systems)), "ended": utc(last), "notes": "; ".join(notes)}
        store.finish(replace(flight, **known), file)  # type: ignore[arg-type]
    return store.pack(flight.id)


class _Log:
    """A log that is read by pymavlink.

    Attributes:
        parameters: values by name, by system id.
        firmwares: what each autopilot said it is.
        is_damaged: whether something in it cannot be.
    """

    def __init__(self) -> None:
        self.parameters: dict[int, dict[str, float]] = {}
        self.firmwares: dict[int, str] = {}
        self.is_damaged = False

    def events(self, path: Path) -> Iterator[Event]:
        """What is in a log, as events of the stream, in its order."""
        if path.stat().st_size == 0:
            return  # pymavlink cannot open it
        try:
            log = mavutil.mavlink_connection(str(path), robust_parsing=True)
        except Exception as error:  # whatever a damaged head leads pymavlink to
            raise BadRequest(f"{path.name} is no log, or its beginning is damaged") from error
        began = math.nan
        try:
            for message in self._messages(log):
                at = message._timestamp
                if message.get_type() == "BAD_DATA" or not 0.0 <= at < LATEST:
                    self.is_damaged = True
                    continue
                began = at if math.isnan(began) else began
                for kind, name, info in self.views(message):
                    yield of_info(kind, name, self.system(message), When(at, at - began), info)
        finally:
            log.close()

    def _messages(self, log: Any) -> Iterator[Any]:
        """The messages of a log; one that pymavlink fails at is left out, and ends it where it goes no further."""
        while True:
            before = _where(log)
            try:
                message = log.recv_msg()
            except Exception:  # noqa: BLE001 - whatever a damaged message leads it to
                self.is_damaged = True
                if _where(log) == before:
                    return
                continue
            if message is None:
                return
            yield message

    def _said(self, system: int, severity: int, text: str) -> View:
        if autopilot.BANNER.match(text):
            self.firmwares[system] = text
        return "event", "statustext", {"severity": severity, "text": text}

    def system(self, message: Any) -> int:
        """Of which vehicle a message is."""
        raise NotImplementedError

    def views(self, message: Any) -> Iterator[View]:
        """What it tells."""
        raise NotImplementedError


def _where(log: Any) -> int:
    """How far a log was read, bytes."""
    return int(log.f.tell() if isinstance(log, mavutil.mavlogfile) else log.offset)


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
            yield self._said(system, message.severity, message.text)
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
        self._velocity: dict[str, float | None] = {"vx": 0.0, "vy": 0.0, "vz": 0.0}
        self._heading: float | None = None
        self._status: dict[str, Any] = {"mode": "UNKNOWN", "armed": None}  # many logs begin when it is armed already
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
            self._parameter(message)
        elif name in self._makers:
            view = self._makers[name](message)
            if view is not None:
                yield view

    def _parameter(self, m: Any) -> None:
        name, value = getattr(m, "Name", None), _number(m, "Value")
        if not isinstance(name, str) or value is None:
            self.is_damaged = True
            return
        if name in ("SYSID_THISMAV", "MAV_SYSID") and 1 <= value <= HIGHEST_SYSTEM:
            self._system = int(value)
        self.parameters.setdefault(self._system, {})[name] = value

    def _place(self, m: Any) -> View | None:
        lat, lon, alt, above = (_number(m, name) for name in ("Lat", "Lng", "Alt", "RelHomeAlt"))
        if lat is None or lon is None or abs(lat) > 90 or abs(lon) > 180:
            self.is_damaged = True
            return None
        place = {"lat": lat, "lon": lon, "alt": alt, "relative_alt": above}
        return "view", "gps", {"position": place, "velocity": dict(self._velocity), "heading": self._heading}

    def _attitude(self, m: Any) -> View | None:
        roll, pitch, self._heading = (_number(m, name) for name in ("Roll", "Pitch", "Yaw"))
        if roll is None or pitch is None or self._heading is None:
            self.is_damaged = True
            return None
        return "view", "attitude", {"roll": roll, "pitch": pitch, "yaw": self._heading}

    def _estimate(self, m: Any) -> View | None:
        if getattr(m, "C", 0) != 0:  # of another core
            return None
        self._velocity = {ours: _number(m, name) for ours, name in (("vx", "VN"), ("vy", "VE"), ("vz", "VD"))}
        position = {ours: _number(m, name) for ours, name in (("x", "PN"), ("y", "PE"), ("z", "PD"))}
        return "view", "ned", {"position": position, "velocity": dict(self._velocity)}

    def _battery(self, m: Any) -> View | None:
        if getattr(m, "Inst", getattr(m, "Instance", 0)) != 0:
            return None
        volts, amperes = _number(m, "Volt"), _number(m, "Curr")
        known = {
            "voltage": None if volts is None else round(volts * 1000),
            "current": None if amperes is None else round(amperes * 100),
        }
        return "view", "battery", {**known, "battery_remaining": _number(m, "RemPct")}

    def _receiver(self, m: Any) -> View | None:
        if getattr(m, "I", 0) != 0:
            return None
        place = {ours: _number(m, name) for ours, name in (("lat", "Lat"), ("lon", "Lng"), ("alt", "Alt"))}
        speed = {"ground_speed": _number(m, "Spd"), "speed_direction": _number(m, "GCrs")}
        quality = {"satelites": _number(m, "NSats"), "fix_type": _number(m, "Status")}
        return "view", "gps_raw", {"position": place, "velocity": speed, **quality}

    def _mode(self, m: Any) -> View | None:
        number = _number(m, "ModeNum")
        if number is None:
            return None
        self._status["mode"] = mode_name(self._vehicle_type, int(number))
        return self._condition()

    def _arming(self, m: Any) -> View:
        self._status["armed"] = bool(_number(m, "ArmState"))
        return self._condition()

    def _event(self, m: Any) -> View | None:
        number = _number(m, "Id")
        if number not in (ARMED, DISARMED):
            return None
        self._status["armed"] = number == ARMED
        return self._condition()

    def _condition(self) -> View:
        return "view", "status", {"vehicle_type": kind_of(self._vehicle_type), **self._status}

    def _text(self, m: Any) -> View:
        """The autopilot's first texts name its firmware, which tells the vehicle's type."""
        text = str(getattr(m, "Message", ""))
        for word, vehicle_type in FIRMWARES.items():
            if text.startswith(word):
                self._vehicle_type = vehicle_type
        return self._said(self._system, INFO, text)


def _number(message: Any, name: str) -> float | None:
    """A member of a message as a number; None where it is missing, no number, or not finite: a log may be damaged."""
    value = getattr(message, name, None)
    if not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return value


FIRMWARES = {
    "ArduCopter": mavlink.MAV_TYPE_QUADROTOR,
    "ArduPlane": mavlink.MAV_TYPE_FIXED_WING,
    "ArduRover": mavlink.MAV_TYPE_GROUND_ROVER,
    "Rover": mavlink.MAV_TYPE_GROUND_ROVER,
}
