"""What was not rehearsed is refused where it begins; who may rehearse what."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import METRES_PER_DEGREE
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.http.callers.caller import Caller
from mavproxy_uavapi.scripts.rehearser import Conditions, File, RehearsalReport
from tests.support.envelopes import field
from tests.support.make_world import MakeWorld
from tests.support.world import PLACE, World, item_at

TRACK = "/mission/fly-track"
FLOWN = {
    "status": 2,
    "flights": [
        {
            "failure": "",
            "broken": [{"rule": "envelope", "system": 1, "at": 4.0, "sentence": "inside mast"}],
            "losses": [
                {"at": 3.0, "system": 1, "what": "gps", "lat": 1.0, "lon": 2.0, "height": 0.0, "mode": "LAND"}
                | {"armed": False, "seconds": 8.0}
            ],
            "duration_s": 9.0,
            "output": "landed",
            "vehicles": {
                "1": {"distance_m": 40.0, "highest_m": 8.0, "samples": [[0.0, 1.0, 2.0, 8.0, *"abcde", 81.0]]}
            },
        }
    ],
}


def command_long(command: int, *parameters: float) -> dict[str, float]:
    values = (*parameters, *(0,) * (7 - len(parameters)))
    return {"command": command, "confirmation": 0, **{f"param{n}": value for n, value in enumerate(values, 1)}}


@pytest.fixture
def world(make_world: MakeWorld, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> World:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    world: World = make_world(rehearse="require", allow_raw=True)
    world.copter.mission.items[:] = [item_at(*PLACE), item_at(PLACE[0] + 0.002, PLACE[1])]
    world.pass_time(2.0)
    return world


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("POST", "/mission/start", {}),
        ("GET", "/command/set_mode?mode=AUTO", None),
        ("GET", "/command/set_mode?mode=auto", None),
        ("POST", "/fleet/set_mode", {"vehicles": [1], "mode": "AUTO"}),
        ("POST", "/message", {"name": "SET_MODE", "fields": {"base_mode": 1, "custom_mode": 3}}),
        ("POST", "/message", {"name": "COMMAND_LONG", "fields": command_long(mavlink.MAV_CMD_DO_SET_MODE, 1, 3)}),
        ("POST", "/message", {"name": "COMMAND_LONG", "fields": command_long(mavlink.MAV_CMD_MISSION_START)}),
    ],
)
def test_mission_that_was_not_rehearsed_is_refused_however_it_begins(
    world: World, method: str, path: str, body: Any
) -> None:
    answer = world.ask(method, path, body)
    code = answer.body["vehicles"]["1"]["code"] if "fleet" in path else answer.body["code"]
    assert code == "not_rehearsed", answer.body
    assert world.vehicle.mode.name == "GUIDED"


def test_mission_that_was_rehearsed_begins_until_it_is_changed(world: World) -> None:
    began: list[File] = []
    world.service.rehearser.begin = lambda vehicle, file, options: began.append(file)  # type: ignore[method-assign]
    assert world.ask("POST", "/rehearsals", {"seed": 3}).outcome == "200"
    rehearsals.keep(began[0].digest, "{}")
    rehearsals.vouch(began[0].digest, json.dumps(Conditions.of(world.host.registry.find(1), ())))
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.copter.mission.items.append(item_at(PLACE[0], PLACE[1] + 0.002))
    assert world.ask("GET", "/command/guided").outcome == "200"
    assert world.ask("POST", "/mission/start").outcome == "409 not_rehearsed"


def test_mission_that_another_uploads_while_it_is_looked_up_does_not_begin(world: World) -> None:
    def changed_meanwhile(*_: Any) -> None:
        world.host.registry.find(1).waypoints.changes += 1  # an upload of ours

    world.service.rehearser.require = changed_meanwhile  # type: ignore[method-assign]
    assert world.ask("POST", "/mission/start").outcome == "409 superseded"
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "409 superseded"
    assert world.vehicle.mode.name == "GUIDED"


def track_to(metres: float) -> str:
    """The text of a track from the vehicle's place so many m to the north."""
    rows = [(PLACE[0] + north / METRES_PER_DEGREE, PLACE[1], 584 + 8) for north in (0.0, metres)]
    readings = [(0, round(lat * 1e7), round(lon * 1e7), alt * 1000, *[0] * 4, 3, 10) for lat, lon, alt in rows]
    return "\n".join(map(str, readings))


