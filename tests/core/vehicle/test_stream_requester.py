from __future__ import annotations

from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.vehicle.messages import MESSAGE_IDS
from mavproxy_uavapi.core.vehicle.stream_requester import (
    ASK_AGAIN,
    FIRST_ASKINGS,
    LOOK_EVERY,
    WANTED,
    StreamRequester,
)

mavlink = mavutil.mavlink
INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL


@pytest.fixture
def watch(loop: Any, registry: Any) -> Any:
    """Watch for so many seconds; more each time it is called."""
    tasks: list[Any] = []

    def watch(seconds: float) -> None:
        if not tasks:
            tasks.append(loop.create_task(StreamRequester(registry).run()))
        loop.pass_time(seconds)
        assert not tasks[0].done()

    return watch


def requested(drone: Any) -> list[tuple[int, float]]:
    return [(int(command.param1), command.param2) for command in drone.commands(INTERVAL)]


def test_messages_that_arrive_are_not_requested(drone: Any, watch: Any) -> None:
    watch(60.0)
    assert requested(drone) == []


def test_streams_have_time_to_arrive_and_what_is_in_none_is_requested_at_once(
    loop: Any, host: Any, watch: Any, make_drone: Any
) -> None:
    drone = make_drone()
    drone.mute.add("EXTENDED_SYS_STATE")
    host.fleet.vehicles[1].messages.clear()  # as when the module is loaded while the vehicle flies
    watch(60.0)
    assert {number for number, _ in requested(drone)} == {MESSAGE_IDS["EXTENDED_SYS_STATE"]}


def test_messages_that_do_not_arrive_are_requested_at_their_rate(drone: Any, watch: Any) -> None:
    drone.mute.add("EXTENDED_SYS_STATE")
    watch(0.5)
    assert requested(drone) == []  # it came once, when the drone was powered on
    watch(5.0)
    assert requested(drone)[0] == (MESSAGE_IDS["EXTENDED_SYS_STATE"], 1e6 / WANTED["EXTENDED_SYS_STATE"])


def test_message_that_helps_ends_the_asking(loop: Any, drone: Any, watch: Any) -> None:
    drone.mute.add("ATTITUDE")
    watch(4.5)
    assert len(requested(drone)) == 1
    drone.mute.clear()
    watch(60.0)
    assert len(requested(drone)) == 1


def test_message_that_stops_later_is_requested_again(drone: Any, watch: Any) -> None:
    watch(30.0)
    drone.mute.add("VFR_HUD")
    watch(6.0)
    assert requested(drone)[0][0] == MESSAGE_IDS["VFR_HUD"]


def test_asking_without_success_becomes_rare(drone: Any, watch: Any) -> None:
    drone.mute.add("VFR_HUD")
    watch(100.0)
    few = FIRST_ASKINGS + 100 / ASK_AGAIN
    assert FIRST_ASKINGS < len(requested(drone)) <= few


def test_refusal_does_not_end_the_watch(drone: Any, watch: Any) -> None:
    drone.mute |= {"GLOBAL_POSITION_INT", "VFR_HUD"}
    drone.answers[INTERVAL] = [mavlink.MAV_RESULT_DENIED]
    watch(30.0)
    assert {number for number, _ in requested(drone)} == {MESSAGE_IDS["GLOBAL_POSITION_INT"], MESSAGE_IDS["VFR_HUD"]}


def test_nothing_is_requested_while_the_link_is_lost_and_all_again_when_it_is_back(drone: Any, watch: Any) -> None:
    drone.power_off()
    watch(20.0)
    before = len(requested(drone))
    watch(60.0)
    assert len(requested(drone)) == before
    drone.mute.add("VFR_HUD")
    drone.power_on()
    watch(2 * LOOK_EVERY)
    assert MESSAGE_IDS["VFR_HUD"] in {number for number, _ in requested(drone)[before:]}


def test_each_vehicle_is_watched_and_one_that_is_silent_to_commands_delays_no_other(
    loop: Any, watch: Any, make_drone: Any
) -> None:
    deaf, other = make_drone(1), make_drone(2)
    for drone in (deaf, other):
        drone.mute |= {"VFR_HUD", "ATTITUDE"}
    deaf.on_send = lambda *_: None
    watch(6.0)
    assert {number for number, _ in requested(other)} == {MESSAGE_IDS["VFR_HUD"], MESSAGE_IDS["ATTITUDE"]}


def test_watch_waits_for_the_first_vehicle(loop: Any, host: Any, watch: Any, make_drone: Any) -> None:
    watch(10.0)
    drone = make_drone()
    drone.mute.add("ATTITUDE")
    watch(10.0)
    assert requested(drone)
