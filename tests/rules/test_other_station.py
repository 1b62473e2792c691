"""A program at another output of MAVProxy, with the messages of DroneKit's calls, beside the API.

`mode = VehicleMode(…)` is SET_MODE, `armed = True` COMPONENT_ARM_DISARM, `simple_takeoff` NAV_TAKEOFF, and
`simple_goto` a MISSION_ITEM that is for now. The program's vehicle is the embedded one.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.oversight.endings import Policy
from mavproxy_uavapi.prompt.authority import command as authority
from tests.support.make_world import MakeWorld
from tests.support.world import MODES, PLACE, World

ALT = 8.0  # m above home
FAR = {"x": -300.0, "y": 0.0, "z": -ALT}  # m NED


class Program:
    """What a DroneKit program does to the vehicle."""

    def __init__(self, world: World) -> None:
        self.world = world

    def send(self, message: Any) -> None:
        """It arrives with the next tick, past the host."""
        self.world.arriving.append(message)
        self.world.pass_time(0.5)

    def mode(self, name: str) -> None:
        flag = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        self.send(mavlink.MAVLink_set_mode_message(1, flag, MODES[name]))

    def command(self, number: int, *parameters: float) -> None:
        self.send(World.command(number, *parameters))

    def take_off(self) -> None:
        self.mode("GUIDED")
        self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, ALT)
        self.world.pass_time(12.0)

    def simple_goto(self, north: float) -> None:
        frame, number = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_CMD_NAV_WAYPOINT
        place = PLACE[0] + north / 111_319, PLACE[1], ALT
        self.send(mavlink.MAVLink_mission_item_message(1, 0, 0, frame, number, 2, 0, 0, 0, 0, 0, *place))


@pytest.fixture
def program(make_world: MakeWorld) -> Program:
    """It has taken off, and nobody has called the API."""
    world = make_world(World.boot)
    world.pass_time(2.0)
    made = Program(world)
    made.take_off()
    return made


def test_it_flies_and_lands_and_the_api_sends_nothing(program: Program) -> None:
    world = program.world
    assert world.at == pytest.approx((0.0, 0.0, -ALT), abs=0.5)
    program.simple_goto(20.0)
    world.pass_time(3.0)
    assert "another station commands" in world.run(authority(world.host, []))
    world.pass_time(12.0)
    assert world.at == pytest.approx((20.0, 0.0, -ALT), abs=0.7)
    program.mode("LAND")
    world.pass_time(25.0)
    assert not world.copter.armed
    assert world.orders() == []
    assert "commands" not in world.run(authority(world.host, []))


FIRST = {"go_to_ned_wait": {"x": 20.0, "y": 0.0, "z": -ALT}, "travel_at_ned": {"vx": 0.0, "vy": 0.0, "vz": 0.0}}


@pytest.mark.matrix
@pytest.mark.parametrize("first", FIRST)
@pytest.mark.parametrize("late", [5.0, 9.0, 12.0])
def test_target_that_reaches_the_vehicle_late_is_still_ours(
    program: Program, monkeypatch: pytest.MonkeyPatch, first: str, late: float
) -> None:
    """A busy MAVProxy, or a slow link: meanwhile the autopilot reports our setpoint before it."""
    world = program.world
    assert world.ask("POST", f"/movement/{first}", FIRST[first]).status == 200
    world.pass_time(2.0)
    arriving, world.arriving = world.arriving, []
    held_back: list[Any] = []

    with monkeypatch.context() as slow:
        slow.setattr(world, "arrive", held_back.append)
        wire = world.begin("POST", "/movement/go_to_ned_wait", {"x": 20.0, "y": 15.0, "z": -ALT})
        world.pass_time(late)
    world.arriving.extend([*arriving, *held_back])
    assert world.answer(wire).outcome == "200"


def test_targets_that_come_late_one_after_the_other_are_all_ours(program: Program) -> None:
    """When the newest is sent, the one before it has not been reported yet."""
    world = program.world
    assert world.ask("POST", "/movement/go_to_ned_wait", {"x": 20.0, "y": 0.0, "z": -ALT}).status == 200

    def go_to(path: str, east: float) -> tuple[Any, list[Any]]:
        wire = world.begin("POST", f"/movement/{path}", {"x": 20.0, "y": east, "z": -ALT})
        world.loop.settle()
        targets, world.arriving = world.arriving, []
        return wire, targets

    _, second = go_to("go_to_ned", 15.0)
    world.pass_time(0.5)
    newest, third = go_to("go_to_ned_wait", 30.0)
    for late in (second, third):
        world.pass_time(2.5)
        world.arriving.extend(late)
    assert world.answer(newest).outcome == "200"


def test_target_is_ours_with_two_positions_of_different_times(program: Program) -> None:
    """One in the local frame and one on the globe tell where the autopilot will report a target."""
    world = program.world
    assert world.ask("POST", "/movement/go_to_ned", FAR).status == 200
    world.pass_time(8.0)
    bridge = world.host.bridge
    hear = bridge._receive
    bridge._receive = lambda message, waits: message.get_type() == "LOCAL_POSITION_NED" or hear(message, waits)
    world.pass_time(2.7)
    wire = world.begin("POST", "/movement/go_to_ned_wait", {"x": -150.0, "y": 0.0, "z": -ALT})
    world.loop.settle()
    bridge._receive = hear
    assert world.answer(wire).outcome == "200"


def test_its_goto_ends_a_movement_of_the_api_which_leaves_it_alone(program: Program) -> None:
    world = program.world
    waiting = world.begin("POST", "/movement/go_to_ned_wait", FAR)
    world.pass_time(6.0)
    assert world.at[0] < -5
    program.simple_goto(20.0)
    assert world.answer(waiting, 5.0).outcome == "409 superseded"
    sent = len(world.orders())
    world.pass_time(30.0)
    assert math.dist(world.at, (20.0, 0.0, -ALT)) < 1.0
    assert len(world.orders()) == sent


def test_its_landing_ends_a_movement_of_the_api(program: Program) -> None:
    world = program.world
    waiting = world.begin("POST", "/movement/go_to_ned_wait", FAR)
    world.pass_time(6.0)
    program.mode("LAND")
    assert world.answer(waiting, 5.0).outcome == "409 mode_changed"
    sent = len(world.orders())
    world.pass_time(25.0)
    assert not world.copter.armed
    assert len(world.orders()) == sent


def test_the_api_takes_the_vehicle_over_when_it_is_told_to(program: Program) -> None:
    world = program.world
    program.simple_goto(200.0)
    world.pass_time(3.0)
    reply = world.ask("POST", "/movement/go_to_ned_wait", {"x": 0.0, "y": 0.0, "z": -ALT})
    assert reply.outcome == "200"
    assert math.dist(world.at, (0.0, 0.0, -ALT)) < 1.5


def test_its_goto_at_once_after_the_apis_is_not_taken_for_the_apis(program: Program) -> None:
    """The autopilot's first report of a target is the other station's."""
    world = program.world
    waiting = world.begin("POST", "/movement/go_to_ned_wait", FAR)
    world.pass_time(0.2)
    program.simple_goto(40.0)
    reply = world.answer(waiting, 30.0)
    assert (reply.status, reply.body["code"]) == (409, "superseded")
    world.pass_time(15.0)
    assert world.at == pytest.approx((40.0, 0.0, -ALT), abs=0.7)


def test_station_that_flies_our_takeoff_keeps_it_when_the_client_hangs_up(make_world: MakeWorld) -> None:
    world = make_world(World.armed)
    world.host.endings.on_disconnect = Policy.HOLD
    wire = world.begin("GET", "/command/takeoff?alt=100")
    world.pass_time(5.0)
    world.fault("other_station", position=[-80.0, 40.0, -12.0])
    world.pass_time(3.0)
    assert world.host.jobs.running() and world.host.registry.find(1).has_foreign_target
    gone_at = world.now
    wire.hang_up()
    world.pass_time(5.0)
    assert not world.host.jobs.running() and world.orders(gone_at) == []


@pytest.mark.parametrize("later", [0.0, 0.3, 0.6])
def test_its_goto_ends_a_velocity_that_is_repeated(program: Program, later: float) -> None:
    world = program.world
    body = {"vx": -2.0, "vy": 0.0, "vz": 0.0, "duration": 60.0}
    waiting = world.begin("POST", "/movement/travel_at_ned", body)
    world.pass_time(5.1 + later)
    before, sent = world.at[0], len(world.orders())
    program.simple_goto(20.0)
    program.simple_goto(20.0)  # the second one shows, if ours came at once after the first
    assert world.answer(waiting, 3.0).outcome == "409 superseded"
    assert len(world.orders()) <= sent + 1
    world.pass_time(20.0)
    assert world.at == pytest.approx((20.0, 0.0, -ALT), abs=0.7) and before < -5.0


def test_velocity_whose_uplink_fails_beside_an_older_place_is_not_another_stations(program: Program) -> None:
    """The autopilot reports the place before it, which is ours, for as long as nothing arrives."""
    world = program.world
    assert world.ask("POST", "/movement/go_to_ned", FAR).status == 200
    world.pass_time(5.0)
    world.uplink_until = world.now + 20.0
    body = {"vx": 2.0, "vy": 0.0, "vz": 0.0, "duration": 30.0}
    assert world.ask("POST", "/movement/travel_at_ned", body).outcome == "200"


def test_goto_by_a_command_ends_a_flight_of_vision(make_world: MakeWorld) -> None:
    """Velocities that are sent 20 times a second hide its target; the acknowledgement shows it."""
    world = make_world(camera={"sim_tags": "0:0.6@80,0", "tags": "0:0.6"})
    searching = world.begin("POST", "/vision/search", {})
    world.pass_time(6.0)
    place = round((PLACE[0] + 20.0 / 111_319) * 1e7), round(PLACE[1] * 1e7), ALT
    frame, number = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, mavlink.MAV_CMD_DO_REPOSITION
    world.arriving.append(mavlink.MAVLink_command_int_message(1, 1, frame, number, 0, 0, -1, 0, 0, math.nan, *place))
    assert world.answer(searching, 1.0).outcome == "409 superseded"
    sent = len(world.orders())
    world.pass_time(10.0)
    assert len(world.orders()) == sent
