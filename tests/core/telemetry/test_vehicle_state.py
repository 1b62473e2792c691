from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Busy
from mavproxy_uavapi.core.telemetry.vehicle_state import Received, VehicleState
from mavproxy_uavapi.core.telemetry.vehicle_states import VehicleStates
from tests.support.messages import message_of

mavlink = mavutil.mavlink
QUADROTOR = mavlink.MAV_TYPE_QUADROTOR
AIR, GROUND = mavlink.MAV_LANDED_STATE_IN_AIR, mavlink.MAV_LANDED_STATE_ON_GROUND


def test_first_heartbeat_makes_a_vehicle(fleet: VehicleStates, hear: Callable[..., VehicleState | None]) -> None:
    assert hear("attitude", yaw=1.0) is None
    assert fleet.vehicles == {}
    state = hear("heartbeat", at=2.0, armed=True, mode="GUIDED")
    assert list(fleet.vehicles) == [1]
    assert (state.system, state.component, state.vehicle_type) == (1, 1, QUADROTOR)
    assert (state.armed, state.mode, state.heartbeat_at) == (True, 4, 2.0)


@pytest.mark.parametrize(
    ("vehicle_type", "autopilot"),
    [
        (mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID),
        (mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA),
        (mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA),
        (mavlink.MAV_TYPE_ADSB, mavlink.MAV_AUTOPILOT_GENERIC),
        (mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA),
        (QUADROTOR, mavlink.MAV_AUTOPILOT_INVALID),
        (mavlink.MAV_TYPE_GENERIC, mavlink.MAV_AUTOPILOT_GENERIC),
        *((peripheral, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA) for peripheral in (31, 32, 33, 36, 37, 39, 40, 41, 42)),
    ],
)
def test_what_is_no_autopilot_never_makes_a_vehicle(
    fleet: VehicleStates, hear: Callable[..., VehicleState | None], vehicle_type: int, autopilot: int
) -> None:
    assert hear("heartbeat", system=9, type=vehicle_type, autopilot=autopilot) is None
    assert fleet.vehicles == {}


COMPANION = {"component": 191, "type": mavlink.MAV_TYPE_GENERIC, "autopilot": mavlink.MAV_AUTOPILOT_GENERIC}


@pytest.mark.parametrize(
    "first",
    [
        COMPANION,
        {**COMPANION, "type": QUADROTOR},
        {"component": 191, "type": mavlink.MAV_TYPE_ONBOARD_CONTROLLER},
        {"component": 158, "type": mavlink.MAV_TYPE_GENERIC},  # AP_Periph
        {"component": 154, "type": mavlink.MAV_TYPE_GIMBAL},
        {"component": 156, "type": mavlink.MAV_TYPE_ADSB},
        {"component": 100, "type": mavlink.MAV_TYPE_CAMERA, "autopilot": mavlink.MAV_AUTOPILOT_GENERIC},
        {"component": 190, "type": QUADROTOR, "autopilot": mavlink.MAV_AUTOPILOT_INVALID},
        {"component": 2},
    ],
)
def test_autopilot_is_found_whatever_was_heard_before_it(
    fleet: VehicleStates, hear: Callable[..., VehicleState | None], first: dict[str, Any]
) -> None:
    hear("heartbeat", at=1.0, custom_mode=7, base_mode=128, **first)
    hear("attitude", at=1.1, component=first["component"], yaw=3.0)
    state = hear("heartbeat", at=2.0, mode="GUIDED")
    hear("heartbeat", at=3.0, custom_mode=7, base_mode=128, **first)
    assert state is fleet.vehicles[1]
    assert (state.component, state.vehicle_type, state.armed, state.mode) == (1, QUADROTOR, False, 4)
    assert (state.heartbeat_at, state.mode_since, state.packets.received) == (2.0, 2.0, 1)
    assert state.field("ATTITUDE", "yaw") is None


