from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.contract.route import Route
from mavproxy_uavapi.http.routes import ROUTES
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

mavlink = mavutil.mavlink


@pytest.fixture
def three(make_drone: Callable[..., Drone], loop: FastLoop) -> list[Any]:
    """Three copters in flight."""
    drones = [make_drone(system) for system in (1, 2, 3)]
    for drone in drones:
        drone.fly()
    loop.settle()
    return drones


def commands(drone: Any) -> list[int]:
    return [message.command for message in drone.received if message.get_type() == "COMMAND_LONG"]


def test_one_verb_for_all_with_an_answer_of_each(three: list[Any], api: Api) -> None:
    answer = api.post("/fleet/land", {"vehicles": "all"})
    assert answer.status == 200
    assert {key: row["status"] for key, row in answer.body["vehicles"].items()} == {"1": 200, "2": 200, "3": 200}
    assert [drone.mode for drone in three] == ["LAND"] * 3
    assert not any(drone.armed for drone in three)


def test_verb_for_some_leaves_the_others_alone(three: list[Any], api: Api) -> None:
    answer = api.post("/fleet/brake", {"vehicles": [1, 3]})
    assert answer.status == 200
    assert [drone.mode for drone in three] == ["BRAKE", "GUIDED", "BRAKE"]
    assert set(answer.body["vehicles"]) == {"1", "3"}


def test_all_under_a_vehicles_path_is_that_vehicle_alone(three: list[Any], api: Api) -> None:
    answer = api.post("/vehicles/2/fleet/brake", {})
    assert set(answer.body["vehicles"]) == {"2"}
    assert [drone.mode for drone in three] == ["GUIDED", "BRAKE", "GUIDED"]


def test_what_one_cannot_do_is_in_its_answer_and_the_others_do_it(three: list[Any], api: Api) -> None:
    three[1].pilot("LOITER")
    api.loop.settle()
    answer = api.post("/fleet/go_to_gps", {"vehicles": "all", "lat": -35.0, "long": 149.0, "alt": 30})
    assert answer.status == 207
    rows = answer.body["vehicles"]
    assert (rows["1"]["status"], rows["3"]["status"]) == (200, 200)
    assert (rows["2"]["status"], rows["2"]["code"]) == (409, "mode_changed")
    assert "2 of 3" in answer.body["result"]


