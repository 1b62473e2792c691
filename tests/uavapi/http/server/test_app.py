from __future__ import annotations

import asyncio
import errno
import gc
import io
import json
import logging
import socket
import weakref
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from aiohttp import ClientSession
from aiohttp.test_utils import RawTestServer, TestClient

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.contract.requests import Servo
from mavproxy_uavapi.http.contract.responses import Handler
from mavproxy_uavapi.http.contract.route import FLY, Route
from mavproxy_uavapi.http.server.app import ApiServer, is_ours, listening_socket, make_handler
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.drone import Drone
from tests.support.ports import free_port
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

MAX_BODY = 1024 * 1024  # bytes


@pytest.fixture
def listening_on() -> int:
    return free_port()


@pytest.fixture
def server(loop: FastLoop, service: Service, listening_on: int) -> Iterator[ApiServer]:
    loop.real_wait = 0.002
    service.settings = ApiModuleSettings({"port": listening_on}).snapshot()
    server = ApiServer(service)
    yield server
    loop.run(server.stop())


async def status_of(port: int, path: str = "/telemetry/gps") -> int:
    async with ClientSession() as session, session.get(f"http://127.0.0.1:{port}{path}") as response:
        return response.status


@pytest.mark.parametrize("path", ["/", "/command", "/command/fly", "/telemetry/gps/x", "/favicon.ico"])
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_unknown_path_is_404(api: Api, loop: FastLoop, method: str, path: str) -> None:
    answer = loop.run(api.ask(method, path))
    assert (answer.status, answer.body) == (404, {"detail": "no such path", "code": "not_found"})


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("GET", "/movement/go_to_ned", "POST"),
        ("POST", "/telemetry/gps/", "GET"),
        ("DELETE", "/command/arm", "GET,POST"),
        ("GET", "/peripherical/servo_output", "POST"),
        ("POST", "/telemetry/message/ATTITUDE", "GET"),
        ("POST", "/jobs/1", "GET,DELETE"),
    ],
)
def test_wrong_method_is_405_with_those_that_are_allowed(
    flying: Drone, api: Api, loop: FastLoop, method: str, path: str, allowed: str
) -> None:
    answer = loop.run(api.ask(method, path))
    assert answer.status == 405
    assert set(answer.headers["Allow"].split(",")) == set(allowed.split(","))
    assert answer.body["detail"] == f"this path takes {' and '.join(sorted(allowed.split(',')))}, not {method}"
    assert flying.received == []


@pytest.mark.parametrize("data", ["{", "x=1", "", "[1, 2]", '"text"', "null", b"\xff\xfe{}", '{"x": 1,}', "[" * 5000])
@pytest.mark.parametrize("path", ["/movement/go_to_ned", "/command/takeoff"])
def test_body_that_is_no_json_object_is_400_and_nothing_is_sent(
    flying: Drone, api: Api, path: str, data: Any
) -> None:
    answer = api.post(path, data=data, headers={"Content-Type": "application/json"})
    if data == "":  # no body at all: as if nothing had been given
        assert answer.status in (409, 422)
    else:
        assert (answer.status, answer.body["code"]) == (400, "bad_request")
        assert isinstance(answer.body["detail"], str)
    assert flying.orders() == []


@pytest.mark.parametrize("kind", ["application/json", "application/x-www-form-urlencoded"])
def test_body_in_an_unknown_charset_is_400(flying: Drone, api: Api, kind: str) -> None:
    headers = {"Content-Type": f"{kind}; charset=klingon"}
    answer = api.post("/movement/go_to_ned", data=b"x=1", headers=headers)
    assert (answer.status, answer.body["code"]) == (400, "bad_request")


def test_body_that_is_too_large_is_413(flying: Drone, api: Api) -> None:
    body = io.BytesIO(json.dumps({"x": 1, "y": 2, "z": -3, "padding": "p" * MAX_BODY}).encode())
    answer = api.post("/movement/go_to_ned", data=body, headers={"Content-Type": "application/json"})
    assert answer.status == 413
    assert (answer.body["code"], str(MAX_BODY) in answer.body["detail"]) == ("bad_request", True)
    assert flying.orders() == []


def test_parameters_may_be_in_the_query_and_in_the_body(flying: Drone, api: Api) -> None:
    answer = api.post("/movement/go_to_ned?y=2&z=-30", {"x": 7})
    assert answer.body["result"] == "Going to NED coord (7, 2, -30)"