def test_state_that_becomes_the_autopilots_keeps_nothing_of_the_other(
    fleet: VehicleStates, hear: Callable[..., VehicleState | None]
) -> None:
    state = hear("heartbeat", component=191, autopilot=mavlink.MAV_AUTOPILOT_GENERIC)
    hear("attitude", component=191, yaw=3.0, time_boot_ms=900_000)
    hear("battery_status", component=191, id=1, voltages=[0] * 10, voltages_ext=[0] * 4)
    hear("param_value", component=191, param_id="RTL_ALT", param_value=1.0)
    hear("statustext", component=191, text="companion is up")
    hear("vfr_hud", component=1, alt=5.0)
    hear("heartbeat", at=2.0)
    hear("attitude", at=2.0, yaw=1.0, time_boot_ms=500)
    assert fleet.vehicles[1] is state
    assert sorted(state.messages) == ["ATTITUDE", "HEARTBEAT", "VFR_HUD"]
    assert (state.field("VFR_HUD", "alt"), state.field("ATTITUDE", "yaw")) == (5.0, 1.0)
    assert state.others[191, "ATTITUDE"].message.yaw == 3.0
    assert (191, "BATTERY_STATUS") in state.others
    assert (state.parameters, state.statustexts.since(0.0), state.reboots) == ({}, [], 0)


def test_second_autopilot_never_takes_over_even_from_a_silent_first(
    fleet: VehicleStates, hear: Callable[..., VehicleState | None]
) -> None:
    state = hear("heartbeat", at=1.0)
    for second in range(2, 60):
        hear("heartbeat", at=float(second), component=2, armed=True)
    assert (state.component, state.armed, state.heartbeat_at) == (1, False, 1.0)


def test_lone_generic_autopilot_counts_if_it_says_what_vehicle_it_is(
    fleet: VehicleStates, hear: Callable[..., VehicleState | None]
) -> None:
    state = hear("heartbeat", component=5, autopilot=mavlink.MAV_AUTOPILOT_GENERIC)
    assert (state.component, state.vehicle_type) == (5, QUADROTOR)


def test_parameters_come_before_or_after_their_vehicle_and_outlive_reboots(
    fleet: VehicleStates, hear: Callable[..., VehicleState | None]
) -> None:
    fleet.learn({(1, 1): {"RTL_ALT": 1500.0}, (1, 191): {"RTL_ALT": 1.0}})
    state = hear("heartbeat")
    fleet.learn({(1, 1): {"LAND_SPEED": 50.0}, (2, 1): {"LAND_SPEED": 30.0}})
    assert state.parameters == {"RTL_ALT": 1500.0, "LAND_SPEED": 50.0}
    hear("param_value", param_id="RTL_ALT", param_value=2000.0)
    hear("attitude", time_boot_ms=60_000)
    hear("attitude", time_boot_ms=400)
    assert (state.reboots, state.parameters) == (1, {"RTL_ALT": 2000.0, "LAND_SPEED": 50.0})
    assert hear("heartbeat", system=2).parameters == {"LAND_SPEED": 30.0}


def test_parameters_are_those_of_what_turns_out_to_be_the_autopilot(
    fleet: VehicleStates, hear: Callable[..., VehicleState | None]
) -> None:
    fleet.learn({(1, 1): {"RTL_ALT": 1500.0}})
    state = hear("heartbeat", component=191, autopilot=mavlink.MAV_AUTOPILOT_GENERIC)
    assert state.parameters == {}
    hear("heartbeat")
    assert state.parameters == {"RTL_ALT": 1500.0}


def test_copter_that_does_not_know_its_frame_yet_is_a_vehicle(
    fleet: VehicleStates, hear: Callable[..., VehicleState | None]
) -> None:
    state = hear("heartbeat", type=mavlink.MAV_TYPE_GENERIC)
    hear("heartbeat")
    assert (state.component, state.vehicle_type) == (1, QUADROTOR)
    hear("heartbeat", type=mavlink.MAV_TYPE_GENERIC)  # it boots again
    assert state.vehicle_type == QUADROTOR
    hear("heartbeat", type=mavlink.MAV_TYPE_FIXED_WING)
    assert state.vehicle_type == mavlink.MAV_TYPE_FIXED_WING


