"""The fence and the rally points that the autopilot keeps, through the API, in virtual time."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace.store import OPERATOR
from tests.rules.test_envelope import put
from tests.support.envelopes import FIELD, feature, place, square
from tests.support.make_world import MakeWorld
from tests.support.world import World

FENCE, RALLY = mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY
HOME_FIELD = {"type": "FeatureCollection", "features": [feature("field", square(100))]}
ALL_IN_ONE = {
    "fileType": "Plan",
    "version": 1,
    "mission": {
        "version": 2,
        "items": [
            {
                "type": "SimpleItem",
                "command": 22,
                "frame": 3,
                "params": [0, 0, 0, None, 0, 0, 10],
                "autoContinue": True,
                "doJumpId": 1,
            },
        ],
    },
    "geoFence": {
        "version": 2,
        "polygons": [{"version": 1, "inclusion": True, "polygon": [list(place(*c)) for c in square(200)]}],
        "circles": [
            {"version": 1, "inclusion": False, "circle": {"center": list(place(90, 0)), "radius": 12.5}},
        ],
    },
    "rallyPoints": {"version": 2, "points": [[*place(20, 20), 30.48], [*place(-20, 20), 25]]},
}


def held(world: World, kind: int) -> list[Any]:
    return list(world.simulator.missions.items(kind))


def plan(**changes: Any) -> dict[str, Any]:
    return ALL_IN_ONE | changes


@pytest.mark.parametrize("vehicle", ["copter", "plane", "rover"])
def test_a_plan_with_fence_and_rally_points_uploads_all_three(make_world: MakeWorld, vehicle: str) -> None:
    world = make_world(World.boot, vehicle=vehicle)
    answer = world.ask("POST", "/mission/waypoints", plan())
    assert answer.body["result"] == "Mission of 1 items, fence of 5 items, list of 2 rally points uploaded"
    assert [one.param1 for one in held(world, FENCE)] == [4, 4, 4, 4, 12.5]
    assert [one.z for one in held(world, RALLY)] == [30, 25]
    assert world.simulator.vehicle.parameters["RALLY_TOTAL"] == 2
    areas = world.ask("GET", "/mission/fence").body["fence"]["features"]
    assert [area["properties"]["kind"] for area in areas] == ["inclusion", "exclusion"]
    points = world.ask("GET", "/mission/rally").body["points"]
    assert [[point[name] for name in ("seq", "alt", "frame")] for point in points] == [
        [1, 30, "relative"],
        [2, 25, "relative"],
    ]
    assert world.ask("GET", "/mission/waypoints").body["items"][0]["command"] == "NAV_TAKEOFF"


def test_a_mission_that_is_refused_puts_fence_and_rally_points_back(make_world: MakeWorld) -> None:
    world = make_world(World.boot)
    assert world.ask("POST", "/mission/fence", HOME_FIELD).outcome == "200"
    before = held(world, FENCE)
    takeoff = ALL_IN_ONE["mission"]["items"][0]  # type: ignore[index]
    spoilt = {"version": 2, "items": [takeoff, {**takeoff, "command": 31000, "doJumpId": 2}]}
    refused = world.ask("POST", "/mission/waypoints", plan(mission=spoilt))
    assert refused.outcome == "500 rejected"
    assert "item 2 (WAYPOINT_USER_1, command 31000) of the mission" in refused.body["detail"]
    assert "its old fence (4 items) was put back" in refused.body["detail"]
    assert "it has no list of rally points, as before" in refused.body["detail"]
    assert (held(world, FENCE), held(world, RALLY)) == (before, [])


def test_a_fence_that_the_autopilot_refuses_is_refused_in_its_words(make_world: MakeWorld) -> None:
    world = make_world(World.boot)
    many = {**HOME_FIELD, "features": [feature(str(n), square(5, 20.0 * n), "exclusion") for n in range(20)]}
    assert world.ask("POST", "/mission/fence", HOME_FIELD).outcome == "200"
    refused = world.ask("POST", "/mission/fence", many)
    assert refused.outcome == "500 rejected" and refused.body["ack"] == "MAV_MISSION_ERROR"
    assert refused.body["statustext"] == ["Fence exceeds storage size", "Fence validation failed"]
    assert "its old fence is unchanged" in refused.body["detail"]
    assert len(held(world, FENCE)) == 4


def test_what_get_answers_is_what_post_takes(make_world: MakeWorld) -> None:
    world = make_world(World.boot)
    two = {**HOME_FIELD, "features": [feature("a", square(100)), feature("b", square(50))]}
    assert world.ask("POST", "/mission/fence", two).outcome == "422 invalid"
    assert world.ask("POST", "/mission/fence", {**two, "every": True}).outcome == "200"
    fence = world.ask("GET", "/mission/fence").body["fence"]
    assert world.ask("POST", "/mission/fence", fence).outcome == "200"
    point = {"lat": place(10, 0)[0], "long": place(10, 0)[1], "alt": 20, "frame": "amsl"}
    assert world.ask("POST", "/mission/rally", {"points": [point]}).outcome == "200"
    points = world.ask("GET", "/mission/rally").body["points"]
    assert world.ask("POST", "/mission/rally", {"points": points}).outcome == "200"
    for path in ("/mission/fence", "/mission/rally"):
        assert world.ask("DELETE", path).outcome == "200"
    assert held(world, FENCE) == held(world, RALLY) == []


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/mission/fence", {**HOME_FIELD, "limits": {"height": 50}}),
        ("/mission/fence", {**HOME_FIELD, "features": [feature("a", square(9), ceiling=20)]}),
        ("/mission/fence", {"type": "FeatureCollection", "features": []}),
        ("/mission/rally", {"points": []}),
        ("/mission/rally", {"points": [{"lat": 1, "alt": 2}]}),
        ("/mission/rally", {"points": [{"lat": 91, "long": 1, "alt": 2}]}),
        ("/mission/rally", {"points": [{"lat": 1, "long": 1, "alt": 2, "altitude": 3}]}),
        ("/mission/rally", {"points": [1]}),
    ],
)
def test_what_a_list_cannot_hold_is_refused_and_nothing_is_sent(
    make_world: MakeWorld, path: str, body: dict[str, Any]
) -> None:
    world = make_world(World.boot)
    assert world.ask("POST", path, body).outcome == "422 invalid"
    assert held(world, FENCE) == held(world, RALLY) == []


def test_the_vehicles_fence_is_its_envelope_as_soon_as_it_is_uploaded(make_world: MakeWorld) -> None:
    world = make_world(World.flying)
    world.host.envelopes.expects_fences = True
    world.host.envelopes.clear(OPERATOR)
    far = dict(zip(("lat", "long"), place(150, 0), strict=True), alt=10)
    near = dict(zip(("lat", "long"), place(50, 0), strict=True), alt=10)
    assert world.ask("POST", "/movement/go_to_gps", near).outcome == "409 outside_envelope"
    assert world.ask("POST", "/mission/fence", HOME_FIELD).outcome == "200"
    assert world.ask("POST", "/movement/go_to_gps", near).outcome == "200"
    assert world.ask("POST", "/movement/go_to_gps", far).outcome == "409 outside_envelope"
    assert world.ask("DELETE", "/mission/fence").outcome == "200"
    assert world.ask("POST", "/movement/go_to_gps", near).outcome == "409 outside_envelope"


def test_mission_outside_its_own_fence_puts_the_old_one_back_and_says_so(make_world: MakeWorld) -> None:
    world = make_world(World.boot)
    world.host.envelopes.expects_fences = True
    world.host.envelopes.clear(OPERATOR)
    assert world.ask("POST", "/mission/fence", HOME_FIELD).outcome == "200"
    out = {**ALL_IN_ONE["mission"]["items"][0], "command": 16, "params": [0, 0, 0, None, *place(300, 0), 10]}  # type: ignore[index]
    refused = world.ask("POST", "/mission/waypoints", plan(mission={"version": 2, "items": [out]}))
    assert refused.outcome == "409 outside_envelope"
    assert "its old fence (4 items) was put back" in refused.body["detail"]
    assert "nothing was sent" not in refused.body["detail"]
    assert len(held(world, FENCE)) == 4


def test_rally_points_outside_of_the_envelope_are_refused(make_world: MakeWorld) -> None:
    world = make_world(World.flying)
    put(world, FIELD)
    for north, alt, outcome in ((20, 30, "200"), (50, 30, "409 outside_envelope"), (500, 30, "409 outside_envelope")):
        point = dict(zip(("lat", "long"), place(north, 0), strict=True), alt=alt)
        assert world.ask("POST", "/mission/rally", {"points": [point]}).outcome == outcome
    assert len(held(world, RALLY)) == 1


def test_under_another_envelope_a_fence_changes_on_the_ground_only(make_world: MakeWorld) -> None:
    world = make_world(World.flying)
    put(world, FIELD)
    assert world.ask("POST", "/mission/fence", HOME_FIELD).outcome == "409 outside_envelope"
    assert world.ask("DELETE", "/mission/fence").outcome == "409 outside_envelope"
    assert world.ask("GET", "/command/land").outcome == "200"
    assert world.ask("POST", "/mission/fence", HOME_FIELD).outcome == "200"


def test_what_of_a_fence_file_is_not_used_is_in_the_answer(make_world: MakeWorld) -> None:
    world = make_world(World.boot)
    row = "{}\t0\t0\t{}\t3\t0\t0\t0\t{:.7f}\t{:.7f}\t0\t1"
    rows = [row.format(n, 5001, *place(*c)) for n, c in enumerate([(-90, -90), (90, -90), (0, 90)], 1)]
    text = "\n".join(["QGC WPL 110", row.format(0, 5000, *place(0, 0)), *rows])
    answer = world.ask("POST", "/mission/fence", text.encode(), "text/plain")
    assert answer.body["result"] == "Fence of 3 items uploaded; the breach return point is not used"


def test_a_rally_file_of_mavproxy_is_taken_and_a_fence_sent_as_a_mission_is_not(make_world: MakeWorld) -> None:
    world = make_world(World.boot)
    lat, lon = place(20, 20)
    line = f"RALLY {lat:.6f}\t{lon:.6f}\t25.000000\t40.000000\t0.000000\t0\n"
    assert (
        world.ask("POST", "/mission/rally", line.encode(), "text/plain").body["result"]
        == "List of 1 rally points uploaded"
    )
    assert [one.z for one in held(world, RALLY)] == [25]
    rows = f"QGC WPL 110\n0\t0\t3\t5100\t0\t0\t0\t0\t{lat}\t{lon}\t25\t1\n"
    before = held(world, mavlink.MAV_MISSION_TYPE_MISSION)
    refused = world.ask("POST", "/mission/waypoints", rows.encode(), "text/plain")
    assert refused.outcome == "422 invalid"
    assert held(world, mavlink.MAV_MISSION_TYPE_MISSION) == before
