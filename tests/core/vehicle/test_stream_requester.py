from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.messages import MESSAGE_IDS
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry
from mavproxy_uavapi.core.vehicle.stream_requester import (
    GAP,
    IN_GUIDED,
    LISTED,
    LOOK_EVERY,
    MISSING_AFTER,
    NEEDED,
    PAUSES,
    STEADY,
    WANTED,
    StreamRequester,
)
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink
INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL


@pytest.fixture
def watch(loop: FastLoop, registry: VehicleRegistry) -> Callable[[float], None]:
    """Watch for so many seconds; more each time it is called."""
    tasks: list[Any] = []

    def watch(seconds: float) -> None:
        if not tasks:
            tasks.append(loop.create_task(StreamRequester(registry).run()))
        loop.pass_time(seconds)
        assert not tasks[0].done()

    return watch


def requested(drone: Drone) -> list[tuple[int, float]]:
    return [(int(command.param1), command.param2) for command in drone.commands(INTERVAL)]


def numbers(drone: Drone) -> set[int]:
    return {number for number, _ in requested(drone)}


def ids(names: set[str]) -> set[int]:
    return {MESSAGE_IDS[name] for name in names}


def test_messages_that_arrive_are_not_requested(drone: Drone, watch: Callable[[float], None]) -> None:
    watch(60.0)
    assert requested(drone) == []


def test_streams_have_time_to_come_and_what_is_in_none_is_requested(
    loop: FastLoop, host: Host, watch: Callable[[float], None], make_drone: Callable[..., Drone]
) -> None:
    drone = make_drone()
    drone.mute.add("EXTENDED_SYS_STATE")
    host.fleet.vehicles[1].messages.clear()  # as when the module is loaded while the vehicle flies
    watch(60.0)
    assert {number for number, _ in requested(drone)} == {MESSAGE_IDS["EXTENDED_SYS_STATE"]}


def test_messages_that_do_not_arrive_are_requested_at_their_rate(
    drone: Drone, watch: Callable[[float], None]
) -> None:
    drone.mute.add("EXTENDED_SYS_STATE")
    watch(0.5)
    assert requested(drone) == []  # it came once, when the drone was powered on
    watch(5.0)
    assert requested(drone)[0] == (MESSAGE_IDS["EXTENDED_SYS_STATE"], 1e6 / WANTED["EXTENDED_SYS_STATE"])


def test_message_that_helps_ends_the_asking(loop: FastLoop, drone: Drone, watch: Callable[[float], None]) -> None:
    drone.mute.add("ATTITUDE")
    watch(4.5)
    assert len(requested(drone)) == 1
    drone.mute.clear()
    watch(60.0)
    assert len(requested(drone)) == 1


def test_message_that_stops_later_is_requested_again(drone: Drone, watch: Callable[[float], None]) -> None:
    watch(30.0)
    drone.mute.add("VFR_HUD")
    watch(6.0)
    assert requested(drone)[0][0] == MESSAGE_IDS["VFR_HUD"]


@pytest.mark.parametrize("answer", [mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED, None])
def test_message_that_never_comes_is_requested_rarely_and_delays_no_other(
    loop: FastLoop, host: Host, make_drone: Callable[..., Drone], watch: Callable[[float], None], answer: int | None
) -> None:
    drone = make_drone()
    drone.mute |= set(WANTED)
    host.fleet.vehicles[1].messages.clear()
    drone.answers[INTERVAL] = [answer]
    watch(MISSING_AFTER + LOOK_EVERY + len(WANTED) * GAP)
    assert numbers(drone) == ids(set(WANTED) - IN_GUIDED)
    watch(600.0)
    assert Counter(number for number, _ in requested(drone)) == dict.fromkeys(numbers(drone), len(PAUSES) + 1)


def test_message_that_stops_repeatedly_is_requested_a_few_times_a_minute(
    loop: FastLoop, drone: Drone, watch: Callable[[float], None]
) -> None:
    for _ in range(60):
        drone.mute ^= {"VFR_HUD"}
        watch(5.0)
    assert len(requested(drone)) <= (len(PAUSES) + 1) * (1 + 300 / STEADY)


def test_vehicle_that_nobody_uses_is_asked_once_for_what_the_list_shows(
    loop: FastLoop, host: Host, watch: Callable[[float], None], make_drone: Callable[..., Drone]
) -> None:
    _, other = make_drone(1), make_drone(2)
    other.mute |= set(WANTED)
    host.fleet.vehicles[2].messages.clear()
    watch(60.0)
    assert sorted(requested(other)) == sorted((MESSAGE_IDS[name], 1e6 / rate) for name, rate in LISTED.items())
    host.registry.commandable(2)
    watch(LOOK_EVERY + len(WANTED) * GAP)
    wanted = {(MESSAGE_IDS[name], 1e6 / rate) for name, rate in WANTED.items() if name not in IN_GUIDED}
    assert set(requested(other)[len(LISTED) :]) == wanted


