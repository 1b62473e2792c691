from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import LinkLost, NoVehicle
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink


@pytest.fixture
def hear(loop: FastLoop, host: Host) -> Callable[..., None]:
    def hear(**fields: Any) -> None:
        host.bridge.feed(message_of("heartbeat", **fields))
        host.bridge.turn()
        loop.settle()

    return hear


def test_no_vehicle_before_the_first_heartbeat(registry: VehicleRegistry) -> None:
    with pytest.raises(NoVehicle, match="^no vehicle on the link yet$"):
        registry.find()
    with pytest.raises(NoVehicle, match="^no vehicle 7 on the link yet$"):
        registry.find(7)


def test_unknown_vehicle_is_answered_with_those_that_were_heard(
    registry: VehicleRegistry, hear: Callable[..., None]
) -> None:
    hear(system=1)
    hear(system=3)
    with pytest.raises(NoVehicle, match="no vehicle 7 on the link yet; heard so far: 1, 3"):
        registry.find(7)


def test_vehicle_is_the_named_one_or_mavproxys_or_the_first(
    registry: VehicleRegistry, host: Host, hear: Callable[..., None]
) -> None:
    hear(system=5)
    hear(system=2)
    assert registry.find().state.system == 5
    host.registry.current = 2
    assert registry.find().state.system == 2
    assert registry.find(5).state.system == 5


def test_vehicle_is_the_same_each_time(registry: VehicleRegistry, hear: Callable[..., None]) -> None:
    hear()
    assert registry.find(1) is registry.find(1)


def test_type_comes_from_the_heartbeat_and_may_change(registry: VehicleRegistry, hear: Callable[..., None]) -> None:
    hear()
    assert isinstance(registry.find(), Copter)
    hear(type=mavlink.MAV_TYPE_FIXED_WING)
    assert not isinstance(registry.find(), Copter)
    assert isinstance(registry.find(), Vehicle)
    assert registry.find().kind == "plane"


def test_vehicle_without_heartbeats_cannot_be_commanded_but_read(
    loop: FastLoop, registry: VehicleRegistry, hear: Callable[..., None]
) -> None:
    hear()
    loop.pass_time(4.9)
    assert registry.commandable() is registry.find()
    loop.pass_time(1.1)
    assert registry.find().state.system == 1
    with pytest.raises(LinkLost, match=r"no heartbeat from vehicle 1 for 6\.0 s"):
        registry.commandable()
    hear()
    assert registry.commandable() is registry.find()
