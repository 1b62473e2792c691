"""What a path does not understand is refused before its action runs: all routes, those of the other modules too."""

from __future__ import annotations

import re
from typing import Any

import pytest

from mavproxy_gradys.http import GradysHandlers, OneReading, Readings
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.contract.route import JSON, WITH_BODY, Route
from mavproxy_uavapi.http.handlers.manual import ReadByTheSite
from mavproxy_uavapi.http.routes import PAGE, ROUTES
from mavproxy_uavapi.settings import ApiModuleSettings
from mavproxy_vision.http import VisionHandlers
from tests.support.drone import Drone
from tests.uavapi.http.conftest import Api

MODULES: list[Route] = [*VisionHandlers(None, None).routes(), *GradysHandlers(None).routes()]  # type: ignore[arg-type]
CALLS = [(route, method) for route in [*ROUTES, *PAGE, *MODULES] for method in route.methods]
WITH = [(route, method) for route, method in CALLS if method in WITH_BODY]
NAMES = {path: re.sub(r"{\w+}", "1", path) for path in {route.path for route, _ in CALLS}}


def named(value: Any) -> str:
    return value.path if isinstance(value, Route) else str(value)


@pytest.fixture(autouse=True)
def modules(host: Host) -> None:
    """The routes of the other modules, whose actions are never reached here."""
    host.extensions.update({route.path: route for route in MODULES})


def ask(api: Api, method: str, path: str, **kwargs: Any) -> Any:
    if path == "/":
        kwargs["headers"] = {"Accept": "text/html", **kwargs.get("headers", {})}
    return api.loop.run(api.ask(method, NAMES[path], **kwargs))


@pytest.mark.matrix
@pytest.mark.parametrize(
    ("route", "method"), [call for call in CALLS if call[0].model is not ReadByTheSite], ids=named
)
def test_name_in_the_query_that_the_path_does_not_have_is_422(
    drone: Drone, api: Api, route: Route, method: str
) -> None:
    answer = ask(api, method, route.path, params={"colour": "red"})
    (problem,) = [one for one in answer.body["detail"] if one["type"] == "extra_forbidden"]
    assert (answer.status, problem["loc"][0], problem["loc"][-1]) == (422, "query", "colour")
    assert problem["msg"].startswith("there is no `colour`")
    names = OneReading if route.model is Readings else route.model  # a single one stands for a list of one
    assert all(name in problem["msg"] for name in [*names.model_fields, *route.options.model_fields])
    assert drone.received == []


@pytest.mark.matrix
@pytest.mark.parametrize(("route", "method"), CALLS, ids=named)
def test_name_that_is_there_twice_is_422(drone: Drone, api: Api, route: Route, method: str) -> None:
    names = ["client", "colour", *list(route.model.model_fields)[:1]]
    for name in names:
        answer = ask(api, method, route.path, params=[(name, "1"), (name, "1")])
        assert (answer.status, answer.body["detail"][0]["loc"]) == (422, ["query", name])
        assert answer.body["detail"][0]["msg"] == "it is there twice"
    assert drone.received == []


@pytest.mark.matrix
@pytest.mark.parametrize(("route", "method"), [call for call in CALLS if call not in WITH], ids=named)
def test_body_of_what_takes_none_is_400(drone: Drone, api: Api, route: Route, method: str) -> None:
    async def in_pieces() -> Any:
        yield b'{"alt": 5}'

    for body in ({"json": {"alt": 5}}, {"json": {}}, {"data": {"alt": "5"}}, {"data": in_pieces()}):
        answer = ask(api, method, route.path, **body)
        assert (answer.status, answer.body["code"]) == (400, "bad_request")
        assert f"a {method} of {route.path} takes no body" in answer.body["detail"]
    assert drone.received == []


@pytest.mark.matrix
@pytest.mark.parametrize("kind", ["text/html", "application/x-yaml"])
@pytest.mark.parametrize(("route", "method"), WITH, ids=named)
def test_body_of_another_type_is_400(drone: Drone, api: Api, route: Route, method: str, kind: str) -> None:
    answer = ask(api, method, route.path, data=b'{"alt": 5}', headers={"Content-Type": kind})
    assert (answer.status, answer.body["code"]) == (400, "bad_request")
    assert next(iter(route.raw or (JSON,))) in answer.body["detail"]
    assert drone.received == []


PARAMETERS = [(route, method) for route, method in WITH if not route.raw]


