from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.vehicle.raw_messages import message_named

VEHICLE = Address(3, 1)
SERVO: dict[str, Any] = {
    "command": "MAV_CMD_DO_SET_SERVO", "confirmation": 0,
    "param1": 9, "param2": 1500, "param3": 0, "param4": 0, "param5": 0, "param6": 0, "param7": 0,
}  # fmt: skip
STICKS = dict.fromkeys(("x", "y", "z", "r", "buttons"), 0)


def test_names_of_the_enum_are_numbers_and_the_target_is_the_vehicle() -> None:
    message = message_named("command_long", SERVO, VEHICLE)
    assert (message.target_system, message.target_component, message.command) == (3, 1, mavlink.MAV_CMD_DO_SET_SERVO)
    assert (message.param1, message.param2) == (9.0, 1500.0)


def test_extension_fields_may_be_left_out() -> None:
    assert message_named("STATUSTEXT", {"severity": 6, "text": "hello"}, VEHICLE).id == 0


def test_arrays_are_lists() -> None:
    fields = {"group_mlx": 0, "controls": [0.1] * 8, "time_usec": 2**64 - 1}
    message = message_named("SET_ACTUATOR_CONTROL_TARGET", fields, VEHICLE)
    assert message.controls == [0.1] * 8


@pytest.mark.parametrize(
    ("name", "fields", "where", "text"),
    [
        ("NO_SUCH", {}, "name", "no MAVLink message"),
        ("COMMAND_LONG", {**SERVO, "param8": 0}, "fields.param8", "no field"),
        ("COMMAND_LONG", {k: v for k, v in SERVO.items() if k != "param7"}, "fields.param7", "needs param7"),
        ("COMMAND_LONG", {**SERVO, "param1": float("nan")}, "fields.param1", "finite"),
        ("COMMAND_LONG", {**SERVO, "param1": 1e39}, "fields.param1", "finite"),
        ("COMMAND_LONG", {**SERVO, "param1": "MAV_CMD_DO_SET_SERVO"}, "fields.param1", "is a number"),
        ("COMMAND_LONG", {**SERVO, "command": "MAV_CMD_NO_SUCH"}, "fields.command", "name of its enum"),
        ("COMMAND_LONG", {**SERVO, "command": 65536}, "fields.command", "from 0 to 65535"),
        ("COMMAND_LONG", {**SERVO, "command": 1.5}, "fields.command", "whole number"),
        ("COMMAND_LONG", {**SERVO, "command": True}, "fields.command", "is a number"),
        ("COMMAND_LONG", {**SERVO, "target_system": 1}, "fields.target_system", "another vehicle in the path"),
        ("STATUSTEXT", {"severity": 6, "text": "a" * 51}, "fields.text", "at most 50 bytes"),
        ("STATUSTEXT", {"severity": 6, "text": 7}, "fields.text", "at most 50 bytes"),
        ("STATUSTEXT", {"severity": -1, "text": ""}, "fields.severity", "from 0 to 255"),
        ("MANUAL_CONTROL", STICKS | {"target": 2}, "fields.target", "another vehicle in the path"),
        ("MANUAL_CONTROL", dict.fromkeys(("target", "x", "y", "z", "r", "buttons"), -40000), "fields.target", "0 to"),
    ],
)  # fmt: skip
def test_what_a_message_cannot_hold_is_refused(name: str, fields: dict[str, Any], where: str, text: str) -> None:
    with pytest.raises(Invalid) as caught:
        message_named(name, fields, VEHICLE)
    (problem,) = caught.value.problems
    assert ".".join(problem["loc"]) == where
    assert text in problem["msg"]


VALUES = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=60), st.lists(st.floats()))


@settings(derandomize=True, database=None, deadline=None, max_examples=150)
@given(data=st.data())
def test_whatever_is_given_either_fits_the_wire_or_is_refused(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from(sorted(mavlink.mavlink_map.values(), key=lambda kind: kind.msgname)))
    names = [field for field in kind.fieldnames if not field.startswith("target_")]
    fields = {name: data.draw(st.one_of(st.integers(0, 200), VALUES)) for name in names}
    try:
        message = message_named(kind.msgname, fields, VEHICLE)
    except Invalid:
        return
    message.pack(mavlink.MAVLink(None, 255, 230))
