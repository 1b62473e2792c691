"""A `stop` among other verbs: what ends it, what it ends, and what goes on afterwards."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.mission import Item
from tests.support.make_world import MakeWorld
from tests.support.world import PLACE, World, item_at

pytestmark = pytest.mark.matrix

PAUSE, SPEED = mavlink.MAV_CMD_DO_PAUSE_CONTINUE, mavlink.MAV_CMD_DO_CHANGE_SPEED
FAR = {"x": 300, "y": 0, "z": -8}
GO = "/movement/go_to_ned_wait"


def speed(world: World) -> float:
    return math.hypot(*world.copter.body.velocity)


def stop(world: World) -> str:
    return world.ask("GET", "/movement/stop").outcome


def commands(world: World, number: int, since: float) -> list[Any]:
    return [message for message in world.orders(since) if getattr(message, "command", None) == number]


def begin_and_stop(world: World, path: str) -> Any:
    """Begin what ends a stop, and stop again as soon as it has sent that; the call that ends the first stop."""
    since = world.now - 1e-3
    call = world.begin("GET", path)
    world.until(lambda: commands(world, PAUSE, since))
    assert stop(world) == "200"
    assert [message.param1 for message in commands(world, PAUSE, since)] == [1.0, 0.0]  # it goes on, and pauses
    return call


@pytest.mark.parametrize("seconds", [0.0, 0.3, 1.0])
def test_stop_while_a_takeoff_ends_an_earlier_stop(on_ground: World, seconds: float) -> None:
    world = on_ground
    assert stop(world) == "200"
    world.fault("delay_acks", command=PAUSE, seconds=seconds)
    takeoff = begin_and_stop(world, "/command/takeoff?alt=20")
    world.pass_time(5.0)
    assert world.at[2] == pytest.approx(0.0, abs=0.1)
    assert world.ask("GET", "/movement/resume").outcome == "200"
    assert world.answer(takeoff).outcome == "200"  # it has waited, as any movement does


@pytest.mark.parametrize("seconds", [0.0, 0.3])
def test_stop_while_guided_ends_an_earlier_stop(world: World, seconds: float) -> None:
    world.begin("POST", GO, FAR)
    world.pass_time(3.0)
    assert stop(world) == "200"
    world.fault("delay_acks", command=PAUSE, seconds=seconds)
    begin_and_stop(world, "/command/guided")
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "409 paused"
    assert speed(world) < 0.1


def test_a_mission_that_stands_and_does_not_answer_is_left_for_brake(make_world: MakeWorld) -> None:
    def waits(world: World) -> None:
        world.flying()
        frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        here = round((PLACE[0] + 5e-5) * 1e7), round(PLACE[1] * 1e7)
        a_minute = Item(mavlink.MAV_CMD_NAV_WAYPOINT, frame, 60, 0, 0, 0, *here, 10.0)
        world.copter.mission.items[:] = [item_at(*PLACE), a_minute, item_at(PLACE[0] + 0.003, PLACE[1])]
        world.in_mode("AUTO")
        world.by_hand(mavlink.MAV_CMD_MISSION_START)
        world.simulator.run(12.0)

    world = make_world(waits)
    assert speed(world) < 0.1
    world.uplink_until = world.now + 8.0
    assert stop(world) == "200"
    assert world.copter.mode.name == "BRAKE"
    world.pass_time(90.0)
    assert speed(world) < 0.1


def test_the_same_takeoff_again_ends_the_stop(on_ground: World) -> None:
    world = on_ground
    world.begin("GET", "/command/takeoff?alt=10")
    world.pass_time(0.3)
    assert stop(world) == "200"
    assert world.ask("GET", "/command/takeoff?alt=10").outcome == "200"
    assert world.at[2] == pytest.approx(-10.0, abs=0.5)


@pytest.mark.parametrize("wait", ["true", "false"])
def test_the_same_movement_again_is_refused_as_any_other(world: World, wait: str) -> None:
    first = world.begin("POST", GO, FAR)
    world.pass_time(3.0)
    assert stop(world) == "200"
    again = world.ask("POST", f"{GO}?wait={wait}", FAR)
    if wait == "true":
        assert again.outcome == "409 paused"
    else:
        world.pass_time(0.1)
        assert world.ask("GET", again.headers["location"]).body["error"]["code"] == "paused"
    assert world.ask("GET", "/movement/resume").outcome == "200"
    assert world.answer(first).outcome == "200"


@pytest.mark.parametrize("body", [{}, {"until_complete": True}])
def test_a_mission_is_started_anew_after_a_stop(make_world: MakeWorld, body: dict[str, bool]) -> None:
    world = make_world(World.on_mission)
    world.begin("POST", "/mission/start", body)
    world.pass_time(5.0)
    assert stop(world) == "200"
    again = world.begin("POST", "/mission/start", body)
    world.pass_time(5.0)
    assert speed(world) > 3.0
    assert world.answer(again).outcome == "200"


def test_a_yaw_rate_does_not_revive_a_velocity_that_ends(world: World) -> None:
    late: list[Any] = []

    def is_not_late(message: Any) -> bool:
        if message.get_type() != "POSITION_TARGET_LOCAL_NED":
            return True
        late.append(message)
        return False

    travel = world.begin("POST", "/movement/travel_at_ned", {"vx": 6, "vy": 0, "vz": 0, "duration": 5})
    world.pass_time(4.9)
    world.hears = is_not_late
    world.begin("POST", "/movement/set_yaw_rate", {"yaw_rate": 20})  # asks what is in force
    world.pass_time(0.05)
    assert world.answer(travel).outcome == "200"
    world.hears = lambda _message: True
    world.host.bridge.feed(late[0])
    world.host.bridge.turn()
    world.pass_time(1.0)
    setpoints = [message for message in world.orders() if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    assert [message.vx for message in setpoints[-2:]] == [0.0, 0.0]  # the end, and the yaw rate


@pytest.mark.parametrize("fault", ["refuse", "drop"])
@pytest.mark.parametrize("path", [GO, "/movement/go_to_ned"])
def test_a_movement_whose_speed_is_not_taken_ends_at_rest(make_world: MakeWorld, path: str, fault: str) -> None:
    world = make_world(lambda world: world.flying("LOITER"))
    assert world.ask("GET", "/command/set_ground_speed?new_v=3").outcome == "200"
    assert world.ask("GET", "/command/guided").outcome == "200"
    if fault == "refuse":
        world.fault("refuse", command=SPEED, result=mavlink.MAV_RESULT_FAILED, text="no")
    else:
        world.fault("drop", message="COMMAND_LONG", command=SPEED)
    assert world.ask("POST", path, FAR).outcome in ("500 rejected", "504 timeout")
    world.pass_time(10.0)
    assert speed(world) < 0.1


@pytest.mark.parametrize("lost", ["heartbeats", "orders", None])
@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("POST", "/mission/start"),
        ("GET", "/command/set_mode?mode=AUTO"),
        ("GET", "/command/rtl"),
        ("GET", "/command/land"),
    ],
)
def test_stop_while_our_own_switch_is_on_its_way(
    make_world: MakeWorld, method: str, path: str, lost: str | None
) -> None:
    world = make_world(on_a_mission_in_guided)
    world.pass_time(2.0)
    if lost == "heartbeats":
        world.hears = lambda message: message.get_type() != "HEARTBEAT"
    elif lost == "orders":
        world.uplink_until = world.now + 1.5
    switch = world.begin(method, path, {} if method == "POST" else None)
    begins = mavlink.MAV_CMD_MISSION_START if path == "/mission/start" else mavlink.MAV_CMD_DO_SET_MODE
    world.until(lambda: commands(world, begins, 0.0), step=0.005)
    stopping = world.begin("GET", "/movement/stop")
    world.pass_time(1.2)
    world.hears = lambda _message: True
    assert world.answer(stopping).outcome == "200"
    assert world.copter.mode.name == "BRAKE" and speed(world) < 0.1
    assert world.answer(switch).outcome == "409 superseded"
    world.pass_time(10.0)
    assert world.copter.mode.name == "BRAKE" and speed(world) < 0.1


def on_a_mission_in_guided(world: World) -> None:
    world.flying()
    world.copter.mission.items[:] = [item_at(*PLACE), item_at(PLACE[0] + 0.003, PLACE[1])]


CONTINUE = {"command": 193, "confirmation": 0, "param1": 1, **dict.fromkeys([f"param{n}" for n in range(2, 8)], 0)}
NORTHWARDS = {"time_boot_ms": 0, "coordinate_frame": 1, "type_mask": 0x0DC7, "vx": 5}
NORTHWARDS |= dict.fromkeys(("x", "y", "z", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0)


@pytest.mark.parametrize(
    ("name", "fields"), [("SET_POSITION_TARGET_LOCAL_NED", NORTHWARDS), ("COMMAND_LONG", CONTINUE)]
)
def test_raw_message_neither_moves_what_is_stopped_nor_ends_its_flight(
    make_world: MakeWorld, name: str, fields: dict[str, Any]
) -> None:
    world = make_world(World.flying, allow_raw=True)
    flight = world.begin("POST", "/movement/go_to_ned_wait", {"x": 30, "y": 0, "z": -8})
    world.pass_time(2.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    north = world.at[0]
    assert world.ask("POST", "/message", {"name": name, "fields": fields}).outcome == "409 paused"
    world.pass_time(3.0)
    assert world.at[0] == pytest.approx(north, abs=0.5)
    assert world.ask("GET", "/movement/resume").outcome == "200"
    assert world.answer(flight).outcome == "200"


@pytest.mark.parametrize("stage", [World.on_mission, World.armed], ids=["mission", "takeoff"])
def test_what_was_stopped_before_we_knew_the_vehicle_is_begun(make_world: MakeWorld, stage: Any) -> None:
    world = make_world(stage)
    if stage is World.armed:
        world.begin("GET", "/command/takeoff?alt=8")
        world.pass_time(0.4)
    assert world.ask("GET", "/movement/stop").outcome == "200" and world.copter.mode.paused
    world.end_jobs()
    world.host.registry._vehicles.clear()  # what a new process knows of it
    method, path = ("GET", "/command/takeoff?alt=8") if stage is World.armed else ("POST", "/mission/start")
    assert world.ask(method, path).outcome == "200" and not world.copter.mode.paused


def test_another_stations_pause_outlasts_our_movements_after_the_first(world: World) -> None:
    """MAVProxy was started in flight: only a pause from before its first movement is ended by a movement."""
    assert world.ask("POST", GO, {"x": 20, "y": 0, "z": -8}).outcome == "200"
    world.pilot_command(PAUSE, 0)
    world.pass_time(1.0)
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "200"
    world.pass_time(8.0)
    assert world.copter.mode.paused and speed(world) < 0.3
