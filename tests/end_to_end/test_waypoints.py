"""Missions that the autopilot flies: up by all three formats, flown, read back, cleared."""

from __future__ import annotations

import json

import pytest

from tests.support.processes import ardupilot
from tests.support.wired_rig import WiredRig

WPL = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363261\t149.165230\t584\t1
1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t10\t1
2\t0\t3\t16\t0\t0\t0\t0\t-35.3630\t149.1653\t12\t1
3\t0\t3\t178\t1\t8\t-1\t0\t0\t0\t0\t1
4\t0\t3\t16\t0\t0\t0\t0\t-35.3632\t149.1656\t14\t1
5\t0\t3\t20\t0\t0\t0\t0\t0\t0\t0\t1
"""
PLACES = [(-35.3630, 149.1653, 12), (-35.3632, 149.1656, 14)]
LEGS = [{"command": "NAV_WAYPOINT", "lat": lat, "long": lon, "alt": alt} for lat, lon, alt in PLACES]
JSON = {"items": [{"command": 22, "alt": 10}, LEGS[0], {"command": 178, "param1": 1, "param2": 8}, LEGS[1]]}


SPEEDUP = 4  # a vehicle gives an upload up after 8 s of its own clock; a busy machine needs some of ours


@pytest.fixture(scope="module", params=["lockstep", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def rig(request, tmp_path_factory):
    directory = tmp_path_factory.mktemp("waypoints")
    made = WiredRig(directory) if request.param == "lockstep" else ardupilot(directory, speedup=SPEEDUP)
    yield made
    made.stop()


def simple(command, *params):
    return {"type": "SimpleItem", "command": command, "frame": 3, "autoContinue": True, "params": list(params)}


PLAN = {
    "fileType": "Plan",
    "mission": {
        "plannedHomePosition": [-35.363261, 149.165230, 584],
        "items": [
            simple(22, 0, 0, 0, None, 0, 0, 10),
            {
                "type": "ComplexItem",
                "complexItemType": "survey",
                "TransectStyleComplexItem": {"Items": [simple(16, 0, 0, 0, None, *place) for place in PLACES]},
            },
        ],
    },
}


def post(rig, text, kind="text/plain"):
    return rig.call("POST", "/mission/waypoints", data=text, headers={"Content-Type": kind})


def items(rig):
    return rig.ok(rig.get("/mission/waypoints"))["items"]


def commands(rig):
    return [item["command"] for item in items(rig)]


@pytest.fixture(autouse=True)
def empty(rig):
    rig.ok(rig.delete("/mission/waypoints"))


@pytest.mark.parametrize("text", [WPL, json.dumps(PLAN), json.dumps(JSON)], ids=["wpl", "plan", "json"])
def test_upload_is_read_back(rig, text):
    rig.ok(post(rig, text))
    uploaded = items(rig)
    legs = [item for item in uploaded if item["command"] == "NAV_WAYPOINT"]
    assert uploaded[0]["command"] == "NAV_TAKEOFF"
    assert [(leg["lat"], leg["long"], leg["alt"]) for leg in legs] == [pytest.approx(place) for place in PLACES]
    again = rig.ok(rig.get("/mission/waypoints"))
    rig.ok(rig.post("/mission/waypoints", items=again["items"]))
    assert items(rig) == uploaded


def test_upload_by_form(rig):
    answer = rig.call("POST", "/mission/waypoints", files={"file": ("m.waypoints", WPL)})
    assert rig.ok(answer)["result"] == "Mission of 5 items uploaded"


def test_mission_is_flown_to_its_end(rig):
    rig.ok(post(rig, WPL))
    assert rig.post("/mission/start").json()["code"] == "not_armed"
    rig.ok(rig.get("/command/arm"))
    assert rig.ok(rig.post("/mission/start", until_complete=True))["result"] == "Mission complete"
    progress = rig.ok(rig.get("/mission/progress"))["info"]
    assert (progress["total"], progress["last_reached"]) in [(5, 4), (5, 5)]
    rig.until(lambda: rig.status()["landed_state"] == "on_ground")
    rig.ok(rig.get("/command/disarm"))  # ArduPilot may have disarmed it already, or wait for DISARM_DELAY


def test_start_begins_at_the_first_item_and_progress_is_reported(rig):
    rig.ok(rig.post("/mission/waypoints", items=[*JSON["items"], {"command": "NAV_LOITER_UNLIM", "alt": 14}]))
    rig.ok(rig.get("/command/arm"))
    for _ in range(2):
        rig.ok(rig.post("/mission/start"))
        reported = rig.ok(rig.get("/mission/progress"))
        assert reported["info"]["state"] == "active"
        assert reported["info"]["mode"] == "AUTO"
        assert reported["info"]["current"] <= 2
        assert reported["age_s"] < 2
        rig.until(lambda: rig.ok(rig.get("/mission/progress"))["info"]["last_reached"] == 4)
        rig.ok(rig.get("/command/guided"))
    rig.on_the_ground()


def test_mission_is_started_anew_after_a_stop(rig):
    rig.ok(rig.post("/mission/waypoints", items=[*JSON["items"], {"command": "NAV_LOITER_UNLIM", "alt": 14}]))
    rig.in_the_air(10)
    job = rig.post("/mission/start?wait=false", until_complete=True).json()["job"]
    rig.until(lambda: rig.status()["mode"] == "AUTO")
    rig.ok(rig.get("/movement/stop"))
    rig.ok(rig.post("/mission/start"))
    rig.until(lambda: rig.ok(rig.get("/mission/progress"))["info"]["last_reached"] == 4)
    assert rig.get(f"/jobs/{job}").json()["error"]["code"] == "superseded"
    rig.ok(rig.get("/command/guided"))
    rig.on_the_ground()


def test_pilot_who_leaves_auto_ends_the_wait(rig):
    rig.ok(rig.post("/mission/waypoints", items=[*JSON["items"], {"command": "NAV_LOITER_UNLIM", "alt": 14}]))
    rig.in_the_air(10)
    job = rig.post("/mission/start?wait=false", until_complete=True).json()["job"]
    rig.until(lambda: rig.status()["mode"] == "AUTO")
    assert post(rig, WPL).json()["code"] == "busy"
    rig.switch_mode("LOITER")
    rig.until(lambda: "mode_changed" in rig.get(f"/jobs/{job}").text)
    refused = rig.post("/mission/start")
    assert (refused.status_code, refused.json()["code"]) == (409, "mode_changed")
    rig.ok(rig.get("/command/guided"))
    rig.on_the_ground()


def test_refused_upload_puts_the_old_mission_back_and_says_so(rig):
    rig.ok(post(rig, WPL))
    before = items(rig)
    refused = rig.post(
        "/mission/waypoints", items=[{"command": "NAV_TAKEOFF", "alt": 10}, {**LEGS[0], "command": 30001}]
    )
    assert (refused.status_code, refused.json()["code"]) == (500, "rejected")
    assert refused.json()["ack"] == "MAV_MISSION_UNSUPPORTED"
    assert "put back" in refused.json()["detail"]
    assert items(rig) == before


def test_mission_that_cannot_be_flown_is_422_and_changes_nothing(rig):
    rig.ok(post(rig, WPL))
    answer = rig.post("/mission/waypoints", items=[{"command": "NAV_WAYPOINT", "lat": 999, "alt": 10}])
    assert answer.status_code == 422
    assert len(items(rig)) == 5