def test_each_has_values_of_its_own(three: list[Any], api: Api) -> None:
    body = {"vehicles": "all", "x": 0, "y": 0, "z": -20, "each": {"2": {"x": 40}, "3": {"x": 60, "z": -30}}}
    assert api.post("/fleet/go_to_ned", body).status == 200
    targets = [next(m for m in drone.received if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED") for drone in three]
    assert [(target.x, target.z) for target in targets] == [(0, -20), (40, -20), (60, -30)]


def test_a_wrong_value_for_one_is_422_and_nothing_is_sent(three: list[Any], api: Api) -> None:
    body = {"vehicles": "all", "x": 0, "y": 0, "z": -20, "each": {"2": {"x": "far"}}}
    answer = api.post("/fleet/go_to_ned", body)
    assert (answer.status, answer.body["code"]) == (422, "invalid")
    assert answer.body["detail"][0]["loc"][:4] == ["body", "each", "2", "x"]
    assert [drone.orders() for drone in three] == [[], [], []]


def test_all_or_none_sends_nothing_when_one_cannot(three: list[Any], api: Api) -> None:
    three[2].pilot("LOITER")
    api.loop.settle()
    body = {"vehicles": "all", "lat": -35.0, "long": 149.0, "alt": 30, "all_or_none": True}
    answer = api.post("/fleet/go_to_gps", body)
    rows = answer.body["vehicles"]
    assert answer.status == 207
    assert rows["3"]["code"] == "mode_changed"
    assert {rows["1"]["code"], rows["2"]["code"]} == {"aborted"}
    assert "nothing was sent: vehicle 3" in rows["1"]["detail"]
    assert [drone.orders() for drone in three] == [[], [], []]
    api.loop.pass_time(5.0)
    assert [drone.orders() for drone in three] == [[], [], []]


VERBS = {
    "go_to_ned": {"x": 9, "y": 0, "z": -20},
    "go_to_gps_wait": {"lat": -35.0, "long": 149.0, "alt": 30},
    "travel_at_ned": {"vx": 1, "vy": 0, "vz": 0},
    "set_mode": {"mode": "LOITER"},
    "guided": {},
    "brake": {},
    "stop": {},
    "land": {},
    "rtl": {},
    "disarm": {"force": True},
}


@pytest.mark.parametrize("verb", VERBS)
def test_flight_goes_on_when_all_or_none_is_refused(three: list[Any], api: Api, verb: str) -> None:
    """The vehicle 9 was never heard."""
    flight = api.begin("POST", "/vehicles/1/movement/go_to_ned_wait", json={"x": 90, "y": 0, "z": -20})
    api.loop.pass_time(2.0)
    before = len(three[0].orders())
    answer = api.post(f"/fleet/{verb}", {"vehicles": [1, 9], "all_or_none": True, **VERBS[verb]})
    assert {row["code"] for row in answer.body["vehicles"].values()} == {"aborted", "no_vehicle"}
    assert three[0].orders()[before:] == []
    assert api.loop.run_until_complete(flight).status == 200
    assert three[0].at == pytest.approx([90.0, 0.0, -20.0], abs=1.0)
    assert api.post("/vehicles/1/movement/go_to_ned", {"x": 0, "y": 0, "z": -20}).status == 200


def test_all_or_none_begins_together_when_all_can(make_drone: Callable[..., Drone], api: Api, loop: FastLoop) -> None:
    """The second is ready to arm later: the first waits for it, disarmed."""
    first, second = make_drone(1), make_drone(2)
    second.ready = False
    loop.pass_time(2.0)
    flight = api.begin("POST", "/fleet/arm", json={"vehicles": "all", "all_or_none": True})
    loop.pass_time(10.0)
    assert first.orders() == second.orders() == []
    second.ready = True
    answer = loop.run_until_complete(flight)
    assert answer.status == 200, answer.body
    assert first.armed
    assert second.armed


@pytest.mark.parametrize("verb", ["land", "rtl"])
def test_all_or_none_does_not_wait_for_one_that_does_it_already(three: list[Any], api: Api, verb: str) -> None:
    api.begin("POST", f"/fleet/{verb}", json={"vehicles": [1]})
    api.loop.pass_time(1.5)
    both = api.begin("POST", f"/fleet/{verb}", json={"vehicles": [1, 2], "all_or_none": True})
    api.loop.pass_time(1.5)
    assert three[1].mode == verb.upper() and three[0].armed
    assert api.loop.run_until_complete(both).status == 200
    assert not three[1].armed


def test_who_waits_at_the_gate_still_heeds_the_pilot(
    make_drone: Callable[..., Drone], api: Api, loop: FastLoop
) -> None:
    first, second = make_drone(1), make_drone(2)
    second.ready = False
    loop.pass_time(2.0)
    flight = api.begin("POST", "/fleet/arm", json={"vehicles": "all", "all_or_none": True})
    loop.pass_time(5.0)
    first.pilot("LOITER")
    second.ready = True
    answer = loop.run_until_complete(flight)
    assert answer.body["vehicles"]["1"]["code"] == "mode_changed"
    assert not first.armed


def test_all_or_none_needs_somebody_who_waits(three: list[Any], api: Api) -> None:
    answer = api.post("/fleet/brake?wait=false", {"all_or_none": True})
    assert (answer.status, answer.body["code"]) == (422, "invalid")


def test_without_waiting_there_is_a_job_of_each(three: list[Any], api: Api) -> None:
    answer = api.post("/fleet/land?wait=false", {"vehicles": "all"})
    rows = answer.body["vehicles"]
    assert {row["status"] for row in rows.values()} == {202}
    jobs = {job["job"]: job["verb"] for job in api.get("/jobs").body["jobs"]}
    assert {jobs[row["job"]] for row in rows.values()} == {"/fleet/land"}


def test_what_is_not_there_has_an_answer_too(three: list[Any], api: Api) -> None:
    rows = api.post("/fleet/brake", {"vehicles": [2, 9]}).body["vehicles"]
    assert rows["2"]["status"] == 200
    assert (rows["9"]["status"], rows["9"]["code"]) == (503, "no_vehicle")


def test_each_vehicles_call_is_in_the_audit_trail(three: list[Any], api: Api, host: Host) -> None:
    api.post("/fleet/brake", {"vehicles": [1, 2]})
    assert [(entry.verb, entry.system, entry.outcome) for entry in host.audit.entries] == [
        ("/fleet/brake", 1, "ok"),
        ("/fleet/brake", 2, "ok"),
    ]


def test_stopping_all_is_refused_by_no_limit(three: list[Any], api: Api, service: Service) -> None:
    from mavproxy_uavapi.settings import ApiModuleSettings

    service.settings = ApiModuleSettings({"max_rate": 1, "max_jobs": 1}, environ={}).snapshot()
    for _ in range(10):
        assert api.post("/fleet/rtl?wait=false", {"vehicles": "all"}).status == 200


def test_all_before_any_vehicle_was_heard_is_no_success(api: Api) -> None:
    answer = api.post("/fleet/land", {"vehicles": "all"})
    assert (answer.status, answer.body["code"]) == (503, "no_vehicle")


@pytest.mark.parametrize("route", [route for route in ROUTES if route.fleet], ids=lambda route: route.path)
def test_all_is_said_but_for_what_only_holds_the_vehicles(three: list[Any], api: Api, route: Route) -> None:
    answer = api.post(route.path, {})
    if route.path in ("/fleet/brake", "/fleet/stop"):
        assert (answer.status, set(answer.body["vehicles"])) == (200, {"1", "2", "3"})
        return
    assert (answer.status, answer.body["detail"][0]["loc"]) == (422, ["body", "vehicles"])
    assert not any(drone.received for drone in three)


@pytest.mark.parametrize(
    ("body", "loc", "meant"),
    [
        ({"vehicle": [2]}, ["body", "vehicle"], "vehicles"),
        ({"vehicles": [2], "altitude": 9}, ["body", "altitude"], "alt"),
        ({"vehicles": [2], "each": {"2": {"Alt": 9}}}, ["body", "each", "2", "Alt"], "alt"),
    ],
)
def test_name_that_a_fleets_verb_does_not_have_is_422_with_the_nearest(
    three: list[Any], api: Api, body: dict[str, Any], loc: list[str], meant: str
) -> None:
    answer = api.post("/fleet/takeoff", body)
    problem = next(one for one in answer.body["detail"] if one["type"] == "extra_forbidden")
    assert (answer.status, problem["loc"]) == (422, loc)
    assert f"did you mean `{meant}`?" in problem["msg"]
    assert not any(drone.received for drone in three)


@pytest.mark.parametrize("body", [{"vehicles": []}, {"vehicles": [1], "each": {"2": {}}}, {"each": {"one": {}}}])
def test_nobody_and_values_for_nobody_are_422(three: list[Any], api: Api, body: dict[str, Any]) -> None:
    assert api.post("/fleet/brake", body).status == 422
    assert not any(commands(drone) for drone in three)