@pytest.mark.matrix
@pytest.mark.parametrize(("route", "method"), PARAMETERS, ids=named)
def test_member_that_the_path_does_not_have_is_422(drone: Drone, api: Api, route: Route, method: str) -> None:
    for body in ({"json": {"colour": "red"}}, {"data": {"colour": "red"}}):
        answer = ask(api, method, route.path, **body)
        problems = [one for one in answer.body["detail"] if one["type"] == "extra_forbidden"]
        assert (answer.status, [one["loc"][-1] for one in problems]) == (422, ["colour"])
    assert drone.received == []


@pytest.mark.matrix
@pytest.mark.parametrize(("route", "method"), PARAMETERS, ids=named)
def test_json_with_the_type_of_a_form_is_400_and_no_default_flies(
    drone: Drone, api: Api, route: Route, method: str
) -> None:
    """As `curl -d` and many a default client send it."""
    headers = {"Content-Type": "application/x-www-form-urlencoded"}
    answer = ask(api, method, route.path, data=b'{"vehicles": [43]}', headers=headers)
    assert (answer.status, answer.body["code"]) == (400, "bad_request")
    assert "send `Content-Type: application/json`" in answer.body["detail"]
    assert drone.received == []


GPS, NED, BODY = "lat long alt look_at_target", "x y z look_at_target", "front right down look_at_target"
# What each path of uav_api 0.3.1 takes, of all its vehicles; `file` is the field of a form.
ORIGINAL = {
    "/command/takeoff": "alt pitch_deg vtol",
    "/command/disarm": "",
    "/command/land_at": "lat long alt vtol",
    **{f"/command/set_{kind}_speed": "new_v" for kind in ("air", "ground", "climb", "descent")},
    "/command/set_sim_speedup": "sim_factor",
    **{f"/movement/go_to_gps{wait}": GPS for wait in ("", "_wait")},
    **{f"/movement/{verb}{wait}": NED for verb in ("go_to_ned", "drive") for wait in ("", "_wait")},
    **{f"/movement/drive_body{wait}": BODY for wait in ("", "_wait")},
    "/movement/travel_at_ned": "vx vy vz look_at_target",
    "/movement/set_heading": "heading",
    "/movement/set_yaw_rate": "yaw_rate",
    "/mission/execute-script": "script_name",
    "/mission/stop-script": "script_name",
    "/peripherical/take_photo": "command resolution capture_time focus_distance",
    "/peripherical/servo_output": "channel pwm",
}


@pytest.mark.parametrize(("path", "names"), ORIGINAL.items())
def test_what_clients_of_the_original_service_send_is_known(path: str, names: str) -> None:
    (route,) = [route for route in ROUTES if route.path == path]
    assert set(names.split()) <= set(route.model.model_fields)


def test_takeoff_of_the_original_services_plane_is_understood(flying: Drone, api: Api) -> None:
    answer = api.get("/command/takeoff?alt=30&pitch_deg=15&vtol=false")
    assert (answer.status, answer.body["code"]) == (409, "busy")  # it flies already


@pytest.mark.parametrize("body", [b"", b" \r\n", b"{}"])
@pytest.mark.parametrize("kind", [None, "application/json", "application/json; charset=utf-8"])
def test_nothing_is_understood_as_nothing(flying: Drone, api: Api, body: bytes, kind: str | None) -> None:
    headers = {} if kind is None else {"Content-Type": kind}
    answer = api.post("/command/brake", data=body, headers=headers, skip_auto_headers=["Content-Type"])
    assert answer.status == 200
    assert api.get("/command/guided", headers={"Content-Type": "application/json"}).status == 200


@pytest.mark.parametrize(
    ("body", "headers"),
    [
        (b'{"x": 1, "y": 2, "z": -3}', {}),
        (b'\xef\xbb\xbf{"x": 1, "y": 2, "z": -3}', {"Content-Type": "application/json"}),
        ('{"x": 1, "y": 2, "z": -3}'.encode("utf-16"), {"Content-Type": "application/json; charset=utf-16"}),
        (b"x=1&y=2&z=-3", {"Content-Type": "application/x-www-form-urlencoded; charset=UTF-8"}),
        (b"x=1&y=2&z=-3\r\n", {"Content-Type": "application/x-www-form-urlencoded"}),
    ],
    ids=["no type", "byte order mark", "utf-16", "form", "form with a line end"],
)
def test_what_programs_send_is_understood(flying: Drone, api: Api, body: bytes, headers: dict[str, str]) -> None:
    answer = api.post("/movement/go_to_ned", data=body, headers=headers, skip_auto_headers=["Content-Type"])
    assert answer.body["result"] == "Going to NED coord (1, 2, -3)"


