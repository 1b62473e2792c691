"""Any MAVLink message by its name. Its fields and the authority are checked, as for every command."""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Invalid, Rejected
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.link.messages import MavCommand
from mavproxy_uavapi.core.mainloop.permit import Written
from mavproxy_uavapi.core.strict_json import is_finite_number
from mavproxy_uavapi.core.telemetry.flight_modes import mode_name, mode_names, mode_number
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

mavlink = mavutil.mavlink

# The vehicle's address; a message need not name it. MANUAL_CONTROL calls the system `target`.
TARGETS = {"target_system": 0, "target_component": 1, "target": 0}
WITH_ACK = ("COMMAND_LONG", "COMMAND_INT")
SWITCHES = {  # commands that switch the flight mode, and to which: the first that a type has
    mavlink.MAV_CMD_MISSION_START: ("AUTO",),
    mavlink.MAV_CMD_DO_LAND_START: ("AUTO_RTL", "AUTO"),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: ("RTL",),
    mavlink.MAV_CMD_NAV_LAND: ("LAND",),
}
BITS = {f"{sign}int{bits}_t": (sign == "", bits) for sign in ("", "u") for bits in (8, 16, 32, 64)}  # signed, size
LARGEST_FLOAT = 3.4028234e38  # in single precision


@dataclass(frozen=True)
class RawCommand(MavCommand):
    """A COMMAND_LONG or COMMAND_INT as its sender wrote it; it is sent once."""

    message: Any = None
    repeatable: bool = False

    def to(self, address: Address, confirmation: int) -> Any:
        """The message; it is addressed already."""
        del address, confirmation
        return self.message


def message_named(name: str, fields: Mapping[str, Any], address: Address) -> Any:
    """The message of that name, of MAVProxy's dialect.

    Args:
        name: such as `COMMAND_LONG`, in any case.
        fields: a value for each of its fields: a number, the name of an entry of the field's enum, a list for an
            array, text for characters. Extension fields may be left out; so may the target.
        address: the vehicle's.

    Raises:
        Invalid: there is no such message, a field is missing or unknown, or its type cannot hold the value.
    """
    kind = _kinds().get(name.upper())
    if kind is None:
        raise Invalid(f"there is no MAVLink message {name[:64]!r}", "name")
    unknown = sorted(set(fields) - set(kind.fieldnames))
    if unknown:
        raise Invalid(f"{kind.msgname} has no field {unknown[0][:64]!r}", "fields", unknown[0])
    signature = inspect.signature(kind.__init__).parameters
    targets = {field: address[place] for field, place in TARGETS.items()}
    values = targets | dict(fields)
    arguments = {}
    for field in kind.fieldnames:
        if field in values:
            arguments[field] = _value(kind, field, values[field])
        elif signature[field].default is inspect.Parameter.empty:
            raise Invalid(f"{kind.msgname} needs {field}", "fields", field)
    for field, own in targets.items():
        if field in fields and arguments[field] != own:
            raise Invalid(f"{field} of this vehicle is {own}; name another vehicle in the path", "fields", field)
    return kind(**arguments)


async def send(vehicle: Vehicle, job: Job, message: Any) -> None:
    """Send a message for `job`; a command is done when the vehicle has accepted it, another message when it is sent.

    It supersedes a movement, because it may steer.

    Raises:
        ModeChanged: the vehicle flies in a mode that is the pilot's.
        Paused: `stop` holds the vehicle.
        Busy: a verb of a higher rank is on its way.
        Rejected, TimedOut, LinkLost.
    """

    def require_not_the_pilots() -> None:
        if vehicle.is_under_way and vehicle.mode != "GUIDED":
            raise vehicle.anothers()

    require_not_the_pilots()
    command, written = vehicle.command(job), Written()
    await command.take(Rank.MOVEMENT, lambda: vehicle.guard.require(message))
    number = getattr(message, "command", mavlink.MAV_CMD_DO_SET_MODE)
    arms = number == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and message.param1 == 1
    mode = mode_of(vehicle, message)

    def noted() -> None:
        """What stops the vehicle must know what may still arm it, or switch its mode."""
        if arms:
            vehicle.arm_sent_at, vehicle.arm_written = vehicle.clock(), written
        if mode is not None:
            vehicle.mode_requests.note(mode, number, written)
            job.note_modes({mode_name(vehicle.state.vehicle_type, mode)}, written)

    try:
        if message.get_type() in WITH_ACK:
            raw = RawCommand(number, message=message)
            await command.send(raw, require_not_the_pilots, noted, written=written)
        else:
            await command.post(message, require_not_the_pilots, noted)
    except Rejected:
        if arms:
            vehicle.arm_sent_at = -math.inf
        if mode is not None:
            vehicle.mode_requests.forget(mode)
        raise
    command.confirm()


def mode_of(vehicle: Vehicle, message: Any) -> int | None:
    """The flight mode that a message switches to; None where it switches to none that is known."""
    if message.get_type() not in WITH_ACK:
        return int(message.custom_mode) if message.get_type() == "SET_MODE" else None
    if message.command == mavlink.MAV_CMD_DO_SET_MODE:
        return int(message.param2)
    kind = vehicle.state.vehicle_type
    names = (name for name in SWITCHES.get(message.command, ()) if name in mode_names(kind))
    return next((mode_number(kind, name) for name in names), None)


@cache
def _kinds() -> dict[str, Any]:
    return {kind.msgname: kind for kind in mavlink.mavlink_map.values()}


def _value(kind: Any, field: str, value: Any) -> Any:
    """A field's value, as pymavlink takes it.

    Raises:
        Invalid: the field cannot hold it.
    """
    index = kind.fieldnames.index(field)
    order = kind.ordered_fieldnames.index(field)
    kind_of_number, length = kind.fieldtypes[index], kind.array_lengths[order]
    if kind_of_number == "char":
        return _characters(field, value, max(length, 1))
    enum = mavlink.enums.get(kind.fieldenums_by_name.get(field, ""), {})
    if not length:
        return _number(field, value, kind_of_number, enum)
    if not isinstance(value, list) or len(value) != length:
        raise Invalid(f"{field} is a list of {length} numbers", "fields", field)
    return [_number(field, member, kind_of_number, enum) for member in value]


def _characters(field: str, value: Any, length: int) -> bytes:
    encoded = value.encode("utf-8", "replace") if isinstance(value, str) else b"\0" * (length + 1)
    if len(encoded) > length:
        raise Invalid(f"{field} is a text of at most {length} bytes", "fields", field)
    return encoded


def _number(field: str, value: Any, kind_of_number: str, enum: Mapping[int, Any]) -> int | float:
    if isinstance(value, str):
        value = next((number for number, entry in enum.items() if entry.name == value.upper()), value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Invalid(f"{field} is a number" + (" or a name of its enum" if enum else ""), "fields", field)
    if kind_of_number not in BITS:
        largest = LARGEST_FLOAT if kind_of_number == "float" else sys.float_info.max
        if not is_finite_number(value) or abs(value) > largest:
            raise Invalid(f"{field} is a finite number that its type can hold", "fields", field)
        return float(value)
    signed, bits = BITS[kind_of_number]
    least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    if not is_finite_number(value) or value != int(value) or not least <= value <= most:
        raise Invalid(f"{field} is a whole number from {least} to {most}", "fields", field)
    return int(value)
