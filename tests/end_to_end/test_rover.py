"""A rover in a real MAVProxy: the embedded one, and ArduPilot's."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest

from tests.support.sitl_types import ardupilot_type

pytestmark = pytest.mark.long


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def rover(
    request: pytest.FixtureRequest, harness: ModuleType, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Any]:
    """A rover that the tests share."""
    directory = tmp_path_factory.mktemp(request.param)
    embedded = request.param == "embedded"
    rig = (
        harness.embedded(directory, "--vehicle=rover")
        if embedded
        else ardupilot_type(directory, "rover", speedup=harness.SPEEDUP)
    )
    yield rig
    rig.stop()


def test_rover_that_stands_armed_in_manual_is_armed_for_guided_and_disarmed(rover):
    rover.ok(rover.get("/command/arm"))
    rover.ok(rover.get("/command/set_mode", mode="MANUAL"))
    status = rover.status()
    assert (status["mode"], status["armed"], status["landed_state"]) == ("MANUAL", True, "on_ground")
    rover.ok(rover.get("/command/arm"))
    assert rover.status()["mode"] == "GUIDED"
    rover.ok(rover.get("/command/set_mode", mode="MANUAL"))
    rover.ok(rover.get("/command/disarm"))
    assert rover.status()["armed"] is False


def test_rover_drives_to_places_stops_and_returns(rover):
    rover.ok(rover.get("/command/arm"))
    assert rover.ok(rover.get("/command/guided"))["result"] == "Rover in GUIDED mode"
    there = rover.ok(rover.post("/movement/go_to_ned_wait", x=30, y=10, z=0))
    assert there["result"] == "Arrived at NED coord (30, 10, 0)"
    assert math.dist(rover.ned()[:2], (30, 10)) < 3
    rover.ok(rover.post("/movement/go_to_ned", x=-300, y=0, z=0))
    assert rover.ok(rover.get("/movement/stop"))["result"] == "Rover has stopped"
    assert rover.status()["mode"] == "HOLD"
    rover.ok(rover.get("/command/guided"))
    rover.ok(rover.get("/command/set_reverse", reverse="true"))
    rover.ok(rover.get("/command/set_ground_speed", new_v=3))
    assert rover.ok(rover.get("/command/rtl"))["result"] == "Returned to launch"
    assert math.hypot(*rover.ned()[:2]) < 5
    rover.ok(rover.get("/command/brake"))
    rover.ok(rover.get("/command/disarm"))


def test_rover_that_rolls_after_stop_is_nobodys_before_it_stands(rover):
    rover.ok(rover.get("/command/arm"))
    rover.ok(rover.get("/command/guided"))
    rover.ok(rover.get("/command/set_sim_speedup", sim_factor=1))
    rover.ok(rover.post("/movement/go_to_ned", x=300, y=0, z=0))
    rover.until(lambda: speed(rover) > 3, 60, "its speed")
    stopping, answers = rover.begin("GET", "/movement/stop"), []
    while not answers or answers[-1].status_code != 200:
        answers.append(rover.get("/command/guided"))
    assert speed(rover) < 0.7
    assert stopping.answer(30).status_code == 200
    assert "busy" in {answer.json().get("code") for answer in answers}
    rover.ok(rover.get("/command/disarm"))


def speed(rover):
    velocity = rover.ok(rover.get("/telemetry/ned"))["info"]["velocity"]
    return math.hypot(velocity["vx"], velocity["vy"])


@pytest.mark.parametrize("path", ["/command/takeoff", "/command/land", "/movement/set_heading?heading=3"])
def test_what_a_rover_does_not_have_is_404(rover, path):
    answer = rover.get(path)
    assert (answer.status_code, answer.json()["code"]) == (404, "not_supported")