def test_what_was_asked_for_the_list_is_at_full_rate_when_it_is_used(
    loop: FastLoop, host: Host, watch: Callable[[float], None], make_drone: Callable[..., Drone]
) -> None:
    _, other = make_drone(1), make_drone(2)
    other.mute.add("SYS_STATUS")
    watch(10.0)
    other.mute.clear()  # it helped
    watch(60.0)
    host.registry.use(2)
    watch(60.0)
    number = MESSAGE_IDS["SYS_STATUS"]
    assert requested(other) == [(number, 1e6 / LISTED["SYS_STATUS"]), (number, 1e6 / WANTED["SYS_STATUS"])]


def test_without_streams_only_vehicles_in_use_are_asked(
    loop: FastLoop, host: Host, watch: Callable[[float], None], make_drone: Callable[..., Drone]
) -> None:
    drones = [make_drone(system) for system in (1, 2, 3)]
    for drone in drones:
        drone.mute |= set(WANTED)
        host.fleet.vehicles[drone.system].messages.clear()
    host.registry.streams_are_off = True
    host.registry.use(2)
    watch(LOOK_EVERY + 2 * len(NEEDED) * GAP)
    needed = {(MESSAGE_IDS[name], 1e6 / rate) for name, rate in NEEDED.items() if name not in IN_GUIDED}
    assert [set(requested(drone)) for drone in drones] == [needed, needed, set()]


def test_vehicle_of_mavproxys_choice_is_used_as_long_as_it_is_that(
    loop: FastLoop, host: Host, watch: Callable[[float], None], make_drone: Callable[..., Drone]
) -> None:
    drones = [make_drone(system) for system in (1, 2)]
    for drone in drones:
        drone.mute.add("VFR_HUD")
    host.registry.current = 2
    watch(10.0)
    assert [numbers(drone) for drone in drones] == [set(), ids({"VFR_HUD"})]


def test_rates_are_given_back(loop: FastLoop, host: Host, make_drone: Callable[..., Drone]) -> None:
    drone = make_drone()
    drone.mute |= {"VFR_HUD", "EXTENDED_SYS_STATE"}
    requester = StreamRequester(host.registry)
    task = loop.create_task(requester.run())
    loop.pass_time(10.0)
    task.cancel()
    closing_messages = {(int(m.param1), int(m.param2), system) for m, system in requester.closing_messages()}
    assert closing_messages == {(MESSAGE_IDS["VFR_HUD"], 0, 1), (MESSAGE_IDS["EXTENDED_SYS_STATE"], -1, 1)}


def test_lost_link_of_mavproxy_does_not_end_the_watch(
    loop: FastLoop, host: Host, drone: Drone, watch: Callable[[float], None]
) -> None:
    drone.mute.add("VFR_HUD")

    def down(*_: Any) -> None:
        raise LinkLost("MAVProxy has no link")

    up, host.link.on_send = host.link.on_send, down
    watch(5.0)
    host.link.on_send = up
    watch(10.0)
    assert numbers(drone) == ids({"VFR_HUD"})


def test_nothing_is_requested_on_a_lost_link_and_all_when_it_is_back(
    drone: Drone, watch: Callable[[float], None]
) -> None:
    drone.power_off()
    watch(20.0)
    before = len(requested(drone))
    watch(60.0)
    assert len(requested(drone)) == before
    drone.mute.add("VFR_HUD")
    drone.power_on()
    watch(2 * LOOK_EVERY)
    assert MESSAGE_IDS["VFR_HUD"] in {number for number, _ in requested(drone)[before:]}


def test_each_vehicle_is_watched_and_a_silent_one_delays_no_other(
    loop: FastLoop, host: Host, watch: Callable[[float], None], make_drone: Callable[..., Drone]
) -> None:
    deaf, other = make_drone(1), make_drone(2)
    for drone in (deaf, other):
        drone.mute |= {"VFR_HUD", "ATTITUDE"}
        host.registry.use(drone.system)
    deaf.answers[INTERVAL] = [None]
    watch(6.0)
    assert {number for number, _ in requested(other)} == {MESSAGE_IDS["VFR_HUD"], MESSAGE_IDS["ATTITUDE"]}


def test_watch_waits_for_the_first_vehicle(
    loop: FastLoop, host: Host, watch: Callable[[float], None], make_drone: Callable[..., Drone]
) -> None:
    watch(10.0)
    drone = make_drone()
    drone.mute.add("ATTITUDE")
    watch(10.0)
    assert requested(drone)