def test_track_that_was_rehearsed_is_flown_as_it_is_under_the_same_envelope(world: World) -> None:
    began: list[File] = []
    world.service.rehearser.begin = lambda vehicle, file, options: began.append(file)  # type: ignore[method-assign]
    track = {"track": track_to(20.0), "ground": 584, "transit": 12}
    assert world.ask("POST", TRACK, track).outcome == "409 not_rehearsed"
    assert world.ask("POST", "/rehearsals", {"path": TRACK, "body": track}).outcome == "200"
    assert json.loads(began[0].content)["body"] == {**track, "reach": 10_000.0}
    rehearsals.keep(began[0].digest, "{}")
    rehearsals.vouch(began[0].digest, json.dumps(Conditions.of(world.host.registry.find(1), ())))
    for other in ({**track, "track": track_to(21.0)}, {**track, "transit": 13}):
        assert world.ask("POST", TRACK, other).outcome == "409 not_rehearsed"
    world.ask("PUT", "/envelope", field(500.0, 400.0))
    assert world.ask("POST", TRACK, track).outcome == "409 not_rehearsed"
    world.ask("DELETE", "/envelope")
    assert world.ask("POST", TRACK, track).outcome == "200"


def test_mission_by_camera_that_was_rehearsed_is_flown_with_the_same_settings(
    make_world: MakeWorld, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    world = make_world(camera={"descent": 0.8}, rehearse="require")
    began: list[File] = []
    world.service.rehearser.begin = lambda vehicle, file, options: began.append(file)  # type: ignore[method-assign]
    mission = {"north": 4, "east": 0}
    assert world.ask("POST", "/vision/mission", mission).outcome == "409 not_rehearsed"
    assert world.ask("POST", "/rehearsals", {"path": "/vision/mission", "body": mission}).outcome == "200"
    assert json.loads(began[0].content)["vision"] == {"descent": 0.8}
    rehearsals.keep(began[0].digest, "{}")
    rehearsals.vouch(began[0].digest, json.dumps(Conditions.of(world.host.registry.find(1), ())))
    assert world.ask("POST", "/vision/mission?wait=false", {**mission, "east": 1}).outcome == "409 not_rehearsed"
    usual = world.tracker.settings
    world.tracker.settings = replace(usual, on_failure="hold")
    assert world.ask("POST", "/vision/mission?wait=false", mission).outcome == "409 not_rehearsed"
    world.tracker.settings = usual
    assert world.ask("POST", "/vision/mission?wait=false", mission).outcome == "202"


@pytest.mark.parametrize(
    ("body", "outcome"),
    [
        ({"path": TRACK, "body": {"track": ""}}, "422 invalid"),
        ({"path": TRACK, "body": {"track": "1", "hight": 5}}, "422 invalid"),
        ({"path": "/command/arm"}, "404 not_found"),
        ({"path": TRACK, "script_name": "a"}, "422 invalid"),
        ({"body": {"track": "1"}}, "422 invalid"),
    ],
)
def test_what_no_request_flies_is_not_rehearsed(world: World, body: Any, outcome: str) -> None:
    assert world.ask("POST", "/rehearsals", body).outcome == outcome


def test_answer_tells_what_was_broken_and_the_way(world: World) -> None:
    world.service.rehearser.newest = RehearsalReport("a.py", FLOWN, "")
    newest = world.ask("GET", "/rehearsals?until_ended=true").body["newest"]
    assert (newest["verdict"], newest["broken"][0]["rule"], newest["battery_left"]) == ("broken", "envelope", 81.0)
    assert newest["way"] == [[1.0, 2.0, 8.0]]
    assert [(one["what"], one["mode"], "system" in one) for one in newest["losses"]] == [("gps", "LAND", False)]
    world.service.rehearser.newest = RehearsalReport("a.py", None, "this machine was too slow")
    newest = world.ask("GET", "/rehearsals").body["newest"]
    assert (newest["verdict"], newest["failure"]) == ("not flown", "this machine was too slow")


def test_nothing_is_rehearsed_without_a_mission(world: World) -> None:
    world.copter.mission.items.clear()
    assert world.ask("POST", "/rehearsals").outcome == "404 not_found"


def test_what_a_rehearsed_script_printed_is_for_admins(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    world.service.rehearser.newest = RehearsalReport("a.py", FLOWN, "")
    assert world.ask("GET", "/rehearsals").body["newest"]["output"] == "landed"
    monkeypatch.setattr(Caller, "role", Role.FLY)
    assert "output" not in world.ask("GET", "/rehearsals").body["newest"]
