"""Named tokens at the door: streams, and what becomes of connections whose token is taken away."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from aiohttp import ClientError, WSMsgType

from mavproxy_uavapi.core.errors import Forbidden, Unauthorized
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.files.tokens import Token, digest_of
from mavproxy_uavapi.http.security import check_caller
from mavproxy_uavapi.scripts.runs import Run
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support import tokens


@pytest.fixture
def roles(api: Any, tmp_path: Path) -> Callable[..., None]:
    """Writes the file of tokens anew, and has the API take it up."""
    path = tmp_path / "tokens"

    def put(**names: str) -> None:
        file = tokens.write(path, names)
        if not api.service.settings.tokens:
            api.service.settings = replace(api.service.settings, tokens=file)
            api.service.tokens.use(file)
        api.service.tokens.take()

    put(**tokens.ALL)
    return put


async def over_websocket(api: Any, name: str, events: list[Any]) -> None:
    async with api.client.ws_connect("/telemetry/stream", headers=tokens.bearer(name)) as socket:
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                events.append(json.loads(message.data))


async def by_events(api: Any, name: str, events: list[Any]) -> None:
    async with api.client.get("/telemetry/stream", headers=tokens.bearer(name)) as response:
        assert response.status == 200
        async for line in response.content:
            if line.startswith(b"data: "):
                events.append(json.loads(line[6:]))


@pytest.mark.parametrize("stream", [over_websocket, by_events])
@pytest.mark.parametrize("change", [{}, {"tower": "admin"}])
def test_watcher_streams_until_its_token_is_taken_away_or_changed(
    flying: Any, api: Any, loop: Any, roles: Any, stream: Any, change: dict[str, str]
) -> None:
    events, others = list[Any](), list[Any]()
    task = loop.create_task(stream(api, "tower", events))
    other = loop.create_task(stream(api, "anna", others))
    api.until(lambda: len(events) > 5 and len(others) > 5)
    roles(anna="fly", **change)
    api.until(task.done)
    assert task.exception() is None or isinstance(task.exception(), ClientError)
    count = len(others)
    api.until(lambda: len(others) > count + 5)
    assert not other.done() and flying.orders() == []
    other.cancel()
    loop.settle()


@pytest.mark.parametrize("name", ["", "nobody"])
def test_stranger_gets_no_stream(flying: Any, api: Any, roles: Any, name: str) -> None:
    assert api.get("/telemetry/stream", headers=tokens.bearer(name)).status == 401
    assert api.get("/vehicles", headers={"Authorization": f"Bearer {digest_of(b'x').hex()}"}).status == 401


def test_flight_of_a_token_that_is_taken_away_ends_as_if_its_client_hung_up(
    flying: Any, api: Any, loop: Any, roles: Any
) -> None:
    body = {"x": 300, "y": 0, "z": -20}
    going = api.begin("POST", "/movement/go_to_ned_wait", json=body, headers=tokens.bearer("anna"))
    api.until(api.service.host.jobs.running)
    (job,) = api.service.host.jobs.running()
    roles(bo="fly")
    api.until(going.done)
    assert isinstance(going.exception(), ClientError)
    api.until(lambda: not job.running)
    assert "hung up" in str(job.error)
    assert api.get("/vehicles", headers=tokens.bearer("anna")).status == 401


def test_kept_connection_of_a_token_that_is_taken_away_is_refused(api: Any, roles: Any, drone: Any) -> None:
    assert api.get("/vehicles", headers=tokens.bearer("tower")).status == 200
    roles(anna="fly")
    assert api.get("/vehicles", headers=tokens.bearer("tower")).status == 401


def test_documentation_and_page_need_no_token_and_preflights_tell_nothing(api: Any, loop: Any, roles: Any) -> None:
    assert api.get("/openapi.json").status == 200
    assert api.get("/openapi.json", headers=tokens.bearer("tower")).status == 200
    assert loop.run(api.ask("OPTIONS", "/command/arm", headers=tokens.bearer("tower"))).status == 405
    api.service.settings = replace(api.service.settings, cors_origins=("http://gs.example",))
    headers = {"Origin": "http://gs.example"}

    async def preflight() -> tuple[int, bytes]:
        async with api.client.options("/command/arm", headers=headers) as response:
            return response.status, await response.read()

    assert loop.run(preflight()) == (204, b"")
    assert api.get("/vehicles", headers=headers).status == 401


def test_limit_counts_each_token_apart_and_a_watcher_has_no_way_round_it(
    flying: Any, api: Any, loop: Any, roles: Any
) -> None:
    api.service.settings = replace(api.service.settings, local_rate=10.0)

    async def land() -> list[int]:
        asked = [api.ask("GET", "/command/land", headers=tokens.bearer("tower")) for _ in range(60)]
        return [answer.status for answer in await asyncio.gather(*asked)]

    assert {403, 429} == set(loop.run(land()))
    assert api.get("/telemetry/gps", headers=tokens.bearer("anna")).status == 200
    assert api.get("/command/brake?wait=false", headers=tokens.bearer("anna")).status == 202
    assert len(flying.orders()) <= 1


# -- the door itself ----------------------------------------------------------------------------------------


def settings(**given: Any) -> Any:
    return ApiModuleSettings(given, environ={}).snapshot()


def test_setting_token_is_an_admin_without_a_name_and_a_named_one_decides_in_any_network(tmp_path: Path) -> None:
    file = tokens.write(tmp_path / "tokens", tokens.ALL)
    given = settings(token="t", tokens=file, allow_from="10.0.0.0/8")
    tower = Token("tower", Role.WATCH, frozenset(), b"")
    found = {b"tower-tower": tower}
    caller = check_caller("10.0.0.1", tokens.bearer("tower"), given, found.get)
    assert (caller.role, caller.name, caller.flies(1)) == (Role.WATCH, "tower", False)
    for headers, remote in (({"Authorization": "Bearer t"}, "11.0.0.1"), ({}, "10.0.0.1")):
        caller = check_caller(remote, headers, given, found.get)
        assert (caller.role, caller.name, caller.flies(9)) == (Role.ADMIN, "", True)
        assert caller.operator.name == remote


def test_where_there_is_a_file_nobody_calls_without_a_token(tmp_path: Path) -> None:
    given = settings(tokens=str(tmp_path / "later"), allow_open=True)
    for remote in ("127.0.0.1", "192.0.2.1"):
        with pytest.raises(Unauthorized):
            check_caller(remote, {}, given)
    with pytest.raises(Forbidden):
        check_caller("192.0.2.1", {}, settings())
    assert check_caller("127.0.0.1", {}, settings()).role is Role.ADMIN


def test_script_has_a_token_of_its_own_as_long_as_it_runs(api: Any, drone: Any, roles: Any, tmp_path: Path) -> None:
    scripts, log = api.service.scripts, tmp_path / "log"
    secret = digest_of(b"its-own").hex()
    run = Run(log, "square.py", [], "s", 1, 8000, 0.0, log, log, 1.0, operator="boss", token=secret)
    headers = {"Authorization": "Bearer its-own"}
    assert api.get("/command/set_home?wait=false", headers=headers).status == 401
    scripts._trusted_run(run)
    assert api.get("/command/set_home?wait=false", headers=headers).status == 202
    (job,) = api.service.host.jobs.all()
    assert (job.client, job.operator) == ("boss/square@127.0.0.1", "boss")
    roles(boss="fly")
    assert api.get("/vehicles", headers=headers).status == 401, "who started it may not start scripts any more"
    roles(boss="admin")
    scripts._trusted.clear()
    assert api.get("/vehicles", headers=headers).status == 401


def test_scripts_environment_has_a_token_only_where_tokens_are_named(api: Any, roles: Any) -> None:
    assert api.service.scripts.environment("its-own")["UAVAPI_TOKEN"] == "its-own"
    assert api.service.scripts.environment()["UAVAPI_TOKEN"] == ""
