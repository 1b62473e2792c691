"""Sampled quantities, and the readings that they give. Pure: the clock is an argument.

A quantity is written `NAME=MESSAGE.field*SCALE+OFFSET@PERIOD[REPRESENTATION]`:

    alt=GLOBAL_POSITION_INT.relative_alt*0.001@1[m]
    cell1=BATTERY_STATUS[0].voltages[0]*0.001@10[V]

Scale, offset, period (s, default 1) and representation (a unit or a type, for readers) are optional.
`position@1` is built in: [degrees, degrees, m above home].
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.mavlink.vehicle_state import Received, VehicleState

POSITION = "position"
STATUS = "status"  # the quantity in which the MQTT sink reports whether a vehicle is online
CONFIRMED_TOPIC = "confirmed/"  # below it a station confirms the readings that it has stored
POSITION_REPRESENTATION = "degrees, degrees, m above home"
NAME = r"[A-Za-z0-9_.-]{1,64}"  # valid in an MQTT topic
LONGEST_TEXT = 4096  # characters of a value or a representation
NUMBER = r"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?"
GRAMMAR = re.compile(
    rf"(?P<name>{NAME})"
    r"(?:=(?P<message>[A-Z0-9_]+)(?:\[(?P<instance>\d+)\])?\.(?P<attribute>[A-Za-z0-9_]+)(?:\[(?P<index>\d+)\])?"
    rf"(?:\*(?P<scale>{NUMBER}))?(?P<offset>[-+]{NUMBER.removeprefix('[-+]?')})?)?"
    rf"(?:@(?P<period>{NUMBER}))?(?:\[(?P<representation>[^\[\]]{{0,{LONGEST_TEXT}}})\])?"
)
SHORTEST_PERIOD = 0.05  # s
LONGEST_PERIOD = 86400.0  # s

Value = float | int | str | bool | list[float]


@dataclass(frozen=True)
class Quantity:
    """A quantity that is sampled for every vehicle.

    Attributes:
        name: its unique name.
        message: MAVLink message, with `[instance]` if several devices send it; empty for `position`.
        attribute, index: the field, and the index if it is an array.
        scale, offset: the value is field * scale + offset.
        period: s between samples.
        representation: unit or type, for readers.
    """

    name: str
    message: str = ""
    attribute: str = ""
    index: int | None = None
    scale: float = 1.0
    offset: float = 0.0
    period: float = 1.0
    representation: str = ""


@dataclass(frozen=True)
class Reading:
    """One measurement.

    Attributes:
        device: the device that measured it, such as `uav-1`.
        system: MAVLink system id of its vehicle.
        quantity, representation, value: the measurement.
        time: s since 1970 on this machine's clock.
    """

    device: str
    system: int
    quantity: str
    representation: str
    value: Value
    time: float


@dataclass(frozen=True)
class Stored:
    """A reading in the spool, with its sequence number."""

    seq: int
    reading: Reading

    def body(self) -> dict[str, Any]:
        """The JSON object that is sent."""
        reading = self.reading
        return {
            "device": reading.device,
            "id": str(reading.system),
            "seq": self.seq,
            "quantity": reading.quantity,
            "representation": reading.representation,
            "value": reading.value,
            "time": round(reading.time, 3),
        }


def device_of(system: int) -> str:
    """The device name of a vehicle."""
    return f"uav-{system}"


def parse_quantities(text: str) -> tuple[Quantity, ...]:
    """Parse a list of quantities, separated by comma, semicolon or white space (not within brackets).

    Raises:
        SettingError: one is malformed, or two have the same name.
    """
    parts = [part for part in re.split(r"[,;\s]+(?![^\[\]]*\])", text.strip()) if part]
    quantities = [parse_quantity(part) for part in parts]
    names = [quantity.name for quantity in quantities]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SettingError(f"{', '.join(twice)} occurs twice")
    return tuple(quantities)


def parse_quantity(text: str) -> Quantity:
    """Parse one quantity.

    Raises:
        SettingError: it is malformed.
    """
    match = GRAMMAR.fullmatch(text)
    if match is None:
        raise SettingError(f"{text!r} is not NAME=MESSAGE.field*SCALE+OFFSET@PERIOD[REPRESENTATION]")
    groups = match.groupdict()
    try:
        numbers = [float(groups[name] or default) for name, default in (("scale", 1), ("offset", 0), ("period", 1))]
    except ValueError as error:
        raise SettingError(f"{text!r}: {error}") from error
    scale, offset, period = numbers
    if not math.isfinite(scale) or not math.isfinite(offset):
        raise SettingError(f"{text!r}: scale and offset are finite numbers")
    if not SHORTEST_PERIOD <= period <= LONGEST_PERIOD:
        raise SettingError(f"{text!r}: a period is {SHORTEST_PERIOD:g} to {LONGEST_PERIOD:g} s")
    if groups["message"] is None:
        if groups["name"] != POSITION:
            raise SettingError(f"{text!r} names no message; only {POSITION} is built in")
        return Quantity(POSITION, period=period, representation=POSITION_REPRESENTATION)
    instance = "" if groups["instance"] is None else f"[{groups['instance']}]"
    index = None if groups["index"] is None else int(groups["index"])
    message, attribute = groups["message"] + instance, groups["attribute"]
    representation = groups["representation"] or ""
    return Quantity(groups["name"], message, attribute, index, scale, offset, period, representation)


@dataclass
class Sampler:
    """Samples one quantity of every vehicle.

    A message is sampled once; a further reading needs a new message.

    Attributes:
        taken: number of readings.
        why_not: why the last turn gave none, by system id.
    """

    quantity: Quantity
    taken: int = 0
    why_not: dict[int, str] = field(default_factory=dict)
    _sampled_at: dict[int, float] = field(default_factory=dict)

    def sample(self, state: VehicleState, now: float, wall: float, max_age: float) -> Reading | None:
        """A reading from the newest message; None if there is nothing new, and then `why_not` has the reason.

        Args:
            state: the vehicle's state.
            now: s on the clock of arrivals.
            wall: the same moment in s since 1970.
            max_age: s after which a message is too old for a measurement.
        """
        received = state.newest(self.quantity.message)
        value, why = self._read(received, now, max_age)
        if received is None or value is None:
            self.skip(state.system, f"{self.quantity.message} {why}")
            return None
        return self.take(state.system, value, received.at, wall - (now - received.at))

    def _read(self, received: Received | None, now: float, max_age: float) -> tuple[Value | None, str]:
        """The value, or why there is none."""
        if received is None:
            return None, "has not arrived yet"
        if now - received.at > max_age:
            return None, f"is {now - received.at:.1f} s old"
        return self._value(received.message), "has no such number"

    def take(self, system: int, value: Value, received_at: float, at: float) -> Reading | None:
        """A reading of `value`, measured at `at` (s since 1970); None if its message was sampled before.

        Args:
            system: the vehicle's system id.
            value: the measurement.
            received_at: arrival of its message, s on the clock of arrivals.
            at: see above.
        """
        if self._sampled_at.get(system) == received_at:
            self.skip(system, f"no new {self.quantity.message or self.quantity.name} has arrived")
            return None
        self._sampled_at[system] = received_at
        self.why_not.pop(system, None)
        self.taken += 1
        quantity = self.quantity
        return Reading(device_of(system), system, quantity.name, quantity.representation, value, at)

    def skip(self, system: int, why: str) -> None:
        """Note why there is no reading."""
        self.why_not[system] = why

    def _value(self, message: Any) -> float | int | str | None:
        value = getattr(message, self.quantity.attribute, None)
        if self.quantity.index is not None:
            value = _element(value, self.quantity.index)
        if isinstance(value, str):
            return value
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            return None
        if self.quantity.scale == 1.0 and self.quantity.offset == 0.0:
            return value
        scaled = float(f"{value * self.quantity.scale + self.quantity.offset:.12g}")  # without 20.123000000000001
        return scaled if math.isfinite(scaled) else None


def _element(values: Any, index: int) -> Any:
    return values[index] if isinstance(values, list | tuple) and index < len(values) else None