TWICE = {"loc": ["body", "y"], "type": "value_error", "msg": "it is there twice"}


@pytest.mark.parametrize(
    ("query", "body", "problem"),
    [
        (
            "",
            {"data": '{"x": 1, "y": 2, "z": -3, "x": 4}'},
            {**TWICE, "loc": ["body"], "msg": "the body has the name 'x' twice in one object, with 'x, y, z'"},
        ),
        ("", {"data": [("x", "1"), ("y", "2"), ("z", "-3"), ("y", "4")]}, TWICE),
        (
            "?x=1",
            {"json": {"x": 1, "y": 2, "z": -3}},
            {"loc": ["query", "x"], "type": "value_error", "msg": "it is in the query and in the body"},
        ),
    ],
    ids=["JSON", "form", "both"],
)
def test_member_that_is_there_twice_is_422(
    flying: Drone, api: Api, query: str, body: dict[str, Any], problem: dict[str, Any]
) -> None:
    if isinstance(body.get("data"), str):
        body["headers"] = {"Content-Type": "application/json"}
    answer = api.post(f"/movement/go_to_ned{query}", **body)
    assert (answer.status, answer.body["detail"]) == (422, [problem])
    assert flying.received == []


@pytest.mark.parametrize(
    ("body", "kind", "says"),
    [
        ("{", "application/json", "the body is not JSON: line 1, column 2 has the end"),
        ('{"x": 1,\n y: 2}', "application/json", "the body is not JSON: line 2, column 2 has 'y: 2}'"),
        ("[" * 100_000, "application/json", "the body is nested more than 60 levels deep"),
        ('{"mode": "\\ud800"}', "application/json", "the body has half of a surrogate pair"),
        ("[1]", "application/json", "the body is not a JSON object"),
        (
            "{}",
            "application/json; charset=klingon",
            "the body is not text in the charset 'klingon' (header Content-Type)",
        ),
        (b"{\xff}", "application/json", "the body is not UTF-8 text: line 1, column 2 has byte 0xFF"),
        ("\x7b\xff", "application/json; charset=ascii", "the body is not text in the charset 'ascii'"),
        ('{"mode": "+2AA-"}', "application/json; charset=utf-7", "the body is not text in the charset 'utf-7'"),
        ("mode=%2B2AA-", "application/x-www-form-urlencoded; charset=utf-7", "the body is not a form"),
        ("x=%ff", "application/x-www-form-urlencoded", "the body is not a form of at most 1000 fields"),
        ("mode", "application/x-www-form-urlencoded", "the body is not a form of at most 1000 fields"),
        ("&".join(["x=1"] * 1001), "application/x-www-form-urlencoded", "the body is not a form of at most 1000"),
    ],
)
def test_body_that_cannot_be_read_is_400_with_a_sentence(
    flying: Drone, api: Api, body: str | bytes, kind: str, says: str
) -> None:
    answer = api.post("/command/set_mode", data=body, headers={"Content-Type": kind})
    assert (answer.status, answer.body["code"]) == (400, "bad_request")
    assert answer.body["detail"].startswith(says)
    assert flying.received == []


@pytest.mark.parametrize("path", ["/command/takeoff", "/message", "/settings/max_rate", "/fleet/takeoff"])
def test_whole_number_of_401_digits_is_a_wrong_value_and_no_defect(flying: Drone, api: Api, path: str) -> None:
    api.service.settings = ApiModuleSettings({"allow_raw": True}, environ={}).snapshot()
    digits = "1" + "0" * 400
    fields = f'"name": "SYSTEM_TIME", "fields": {{"time_unix_usec": {digits}, "time_boot_ms": 0}}'
    named = {"/message": fields, "/settings/max_rate": f'"value": {digits}'}
    body = named.get(path, f'"alt": {digits}' + (', "vehicles": "all"' if "fleet" in path else ""))
    method = "PUT" if "settings" in path else "POST"
    answer = api.loop.run(api.ask(method, path, data=f"{{{body}}}", headers={"Content-Type": "application/json"}))
    assert answer.status in (404, 422), answer.body
    assert flying.received == []
