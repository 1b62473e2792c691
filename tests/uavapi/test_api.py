from __future__ import annotations

import asyncio
import dataclasses
import socket
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from aiohttp import ClientSession
from pymavlink import mavutil

from mavproxy_uavapi.api import Api
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.settings import ApiModuleSettings, ApiSettings
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink


@pytest.fixture
def settings() -> ApiSettings:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return ApiModuleSettings({"port": probe.getsockname()[1], "link_timeout": 9.0}).snapshot()


@pytest.fixture
def api(loop: FastLoop, host: Host) -> Any:
    loop.real_wait = 0.002
    api = Api(host)
    yield api
    loop.run(api.stop())


async def status_of(settings: Any) -> int:
    address = f"http://{settings.host}:{settings.port}/telemetry/gps"
    async with ClientSession() as session, session.get(address) as response:
        return response.status


def test_start_listens_and_takes_the_settings(
    loop: FastLoop, api: Api, host: Host, settings: ApiSettings, drone: Drone
) -> None:
    assert not api.listening
    loop.run(api.start(settings))
    assert api.listening
    assert host.link_watch.timeout == 9.0
    assert loop.run(status_of(settings)) == 200


def test_start_twice_is_one_server(loop: FastLoop, api: Api, settings: ApiSettings) -> None:
    loop.run(api.start(settings))
    before = api.filenos()
    loop.run(api.start(settings))
    assert api.filenos() == before


def test_stop_closes_the_port_and_ends_the_watch(
    loop: FastLoop, api: Api, settings: ApiSettings, drone: Drone
) -> None:
    loop.run(api.start(settings))
    loop.run(api.stop())
    loop.run(api.stop())
    assert not api.listening
    assert api.filenos() == []
    with pytest.raises(OSError, match="Cannot connect"):
        loop.run(status_of(settings))
    drone.received.clear()
    drone.mute.add("VFR_HUD")
    loop.pass_time(20.0)
    assert drone.received == []


def test_stop_gives_back_the_rates_that_it_asked_for(
    loop: FastLoop, api: Api, host: Host, mpstate: SimpleNamespace, settings: ApiSettings, drone: Drone
) -> None:
    loop.run(api.start(settings))
    drone.mute.add("VFR_HUD")
    loop.pass_time(10.0)
    loop.run(api.stop())
    assert mpstate.the_master.written == []  # MAVProxy's main loop writes them
    host.bridge.turn()
    (message,) = mpstate.the_master.written
    assert (message.param1, message.param2) == (mavlink.MAVLINK_MSG_ID_VFR_HUD, 0)


def test_vehicle_of_the_setting_is_used(loop: FastLoop, api: Api, host: Host, settings: ApiSettings) -> None:
    loop.run(api.start(dataclasses.replace(settings, sysid=7)))
    assert host.registry.is_used(7)


def test_api_watches_the_telemetry(loop: FastLoop, api: Api, settings: ApiSettings, drone: Drone) -> None:
    loop.run(api.start(settings))
    drone.mute.add("VFR_HUD")
    loop.pass_time(10.0)
    assert drone.received


def test_taken_port_leaves_nothing_behind_and_can_be_tried_again(
    loop: FastLoop, api: Api, settings: ApiSettings, drone: Drone, descriptors: Callable[[], int]
) -> None:
    with socket.socket() as taken:
        taken.bind((settings.host, settings.port))
        taken.listen()
        before = descriptors()
        with pytest.raises(OSError, match="in use"):
            loop.run(api.start(settings))
        assert not api.listening
        assert descriptors() == before
        assert asyncio.all_tasks(loop) <= {drone._stream}
    loop.run(api.start(settings))
    assert loop.run(status_of(settings)) == 200