@pytest.mark.parametrize("component", [mavlink.MAV_COMP_ID_GIMBAL, mavlink.MAV_COMP_ID_ADSB, 191])
def test_other_components_do_not_disturb_their_vehicle(
    state: VehicleState, hear: Callable[..., VehicleState | None], component: int
) -> None:
    hear("heartbeat", at=2.0, armed=True, mode="GUIDED", component=component, system_status=mavlink.MAV_STATE_ACTIVE)
    hear("attitude", at=2.0, component=component, yaw=3.0, time_boot_ms=5)
    hear("extended_sys_state", at=2.0, component=component, landed_state=AIR)
    hear("param_value", at=2.0, component=component, param_id="RTL_ALT", param_value=1.0)
    hear("statustext", at=2.0, component=component, text="gimbal is tired")
    assert (state.armed, state.mode, state.heartbeat_at) == (False, 0, 1.0)
    assert state.landed is True
    assert state.age("ATTITUDE", 2.0) is None
    assert state.parameters == {}
    assert state.statustexts.since(0.0) == []
    assert state.others[component, "ATTITUDE"].message.yaw == 3.0


def test_newest_prefers_the_autopilots_own_message(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    hear("attitude", component=154, yaw=3.0)
    hear("attitude", at=2.0, component=191, yaw=4.0)
    assert state.newest("ATTITUDE").message.yaw == 4.0
    hear("attitude", at=1.5, yaw=1.0)
    assert state.newest("ATTITUDE").message.yaw == 1.0
    assert state.newest("VFR_HUD") is None


def test_several_vehicles_are_kept_apart(fleet: VehicleStates, hear: Callable[..., VehicleState | None]) -> None:
    hear("heartbeat", system=1)
    hear("heartbeat", system=2, armed=True, type=mavlink.MAV_TYPE_FIXED_WING)
    hear("attitude", system=2, yaw=2.0)
    first, second = fleet.vehicles[1], fleet.vehicles[2]
    assert (first.armed, second.armed) == (False, True)
    assert second.vehicle_type == mavlink.MAV_TYPE_FIXED_WING
    assert first.field("ATTITUDE", "yaw") is None
    assert second.field("ATTITUDE", "yaw") == 2.0


def test_reboot_resets_home_mode_and_arming(state: VehicleState, hear: Callable[..., VehicleState | None]) -> None:
    hear("heartbeat", armed=True, mode="GUIDED", system_status=mavlink.MAV_STATE_ACTIVE)
    hear("attitude", time_boot_ms=60_000)
    hear("home_position", latitude=1)
    hear("extended_sys_state", landed_state=AIR)
    assert state.landed is False
    hear("attitude", at=2.0, time_boot_ms=400)
    assert (state.armed, state.mode, state.landed, state.reboots) == (None, None, None, 1)
    for forgotten in ("HOME_POSITION", "EXTENDED_SYS_STATE", "HEARTBEAT"):
        assert forgotten not in state.messages
    hear("heartbeat", at=2.5)
    assert (state.armed, state.mode, state.landed) == (False, 0, True)


def test_landed_is_what_extended_sys_state_says(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    hear("heartbeat", armed=True, system_status=mavlink.MAV_STATE_ACTIVE)
    assert state.landed is False
    hear("extended_sys_state", landed_state=GROUND)
    assert state.landed is True
    for landed_state in (AIR, mavlink.MAV_LANDED_STATE_TAKEOFF, mavlink.MAV_LANDED_STATE_LANDING):
        hear("extended_sys_state", landed_state=landed_state)
        assert state.landed is False


@pytest.mark.parametrize(
    ("armed", "system_status", "landed"),
    [
        (False, mavlink.MAV_STATE_STANDBY, True),
        (True, mavlink.MAV_STATE_STANDBY, True),
        (True, mavlink.MAV_STATE_ACTIVE, False),
        (True, mavlink.MAV_STATE_CRITICAL, False),
        (True, mavlink.MAV_STATE_EMERGENCY, False),
        (False, mavlink.MAV_STATE_CRITICAL, True),
    ],
)
def test_landed_is_the_heartbeats_word_without_extended_sys_state(
    state: VehicleState, hear: Callable[..., VehicleState | None], armed: bool, system_status: int, landed: bool
) -> None:
    hear("extended_sys_state", landed_state=mavlink.MAV_LANDED_STATE_UNDEFINED)
    hear("heartbeat", armed=armed, system_status=system_status)
    assert state.landed is landed


@pytest.mark.parametrize("vehicle_type", [mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_SURFACE_BOAT])
@pytest.mark.parametrize("system_status", [mavlink.MAV_STATE_ACTIVE, mavlink.MAV_STATE_CRITICAL])
def test_rover_stands_on_the_ground_whatever_its_heartbeat_says(
    hear: Callable[..., VehicleState | None], vehicle_type: int, system_status: int
) -> None:
    state = hear("heartbeat", type=vehicle_type, armed=True, mode="MANUAL", system_status=system_status)
    assert state.landed is True
    hear("extended_sys_state", landed_state=mavlink.MAV_LANDED_STATE_UNDEFINED)
    assert state.landed is True


@pytest.mark.parametrize("vehicle_type", [mavlink.MAV_TYPE_FIXED_WING, 20])
def test_plane_is_where_extended_sys_state_says_until_that_is_old(
    hear: Callable[..., VehicleState | None], vehicle_type: int
) -> None:
    flying = {"type": vehicle_type, "armed": True, "system_status": mavlink.MAV_STATE_ACTIVE}
    state = hear("heartbeat", **flying)
    assert state.landed is False  # nothing else tells
    hear("extended_sys_state", at=2.0, landed_state=GROUND)
    hear("heartbeat", at=2.5, **flying)
    assert state.landed is True
    hear("extended_sys_state", at=3.0, landed_state=AIR)
    hear("heartbeat", at=3.5, **{**flying, "system_status": mavlink.MAV_STATE_STANDBY})
    assert state.landed is False
    hear("heartbeat", at=8.5, **{**flying, "system_status": mavlink.MAV_STATE_STANDBY})
    assert state.landed is True


def test_rate_is_messages_per_second(state: VehicleState, hear: Callable[..., VehicleState | None]) -> None:
    for number in range(40):
        hear("attitude", at=1.0 + number * 0.1)
    assert state.messages["ATTITUDE"].rate(4.9) == pytest.approx(10.0)
    assert state.messages["ATTITUDE"].count == 40


def test_rate_falls_when_messages_stop() -> None:
    received = Received("m", 0.0)
    for number in range(1, 20):
        received.renew("m", number * 0.1)
    assert received.rate(2.0) == pytest.approx(10.0)
    assert received.rate(11.9) == pytest.approx(0.1)


def test_rate_of_a_single_message_is_zero() -> None:
    assert Received("m", 0.0).rate(100.0) == 0.0


def test_messages_for_several_devices_are_kept_for_each(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    volts = [65535] * 10
    hear("battery_status", id=0, battery_remaining=80, voltages=volts)
    hear("battery_status", id=1, battery_remaining=50, voltages=volts)
    assert state.field("BATTERY_STATUS[0]", "battery_remaining") == 80
    assert state.field("BATTERY_STATUS[1]", "battery_remaining") == 50
    assert state.field("BATTERY_STATUS", "battery_remaining") == 50


def test_parameters_are_remembered(state: VehicleState, hear: Callable[..., VehicleState | None]) -> None:
    hear("param_value", param_id="RTL_ALT", param_value=1500.0)
    assert state.parameters == {"RTL_ALT": 1500.0}


def test_age_is_time_since_arrival(state: VehicleState, hear: Callable[..., VehicleState | None]) -> None:
    hear("attitude", at=3.0)
    assert state.age("ATTITUDE", 4.5) == 1.5
    assert state.age("VFR_HUD", 4.5) is None


# -- what a heartbeat shows ---------------------------------------------------------------------------------


@pytest.fixture
def clocked(hear: Callable[..., VehicleState | None], state: VehicleState) -> VehicleState:
    """A vehicle that booted at 0 s of ours, on a link of 0.5 s each way."""
    for number in range(5):
        ask_clock(hear, state, 10.0 + number, number)
    return state


def ask_clock(hear: Callable[..., VehicleState | None], state: VehicleState, at: float, number: int) -> None:
    """A question for its clock, and the answer."""
    name = state.trip.ask(at)
    hear("timesync", at=at + 1.0, tc1=int((at + 0.5) * 1e9), ts1=name, sequence=number)


def beat(hear: Callable[..., VehicleState | None], left: float, trip: float, number: int, **fields: Any) -> None:
    """ATTITUDE and a heartbeat that left the vehicle at that time (s) and took `trip` s."""
    hear("attitude", at=left + trip, time_boot_ms=int(left * 1000), sequence=number)
    hear("heartbeat", at=left + trip, sequence=number + 1, **fields)


def test_heartbeat_that_left_before_a_command_came_shows_nothing_of_it(
    hear: Callable[..., VehicleState | None], clocked: VehicleState
) -> None:
    ask_clock(hear, clocked, 21.1, 9)
    beat(hear, 20.0, 2.0, 10)
    assert clocked.heartbeat_at > 21.0 and not clocked.shows(21.0)  # it arrived later, and had left before


def test_a_time_that_no_clock_could_have_reached_shows_nothing(
    hear: Callable[..., VehicleState | None], clocked: VehicleState
) -> None:
    hear("attitude", at=20.5, time_boot_ms=20_000, sequence=8)
    ask_clock(hear, clocked, 21.1, 9)
    hear("attitude", at=22.0, time_boot_ms=2**32 - 1, sequence=10)
    hear("heartbeat", at=22.0, sequence=11)
    assert not clocked.shows(21.0)


def test_heartbeat_that_left_after_the_command_came_shows_it(
    hear: Callable[..., VehicleState | None], clocked: VehicleState
) -> None:
    beat(hear, 24.0, 0.5, 10)
    assert not clocked.shows(21.0)  # as far as anybody knows
    ask_clock(hear, clocked, 21.1, 9)
    assert clocked.shows(21.0)


def test_without_its_clock_two_heartbeats_after_the_longest_trip_show_it(
    hear: Callable[..., VehicleState | None], state: VehicleState
) -> None:
    state.trip.measured(1.0)
    sent_at = 20.0
    for at, shows in ((20.5, False), (21.5, False), (23.5, False), (24.5, True)):
        hear("heartbeat", at=at)
        assert state.shows(sent_at) is shows


@pytest.mark.parametrize("waited", [False, True])
def test_answer_that_waited_while_the_main_loop_stood_measures_no_trip(
    fleet: VehicleStates, state: VehicleState, waited: bool
) -> None:
    answer = message_of("timesync", ts1=state.trip.ask(20.0), tc1=int(7e9))
    fleet.update(answer, 28.0, 20.1 if waited else None)
    assert (state.trip.mean is None) is waited


def test_heartbeat_within_a_trip_may_have_left_before_what_was_sent(
    hear: Callable[..., VehicleState | None], state: VehicleState
) -> None:
    hear("heartbeat", at=20.5)
    assert state.came_after(20.0)  # nobody knows better
    state.trip.measured(1.0)
    for at, later in ((20.5, False), (22.0, False), (23.5, True)):  # the deadline is 3 s
        hear("heartbeat", at=at)
        assert state.came_after(20.0) is later


def test_heartbeat_that_waited_on_its_way_does_not_tell_what_the_pilot_did(
    hear: Callable[..., VehicleState | None], clocked: VehicleState
) -> None:
    beat(hear, 20.0, 6.0, 10)
    assert clocked.heartbeat_at > 25.0 and not clocked.heard_since(25.0)
    beat(hear, 26.0, 0.5, 20)
    assert clocked.heard_since(25.0)


def test_heartbeat_that_was_overtaken_changes_nothing(
    hear: Callable[..., VehicleState | None], clocked: VehicleState
) -> None:
    beat(hear, 20.0, 0.5, 10, mode="LOITER")
    hear("attitude", at=20.8, time_boot_ms=19_000, sequence=6)
    hear("heartbeat", at=20.9, sequence=7, mode="GUIDED")
    assert clocked.mode == 5 and clocked.heartbeat_at == 20.5


def test_heartbeat_that_was_overtaken_alone_changes_nothing(
    hear: Callable[..., VehicleState | None], clocked: VehicleState
) -> None:
    hear("attitude", at=20.0, time_boot_ms=19_000, sequence=6)
    hear("heartbeat", at=20.5, sequence=10, mode="LOITER")
    hear("heartbeat", at=20.9, sequence=8, mode="GUIDED")  # nothing with the vehicle's time lies between them
    assert clocked.mode == 5 and clocked.heartbeat_at == 20.5


def test_arming_makes_home_unknown_until_it_is_told_again(
    hear: Callable[..., VehicleState | None], state: VehicleState
) -> None:
    hear("home_position", at=2.0)
    hear("heartbeat", at=3.0, armed=True)
    assert "HOME_POSITION" not in state.messages and state.armings == 1
    hear("home_position", at=3.5)
    hear("heartbeat", at=4.0, armed=True)
    assert "HOME_POSITION" in state.messages


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_number_that_is_not_finite_is_not_taken(
    hear: Callable[..., VehicleState | None], state: VehicleState, number: float
) -> None:
    hear("attitude", at=2.0, yaw=0.5)
    hear("attitude", at=3.0, yaw=number)
    assert state.field("ATTITUDE", "yaw") == 0.5 and state.age("ATTITUDE", 3.0) == 1.0
    hear("param_value", at=3.0, param_id="GUID_TIMEOUT", param_value=3.0)
    hear("param_value", at=4.0, param_id="GUID_TIMEOUT", param_value=number)
    assert state.parameters["GUID_TIMEOUT"] == 3.0


def test_parameter_of_mavproxys_table_that_is_not_finite_is_not_taken(
    fleet: VehicleStates, hear: Callable[..., VehicleState | None]
) -> None:
    fleet.learn({(1, 1): {"GUID_TIMEOUT": float("nan"), "WPNAV_SPEED": 500.0}})
    assert hear("heartbeat").parameters == {"WPNAV_SPEED": 500.0}


def both(hear: Callable[..., VehicleState | None], seconds: float, apart: float) -> None:
    """Two autopilots with one id, whose clocks are so many s apart, talk in turns."""
    for step in range(int(seconds / 0.25)):
        at = 100.0 + step * 0.25
        for clock in (at, at + apart):
            hear("attitude", at=at, time_boot_ms=int(clock * 1000))


@pytest.mark.parametrize("apart", [10.0, 400.0, -50.0])
def test_two_autopilots_with_one_id_are_noticed_and_are_no_reboots(
    hear: Callable[..., VehicleState | None], state: VehicleState, apart: float
) -> None:
    both(hear, 10.0, apart)
    assert state.reboots <= 1
    with pytest.raises(Busy, match="two autopilots have the system id 1"):
        state.require_one(110.0)


def test_second_autopilot_that_falls_silent_is_forgotten(
    hear: Callable[..., VehicleState | None], state: VehicleState
) -> None:
    both(hear, 10.0, 50.0)
    for step in range(60):
        hear("attitude", at=110.0 + step * 0.25, time_boot_ms=int((110.0 + step * 0.25) * 1000))
    state.require_one(125.0)


def test_reboot_with_messages_that_were_overtaken_is_one_autopilot(
    hear: Callable[..., VehicleState | None], state: VehicleState
) -> None:
    hear("attitude", at=100.0, time_boot_ms=100_000)
    for step in range(20):
        hear("attitude", at=101.0 + step * 0.1, time_boot_ms=1000 + step * 100)
        hear("attitude", at=101.0 + step * 0.1, time_boot_ms=100_500)
    state.require_one(103.0)
    assert state.reboots == 1


def test_what_an_autopilot_runs_is_what_it_says_or_else_its_version(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    assert state.firmware == ""
    version = 4 << 24 | 6 << 16 | 3 << 8
    hear("autopilot_version", flight_sw_version=version | 255, flight_custom_version=[*b"3fc7011a"])
    assert state.firmware == "copter 4.6.3 (3fc7011a)"
    hear("autopilot_version", flight_sw_version=version | 192, flight_custom_version=[0xFF, *[0] * 7])
    assert state.firmware == "copter 4.6.3-rc (\ufffd)"
    hear("statustext", text="Rover is ready")
    hear("statustext", text="ArduCopter V4.6.3 (3fc7011a)")
    assert state.firmware == "ArduCopter V4.6.3 (3fc7011a)"
