from __future__ import annotations

from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import TimedOut, ToolFailed
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.programs import cameras
from mavproxy_uavapi.programs.cameras import Shot
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

SERVO = mavutil.mavlink.MAV_CMD_DO_SET_SERVO


@pytest.mark.parametrize("slash", ["", "/"])
def test_servo_output(drone: Drone, api: Api, slash: str) -> None:
    answer = api.post(f"/peripherical/servo_output{slash}", {"channel": 9, "pwm": 1700})
    assert (answer.status, answer.body["result"]) == (200, "Servo 9 set to 1700 PWM")
    assert [(command.param1, command.param2) for command in drone.commands(SERVO)] == [(9, 1700)]


@pytest.mark.parametrize(
    "body",
    [
        {"channel": 0, "pwm": 1500},
        {"channel": 17, "pwm": 1500},
        {"channel": 1, "pwm": 799},
        {"channel": 1, "pwm": 2201},
        {"channel": 1.5, "pwm": 1500},
        {"channel": 1},
    ],
)
def test_servo_out_of_range_is_422_and_nothing_is_sent(drone: Drone, api: Api, body: dict[str, Any]) -> None:
    assert api.post("/peripherical/servo_output", body).status == 422
    assert drone.received == []


@pytest.fixture
def taken(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What the camera tool was asked for."""
    requested: list[Any] = []

    async def take(tool: str, shot: Shot) -> bytes:
        requested.append((tool, shot))
        return b"\xff\xd8\xffpicture"

    monkeypatch.setattr(cameras, "take", take)
    return requested


def photo(api: Api, loop: FastLoop, query: str) -> Any:
    async def ask() -> Any:
        async with api.client.get(f"/peripherical/take_photo?{query}") as response:
            return response, await response.read()

    return loop.run(ask())


def test_photo_is_a_jpeg_attachment_and_needs_no_vehicle(api: Api, loop: FastLoop, taken: list[Any]) -> None:
    response, body = photo(api, loop, "command=rpicam-still&focus_distance=2")
    assert (response.status, response.content_type) == (200, "image/jpeg")
    assert body.startswith(b"\xff\xd8\xff\xe1") and b"Exif" in body and body.endswith(b"\xffpicture")
    assert response.headers["Content-Disposition"] == 'attachment; filename="photo.jpg"'
    assert taken == [("rpicam-still", Shot(1280, 720, 150, 2.0))]


@pytest.mark.parametrize("query", ["command=rm", "command=", "command=fswebcam&resolution=big"])
def test_other_tools_and_bad_resolutions_are_400(api: Api, taken: list[Any], query: str) -> None:
    answer = api.get(f"/peripherical/take_photo?{query}")
    assert (answer.status, answer.body["code"]) == (400, "bad_request")
    assert taken == []


def test_a_tool_that_there_is_not_is_told_which_are_allowed(api: Api) -> None:
    detail = api.get("/peripherical/take_photo?command=rm").body["detail"]
    assert detail == "camera tool 'rm' is not allowed, but fswebcam, rpicam-still, libcamera-still, vision"


@pytest.mark.parametrize(
    "query",
    [
        "",
        "command=fswebcam&capture_time=-1",
        "command=rpicam-still&exposure=0",
        "command=fswebcam&focus_distance=nan",
    ],
)
def test_values_out_of_range_are_422(api: Api, taken: list[Any], query: str) -> None:
    assert api.get(f"/peripherical/take_photo?{query}").status == 422
    assert taken == []


@pytest.mark.parametrize(("error", "status"), [(ToolFailed("failed", "its words"), 500), (TimedOut("slow"), 504)])
def test_failures_are_reported(api: Api, monkeypatch: pytest.MonkeyPatch, error: Exception, status: int) -> None:
    async def take(_tool: str, _shot: Shot) -> bytes:
        raise error

    monkeypatch.setattr(cameras, "take", take)
    answer = api.get("/peripherical/take_photo?command=fswebcam")
    assert (answer.status, answer.body.get("stderr")) == (status, getattr(error, "stderr", None))


def test_vision_is_the_newest_frame_of_the_vision_module(api: Api, loop: FastLoop, service: Service) -> None:
    assert api.get("/peripherical/take_photo?command=vision").status == 400

    async def newest_frame() -> bytes:
        return b"\xff\xd8\xffframe"  # geotagged already

    service.host.newest_frame = newest_frame
    assert photo(api, loop, "command=vision")[1] == b"\xff\xd8\xffframe"
