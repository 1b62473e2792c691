from __future__ import annotations

import io
import json
from typing import Any

import pytest
from aiohttp import FormData
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Rejected
from mavproxy_uavapi.core.mission.list_transfers import MISSION
from mavproxy_uavapi.core.mission.mission_files import HOME, parts_of
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.handlers.mission import WPL
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

FILE_WAIT = 2.0  # real s that the executor gets before the clock jumps
ITEMS = {"items": [{"command": "NAV_TAKEOFF", "alt": 10}]}


@pytest.fixture
def vehicles_mission(api: Api, loop: FastLoop, copter: Vehicle, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The vehicle's mission, as uploads and clearings leave it."""
    loop.real_wait = FILE_WAIT
    held: list[Any] = []

    async def upload(lists: Any, progress: Any, **_more: Any) -> None:
        progress(1, len(lists[MISSION]))
        held[:] = lists[MISSION]

    async def clear(_kind: int) -> None:
        held.clear()

    async def download() -> Any:
        return HOME, list(held)

    for name, verb in (("upload", upload), ("clear", clear), ("read", download)):
        monkeypatch.setattr(copter.waypoints, name, verb)
    return held


def post(api: Api, data: bytes | str, kind: str = "text/plain") -> Any:
    return api.post("/mission/waypoints", data=data, headers={"Content-Type": kind})


def test_a_file_as_body_or_form_and_json_are_uploaded(api: Api, vehicles_mission: list[Any]) -> None:
    answer = post(api, WPL)
    assert (answer.status, answer.body["result"]) == (200, "Mission of 3 items uploaded")
    assert vehicles_mission == list(parts_of(WPL).items)
    assert post(api, json.dumps(ITEMS), "application/json").body["result"] == "Mission of 1 items uploaded"
    form = FormData()
    form.add_field("file", io.BytesIO(WPL.encode()), filename="m.waypoints")
    assert api.post("/mission/waypoints", data=form).status == 200
    assert len(vehicles_mission) == 3


def test_mission_is_reported_and_cleared(api: Api, loop: FastLoop, vehicles_mission: list[Any]) -> None:
    post(api, WPL)
    reported = api.get("/mission/waypoints").body
    assert (reported["home"]["seq"], [item["seq"] for item in reported["items"]]) == (0, [1, 2, 3])
    assert loop.run(api.ask("DELETE", "/mission/waypoints")).body["result"] == "Mission cleared"
    assert vehicles_mission == []


@pytest.mark.parametrize(("data", "status"), [(b"", 400), (b" ", 400), (b"\xff\xfe", 400), (b"[]", 422), (b"{", 400)])
def test_what_is_no_mission_changes_nothing(api: Api, vehicles_mission: list[Any], data: bytes, status: int) -> None:
    assert post(api, data).status == status
    assert vehicles_mission == []


def test_mission_in_flight_is_not_changed(api: Api, loop: FastLoop, flying: Drone) -> None:
    loop.real_wait = FILE_WAIT
    flying.pilot("AUTO")
    loop.settle()
    assert post(api, WPL).body["code"] == "busy"
    assert loop.run(api.ask("DELETE", "/mission/waypoints")).body["code"] == "busy"


@pytest.mark.usefixtures("vehicles_mission")
def test_refusal_is_reported(api: Api, copter: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    async def refuse(_lists: Any, _progress: Any, **_more: Any) -> None:
        raise Rejected("no; its old mission is unchanged", "MAV_MISSION_NO_SPACE", ["Full"])

    monkeypatch.setattr(copter.waypoints, "upload", refuse)
    answer = post(api, WPL)
    assert (answer.status, answer.body["ack"], answer.body["statustext"]) == (500, "MAV_MISSION_NO_SPACE", ["Full"])


def test_progress_says_how_old_it_is(api: Api, loop: FastLoop, drone: Drone) -> None:
    assert api.get("/mission/progress").body["code"] == "stale"
    drone.send("mission_current", seq=2, total=3, mission_state=mavutil.mavlink.MISSION_STATE_ACTIVE)
    loop.settle()
    body = api.get("/mission/progress").body
    assert (body["info"]["current"], body["info"]["state"]) == (2, "active")
    loop.pass_time(20.0)
    assert api.get("/mission/progress").body["code"] == "stale"
    assert api.get("/mission/progress?max_age=60").status == 200


def test_start_of_a_vehicle_that_is_not_armed_is_409(api: Api, drone: Drone) -> None:
    assert api.post("/mission/start", {}).body["code"] == "not_armed"
    assert drone.orders() == []
