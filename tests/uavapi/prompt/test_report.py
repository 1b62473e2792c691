from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.api import Api
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.prompt.report import report, vehicles
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.drone import Drone
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink
SETTINGS = ApiModuleSettings().snapshot()


@pytest.fixture
def api(host: Host) -> Api:
    return Api(host)


def test_report_before_anything_happened(api: Api) -> None:
    assert report(api, SETTINGS) == (
        "uavapi: not listening; it would be http://127.0.0.1:8000\nno vehicle on the link yet\n0 calls in flight"
    )


def test_report_of_a_vehicle(loop: FastLoop, api: Api, drone: Drone) -> None:
    loop.pass_time(0.1)
    assert report(api, SETTINGS).splitlines()[1] == (
        "vehicle 1: copter, STABILIZE, disarmed, link ok (heartbeat 0.1 s ago, 0.0 % lost)"
    )


def test_report_of_a_call_in_flight_reports_its_progress(
    loop: FastLoop, host: Host, api: Api, flying: Drone, copter: Vehicle
) -> None:
    async def body(job: Any) -> str:
        await copter.go_to(job, NedTarget(200.0, 0.0, -20.0), wait=True)
        return "done"

    async def begin() -> None:
        host.jobs.begin(copter, "/movement/go_to_ned_wait", {}, body)

    loop.run(begin())
    loop.pass_time(5.1)
    *_, count, job = report(api, SETTINGS).splitlines()
    assert count == "1 call in flight"
    assert job == "  1: /movement/go_to_ned_wait altitude 20.0 m, distance to go 150.0 m"


def test_lost_link_and_lost_packets_are_reported(loop: FastLoop, api: Api, drone: Drone) -> None:
    drone._sequence += 9
    loop.pass_time(0.25)
    drone.power_off()
    loop.pass_time(7.0)
    assert "LINK LOST (heartbeat 7.0 s ago, 37.5 % lost)" in report(api, SETTINGS)


def test_report_is_of_the_vehicle_of_the_settings(api: Api, make_drone: Callable[..., Drone]) -> None:
    make_drone(1)
    make_drone(2)
    assert "vehicle 2:" in report(api, ApiModuleSettings({"sysid": 2}).snapshot())
    assert "no vehicle 9 on the link yet; heard so far: 1, 2" in report(
        api, ApiModuleSettings({"sysid": 9}).snapshot()
    )


def test_vehicles_are_a_line_each(loop: FastLoop, host: Host, api: Api, make_drone: Callable[..., Drone]) -> None:
    assert vehicles(api) == "uavapi: no vehicle was heard yet"
    make_drone(7)
    make_drone(2).fly("LOITER")
    host.bridge.feed(message_of("heartbeat", system=5, type=mavlink.MAV_TYPE_FIXED_WING, custom_mode=15, armed=True))
    host.bridge.turn()
    loop.settle()
    assert [line.split(" (")[0] for line in vehicles(api).splitlines()] == [
        "vehicle 2: copter, LOITER, armed, link ok",
        "vehicle 5: plane, GUIDED, armed, link ok",
        "vehicle 7: copter, STABILIZE, disarmed, link ok",
    ]


def test_rebooted_vehicle_is_armed_or_not(loop: FastLoop, api: Api, drone: Drone) -> None:
    drone.power_off()
    drone.send("attitude", time_boot_ms=100)
    loop.settle()
    assert "copter, UNKNOWN, armed or not: unknown" in vehicles(api)
