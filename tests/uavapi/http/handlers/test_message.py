"""/message, before the scripted copter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.drone import Drone
from tests.uavapi.http.conftest import Api

PAUSE = {"command": "MAV_CMD_DO_SET_MODE", "confirmation": 0, "param1": 1, "param2": 17}
PAUSE |= dict.fromkeys([f"param{number}" for number in range(3, 8)], 0)
BRAKE = {"name": "COMMAND_LONG", "fields": PAUSE}
DOWN = {"time_boot_ms": 0, "coordinate_frame": "MAV_FRAME_LOCAL_NED", "type_mask": 0x0DF8, "x": 0, "y": 0, "z": -5}
DOWN |= dict.fromkeys(("vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0)
SETPOINT = {"name": "SET_POSITION_TARGET_LOCAL_NED", "fields": DOWN}


@pytest.fixture
def allowed(api: Api) -> None:
    api.service.settings = replace(api.service.settings, allow_raw=True)


def test_off_until_it_is_set(api: Api, flying: Drone) -> None:
    answer = api.post("/message", BRAKE)
    assert (answer.status, answer.body["code"]) == (403, "forbidden")
    assert "allow_raw" in answer.body["detail"]
    assert flying.orders() == []


@pytest.mark.usefixtures("allowed")
def test_a_command_is_done_when_it_is_accepted(api: Api, flying: Drone) -> None:
    answer = api.post("/message", BRAKE)
    assert (answer.status, answer.body["result"]) == (200, "COMMAND_LONG accepted")
    assert flying.mode == "BRAKE"


@pytest.mark.usefixtures("allowed")
def test_a_refused_command_is_an_error_with_its_ack(api: Api, flying: Drone) -> None:
    flying.answers[mavlink.MAV_CMD_DO_SET_MODE] = [mavlink.MAV_RESULT_DENIED]
    answer = api.post("/message", BRAKE)
    assert (answer.status, answer.body["code"], answer.body["ack"]) == (500, "rejected", "MAV_RESULT_DENIED")
    assert len(flying.orders()) == 1


@pytest.mark.usefixtures("allowed")
def test_any_other_message_is_sent_as_it_is(api: Api, flying: Drone) -> None:
    assert api.post("/message", SETPOINT).body["result"] == "SET_POSITION_TARGET_LOCAL_NED sent"
    (order,) = flying.orders()
    assert (order.get_type(), order.z, order.target_system) == ("SET_POSITION_TARGET_LOCAL_NED", -5.0, 1)


@pytest.mark.usefixtures("allowed")
def test_it_supersedes_a_movement(api: Api, flying: Drone) -> None:
    movement = api.post("/movement/go_to_ned_wait?wait=false", {"x": 200, "y": 0, "z": -20}).body["job"]
    assert api.post("/message", SETPOINT).status == 200
    assert api.get(f"/jobs/{movement}").body["error"]["code"] == "superseded"


@pytest.mark.usefixtures("allowed")
@pytest.mark.parametrize("message", [BRAKE, SETPOINT])
def test_a_pilot_who_flies_is_left_alone(api: Api, flying: Drone, message: Any) -> None:
    flying.pilot("LOITER")
    api.loop.settle()
    answer = api.post("/message", message)
    assert (answer.status, answer.body["code"]) == (409, "mode_changed")
    assert flying.orders() == []


@pytest.mark.usefixtures("allowed")
def test_what_does_not_fit_is_422_and_names_the_field(api: Api, flying: Drone) -> None:
    answer = api.post("/message", {**BRAKE, "fields": {**PAUSE, "param1": "x"}})
    assert answer.status == 422
    assert answer.body["detail"][0]["loc"] == ["body", "fields", "param1"]
    assert flying.orders() == []


HOSTILE = {
    "a number of 401 digits": (b'{"name": "PARAM_SET", "fields": {"param_value": ' + b"9" * 401 + b"}}", 422),
    "a whole number of 401 digits": (b'{"name": "PARAM_SET", "fields": {"param_type": ' + b"9" * 401 + b"}}", 422),
    "half a character": (b'{"name": "STATUSTEXT", "fields": {"severity": 1, "text": "\\ud800"}}', 400),
    "half a name": (b'{"name": "\\ud800"}', 400),
    "a name twice": (b'{"name": "A", "name": "COMMAND_LONG"}', 422),
    "nested": (b'{"name": "A", "fields": ' + b'{"a":' * 500 + b"1" + b"}" * 501, 400),
}


@pytest.mark.usefixtures("allowed")
@pytest.mark.parametrize("kind", HOSTILE)
def test_what_json_cannot_mean_is_refused_by_no_defect(api: Api, flying: Drone, kind: str) -> None:
    body, status = HOSTILE[kind]
    answer = api.post("/message", data=body, headers={"Content-Type": "application/json"})
    assert answer.status == status, answer.body
    assert flying.orders() == []


@pytest.mark.parametrize("charset", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_a_body_in_another_charset_is_read(api: Api, flying: Drone, charset: str) -> None:
    named = "" if charset == "utf-8-sig" else f"; charset={charset}"
    headers = {"Content-Type": f"application/json{named}"}
    body = '{"x": 1, "y": 0, "z": 0}'.encode(charset)
    assert api.post("/movement/drive", data=body, headers=headers).status == 200
    assert flying.orders() != []


def test_a_body_in_an_unknown_charset_is_refused_by_its_name(api: Api, flying: Drone) -> None:
    answer = api.post("/movement/drive", data=b"{}", headers={"Content-Type": "application/json; charset=klingon"})
    assert answer.status == 400 and "klingon" in answer.body["detail"]
    assert flying.orders() == []
