"""The client at the API, both on the time-travelling loop, before the scripted copter."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import pytest
from aiohttp.test_utils import RawTestServer

from mavproxy_uavapi.client import Drone, connect
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.app import make_handler
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.virtual_time import FastLoop

SOCKET_WAIT = 0.002  # real s that the sockets get before the clock jumps


@pytest.fixture
def service(host: Host) -> Service:
    return Service(host, ApiModuleSettings(environ={}).snapshot())


@pytest.fixture
def url(loop: FastLoop, service: Service) -> Iterator[str]:
    """The API's address."""
    loop.real_wait = SOCKET_WAIT
    server = RawTestServer(make_handler(service))
    loop.run(server.start_server(access_log=None))
    yield str(server.make_url("")).rstrip("/")
    service.host.jobs.on_ended.clear()
    loop.run(server.close())


@pytest.fixture
def ours(loop: FastLoop, url: str, flying: Any) -> Iterator[Drone]:
    """The client's side of a copter that hovers 20 m above home."""
    stack = contextlib.AsyncExitStack()
    yield loop.run(stack.enter_async_context(connect(url, "")))
    loop.run(stack.aclose())
