"""MAVProxy's main loop stands for seconds: nothing that is old by then is sent, and everybody has his answer."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.control.jobs import Ending
from mavproxy_uavapi.core.mainloop.permit import ORDER_LASTS, STOP_LASTS
from mavproxy_uavapi.core.oversight.endings import Policy
from tests.rules.test_envelope import put
from tests.support.envelopes import field
from tests.support.make_world import MakeWorld
from tests.support.world import LEGS, PLACE, World, item_at

SWITCHES = {
    "/command/guided": "LOITER",
    "/command/brake": "GUIDED",
    "/command/rtl": "GUIDED",
    "/command/land": "GUIDED",
    "/command/set_mode?mode=AUTO": "GUIDED",
}


def a_world(make_world: MakeWorld, stage: Any, at_once: int = 1000) -> World:
    """A world with a mission, whose main loop reads at most so many messages at once."""
    world: World = make_world(stage)
    world.at_once = at_once
    world.copter.mission.items[:] = [item_at(*PLACE), *(item_at(PLACE[0] + n, PLACE[1]) for n in LEGS)]
    world.pass_time(3.0)
    return world


@pytest.mark.matrix
@pytest.mark.parametrize("seconds", [0.5, 1.5, 4.0, 9.0, 60.0])
@pytest.mark.parametrize("path", SWITCHES)
def test_what_waited_does_not_take_the_vehicle_from_its_pilot(
    make_world: MakeWorld, path: str, seconds: float
) -> None:
    world = a_world(make_world, lambda world: world.flying(mode=SWITCHES[path]))
    world.stand(True)
    wire = world.begin("GET", path)
    world.pass_time(seconds / 2)
    world.fault("pilot_mode", mode="ALT_HOLD")
    world.pass_time(seconds / 2)
    world.stand(False)
    world.pass_time(5.0)
    assert world.vehicle.mode.name == "ALT_HOLD" and not world.orders_of(
        [sent for sent in world.sent if getattr(sent.message, "command", 0) == 176]
    )
    wire.hang_up()


@pytest.mark.parametrize("path", ["/command/brake", "/command/land", "/command/rtl"])
def test_what_stops_or_lands_it_goes_out_late_if_it_is_still_right(make_world: MakeWorld, path: str) -> None:
    world = a_world(make_world, World.flying)
    world.stand(True)
    wire = world.begin("GET", path)
    world.pass_time(STOP_LASTS - 2.0)
    world.stand(False)
    world.until(lambda: world.vehicle.mode.name != "GUIDED", 3.0, step=0.02)
    wire.hang_up()


def test_envelope_that_comes_while_a_target_waits_counts_for_it(make_world: MakeWorld) -> None:
    world = a_world(make_world, World.flying)
    world.stand(True)
    wire = world.begin("POST", "/movement/go_to_ned", {"x": 60, "y": 0, "z": -8})
    put(world, field(25.0, 400))
    world.stand(False)
    world.pass_time(1.0)
    assert world.answer(wire).outcome == "409 outside_envelope"
    assert not any(message.get_type().startswith("SET_POSITION") for message in world.orders())


def test_arm_that_waited_for_a_minute_arms_nothing(make_world: MakeWorld) -> None:
    world = a_world(make_world, lambda world: (world.boot(), world.in_mode("GUIDED")))
    world.stand(True)
    wire = world.begin("GET", "/command/arm?timeout=100")
    world.pass_time(60.0)
    world.stand(False)
    world.pass_time(5.0)
    assert not world.copter.armed and wire.reply.done()


def test_arm_that_waits_for_readiness_ends_when_the_loop_stands(make_world: MakeWorld) -> None:
    world = a_world(make_world, lambda world: (world.boot(), world.in_mode("GUIDED")))
    world.fault("ekf_bad")
    world.pass_time(2.0)
    wire = world.begin("GET", "/command/arm?timeout=100")
    world.pass_time(1.0)
    world.stand(True)
    world.control.ask("clear")
    world.pass_time(60.0)
    world.stand(False)
    assert world.answer(wire).outcome == "409 expired" and not world.copter.armed


def test_arm_that_waited_is_not_sent_to_what_its_pilot_has_armed(make_world: MakeWorld) -> None:
    world = a_world(make_world, lambda world: (world.boot(), world.in_mode("GUIDED")))
    world.stand(True)
    wire = world.begin("GET", "/command/arm")
    world.pass_time(0.5)
    world.by_hand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    world.pass_time(1.0)
    world.stand(False)
    assert world.answer(wire).outcome == "409 mode_changed"
    sent = [message.command for message in world.orders() if message.get_type() == "COMMAND_LONG"]
    assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM not in sent


@pytest.mark.matrix
@pytest.mark.parametrize(
    ("method", "path", "body", "within"),
    [
        ("GET", "/movement/stop", None, STOP_LASTS),
        ("GET", "/command/land", None, STOP_LASTS),
        ("GET", "/command/brake", None, STOP_LASTS),
        ("GET", "/command/disarm", None, STOP_LASTS),
        ("GET", "/command/set_mode?mode=LOITER", None, ORDER_LASTS),
        ("GET", "/command/set_ground_speed?new_v=3", None, ORDER_LASTS),
        ("POST", "/movement/go_to_ned", {"x": 5, "y": 5, "z": -8}, ORDER_LASTS),
        ("POST", "/movement/travel_at_ned", {"vx": 1, "vy": 0, "vz": 0}, ORDER_LASTS),
        ("POST", "/peripherical/servo_output", {"channel": 9, "pwm": 1500}, 6.0),
        ("GET", "/mission/waypoints", None, 6.0),
        ("GET", "/telemetry/home_info", None, 6.0),
    ],
)
def test_everybody_has_his_answer_while_the_main_loop_stands(
    make_world: MakeWorld, method: str, path: str, body: Any, within: float
) -> None:
    world = a_world(make_world, World.flying)
    world.host.link_watch.timeout = 3600.0  # so that no lost link ends the waits
    world.stand(True)
    wire = world.begin(method, path, body)
    world.pass_time(within + 0.5)
    assert wire.reply.done() and wire.reply.result().status != 200


STANDS_FOR = [0.2, 2.0, 4.9, 5.5, 9.0, 20.0, 60.0]  # s; a link without a heartbeat for 5 s is lost
UNENDING = {"x": 900, "y": 0, "z": -8}


def at_work(make_world: MakeWorld, stage: Any = World.flying) -> World:
    """MAVProxy reads few messages in each turn, so that it has not read all at once after a stand."""
    return a_world(make_world, stage, at_once=6)


@pytest.mark.matrix
@pytest.mark.parametrize("seconds", STANDS_FOR)
def test_vehicle_that_never_falls_silent_is_not_lost_and_flies_on(make_world: MakeWorld, seconds: float) -> None:
    world = at_work(make_world)
    wire = world.begin("POST", "/movement/go_to_ned_wait?timeout=600", UNENDING)
    world.pass_time(2.0)
    vehicle, watch = world.host.registry.find(1), world.host.link_watch
    stood_from = world.now
    world.stand(True)
    world.pass_time(seconds)
    world.stand(False)
    for _ in range(200):
        world.pass_time(0.05)
        assert watch.is_alive(vehicle.state) and not wire.reply.done()
    assert world.orders(stood_from) == []
    assert vehicle.state.time_ratio.ratio == pytest.approx(1.0, abs=0.05) and vehicle.state.trip.deadline < 0.5
    wire.hang_up()


@pytest.mark.parametrize("seconds", [0.2, 4.0, 20.0])
def test_vehicle_that_falls_silent_while_the_loop_stands_is_lost_after_it(
    make_world: MakeWorld, seconds: float
) -> None:
    world = at_work(make_world)
    lost_after = world.host.link_watch.timeout
    wire = world.begin("POST", "/movement/go_to_ned_wait?timeout=600", UNENDING)
    world.pass_time(2.0)
    world.stand(True)
    world.hears = lambda _message: False
    world.pass_time(seconds)
    world.stand(False)
    world.pass_time(lost_after + 1.5)
    assert world.answer(wire).outcome == "503 link_lost"


@pytest.mark.matrix
@pytest.mark.parametrize(
    ("stage", "method", "path", "body"),
    [
        (World.flying, "POST", "/movement/go_to_ned_wait", {"x": 20, "y": 0, "z": -8}),
        (World.flying, "GET", "/command/land?wait=true", None),
        (World.flying, "GET", "/command/rtl?wait=true", None),
        (World.flying, "GET", "/movement/set_heading?heading=90&wait=true", None),
        (World.flying, "GET", "/movement/stop", None),
        (World.armed, "GET", "/command/takeoff?alt=8&wait=true", None),
        (lambda world: (world.boot(), world.in_mode("GUIDED")), "GET", "/command/arm?wait=true", None),
        (World.flying, "POST", "/mission/start", None),
    ],
)
@pytest.mark.parametrize("after", [0.03, 0.5])
def test_verb_that_was_sent_succeeds_although_the_loop_stands_then(
    make_world: MakeWorld, stage: Any, method: str, path: str, body: Any, after: float
) -> None:
    world = at_work(make_world, stage)
    wire = world.begin(method, path, body)
    world.pass_time(after)
    world.stand(True)
    world.pass_time(8.0)
    world.stand(False)
    assert world.answer(wire).outcome == "200"


def test_position_that_waited_is_as_old_as_it_may_be(make_world: MakeWorld) -> None:
    world = at_work(make_world)
    state = world.host.registry.find(1).state
    world.stand(True)
    world.pass_time(6.0)
    world.stand(False)
    world.pass_time(0.3)
    assert state.age("GLOBAL_POSITION_INT", world.now) >= 6.0
    world.pass_time(6.0)
    assert state.age("GLOBAL_POSITION_INT", world.now) <= 1.0


def test_lease_ends_silently_once_the_pilot_took_it_from_a_standing_loop(make_world: MakeWorld) -> None:
    world = at_work(make_world)
    assert world.ask("POST", "/movement/go_to_ned?lease=3", UNENDING).outcome == "200"
    world.stand(True)
    world.pass_time(2.0)
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(6.0)
    before = len(world.sent)
    world.stand(False)
    world.pass_time(5.0)
    assert world.vehicle.mode.name == "LOITER" and not world.orders_of(world.sent[before:])


@pytest.mark.parametrize("seconds", [1.0, 6.0])
def test_border_stop_that_was_sent_outlasts_a_standing_loop(make_world: MakeWorld, seconds: float) -> None:
    world = at_work(make_world)
    put(world, field(60.0, 400))
    world.pass_time(3.0)
    world.begin("POST", "/movement/go_to_ned_wait", {"x": 0, "y": 59, "z": -8})
    world.until(lambda: world.at[1] > 36, step=0.05)
    world.begin("POST", "/movement/go_to_ned_wait", {"x": 50, "y": world.at[1], "z": -8})
    world.until(lambda: world.vehicle.mode.name == "BRAKE", step=0.01)
    world.stand(True)
    world.pass_time(seconds)
    world.stand(False)
    world.pass_time(5.0)
    (stop,) = [job for job in world.host.jobs.all() if job.client == "envelope"]
    assert stop.ending is Ending.DONE and world.at[1] < 60.0


def test_client_that_calls_a_suspended_process_keeps_its_lease(make_world: MakeWorld) -> None:
    world = at_work(make_world)
    assert world.ask("POST", "/movement/go_to_ned?lease=3&client=a", UNENDING).outcome == "200"
    lease = world.host.leases.of(world.host.registry.find(1))
    world.loop.now += 20.0  # and a request comes meanwhile: it is read in the turn in which the timers are late
    wire = world.begin("GET", "/telemetry/ned?client=a")
    world.until(wire.reply.done, step=0.02)
    world.pass_time(2.0)
    assert world.host.leases.of(world.host.registry.find(1)) is lease
    assert not [job for job in world.host.jobs.all() if "lease" in job.verb]


def test_switch_that_was_never_written_makes_nobody_elses_switch_ours(make_world: MakeWorld) -> None:
    world = at_work(make_world, lambda world: world.flying(mode="LOITER"))
    world.host.endings.on_disconnect = Policy.RTL
    world.stand(True)
    wire = world.begin("GET", "/command/guided?wait=true")
    world.pass_time(0.5)
    wire.hang_up()
    world.loop.settle()
    world.fault("pilot_mode", mode="GUIDED")
    stood_until = world.now
    world.stand(False)
    world.pass_time(5.0)
    assert world.vehicle.mode.name == "GUIDED" and world.orders(stood_until) == []


def test_arm_that_was_never_written_disarms_nobody_elses_vehicle(make_world: MakeWorld) -> None:
    world = at_work(make_world, lambda world: (world.boot(), world.in_mode("GUIDED")))
    world.host.endings.on_disconnect = Policy.HOLD
    world.stand(True)
    wire = world.begin("GET", "/command/arm?wait=true")
    world.pass_time(0.5)
    wire.hang_up()
    world.loop.settle()
    world.pilot_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    stood_until = world.now
    world.stand(False)
    world.pass_time(5.0)
    assert world.vehicle.armed and world.orders(stood_until) == []


def test_target_that_an_envelope_forbids_by_then_is_not_written(make_world: MakeWorld) -> None:
    world = at_work(make_world)
    world.stand(True)
    wire = world.begin("POST", "/movement/go_to_ned", {"x": 30, "y": 0, "z": -8})
    world.pass_time(0.2)
    put(world, field(10.0, 400))
    world.pass_time(0.1)
    world.stand(False)
    assert world.answer(wire).outcome == "409 outside_envelope"
    assert not [sent for sent in world.sent if sent.message.get_type().startswith("SET_POSITION_TARGET")]


def test_stop_that_was_never_written_leaves_no_pause(make_world: MakeWorld) -> None:
    world = a_world(make_world, World.flying)
    going = world.begin("POST", "/movement/go_to_ned_wait", {"x": 300, "y": 0, "z": -8})
    world.pass_time(1.0)
    world.stand(True)
    stop = world.begin("GET", "/movement/stop")
    world.pass_time(STOP_LASTS + 1.0)
    world.stand(False)
    world.pass_time(1.0)
    assert world.answer(stop).outcome == "409 expired" and not going.reply.done()
    assert not world.host.registry.find(1).authority.paused
    assert world.ask("POST", "/movement/go_to_ned", {"x": 0, "y": 0, "z": -8}).outcome == "200"


def test_parameter_that_an_envelope_protects_by_then_is_not_written(make_world: MakeWorld) -> None:
    world = a_world(make_world, World.flying)
    assert world.ask("GET", "/parameters/RTL_ALT_M").outcome == "200"
    world.stand(True)
    setting = world.begin("PUT", "/parameters/RTL_ALT_M", {"value": 90})
    world.pass_time(0.5)
    put(world, field(60.0, 400))
    world.pass_time(0.5)
    world.stand(False)
    assert world.answer(setting).outcome == "409 outside_envelope"
    assert not any(sent.message.get_type() == "PARAM_SET" for sent in world.sent)
