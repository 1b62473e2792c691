"""What `uavapi` shows in MAVProxy's console and map."""

from __future__ import annotations

import pytest

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.messages import GlobalTarget, NedTarget, VelocityTarget
from mavproxy_uavapi.core.roles import THE_PROMPT
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.prompt.windows import view
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.piloting import place
from tests.support.virtual_time import FastLoop


def test_without_a_vehicle_there_is_nothing(host: Host) -> None:
    assert (view(host).line, view(host).places) == ("", {})


def test_the_line_says_who_commands_and_who_holds(
    host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    assert view(host).line == "Commands 1: nobody"
    pilotage.start(copter.go_to, NedTarget(300.0, 0.0, -20.0), wait=True)
    assert view(host).line.startswith("Commands 1: console go_to")
    host.leases.take_hold(copter, THE_PROMPT, 0)
    assert view(host).line.endswith(f"(held by {THE_PROMPT.name})")


def test_the_place_is_that_of_our_target_in_either_frame(
    host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage, loop: FastLoop
) -> None:
    assert view(host).places == {}
    there = pytest.approx(place(flying, 30.0, 40.0), abs=1e-6)  # 0.1 m
    pilotage.start(copter.go_to, NedTarget(30.0, 40.0, -20.0))
    assert view(host).places == {"target 1": there}
    loop.pass_time(3.0)  # it is on its way
    assert view(host).places == {"target 1": there}
    pilotage.start(copter.go_to, GlobalTarget(*place(flying, -10.0, 0.0), 20.0))
    assert view(host).places == {"target 1": pytest.approx(place(flying, -10.0, 0.0), abs=1e-6)}


def test_velocity_another_mode_and_another_station_are_no_target_of_ours(
    host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage, loop: FastLoop
) -> None:
    pilotage.start(copter.travel, VelocityTarget(1.0, 0.0, 0.0))
    assert view(host).places == {}
    pilotage.start(copter.go_to, GlobalTarget(*place(flying, 300.0, 40.0), 20.0))
    assert "target 1" in view(host).places
    loop.pass_time(3.0)
    lat, lon = flying.place((0.0, 300.0))
    flying.send(
        "position_target_global_int", coordinate_frame=0, lat_int=lat, lon_int=lon, alt=604.0, type_mask=0xDF8
    )
    loop.settle()
    assert (view(host).line, view(host).places) == ("Commands 1: another station", {})
    pilotage.start(copter.go_to, NedTarget(300.0, 40.0, -20.0))
    flying.mode = "LOITER"
    loop.pass_time(2.0)
    assert view(host).places == {}