def test_no_answer_is_a_redirect(flying: Drone, api: Api) -> None:
    for path in ("/movement/go_to_ned", "/movement/go_to_ned/"):
        assert api.post(path, {"x": 1, "y": 2, "z": -30}).status == 200


# -- paths of the other modules ---------------------------------------------------------------------------


def test_path_of_another_module_is_served_while_that_is_loaded(flying: Drone, api: Api, host: Host) -> None:
    async def search(call: Any) -> dict[str, Any]:
        return call.answer(f"Searching for {call.params(Servo).channel}")

    assert api.post("/vision/search", {"channel": 3, "pwm": 1000}).status == 404
    host.extensions["/vision/search"] = Route("/vision/search", search, Servo, FLY, ("POST",))
    for slash in ("", "/"):
        answer = api.post(f"/vision/search{slash}", {"channel": 3, "pwm": 1000})
        assert (answer.status, answer.body["result"]) == (200, "Searching for 3")
    assert api.post("/vision/search", {"channel": 99, "pwm": 1000}).status == 422
    refused = api.get("/vision/search")
    assert (refused.status, refused.headers["Allow"]) == (405, "POST")
    del host.extensions["/vision/search"]
    assert api.post("/vision/search", {"channel": 3, "pwm": 1000}).status == 404


# -- the server -------------------------------------------------------------------------------------------


def test_server_listens_and_stops(loop: FastLoop, server: ApiServer, listening_on: int, drone: Drone) -> None:
    loop.run(server.start())
    assert loop.run(status_of(listening_on)) == 200
    loop.run(server.stop())
    with pytest.raises(OSError, match="refused|Cannot connect"):
        loop.run(status_of(listening_on))


