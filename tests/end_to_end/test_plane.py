"""A plane behind the API: the embedded one in lock step, ArduPilot's in a real MAVProxy."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from mavproxy_uavapi.core.vehicle.plane import LOWEST_CIRCLE
from tests.support.processes import Rig
from tests.support.sitl_types import ardupilot_type
from tests.support.wired_rig import WiredRig

pytestmark = pytest.mark.long

FIELD = (-35.363261, 149.165230)  # degrees, where it stands at the beginning


@pytest.fixture(scope="module", params=["lockstep", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def plane(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A plane that the tests share."""
    directory = tmp_path_factory.mktemp("plane")
    rig = WiredRig(directory, "plane") if request.param == "lockstep" else ardupilot_type(directory, "plane")
    yield rig
    rig.stop()


def height(plane: Rig) -> float:
    return float(plane.ok(plane.get("/telemetry/gps"))["info"]["position"]["relative_alt"])


def item(command: str, north: float | None = None, alt: float = 0.0, **params: float) -> dict[str, Any]:
    """A mission item, so many degrees north of the field."""
    place = {} if north is None else {"lat": FIELD[0] + north, "long": FIELD[1], "alt": alt}
    return {"command": command, **place, **params}


def take_off(plane: Rig) -> None:
    plane.ok(plane.get("/command/arm", timeout=60))
    plane.ok(plane.get("/command/takeoff", alt=60))


def wait_until_disarmed(plane: Rig) -> None:
    plane.until(lambda: plane.status()["armed"] is False, 120, "landing and disarming")
    assert plane.status()["landed_state"] == "on_ground"


def test_plane_takes_off_flies_circles_returns_lands_and_arms_again(plane: Rig) -> None:
    take_off(plane)
    assert height(plane) == pytest.approx(60, abs=15)
    assert plane.status()["mode"] == "GUIDED"
    plane.ok(plane.post("/movement/go_to_gps_wait", lat=FIELD[0] + 0.004, long=FIELD[1], alt=80))
    assert height(plane) == pytest.approx(80, abs=15)
    plane.ok(plane.post("/movement/go_to_gps", lat=FIELD[0] + 0.01, long=FIELD[1], alt=80))
    assert plane.ok(plane.get("/movement/stop"))["result"] == "Plane is loitering"
    assert plane.status()["mode"] == "LOITER"
    answer = plane.get("/command/land")
    assert (answer.status_code, answer.json()["code"]) == (409, "busy")
    assert plane.status()["mode"] == "LOITER"
    assert plane.ok(plane.get("/command/rtl"))["result"] == "Returned to launch"
    landing = plane.ok(plane.get("/command/land_at", lat=FIELD[0], long=FIELD[1]))
    assert landing["result"] == f"Landing mission started for coord ({FIELD[0]}, {FIELD[1]})"
    wait_until_disarmed(plane)
    plane.ok(plane.get("/command/arm", timeout=60))
    plane.ok(plane.get("/command/disarm"))


def test_plane_whose_landing_cannot_be_uploaded_stays_in_its_mode(plane: Rig) -> None:
    if plane.control is None:
        pytest.skip("the link of this rig loses nothing")
    take_off(plane)
    plane.control.fault("drop", message="MISSION_ITEM_INT")
    since = plane.control.ask("received", since=0)["last"]
    answer = plane.get("/command/land_at", lat=FIELD[0], long=FIELD[1])
    plane.control.ask("clear")
    assert (answer.status_code, answer.json()["code"]) == (500, "rejected")
    received = plane.control.ask("received", since=since)["messages"]
    commands = {message["fields"]["command"] for message in received if message["name"] == "COMMAND_LONG"}
    assert not commands & {176, 224, 300}, "no mode, no current item, no start"
    assert plane.status()["mode"] == "GUIDED"
    plane.ok(plane.get("/command/land_at", lat=FIELD[0], long=FIELD[1]))
    wait_until_disarmed(plane)
    plane.ok(plane.get("/command/arm", timeout=60))
    plane.ok(plane.get("/command/disarm"))


def test_plane_lands_by_the_landing_sequence_of_the_mission_that_it_flies(plane: Rig) -> None:
    plane.ok(plane.delete("/mission/waypoints"))
    take_off(plane)
    items = [
        item("NAV_WAYPOINT", 0.004, 80.0),
        item("NAV_LOITER_UNLIM", 0.008, 80.0),
        item("DO_LAND_START"),
        item("NAV_WAYPOINT", -0.006, 40.0),
        item("NAV_WAYPOINT", -0.003, 20.0),
        item("NAV_LAND", 0.0),
    ]
    plane.ok(plane.post("/mission/waypoints", items=items))
    plane.ok(plane.post("/mission/start"))
    plane.until(lambda: plane.ok(plane.get("/mission/progress"))["info"]["current"] == 2, 60, "item 2")
    assert plane.ok(plane.get("/command/land", timeout=240))["result"]
    wait_until_disarmed(plane)
    assert plane.status()["mode"] == "AUTO"
    plane.ok(plane.delete("/mission/waypoints"))  # the autopilot does not forget the landing by that
    plane.until(lambda: plane.get("/mission/progress").json()["info"]["current"] == 0, 60, "an empty mission")
    plane.ok(plane.get("/command/arm", timeout=60))
    plane.ok(plane.get("/command/disarm"))


def test_plane_that_is_stopped_low_in_its_landing_climbs_straight_on_whatever_others_ask(plane: Rig) -> None:
    take_off(plane)
    plane.ok(plane.get("/command/land_at", lat=FIELD[0], long=FIELD[1]))
    plane.until(lambda: height(plane) < 12, 240, "its last metres")
    before, lowest = course(plane), height(plane)
    stopping, answers, turned = plane.begin("GET", "/movement/stop"), [], []
    while not stopping.is_answered():  # then it is in LOITER, and go_to is refused again
        answers.append(plane.post("/movement/go_to_gps", lat=FIELD[0], long=FIELD[1] + 0.01, alt=60))
        plane.pass_time(0.1)
        lowest = min(lowest, height(plane))
        if height(plane) < LOWEST_CIRCLE:
            turned.append(abs((course(plane) - before + 180) % 360 - 180))
    assert stopping.answer(60).status_code == 200
    assert {answer.status_code for answer in answers} == {409}
    assert "busy" in {answer.json()["code"] for answer in answers}
    assert turned and max(turned) < 25, "degrees, low over the ground"
    assert lowest > 1
    assert height(plane) > LOWEST_CIRCLE - 1
    plane.ok(plane.get("/command/land_at", lat=FIELD[0], long=FIELD[1]))
    wait_until_disarmed(plane)


def course(plane: Rig) -> float:
    """Degrees over ground."""
    velocity = plane.ok(plane.get("/telemetry/ned"))["info"]["velocity"]
    return math.degrees(math.atan2(velocity["vy"], velocity["vx"]))


@pytest.mark.parametrize("path", ["/movement/resume", "/movement/set_heading?heading=3"])
def test_what_a_plane_does_not_have_is_404(plane: Rig, path: str) -> None:
    answer = plane.get(path)
    assert (answer.status_code, answer.json()["code"]) == (404, "not_supported")
