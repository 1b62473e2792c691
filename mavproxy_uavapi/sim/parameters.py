"""The parameters: a fixed list of names with a type and a value each, as ArduPilot's AP_Param holds them.

A firmware, 4.7 or 4.6, has its own names and units; the vehicle itself knows those of 4.7 only.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .parameter_tables import copter, names
from .parameter_tables.blocks import Blocks

FIRMWARES = ("4.7", "4.6")
_KINDS = (
    mavlink.MAV_PARAM_TYPE_INT8,
    mavlink.MAV_PARAM_TYPE_INT16,
    mavlink.MAV_PARAM_TYPE_INT32,
    mavlink.MAV_PARAM_TYPE_REAL32,
)
_INTEGER_RANGE = {
    mavlink.MAV_PARAM_TYPE_INT8: (-128, 127),
    mavlink.MAV_PARAM_TYPE_INT16: (-32768, 32767),
    mavlink.MAV_PARAM_TYPE_INT32: (-2147483648, 2147483647),
}


@dataclass
class Parameter:
    """One entry as the firmware reports it: its place in the list, MAV_PARAM_TYPE and present value.

    `key` is its name in 4.7, and what it is there `shown` turns into the value, `read` the other way round.
    """

    index: int
    name: str
    kind: int
    value: float
    key: str
    shown: Callable[[float], float]
    read: Callable[[float], float]


class ParameterStore(dict[str, float]):
    """All parameters of a firmware. They outlive a reboot.

    As a dict it has their values by the names of 4.7, and in their units, whatever the firmware: m, m/s, degrees.
    """

    def __init__(self, blocks: Blocks = copter.BLOCKS, firmware: str = FIRMWARES[0]) -> None:
        rows = _rows(blocks, firmware)
        self.ordered = [Parameter(index, *row) for index, row in enumerate(rows)]
        self._by_name = {parameter.name: parameter for parameter in self.ordered}
        self._by_key = {parameter.key: parameter for parameter in self.ordered}
        self._formers = {former.name: (key, former.scale) for key, former in blocks.former}
        super().__init__((parameter.key, _stored(parameter.read(parameter.value))) for parameter in self.ordered)

    def find(self, name: str, index: int = -1) -> Parameter | None:
        """The parameter at index, or by its name in the firmware when index is -1; None when there is none."""
        if index >= 0:
            return self.ordered[index] if index < len(self.ordered) else None
        return self._by_name.get(name)

    def put(self, key: str, value: float) -> None:
        """Store value by the name, and in the unit, of 4.7."""
        parameter = self._by_key[key]
        self.set(parameter.name, parameter.shown(value))

    def adopt(self, name: str, value: float) -> None:
        """Store a value from a list of any firmware; a name that none has is left out."""
        if name in self._by_name:
            self.set(name, value)
            return
        key, scale = self._formers.get(name, (name, 1.0))
        if name == names.DONE:
            key, value = names.SKIPPED, names.skipped_of(value)
        if key in self._by_key:
            self.put(key, value / scale)

    def set(self, name: str, value: float) -> Parameter | None:
        """Store value, in the firmware's unit, as the parameter's type can hold it; None for an unknown name."""
        parameter = self._by_name.get(name)
        if parameter is not None:
            parameter.value = _as_stored(value, parameter.kind)
            self[parameter.key] = _stored(parameter.read(parameter.value))
        return parameter


@cache
def _rows(blocks: Blocks, firmware: str) -> list[tuple[Any, ...]]:
    """Name, type and default of each parameter, by name, and how it is written in 4.7."""
    words: dict[str, tuple[str, int]] = {}
    for block, kind in zip(blocks[:4], _KINDS, strict=True):
        words |= {key: (text, kind) for key, _, text in (word.partition("=") for word in block.split())}
    rows, formers = [], dict(blocks.former)
    for key, (text, kind) in words.items():
        former = names.Former(key)
        if firmware == "4.6":
            former = formers.get(key, former)
        shown, read = former.scale.__mul__, former.scale.__rtruediv__
        if firmware == "4.6" and key in names.SINCE_4_7:
            continue
        if firmware == "4.6" and key == names.SKIPPED:
            former, shown, read = names.Former(names.DONE), names.done_of, names.skipped_of
        stored = kind if former.kind is None else former.kind
        rows.append((former.name, stored, _as_stored(shown(float(text)), stored), key, shown, read))
    return sorted(rows, key=lambda row: str(row[0]))


def _stored(value: float) -> float:
    return _as_stored(value, mavlink.MAV_PARAM_TYPE_REAL32)


def _as_stored(value: float, kind: int) -> float:
    """Integers are rounded and clamped, floats have 32 bits, as AP_Param::set_float stores them."""
    if kind in _INTEGER_RANGE:
        low, high = _INTEGER_RANGE[kind]
        return float(max(low, min(high, round(value))))
    return float(struct.unpack("<f", struct.pack("<f", value))[0])
