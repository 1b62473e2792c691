"""The parameters: a fixed list of names with a type and a value each, as ArduPilot's AP_Param holds them."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .parameter_tables import copter
from .parameter_tables.blocks import Blocks

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
    """One entry: its place in the list, MAV_PARAM_TYPE and present value."""

    index: int
    name: str
    kind: int
    value: float


class ParameterStore(dict[str, float]):
    """All parameters, by name and by index, and as a dict their values; they outlive a reboot."""

    def __init__(self, blocks: Blocks = copter.BLOCKS) -> None:
        self.ordered = [Parameter(index, *row) for index, row in enumerate(_rows(blocks))]
        self._by_name = {parameter.name: parameter for parameter in self.ordered}
        super().__init__((parameter.name, parameter.value) for parameter in self.ordered)

    def find(self, name: str, index: int = -1) -> Parameter | None:
        """The parameter at index, or by name when index is -1; None when there is none."""
        if index >= 0:
            return self.ordered[index] if index < len(self.ordered) else None
        return self._by_name.get(name)

    def set(self, name: str, value: float) -> Parameter | None:
        """Store value as the parameter's type can hold it; None for an unknown name."""
        parameter = self._by_name.get(name)
        if parameter is not None:
            self[name] = parameter.value = _as_stored(value, parameter.kind)
        return parameter


@cache
def _rows(blocks: Blocks) -> list[tuple[str, int, float]]:
    """Name, type and default of each parameter, by name."""
    return sorted(
        (name, kind, _as_stored(float(text), kind))
        for block, kind in zip(blocks, _KINDS, strict=True)
        for name, text in (entry.split("=") for entry in block.split())
    )


def _as_stored(value: float, kind: int) -> float:
    """Integers are rounded and clamped, floats have 32 bits, as AP_Param::set_float stores them."""
    if kind in _INTEGER_RANGE:
        low, high = _INTEGER_RANGE[kind]
        return float(max(low, min(high, round(value))))
    return float(struct.unpack("<f", struct.pack("<f", value))[0])
