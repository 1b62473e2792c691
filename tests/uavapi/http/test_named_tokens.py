"""Named tokens in the whole API: what becomes of streams, flights and scripts whose token is taken away.

It takes all of them together. `test_security.py` tests the door alone, `tests/rules/test_roles.py` each route.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from aiohttp import ClientError, WSMsgType

from mavproxy_uavapi.files.tokens import digest_of
from mavproxy_uavapi.scripts.runs import Run
from tests.support import tokens
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api


@pytest.fixture
def roles(api: Api, tmp_path: Path) -> Callable[..., None]:
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


async def over_websocket(api: Api, name: str, events: list[Any]) -> None:
    async with api.client.ws_connect("/telemetry/stream", headers=tokens.bearer(name)) as socket:
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                events.append(json.loads(message.data))


async def by_events(api: Api, name: str, events: list[Any]) -> None:
    async with api.client.get("/telemetry/stream", headers=tokens.bearer(name)) as response:
        assert response.status == 200
        async for line in response.content:
            if line.startswith(b"data: "):
                events.append(json.loads(line[6:]))


@pytest.mark.parametrize("stream", [over_websocket, by_events])
@pytest.mark.parametrize("change", [{}, {"tower": "admin"}])
def test_watcher_streams_until_its_token_is_taken_away_or_changed(
    flying: Drone, api: Api, loop: FastLoop, roles: Callable[..., None], stream: Any, change: dict[str, str]
) -> None:
    tower_events, anna_events = list[Any](), list[Any]()
    tower = loop.create_task(stream(api, "tower", tower_events))
    anna = loop.create_task(stream(api, "anna", anna_events))
    api.until(lambda: len(tower_events) > 5 and len(anna_events) > 5)
    roles(anna="fly", **change)
    api.until(tower.done)
    assert tower.exception() is None or isinstance(tower.exception(), ClientError)
    count = len(anna_events)
    api.until(lambda: len(anna_events) > count + 5)
    assert not anna.done() and flying.orders() == []
    anna.cancel()
    loop.settle()


@pytest.mark.parametrize("name", ["", "nobody"])
def test_stranger_gets_no_stream(flying: Drone, api: Api, roles: Callable[..., None], name: str) -> None:
    assert api.get("/telemetry/stream", headers=tokens.bearer(name)).status == 401
    assert api.get("/vehicles", headers={"Authorization": f"Bearer {digest_of(b'x').hex()}"}).status == 401


def test_flight_of_a_revoked_token_ends_as_if_its_client_hung_up(
    flying: Drone, api: Api, loop: FastLoop, roles: Callable[..., None]
) -> None:
    body = {"x": 300, "y": 0, "z": -20}
    request = api.begin("POST", "/movement/go_to_ned_wait", json=body, headers=tokens.bearer("anna"))
    api.until(api.service.host.jobs.running)
    (job,) = api.service.host.jobs.running()
    roles(bo="fly")
    api.until(request.done)
    assert isinstance(request.exception(), ClientError)
    api.until(lambda: not job.running)
    assert "hung up" in str(job.error)
    assert api.get("/vehicles", headers=tokens.bearer("anna")).status == 401


def test_kept_connection_of_a_token_that_is_taken_away_is_refused(
    api: Api, roles: Callable[..., None], drone: Drone
) -> None:
    assert api.get("/vehicles", headers=tokens.bearer("tower")).status == 200
    roles(anna="fly")
    assert api.get("/vehicles", headers=tokens.bearer("tower")).status == 401


def test_read_only_api_is_watched_and_commanded_by_nobody(api: Api, roles: Callable[..., None], drone: Drone) -> None:
    api.service.settings = replace(api.service.settings, read_only=True)
    for headers in (tokens.bearer("tower"), tokens.bearer("anna"), {}):
        for path in ("/command/arm", "/movement/stop", "/fleet/brake"):
            answer = api.post(path, headers=headers)
            assert answer.status in (401, 403), path
    assert "read only" in api.post("/movement/stop", headers=tokens.bearer("tower")).body["detail"]
    assert api.get("/vehicles", headers=tokens.bearer("tower")).status == 200


def test_documentation_and_page_need_no_token_and_preflights_tell_nothing(
    api: Api, loop: FastLoop, roles: Callable[..., None]
) -> None:
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
    flying: Drone, api: Api, loop: FastLoop, roles: Callable[..., None]
) -> None:
    api.service.settings = replace(api.service.settings, local_rate=10.0)

    async def land() -> list[int]:
        requests = [api.ask("GET", "/command/land", headers=tokens.bearer("tower")) for _ in range(60)]
        return [answer.status for answer in await asyncio.gather(*requests)]

    assert {403, 429} == set(loop.run(land()))
    assert api.get("/telemetry/gps", headers=tokens.bearer("anna")).status == 200
    assert api.get("/command/brake?wait=false", headers=tokens.bearer("anna")).status == 202
    assert len(flying.orders()) <= 1


def test_script_has_a_token_of_its_own_as_long_as_it_runs(
    api: Api, drone: Drone, roles: Callable[..., None], tmp_path: Path
) -> None:
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


def test_scripts_environment_has_a_token_only_where_tokens_are_named(api: Api, roles: Callable[..., None]) -> None:
    assert api.service.scripts.environment("its-own")["UAVAPI_TOKEN"] == "its-own"
    assert api.service.scripts.environment()["UAVAPI_TOKEN"] == ""
