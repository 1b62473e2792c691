from __future__ import annotations

import re
from collections.abc import Callable

import pytest

from mavproxy_uavapi.core.audit import Entry, utc_now
from mavproxy_uavapi.core.errors import BadRequest, NoVehicle
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.prompt.why import MOST_LINES, command
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop

EKF = "EKF Failsafe: changed to LAND Mode"


def test_why_tells_what_happened_last_and_what_led_to_it(flying: Drone, host: Host, loop: FastLoop) -> None:
    loop.pass_time(60.0)
    host.audit.newest.clear()
    flying.say(EKF, severity=2)
    flying.pilot("LAND")
    loop.pass_time(2.0)
    head, *lines = loop.run(command(host, [])).splitlines()
    assert head == "why"
    assert all(re.match(r"  \d\d:\d\d:\d\d \(\d\d:\d\d:\d\d UTC\) vehicle 1 ", line) for line in lines)
    assert {line.partition(") ")[2] for line in lines} == {
        f"vehicle 1 says: {EKF}",
        f"vehicle 1 changes from GUIDED to LAND, by a failsafe ({EKF})",
    }


def test_only_the_vehicles_that_are_named_and_no_more_lines_than_one_reads(
    make_drone: Callable[..., Drone], host: Host, loop: FastLoop
) -> None:
    for number in (1, 2):
        make_drone(number)
    for _ in range(2 * MOST_LINES):
        host.audit.add(Entry(utc_now(), "anna", "/command/arm", {}, 1, "rejected", "no"))
    assert len(loop.run(command(host, ["1"])).splitlines()) == 1 + MOST_LINES
    (_, line) = loop.run(command(host, ["2"])).splitlines()
    assert "vehicle 2 is heard" in line


def test_success_is_no_turn(drone: Drone, host: Host, loop: FastLoop) -> None:
    host.audit.newest.clear()
    host.audit.add(Entry(utc_now(), "anna", "/command/arm", {}, 1, "ok", "Armed"))
    assert loop.run(command(host, [])) == "why\n  nothing has happened to vehicle 1 yet"


def test_words_that_are_no_vehicle_are_refused(drone: Drone, host: Host, loop: FastLoop) -> None:
    with pytest.raises(BadRequest):
        loop.run(command(host, ["all"]))
    with pytest.raises(NoVehicle):
        loop.run(command(host, ["7"]))


def test_nothing_was_heard_yet(host: Host, loop: FastLoop) -> None:
    assert loop.run(command(host, [])) == "nothing has happened yet"
