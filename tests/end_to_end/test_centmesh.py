"""CentMesh's tutorial: its two kinds of pymavlink program, which fly through MAVProxy's `--out`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_gradys.tracks.formats import parse, waypoints
from tests.support.ports import free_port

pytestmark = pytest.mark.long

mavlink = mavutil.mavlink
GROUND = 584.0  # m AMSL, the tutorial's and this rig's
MISSION = """QGC WPL 110
0	1	0	16	0	0	0	0	-35.363261	149.165230	584	1
1	0	3	22	0	0	0	0	0	0	8	1
2	0	3	16	0	0	0	0	-35.363081	149.165230	8	1
3	0	3	16	0	0	0	0	-35.363081	149.165450	12	1
4	0	3	20	0	0	0	0	0	0	0	1
"""
TIMEOUT = 60.0  # s


@pytest.fixture
def drone(rig, harness) -> Iterator[Any]:
    """A program's connection, as the tutorial makes it."""
    port = free_port()
    rig.mavproxy.ask(f"output add 127.0.0.1:{port}", "Adding output")
    connection = mavutil.mavlink_connection(f"udp:127.0.0.1:{port}")
    assert connection.wait_heartbeat(timeout=TIMEOUT)
    yield connection
    connection.close()
    rig.mavproxy.type(f"output remove 127.0.0.1:{port}")


def heard(drone: Any, kind: str) -> Any:
    message = drone.recv_match(type=kind, blocking=True, timeout=TIMEOUT)
    assert message is not None, f"no {kind}"
    return message


def switch(drone: Any, mode: str, request: Any) -> None:
    """Request a mode at each heartbeat, until one shows it."""
    deadline = time.monotonic() + TIMEOUT
    while drone.flightmode != mode:
        assert time.monotonic() < deadline, drone.flightmode
        request()
        heard(drone, "HEARTBEAT")


def arm(drone: Any) -> None:
    deadline = time.monotonic() + TIMEOUT
    while not drone.motors_armed():
        assert time.monotonic() < deadline
        drone.arducopter_arm()
        heard(drone, "HEARTBEAT")


def collect(drone: Any, file: Path, until: Any) -> None:
    """The first program's work: a line for each reading."""
    deadline = time.monotonic() + 3 * TIMEOUT
    with file.open("w") as lines:
        while not until():
            assert time.monotonic() < deadline
            lines.write(f"{heard(drone, 'GPS_RAW_INT')}\n")


def lands(drone: Any) -> None:
    deadline = time.monotonic() + TIMEOUT
    while drone.motors_armed():
        assert time.monotonic() < deadline
        heard(drone, "HEARTBEAT")


def test_without_the_option_auto_refuses_to_arm(rig, drone):
    rig.ok(rig.call("POST", "/mission/waypoints", data=MISSION, headers={"Content-Type": "text/plain"}))
    rig.ok(rig.call("PUT", "/parameters/AUTO_OPTIONS", json={"value": 0}))
    rig.until(lambda: rig.status()["ready_to_arm"], 120, "getting ready to arm")
    switch(drone, "AUTO", drone.set_mode_auto)
    drone.arducopter_arm()
    rig.mavproxy.says("AUTO mode not armable")
    assert rig.status()["armed"] is False


def test_auto_then_arm_then_take_off_by_the_mission(rig, drone, tmp_path):
    """The tutorial's first program; the throttle starts the take-off."""
    rig.ok(rig.call("POST", "/mission/waypoints", data=MISSION, headers={"Content-Type": "text/plain"}))
    rig.ok(rig.call("PUT", "/parameters/AUTO_OPTIONS", json={"value": 1}))
    rig.mavproxy.type("rc 3 1000")
    switch(drone, "AUTO", drone.set_mode_auto)
    arm(drone)
    rig.mavproxy.type("rc 3 1300")
    file = tmp_path / "gps_data"
    with rig.slowly():
        collect(drone, file, lambda: not drone.motors_armed())
    rig.mavproxy.type("rc 3 1000")  # down: with another throttle ArduCopter does not arm again
    track = parse(file.read_text())
    assert max(reading.alt for reading in track) / 1e3 - GROUND == pytest.approx(15, abs=8)
    assert len(waypoints(track)) >= 3


def guide(drone: Any, lat: float, lon: float, alt: float) -> int:
    """A guided MISSION_ITEM, again every 2 s until it is acknowledged, because UDP may lose either.

    Returns the MAV_MISSION_RESULT. `alt` is m above home.
    """
    deadline = time.monotonic() + TIMEOUT
    while True:
        assert time.monotonic() < deadline
        drone.mav.mission_item_send(
            drone.target_system, drone.target_component, 0, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
            mavlink.MAV_CMD_NAV_WAYPOINT, 2, 0, 0, 0, 0, 0, lat, lon, alt,
        )  # fmt: skip
        answer = drone.recv_match(type="MISSION_ACK", blocking=True, timeout=2)
        if answer is not None:
            return int(answer.type)


def test_guided_mission_items_fly_the_recorded_track(rig, drone):
    """The tutorial's second program: a line is a place; here it takes off first."""
    lines = [(-353630810, 1491652300, 592000), (-353630810, 1491654500, 596000)]
    switch(drone, "GUIDED", lambda: drone.set_mode("GUIDED"))
    arm(drone)
    drone.mav.command_long_send(
        drone.target_system, drone.target_component, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 0, 8
    )
    rig.until(lambda: heard(drone, "GLOBAL_POSITION_INT").relative_alt > 7500, what="the take-off")
    for lat, lon, alt in lines:
        assert guide(drone, lat / 1e7, lon / 1e7, alt / 1e3 - GROUND) == mavlink.MAV_MISSION_ACCEPTED

        def arrived(lat: int = lat, lon: int = lon, alt: int = alt) -> bool:
            position = heard(drone, "GLOBAL_POSITION_INT")
            near = abs(position.lat - lat) < 100 and abs(position.lon - lon) < 100  # 1 m
            return near and abs(position.relative_alt / 1e3 - (alt / 1e3 - GROUND)) < 1.0

        rig.until(arrived, what="the arrival")
    drone.set_mode_rtl()
    lands(drone)
    assert rig.status()["mode"] == "RTL"
