"""The HTTP application before the scripted copter, both on the time-travelling loop."""

from __future__ import annotations

import asyncio
import fcntl
import json
import resource
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from aiohttp import TCPConnector, web
from aiohttp.test_utils import RawTestServer, TestClient

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.app import ApiServer, make_handler
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from mavproxy_uavapi.scripts.manager import Scripts
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support import described
from tests.support.api_port import TOKEN, Port
from tests.support.virtual_time import FastLoop

SOCKET_WAIT = 0.002  # real s that the sockets get before the clock jumps


class Api:
    """A client of the API; `get` and `post` give an answer with `status`, `body` and `headers`."""

    def __init__(self, loop: FastLoop, service: Service) -> None:
        self.loop, self.service = loop, service
        self.client: TestClient[Any, Any]

    async def start(self) -> None:
        server = RawTestServer(make_handler(self.service))
        await server.start_server(access_log=None)
        self.client = TestClient(server, connector=TCPConnector(limit=0))

    async def ask(self, method: str, path: str, **kwargs: Any) -> Any:
        """One request; the body is parsed strictly, without NaN and infinities."""

        def forbidden(constant: str) -> None:
            raise AssertionError(f"{constant} is not JSON")

        async with self.client.request(method, path, allow_redirects=False, **kwargs) as response:
            text = await response.text()
            body = json.loads(text, parse_constant=forbidden)
            described.check(method, path, response.status, body)
            return SimpleNamespace(status=response.status, body=body, headers=response.headers)

    def get(self, path: str, **kwargs: Any) -> Any:
        return self.loop.run(self.ask("GET", path, **kwargs))

    def post(self, path: str, body: Any = None, **kwargs: Any) -> Any:
        if body is not None:
            kwargs["json"] = body
        return self.loop.run(self.ask("POST", path, **kwargs))

    def until(self, condition: Callable[[], Any]) -> None:
        """Let time pass until that holds."""
        for _ in range(100):
            if condition():
                return
            self.loop.pass_time(0.1)
        raise AssertionError("it did not happen")

    def begin(self, method: str, path: str, **kwargs: Any) -> asyncio.Task[Any]:
        """A request in flight."""
        return self.loop.create_task(self.ask(method, path, **kwargs))


@pytest.fixture
def service(host: Host) -> Service:
    """What the handlers work with."""
    return Service(host, ApiModuleSettings(environ={}).snapshot())


@pytest.fixture
def api(loop: FastLoop, service: Service) -> Iterator[Api]:
    """The API, with whatever vehicle the test puts on the link."""
    loop.real_wait = SOCKET_WAIT
    loop.set_default_executor(AtOnce())  # of threads its clock would know nothing
    api = Api(loop, service)
    loop.run(api.start())
    yield api
    service.host.jobs.on_ended.clear()
    service.host.jobs.abort_remote("the test is over")
    loop.run(api.client.close())


@pytest.fixture
def raising(loop: FastLoop, service: Service) -> Callable[[BaseException], Any]:
    """The answer of an application that raises this."""
    from mavproxy_uavapi.http.callers.call import SERVICE
    from mavproxy_uavapi.http.server.error_answers import errors_as_answers

    def raising(error: BaseException) -> Any:
        async def handler(_request: web.BaseRequest) -> web.StreamResponse:
            raise error

        async def ask() -> Any:

            from aiohttp.test_utils import make_mocked_request

            request = make_mocked_request("GET", "/x")
            request[SERVICE] = service
            response = await errors_as_answers(request, handler)
            return SimpleNamespace(
                status=response.status, body=json.loads(response.text or "null"), headers=response.headers
            )

        return loop.run(ask())

    return raising


@pytest.fixture
def unread(api: Api, loop: FastLoop) -> Iterator[Callable[..., socket.socket]]:
    """A client that asks for a stream and reads nothing: `unread(path, header=value)`."""
    clients: list[socket.socket] = []

    def connect(path: str = "/telemetry/stream", **headers: str) -> socket.socket:
        client = socket.socket()
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.connect(("127.0.0.1", api.client.port))
        lines = [f"GET {path} HTTP/1.1", "Host: 127.0.0.1", *(f"{k}: {v}" for k, v in headers.items())]
        client.sendall("\r\n".join([*lines, "", ""]).encode())
        client.setblocking(False)
        clients.append(client)
        return client

    yield connect
    for client in clients:
        client.close()


@pytest.fixture
def idle_strangers(port: Port) -> Iterator[Callable[[int], list[socket.socket]]]:
    """Opens so many connections that say nothing; their own ends take none of the low descriptors."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(limits[1], 8192), limits[1]))
    clients: list[socket.socket] = []

    def connect(count: int) -> list[socket.socket]:
        for _ in range(count):
            with socket.socket() as low:
                clients.append(socket.socket(fileno=fcntl.fcntl(low, fcntl.F_DUPFD, 2000)))
            clients[-1].setblocking(False)
            clients[-1].connect_ex(("127.0.0.1", port.port))
        return clients

    yield connect
    for client in clients:
        client.close()
    resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.fixture
def port(loop: FastLoop, service: Service, tmp_path: Path) -> Iterator[Port]:
    """The API with a token, on a real port of the loopback."""
    loop.real_wait = 0.002
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = int(probe.getsockname()[1])
    keywords = {"port": free, "token": TOKEN, "scripts_path": str(tmp_path / "scripts")}
    service.settings = ApiModuleSettings(keywords, environ={}).snapshot()
    service.scripts = Scripts(service.host, service.settings)
    server = ApiServer(service)
    loop.run(server.start())
    port = Port(loop, server, free)
    yield port
    loop.run(port.close())
