"""Every route says which role it needs, and keeps to it: who may only watch causes no message to a vehicle."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlencode

import pytest

from mavproxy_gradys.http import GradysHandlers
from mavproxy_uavapi.core.errors import Forbidden
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.files.tokens import Token
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.callers.caller import CALLER, Caller
from mavproxy_uavapi.http.contract.requests import Empty
from mavproxy_uavapi.http.contract.route import JSON, Route
from mavproxy_uavapi.http.handlers.fleet import FleetRequest
from mavproxy_uavapi.http.openapi import document, example_of
from mavproxy_uavapi.http.routes import PAGE, ROUTES
from mavproxy_vision.http import VisionHandlers
from tests.rules.fault_scenes import track
from tests.support import tokens
from tests.support.make_world import MakeWorld
from tests.support.virtual_time import FastLoop
from tests.support.world import TICK, World

VISION = VisionHandlers(None, None).routes()  # type: ignore[arg-type]
GRADYS = GradysHandlers(None).routes()  # type: ignore[arg-type]
EVERY = [*ROUTES, *PAGE, *VISION, *GRADYS]
ENDLESS = {"/telemetry/stream", "/vision/stream.mjpg"}  # tests/uavapi/http/test_named_tokens.py
METHODS = ("GET", "HEAD", "OPTIONS", "POST", "PUT", "PATCH", "DELETE")
NAMES = {
    "z": "0",
    "x": "0",
    "y": "0",
    "id": "1",
    "name": "ATTITUDE",
    "sysid": "1",
    "file": "x.css",
    "room": "net",
    "inner": "x",
}
FAR = {"x": 5000, "y": 0, "z": -8}
EXAMPLES: dict[str, dict[str, Any]] = {
    "/gradys/readings": {"quantity": "t", "value": 1, "sysid": 1},
    "/vision/mission": {"north": 5, "east": 5},
    "/mission/fly-track": {"track": track(3e-3), "ground": 584},
}
# What the docs promise: docs/security.md.
OPEN = {
    *("/", "/page/{file}", "/page/{room}/{file}", "/docs", "/docs/{file}", "/openapi.json", "/version"),
    *("/manual", "/manual/{file}", "/manual/{room}/{file}", "/manual/{room}/{inner}/{file}"),
}
FOR_ADMINS = {
    "POST /mission/fence",
    "DELETE /mission/fence",
    "POST /parameters",
    "PUT /parameters/{name}",
    "PUT /settings/{name}",
    "PUT /envelope",
    "PUT /tiles/{z}/{x}/{y}",
    "DELETE /envelope",
    "DELETE /flights/{id}",
    "POST /message",
    *(f"{method} /command/{verb}" for method in ("GET", "POST") for verb in ("reboot", "set_sim_speedup")),
    *(f"POST /fleet/{verb}" for verb in ("reboot", "set_sim_speedup")),
}
FOR_WATCHERS = re.compile(
    r"GET (/telemetry/.*|/jobs.*|/audit|/flights.*|/vehicles.*|/parameters|/parameters\.param|/settings|/envelope"
    r"|/authority|/mission/progress|/logs|/logs/{id}|/vision/(status|tags|frame\.jpg|stream\.mjpg)|/gradys/(status|recent)|/tiles.*)"
)


def named(route: Route) -> str:
    return f"{'+'.join(route.methods)} {route.path}"


@pytest.mark.parametrize("route", EVERY, ids=named)
def test_every_route_needs_a_role_and_it_is_that_of_the_docs(route: Route) -> None:
    for method in route.methods:
        operation = f"{method} {route.path}"
        scripts = route.path.startswith("/mission/") and "script" in route.path or route.path == "/mission/clear"
        if operation in FOR_ADMINS or scripts:
            assert route.needs is Role.ADMIN
        elif route.path in OPEN or FOR_WATCHERS.fullmatch(operation):
            assert route.needs is Role.WATCH
        else:
            assert route.needs is Role.FLY


def test_no_command_is_for_watchers_and_the_description_shows_each_role() -> None:
    assert [named(route) for route in EVERY if route.commands and route.needs < Role.FLY] == []
    described = document([*ROUTES, *VISION, *GRADYS])["paths"]
    for route in (*ROUTES, *VISION, *GRADYS):
        for method in route.methods:
            assert described[route.path][method.lower()]["x-role"] == route.needs.word


# -- asked of the application itself ------------------------------------------------------------------------


@pytest.fixture
def world(make_world: MakeWorld, tmp_path: Path) -> Any:
    """A vehicle that an admin flies far away."""
    file = tokens.write(tmp_path / "tokens", tokens.ALL)
    camera = {"width": 240, "height": 180, "fps": 8.0, "sim_tags": "0:0.30@0.6,-0.4"}
    world = make_world(camera=camera, tokens=file, allow_raw="true", max_rate=100_000)
    assert ask(world, "boss", "POST", "/movement/go_to_ned_wait?wait=false", FAR).status == 202
    return world


def ask(world: World, name: str, method: str, path: str, body: Any = None) -> Any:
    wire = world.begin(method, path, body, headers=tokens.bearer(name))
    return world.answer(wire, 60.0)


def begin(world: World, name: str, route: Route, method: str, prefix: str) -> int:
    """The status of an answer to a request that would do something."""
    path = re.sub(r"{(\w+)}", lambda match: NAMES[match[1]], route.path)
    body: Any = None
    if method in ("POST", "PUT"):
        example = EXAMPLES.get(route.path) or ({} if route.raw else example_of(route.model))
        if issubclass(route.model, FleetRequest):
            example["vehicles"] = "all"
        body = b"WPNAV_SPEED 500" if route.raw else example
    elif method == "GET":
        path += f"?{urlencode(example_of(route.model))}"
    kind = next(iter(route.raw or (JSON,)))
    wire = world.begin(method, prefix + path, body, kind=kind, headers=tokens.bearer(name))
    world.pass_time(TICK)
    written = bytes(wire._written)
    assert written.startswith(b"HTTP/1.1 "), f"{method} {path} is not answered"
    return int(written.split()[1])


def walk(world: World, name: str, prefix: str = "") -> dict[str, int]:
    """The answers to every method of every route; none of them may have caused a message to the vehicle."""
    routes = [*ROUTES, *PAGE, *world.host.extensions.values()]
    answers: dict[str, int] = {}
    for route in routes:
        if route.path in ENDLESS:
            continue
        for method in METHODS:
            before = len(world.sent)
            status = begin(world, name, route, method, prefix)
            assert world.orders_of(world.sent[before:]) == [], f"{name}: {method} {route.path}"
            allowed = {one for other in routes if other.path == route.path for one in other.methods}
            if method in allowed:
                matching = next(other for other in routes if other.path == route.path and method in other.methods)
                answers[f"{method} {route.path}"] = status
                assert (status == 403) is (matching.needs > tokens_role(name)), f"{method} {route.path}: {status}"
            else:
                assert status in (404, 405), f"{method} {route.path}: {status}"
    assert world.host.jobs.get("1").running
    return answers


def tokens_role(name: str) -> Role:
    return Role[tokens.ALL[name].partition(":")[0].upper()]


@pytest.mark.parametrize("prefix", ["", pytest.param("/vehicles/1", marks=pytest.mark.matrix)])
def test_watcher_causes_no_message_on_any_route(world: World, prefix: str) -> None:
    world.pass_time(2.0)
    answers = walk(world, "tower", prefix)
    assert {answers["GET /telemetry/gps"], answers["GET /vehicles"], answers["GET /authority"]} == {200}
    assert answers["GET /telemetry/home_info"] == 503, "nobody has asked for it"
    before = len(world.sent)
    assert ask(world, "anna", "GET", "/telemetry/home_info").status == 200
    assert world.orders_of(world.sent[before:]), "whoever may fly does ask"
    assert ask(world, "tower", "GET", "/telemetry/home_info").status == 200


def test_token_for_another_vehicle_sends_nothing_to_this_one(world: World) -> None:
    world.pass_time(2.0)
    for route in (*ROUTES, *world.host.extensions.values()):
        if route.path in ENDLESS:
            continue
        for method in route.methods:
            before = len(world.sent)
            status = begin(world, "second", route, method, "")
            assert world.orders_of(world.sent[before:]) == [], f"{method} {route.path}"
            no_vehicle = route.path in (
                "/gradys/flush",
                "/peripherical/take_photo",
                "/vision/stop",
                "/flights/{id}/end",
            )
            if route.commands and not no_vehicle:
                assert status == (207 if route.path.startswith("/fleet/") and route.needs < Role.ADMIN else 403), (
                    f"{method} {route.path}: {status}"
                )
    assert world.host.jobs.get("1").running
    body = ask(world, "second", "POST", "/fleet/land", {"vehicles": "all"}).body
    assert body["vehicles"]["1"]["code"] == "forbidden"
    all_or_none = {"vehicles": "all", "all_or_none": True}
    assert ask(world, "second", "POST", "/fleet/land", all_or_none).body["vehicles"]["1"]["status"] == 403


def test_flight_of_vision_is_not_stopped_by_a_token_for_another_vehicle(world: World) -> None:
    assert ask(world, "anna", "POST", "/vision/search?wait=false", {}).status == 202
    world.pass_time(2.0)
    for name in ("second", "tower"):
        assert ask(world, name, "GET", "/vision/stop").outcome == "403 forbidden"
    assert ask(world, "bo", "GET", "/vision/stop").body["result"] != "Nothing was in flight"


def test_flight_of_vision_ends_none_of_a_vehicle_outside_the_token(loop: FastLoop) -> None:
    handlers = VisionHandlers(None, SimpleNamespace(systems=[1]))  # type: ignore[arg-type]
    second = Caller(None, has_token=True, token=Token("second", Role.FLY, frozenset({2}), b""))
    call = Call(None, {CALLER: second}, Empty())  # type: ignore[arg-type]
    with pytest.raises(Forbidden, match="not for commands to vehicle 1"):
        loop.run(handlers._fly(call, None))  # type: ignore[arg-type]


def test_who_may_fly_flies_and_is_no_admin(world: World) -> None:
    for name in ("anna", "boss"):
        assert ask(world, name, "POST", "/movement/go_to_ned", FAR).status == 200
        assert ask(world, name, "GET", "/command/brake").status == 200
        assert ask(world, name, "GET", "/command/guided").status == 200
    for name, status in (("anna", 403), ("boss", 200)):
        assert ask(world, name, "PUT", "/parameters/WP_SPD", {"value": 4}).status == status
    assert ask(world, "nobody", "GET", "/telemetry/gps").status == 401
    assert ask(world, "", "GET", "/telemetry/gps").status == 401


def test_port_of_a_vehicle_is_no_way_round(world: World) -> None:
    for prefix in ("/vehicles/1", "/vehicles/2", "/vehicles/2/vehicles/1"):
        answer = ask(world, "second", "GET", f"{prefix}/command/land")
        assert answer.status in (403, 404, 503)
    assert world.copter.mode.name == "GUIDED"


def test_audit_trail_and_commander_have_the_name(world: World) -> None:
    assert ask(world, "anna", "POST", "/movement/go_to_ned_wait?wait=false&lease=5", {**FAR, "y": 9}).status == 202
    report = ask(world, "tower", "GET", "/vehicles/1").body
    assert report["commanded_by"]["client"] == "anna@127.0.0.1"
    assert report["lease"]["client"] == "anna@127.0.0.1"
    assert ask(world, "anna", "GET", "/command/brake").status == 200
    assert ask(world, "tower", "GET", "/command/land").status == 403
    clients = [entry.client for entry in world.host.audit.entries]
    assert clients[-1] == "anna@127.0.0.1" and "tower@127.0.0.1" not in clients
    world.pass_time(70.0)
    refused = world.host.audit.entries[-1]
    assert (refused.client, refused.verb) == ("tower@127.0.0.1", "refused")
    assert not any(tokens.secret_of("anna") in str(entry) for entry in world.host.audit.entries)


def test_token_in_a_query_is_none(world: World) -> None:
    assert ask(world, "", "GET", f"/telemetry/gps?token={tokens.secret_of('boss')}").status == 401
    assert ask(world, "", "GET", f"/command/land?Authorization=Bearer+{tokens.secret_of('boss')}").status == 401
