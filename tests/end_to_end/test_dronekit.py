"""DroneKit's way, through MAVProxy's `--out`, while the API is loaded: the messages that its calls send.

`mode = VehicleMode(…)` is SET_MODE, `armed = True` COMPONENT_ARM_DISARM, `simple_takeoff` NAV_TAKEOFF, and
`simple_goto` a MISSION_ITEM that is for now.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink import mavutil

from tests.end_to_end.test_centmesh import PATIENCE, arm, guide, heard, lands, switch

mavlink = mavutil.mavlink
ALT = 8.0  # m above home


@pytest.fixture(scope="module")
def rig(harness: Any, tmp_path_factory: Any) -> Iterator[Any]:
    made = harness.embedded(tmp_path_factory.mktemp("dronekit"))
    yield made
    made.stop()


@pytest.fixture
def drone(rig: Any, harness: Any) -> Iterator[Any]:
    """The program's connection, in flight."""
    port = harness.free_port()
    rig.mavproxy.ask(f"output add 127.0.0.1:{port}", "Adding output")
    connection = mavutil.mavlink_connection(f"udp:127.0.0.1:{port}")
    assert connection.wait_heartbeat(timeout=PATIENCE)
    switch(connection, "GUIDED", lambda: connection.set_mode("GUIDED"))
    arm(connection)
    target = connection.target_system, connection.target_component
    connection.mav.command_long_send(*target, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 0, ALT)
    rig.eventually(lambda: heard(connection, "GLOBAL_POSITION_INT").relative_alt > 950 * ALT, what="the take-off")
    yield connection
    connection.close()
    rig.mavproxy.type(f"output remove 127.0.0.1:{port}")


def simple_goto(drone: Any, metres_north: float) -> int:
    """Fly so far north; the latitude (1e-7 degrees) of the target."""
    here = heard(drone, "GLOBAL_POSITION_INT")
    lat = here.lat / 1e7 + metres_north / 111_319
    assert guide(drone, lat, here.lon / 1e7, ALT) == mavlink.MAV_MISSION_ACCEPTED
    return round(lat * 1e7)


def land(rig: Any, drone: Any) -> None:
    switch(drone, "LAND", lambda: drone.set_mode("LAND"))
    lands(drone)
    assert rig.status()["mode"] == "LAND"


def test_it_flies_and_the_api_claims_nothing_of_it(rig: Any, drone: Any) -> None:
    lat = simple_goto(drone, 20)
    (vehicle,) = rig.ok(rig.get("/vehicles"))["vehicles"]
    assert vehicle["commanded_by"] is None
    rig.eventually(
        lambda: "another station commands" in rig.mavproxy.ask("uavapi authority", "vehicle 1: nobody holds it"),
        what="its being known",
    )
    rig.eventually(lambda: abs(heard(drone, "GLOBAL_POSITION_INT").lat - lat) < 100, what="the arrival")
    land(rig, drone)


def test_its_goto_ends_a_movement_of_the_api_and_its_landing_the_next(rig: Any, drone: Any) -> None:
    x, y, z = rig.ned()
    first = rig.begin("POST", "/movement/go_to_ned_wait", {"x": x - 2000, "y": y, "z": z})
    rig.eventually(lambda: rig.ned()[0] < x - 400, what="its flying for the API")  # its target has been reported
    simple_goto(drone, 60)
    assert first.answer(20).json()["code"] == "superseded"
    x, y, z = rig.ned()
    second = rig.begin("POST", "/movement/go_to_ned_wait", {"x": x - 2000, "y": y, "z": z})
    rig.eventually(lambda: rig.ned()[0] < x - 2, what="its flying for the API again")
    land(rig, drone)
    assert second.answer(20).json()["code"] in ("mode_changed", "not_armed")
