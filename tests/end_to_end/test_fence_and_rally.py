"""A .plan with a mission, a fence and rally points, and each of the lists alone: up, read back, followed, removed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from mavproxy_uavapi.files.envelope_file import EnvelopeFile
from tests.support.envelopes import feature, place, square
from tests.support.processes import Rig, ardupilot
from tests.support.wired_rig import WiredRig

SPEEDUP = 1  # a vehicle gives a list up after 8 s of its own clock
JSON = "application/json"
MAST = feature("mast", square(10, 50), "exclusion")
FIELD = {"type": "FeatureCollection", "features": [feature("field", square(100)), MAST]}


@pytest.fixture(scope="module", params=["lockstep", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    directory = tmp_path_factory.mktemp("fence")
    made: Any
    if request.param == "lockstep":
        made = WiredRig(directory)
        EnvelopeFile(made.world.host.envelopes, print).use("vehicle")
    else:
        made = ardupilot(directory, speedup=SPEEDUP, envelope="vehicle")
    yield made
    made.stop()


@pytest.fixture(autouse=True)
def empty(rig: Rig) -> Iterator[None]:
    yield
    for path in ("waypoints", "fence", "rally"):
        rig.ok(rig.delete(f"/mission/{path}"))


def item(command: int, *params: float) -> dict[str, Any]:
    return {"type": "SimpleItem", "command": command, "frame": 3, "autoContinue": True, "params": list(params)}


def plan(half: float) -> str:
    """A square fence with a hole and a circle in it, two rally points, and a mission."""
    circle = {"circle": {"center": list(place(40, 40)), "radius": 12.5}, "inclusion": False, "version": 1}
    polygons = [
        {"polygon": [list(place(*corner)) for corner in square(half)], "inclusion": True, "version": 1},
        {"polygon": [list(place(*corner)) for corner in square(5, -40, 0)], "inclusion": False, "version": 1},
    ]
    mission = [item(22, 0, 0, 0, 0, 0, 0, 10), item(16, 0, 0, 0, 0, *place(30, 0), 12)]
    return json.dumps(
        {
            "fileType": "Plan",
            "version": 1,
            "mission": {"version": 2, "plannedHomePosition": [*place(0, 0), 584], "items": mission},
            "geoFence": {"version": 2, "circles": [circle], "polygons": polygons},
            "rallyPoints": {"version": 2, "points": [[*place(20, -20), 15], [*place(-20, 20), 8]]},
        }
    )


def send(rig: Rig, path: str, text: str, kind: str = JSON) -> Any:
    return rig.call("POST", f"/mission/{path}", data=text, headers={"Content-Type": kind})


def areas(rig: Rig) -> list[tuple[str, str]]:
    found = rig.ok(rig.get("/mission/fence"))["fence"]["features"]
    return sorted((one["properties"]["kind"], one["geometry"]["type"]) for one in found)


def rally(rig: Rig) -> list[tuple[float, float, float]]:
    points = rig.ok(rig.get("/mission/rally"))["points"]
    return [(point["lat"], point["long"], point["alt"]) for point in points]


def test_a_plan_uploads_mission_fence_and_rally_points_and_the_envelope_follows(rig: Rig) -> None:
    done = rig.ok(send(rig, "waypoints", plan(90)))
    assert done["result"] == "Mission of 2 items, fence of 9 items, list of 2 rally points uploaded"
    assert len(rig.ok(rig.get("/mission/waypoints"))["items"]) == 2
    assert areas(rig) == [("exclusion", "Point"), ("exclusion", "Polygon"), ("inclusion", "Polygon")]
    assert rally(rig) == [pytest.approx((*place(20, -20), 15)), pytest.approx((*place(-20, 20), 8))]
    envelope = rig.ok(rig.get("/envelope"))
    assert json.dumps(envelope).count('"exclusion"') >= 2
    outside = dict(zip(("lat", "long"), place(200, 0), strict=True))
    refused = rig.call("POST", "/mission/waypoints", json={"items": [{"command": 16, **outside, "alt": 10}]})
    assert refused.status_code == 409 and refused.json()["code"] == "outside_envelope"


def test_a_fence_alone_is_replaced_and_removed(rig: Rig) -> None:
    rig.ok(send(rig, "fence", json.dumps(FIELD)))
    assert areas(rig) == [("exclusion", "Polygon"), ("inclusion", "Polygon")]
    small = {"type": "FeatureCollection", "features": [feature("field", square(50))]}
    rig.ok(send(rig, "fence", json.dumps(small)))
    assert areas(rig) == [("inclusion", "Polygon")]
    rig.ok(rig.delete("/mission/fence"))
    assert areas(rig) == []


def test_rally_points_alone_are_replaced_and_removed(rig: Rig) -> None:
    rig.ok(send(rig, "fence", json.dumps(FIELD)))  # the envelope: without one nobody knows whether they are inside
    points = [dict(zip(("lat", "long", "alt"), (*place(10 * n, 5), 20), strict=True)) for n in range(3)]
    rig.ok(send(rig, "rally", json.dumps({"points": points})))
    assert rally(rig) == [pytest.approx(tuple(point.values())) for point in points]
    rig.ok(rig.delete("/mission/rally"))
    assert rally(rig) == []


def test_a_fence_that_the_autopilot_refuses_leaves_the_old_one(rig: Rig) -> None:
    rig.ok(send(rig, "waypoints", plan(90)))
    corners = [place(80 + n % 2, -80 + n) for n in range(160)]
    ring = [list(corner[::-1]) for corner in (*corners, place(-80, 0), corners[0])]
    many = {
        "type": "Feature",
        "properties": {"kind": "inclusion"},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }
    refused = send(rig, "fence", json.dumps({"type": "FeatureCollection", "features": [many]}))
    assert refused.status_code == 500 and refused.json()["code"] == "rejected"
    assert "unchanged" in refused.json()["detail"] or "put back" in refused.json()["detail"]
    assert areas(rig) == [("exclusion", "Point"), ("exclusion", "Polygon"), ("inclusion", "Polygon")]


def test_a_mission_that_leaves_the_fence_of_its_own_file_puts_the_old_fence_back(rig: Rig) -> None:
    rig.ok(send(rig, "waypoints", plan(90)))
    refused = send(rig, "waypoints", plan(20))
    assert refused.status_code == 409 and refused.json()["code"] == "outside_envelope"
    assert "old fence (9 items) was put back" in refused.json()["detail"]
    corners = rig.ok(rig.get("/mission/fence"))["fence"]["features"][0]["geometry"]["coordinates"][0]
    assert max(lat for _, lat in corners) == pytest.approx(place(90, 0)[0], abs=1e-6)
    again = {"items": [{"command": 16, **dict(zip(("lat", "long"), place(60, 0), strict=True)), "alt": 10}]}
    rig.ok(rig.call("POST", "/mission/waypoints", json=again))  # inside of the old fence, which is the envelope again
