"""The quantities of the setting `quantities`, and how they are written. Pure, except for `~` in a file's name.

A field of a MAVLink message is `NAME=MESSAGE.field*SCALE+OFFSET@PERIOD[REPRESENTATION]`:

    alt=GLOBAL_POSITION_INT.relative_alt*0.001@1[m]
    cell1=BATTERY_STATUS[0].voltages[0]*0.001@10[V]

A sensor of the companion computer is a file or a command:

    soil=file:/run/soil.txt@5[percent]
    pressure=exec:"read-pressure --bus 1"*0.01@30[hPa]

Scale, offset, period (s, default 1) and representation (a unit or a type, for readers) are optional.
`position@1` is built in: [degrees, degrees, m above home].
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.values import path_of

POSITION = "position"
STATUS = "status"  # no quantity: in its place the MQTT sink reports whether a vehicle is online
ONLINE, OFFLINE = "online", "offline"
STATES = frozenset({ONLINE.encode(), OFFLINE.encode()})  # all payloads of a status
POSITION_REPRESENTATION = "degrees, degrees, m above home"
TEXTS = ("text", "raw")  # representations of a sensor whose value is a text
NAME = r"[A-Za-z0-9_.-]{1,64}"  # valid in an MQTT topic
LONGEST_TEXT = 4096  # characters of a value or a representation
NUMBER = r"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?"
SCALE = rf"(?:\*(?P<scale>{NUMBER}))?(?P<offset>[-+]{NUMBER.removeprefix('[-+]?')})?"
PERIOD = rf"(?:@(?P<period>{NUMBER}))?(?:\[(?P<representation>[^\[\]]{{0,{LONGEST_TEXT}}})\])?"
FIELD = re.compile(
    rf"(?P<name>{NAME})"
    r"(?:=(?P<message>[A-Z0-9_]+)(?:\[(?P<instance>\d+)\])?\.(?P<attribute>[A-Za-z0-9_]+)(?:\[(?P<index>\d+)\])?"
    rf"{SCALE})?{PERIOD}"
)
# Without quotation marks a file's name goes on to `*`, `@` or `[`: a `-1` at its end is no offset.
SENSOR = re.compile(
    rf'(?P<name>{NAME})=(?P<kind>file|exec):(?:"(?P<quoted>[^"]+)"|(?P<plain>[^\s",;*@\[\]]+)){SCALE}{PERIOD}'
)
PIECE = re.compile(r'"[^"]*"|\[[^\[\]]*\]|(?P<separator>[,;\s]+)|.', re.DOTALL)
SHORTEST_PERIOD = 0.05  # s
SHORTEST_COMMAND_PERIOD = 1.0  # s
LONGEST_PERIOD = 86400.0  # s


@dataclass(frozen=True)
class Quantity:
    """A quantity that is sampled: of every vehicle, or from a sensor.

    Attributes:
        name: its unique name.
        message: MAVLink message, with `[instance]` if several devices send it; empty for `position` and sensors.
        attribute, index: the field, and the index if it is an array.
        scale, offset: the value is field * scale + offset.
        period: s between samples.
        representation: unit or type, for readers.
        file: the sensor's file; empty if it is none.
        command: the sensor's program and arguments; empty if it is none.
    """

    name: str
    message: str = ""
    attribute: str = ""
    index: int | None = None
    scale: float = 1.0
    offset: float = 0.0
    period: float = 1.0
    representation: str = ""
    file: str = ""
    command: tuple[str, ...] = ()

    @property
    def is_sensor(self) -> bool:
        """Whether the companion computer measures it."""
        return bool(self.file or self.command)

    @property
    def is_text(self) -> bool:
        """Whether it is a sensor whose value is a text."""
        return self.is_sensor and self.representation in TEXTS

    def scaled(self, value: float) -> float | None:
        """`value` with scale and offset; None if that is not finite."""
        if self.scale == 1.0 and self.offset == 0.0:
            return value if math.isfinite(value) else None
        scaled = float(f"{value * self.scale + self.offset:.12g}")  # without 20.123000000000001
        return scaled if math.isfinite(scaled) else None


def parse_quantities(text: str) -> tuple[Quantity, ...]:
    """Parse a list of quantities, separated by comma, semicolon or white space (not within brackets or quotes).

    Raises:
        SettingError: one is malformed, or two have the same name.
    """
    quantities = [parse_quantity(part) for part in split(text)]
    names = [quantity.name for quantity in quantities]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SettingError(f"{', '.join(twice)} occurs twice")
    if STATUS in names:
        raise SettingError(f"{STATUS} tells whether a vehicle is online; take another name")
    return tuple(quantities)


def split(text: str) -> Iterator[str]:
    """The parts of a list; see `parse_quantities`."""
    part = ""
    for piece in PIECE.finditer(text):
        if piece["separator"] is None:
            part += piece[0]
        elif part:
            yield part
            part = ""
    if part:
        yield part


def parse_quantity(text: str) -> Quantity:
    """Parse one quantity.

    Raises:
        SettingError: it is malformed.
    """
    sensor = SENSOR.fullmatch(text)
    if sensor is not None:
        return _sensor(text, sensor.groupdict())
    match = FIELD.fullmatch(text)
    if match is None:
        raise SettingError(
            f"{text!r} is not NAME=MESSAGE.field*SCALE+OFFSET@PERIOD[REPRESENTATION],"
            ' NAME=file:PATH@PERIOD[…] or NAME=exec:"COMMAND"@PERIOD[…]'
        )
    groups = match.groupdict()
    quantity = _sampled(text, groups)
    if groups["message"] is None:
        if groups["name"] != POSITION:
            raise SettingError(f"{text!r} names no message; only {POSITION} is built in")
        return Quantity(POSITION, period=quantity.period, representation=POSITION_REPRESENTATION)
    instance = "" if groups["instance"] is None else f"[{groups['instance']}]"
    index = None if groups["index"] is None else int(groups["index"])
    return replace(quantity, message=groups["message"] + instance, attribute=groups["attribute"], index=index)


def _sampled(text: str, groups: Mapping[str, Any]) -> Quantity:
    """The name, the numbers and the representation, which all quantities may have."""
    try:
        numbers = [float(groups[name] or default) for name, default in (("scale", 1), ("offset", 0), ("period", 1))]
    except ValueError as error:
        raise SettingError(f"{text!r}: {error}") from error
    scale, offset, period = numbers
    if not math.isfinite(scale) or not math.isfinite(offset):
        raise SettingError(f"{text!r}: scale and offset are finite numbers")
    shortest = SHORTEST_COMMAND_PERIOD if groups.get("kind") == "exec" else SHORTEST_PERIOD
    if not shortest <= period <= LONGEST_PERIOD:
        raise SettingError(f"{text!r}: a period is {shortest:g} to {LONGEST_PERIOD:g} s")
    representation = groups["representation"] or ""
    return Quantity(groups["name"], scale=scale, offset=offset, period=period, representation=representation)


def _sensor(text: str, groups: Mapping[str, Any]) -> Quantity:
    quantity = _sampled(text, groups)
    if quantity.name == POSITION:
        raise SettingError(f"{text!r}: {POSITION} is the vehicle's own")
    if quantity.representation in TEXTS and (quantity.scale, quantity.offset) != (1.0, 0.0):
        raise SettingError(f"{text!r}: a text has no scale and no offset")
    source = groups["quoted"] or groups["plain"]
    if groups["kind"] == "exec":
        return replace(quantity, command=_words(text, source))
    path = path_of(source)
    if not path.is_absolute():
        raise SettingError(f"{text!r}: the file's name begins with / or ~")
    return replace(quantity, file=str(path))


def _words(text: str, command: str) -> tuple[str, ...]:
    """The program and its arguments, separated as a shell does it; no shell runs them."""
    try:
        words = tuple(shlex.split(command))
    except ValueError as error:
        raise SettingError(f"{text!r}: {error}") from error
    if not words or not words[0] or "\0" in command:
        raise SettingError(f"{text!r} names no program")
    return words