def test_port_that_is_taken_is_an_os_error_and_leaks_nothing(
    loop: FastLoop, server: ApiServer, listening_on: int, descriptors: Callable[[], int]
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", listening_on))
        taken.listen()
        before = descriptors()
        with pytest.raises(OSError, match="in use"):
            loop.run(server.start())
        loop.run(server.stop())
        assert descriptors() == before


def test_port_can_be_bound_again_at_once(loop: FastLoop, service: Service, listening_on: int, drone: Drone) -> None:
    loop.real_wait = 0.002
    service.settings = ApiModuleSettings({"port": listening_on}).snapshot()
    for _ in range(3):
        server = ApiServer(service)
        loop.run(server.start())
        assert loop.run(status_of(listening_on)) == 200
        loop.run(server.stop())


@pytest.mark.parametrize(
    ("head", "says"),
    [
        (
            "GET /?" + "a" * 9000 + " HTTP/1.1",
            "a line of the request is too long: a POST takes parameters in its body",
        ),
        ("GET / HTTP/1.1\r\nHost: a\r\nHost: b", "the request is not HTTP: Duplicate 'Host' header found."),
        ("GET /\xe9 HTTP/1.1", "the request is not HTTP: Invalid char in url path:"),
        ("hello", "the request is not HTTP: "),
    ],
)
def test_what_is_no_http_is_answered_by_a_sentence_in_json(
    loop: FastLoop, server: ApiServer, listening_on: int, head: str, says: str
) -> None:
    async def answer() -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", listening_on)
        writer.write(f"{head}\r\n\r\n".encode("latin-1"))
        data = await reader.read()
        writer.close()
        return data

    loop.run(server.start())
    status, _, body = loop.run(answer()).partition(b"\r\n\r\n")
    assert status.split()[1] == b"400"
    detail = json.loads(body)
    assert detail["code"] == "bad_request"
    assert detail["detail"].startswith(says)
    assert "bytearray" not in detail["detail"]


def test_stop_answers_the_clients_whose_verbs_it_ends(
    loop: FastLoop, server: ApiServer, service: Service, listening_on: int, flying: Drone
) -> None:
    async def stop_meanwhile() -> tuple[int, Any]:
        async with ClientSession() as session:
            request = loop.create_task(session.get(f"http://127.0.0.1:{listening_on}/command/land"))
            for _ in range(100):  # on a busy machine the request comes late, by the clock of this loop
                if service.host.jobs.running():
                    break
                await asyncio.sleep(0.2)
            assert service.host.jobs.running()
            await server.stop()
            async with await request as response:
                return response.status, await response.json()

    loop.run(server.start())
    status, body = loop.run(stop_meanwhile())
    assert (status, body["code"]) == (409, "aborted")
    assert "stopping" in body["detail"]


def test_stop_does_not_wait_long_for_an_open_stream(
    loop: FastLoop, server: ApiServer, listening_on: int, flying: Drone
) -> None:
    async def stop_meanwhile() -> float:
        async with ClientSession() as session:
            socket = await session.ws_connect(f"http://127.0.0.1:{listening_on}/telemetry/stream")
            await socket.receive()
            started = loop.time()
            await server.stop()
            return loop.time() - started

    loop.run(server.start())
    assert loop.run(stop_meanwhile()) < 3.5  # MAVProxy gives an unload 5 s, and we give this 4


def test_descriptors_are_those_of_the_port_and_of_every_connection(
    loop: FastLoop, server: ApiServer, listening_on: int, drone: Drone
) -> None:
    async def count() -> list[int]:
        async with ClientSession() as session, session.get(f"http://127.0.0.1:{listening_on}/telemetry/gps"):
            return server.filenos()

    assert server.filenos() == []
    loop.run(server.start())
    assert len(server.filenos()) == 1
    descriptors = loop.run(count())
    assert len(set(descriptors)) == 2
    assert server._sockets[0].fileno() in descriptors


def test_each_vehicle_has_a_port_of_its_own(
    loop: FastLoop, service: Service, make_drone: Callable[..., Drone], listening_on: int
) -> None:
    async def ids(ports: list[int]) -> list[str]:
        async with ClientSession() as session:
            answers = [await session.get(f"http://127.0.0.1:{port}/telemetry/gps") for port in ports]
            return [(await answer.json())["id"] for answer in answers]

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        other_port = int(probe.getsockname()[1])
    make_drone(1)
    make_drone(2)
    loop.real_wait = 0.002
    service.settings = ApiModuleSettings({"port": listening_on, "ports": f"{other_port}:2"}).snapshot()
    server = ApiServer(service)
    loop.run(server.start())
    assert loop.run(ids([listening_on, other_port])) == ["1", "2"]
    assert len(server.filenos()) == 2
    loop.run(server.stop())


def test_a_port_that_is_taken_closes_those_before_it(
    loop: FastLoop, service: Service, listening_on: int, drone: Drone
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        ports = f"{taken.getsockname()[1]}:2"
        service.settings = ApiModuleSettings({"port": listening_on, "ports": ports}).snapshot()
        server = ApiServer(service)
        with pytest.raises(OSError, match="in use"):
            loop.run(server.start())
        loop.run(server.stop())
    with socket.socket() as free:
        free.bind(("127.0.0.1", listening_on))


def test_listening_socket_of_a_foreign_address_is_an_os_error() -> None:
    with pytest.raises(OSError, match="assign"):
        listening_socket("192.0.2.1", 0)


def test_handler_that_has_served_is_forgotten(loop: FastLoop, service: Service) -> None:
    loop.real_wait = 0.002

    async def served() -> weakref.ref[Handler]:
        handler = make_handler(service)
        async with TestClient(RawTestServer(handler)) as client:
            assert (await client.get("/telemetry/gps")).status == 503
        return weakref.ref(handler)

    forgotten = loop.run(served())
    gc.collect()
    assert forgotten() is None


@pytest.mark.parametrize(
    ("method", "path", "gives_way"),
    [
        ("GET", "/telemetry/gps", True),
        ("GET", "/jobs", True),
        ("GET", "/command/brake", False),
        ("GET", "/movement/stop", False),
        ("POST", "/movement/travel_at_ned", False),
        ("DELETE", "/jobs/1", False),
    ],
)
def test_only_what_commands_does_not_wait_for_the_main_loop(
    flying: Drone,
    api: Api,
    loop: FastLoop,
    host: Host,
    monkeypatch: pytest.MonkeyPatch,
    method: str,
    path: str,
    gives_way: bool,
) -> None:
    waited: list[str] = []

    async def wait_for_main_loop() -> None:
        waited.append(path)

    monkeypatch.setattr(host.bridge, "wait_for_main_loop", wait_for_main_loop)
    loop.run(api.ask(method, path))
    assert bool(waited) is gives_way


@pytest.mark.parametrize(
    ("error", "ours"),
    [
        (TimeoutError(errno.ETIMEDOUT, "Connection timed out"), False),  # it read nothing, and the kernel closed it
        (ConnectionResetError(), False),
        (TimeoutError(), True),
        (KeyError("x"), True),
    ],
)
def test_a_line_about_a_client_that_has_gone_is_not_logged(error: Exception, ours: bool) -> None:
    record = logging.LogRecord("uavapi", logging.ERROR, "", 0, "", None, (type(error), error, None))
    assert is_ours(record) is ours
