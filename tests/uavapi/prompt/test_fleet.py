from __future__ import annotations

from collections.abc import Callable

import pytest

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.prompt.fleet import command
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop


def test_every_vehicle_has_a_line(make_drone: Callable[..., Drone], host: Host, loop: FastLoop) -> None:
    flying, standing = make_drone(1), make_drone(2)
    flying.fly()
    loop.settle()
    lines = loop.run(command(host, ["rtl"])).splitlines()
    assert lines == ["fleet rtl", "  vehicle 1: done", "  vehicle 2: done"]
    assert flying.mode == "RTL"
    assert standing.mode == "STABILIZE"


def test_only_those_that_are_named(make_drone: Callable[..., Drone], host: Host, loop: FastLoop) -> None:
    drones = [make_drone(1), make_drone(2)]
    for drone in drones:
        drone.fly()
    loop.settle()
    text = loop.run(command(host, ["brake", "2", "7"]))
    assert "vehicle 2: done" in text
    assert "vehicle 7: no vehicle 7" in text
    assert [drone.mode for drone in drones] == ["GUIDED", "BRAKE"]


@pytest.mark.parametrize("words", [[], ["dance"], ["land", "all"]])
def test_what_means_nothing_is_reported(host: Host, loop: FastLoop, words: list[str]) -> None:
    with pytest.raises(BadRequest):
        loop.run(command(host, words))
