"""What the trail tells of vehicles, and what the clients of ended flights hear."""

from __future__ import annotations

from datetime import datetime

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import ModeChanged, NotArmed
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.messages import VelocityTarget
from mavproxy_uavapi.core.oversight.history import EVENTS_A_MINUTE, REASON_WITHIN, SAID_AGAIN, SETTLED_AFTER
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.virtual_time import FastLoop

WARNING, CRITICAL = mavlink.MAV_SEVERITY_WARNING, mavlink.MAV_SEVERITY_CRITICAL
EKF = "EKF Failsafe: changed to LAND Mode"


def sentences(host: Host, *kinds: str) -> list[str]:
    """The events of these kinds, oldest first."""
    return [entry.detail for entry in host.audit.newest if entry.kind in kinds]


@pytest.fixture
def flying(flying: Drone, loop: FastLoop, host: Host) -> Drone:
    """The drone in the air, and nothing in the trail yet."""
    loop.pass_time(2.0)
    host.audit.newest.clear()
    return flying


@pytest.fixture
def flight(flying: Drone, copter: Vehicle, pilotage: Pilotage, loop: FastLoop) -> Job:
    """A job that flies the vehicle."""
    job = pilotage.start(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=60.0)
    loop.pass_time(2.0)
    assert job.running
    return job


# -- why a flight ended ---------------------------------------------------------------------------------


@pytest.mark.parametrize("is_first", [True, False], ids=["text first", "heartbeat first"])
def test_failsafe_is_named_in_the_words_before_or_after_the_heartbeat(
    flight: Job, flying: Drone, loop: FastLoop, pilotage: Pilotage, is_first: bool
) -> None:
    if is_first:
        flying.say(EKF, severity=CRITICAL)
    flying.pilot("LAND")
    if not is_first:
        loop.pass_time(REASON_WITHIN / 2)
        flying.say(EKF, severity=CRITICAL)
    heard_at = loop.time()
    with pytest.raises(ModeChanged) as caught:
        pilotage.result(flight)
    assert str(caught.value) == f"the vehicle left GUIDED: a failsafe switched it to LAND ({EKF})"
    assert caught.value.statustext == [EKF]
    assert {name: caught.value.change[name] for name in ("from", "to", "by")} == {
        "from": "GUIDED",
        "to": "LAND",
        "by": "failsafe",
    }
    assert loop.time() - heard_at < 0.05


def test_job_has_ended_while_its_clients_wait_for_the_reason(flight: Job, flying: Drone, loop: FastLoop) -> None:
    flying.pilot("LOITER")
    loop.settle()
    assert not flight.running
    assert not flight.is_told
    loop.pass_time(REASON_WITHIN + 0.01)
    assert flight.is_told


def test_switch_without_a_word_of_the_autopilot_is_no_failsafe(
    flight: Job, flying: Drone, loop: FastLoop, pilotage: Pilotage
) -> None:
    flying.pilot("LOITER")
    with pytest.raises(ModeChanged, match="left GUIDED: the pilot or another station switched it to LOITER$"):
        pilotage.result(flight)


def test_word_may_be_lost_where_messages_are(flight: Job, flying: Drone, loop: FastLoop, pilotage: Pilotage) -> None:
    flying._sequence += 3
    flying.pilot("LOITER")
    with pytest.raises(ModeChanged, match="the pilot or a failsafe switched it to LOITER$"):
        pilotage.result(flight)


def test_move_of_the_radios_switch_is_the_pilots(
    flight: Job, flying: Drone, loop: FastLoop, pilotage: Pilotage, copter: Vehicle
) -> None:
    copter.state.parameters["FLTMODE_CH"] = 6.0
    flying.send("rc_channels", chan6_raw=1100, chan5_raw=1800)
    flying.send("rc_channels", chan6_raw=1500, chan5_raw=1800)
    flying.pilot("LOITER")
    with pytest.raises(ModeChanged, match="left GUIDED: the pilot switched it to LOITER$") as caught:
        pilotage.result(flight)
    assert caught.value.change["by"] == "pilot"


def test_acknowledged_order_that_is_not_ours_is_another_stations(
    flight: Job, flying: Drone, loop: FastLoop, pilotage: Pilotage
) -> None:
    flying.acknowledge(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_RESULT_ACCEPTED)
    flying.pilot("LOITER")
    with pytest.raises(ModeChanged, match="MAVProxy's prompt or another station switched it to LOITER$"):
        pilotage.result(flight)


def test_answer_tells_what_was_sent_last_and_by_whom(
    flight: Job, flying: Drone, loop: FastLoop, pilotage: Pilotage
) -> None:
    flying.pilot("LOITER")
    with pytest.raises(ModeChanged) as caught:
        pilotage.result(flight)
    sent = caught.value.change["last_sent"]
    assert sent["message"] == "SET_POSITION_TARGET_LOCAL_NED"
    assert (sent["client"], sent["job"]) == ("console", flight.id)
    assert 0.0 <= sent["seconds_before"] < 1.0


def test_disarming_in_the_air_is_explained(
    flight: Job, flying: Drone, loop: FastLoop, pilotage: Pilotage, host: Host
) -> None:
    flying.say("Crash: Disarming: AngErr=45>30", severity=mavlink.MAV_SEVERITY_EMERGENCY)
    flying.armed = False
    flying.tell("HEARTBEAT")
    with pytest.raises(NotArmed) as caught:
        pilotage.result(flight)
    says = "the vehicle was disarmed meanwhile, by a failsafe (Crash: Disarming: AngErr=45>30)"
    assert str(caught.value) == says
    loop.pass_time(SETTLED_AFTER)
    assert "vehicle 1 disarms in the air in GUIDED, by a failsafe (Crash: Disarming: AngErr=45>30)" in sentences(
        host, "armed"
    )


@pytest.mark.parametrize(("mode", "landed"), [("LAND", False), ("AUTO", False), ("LOITER", True)])
def test_disarming_after_a_landing_is_not_in_the_air(
    flying: Drone, loop: FastLoop, host: Host, mode: str, landed: bool
) -> None:
    flying.pilot(mode)
    loop.pass_time(2.0)
    host.audit.newest.clear()
    if landed:
        flying.landed = mavlink.MAV_LANDED_STATE_ON_GROUND
        flying.tell("EXTENDED_SYS_STATE")
    flying.armed = False
    flying.tell("HEARTBEAT")
    loop.pass_time(SETTLED_AFTER + 0.1)
    assert sentences(host, "armed") == [f"vehicle 1 disarms in {mode}"]


def test_boot_that_only_a_text_shows_is_a_reboot(
    flight: Job, flying: Drone, loop: FastLoop, pilotage: Pilotage, host: Host
) -> None:
    flying.mode, flying.armed = "STABILIZE", False
    flying.tell("HEARTBEAT")
    flying.say("ArduPilot Ready")
    with pytest.raises(NotArmed, match="^the autopilot rebooted meanwhile$") as caught:
        pilotage.result(flight)
    assert [caught.value.change[name] for name in ("what", "from", "to", "by")] == [
        "boot",
        "armed",
        "booted",
        "reboot",
    ]
    loop.pass_time(SETTLED_AFTER + 1.0)
    assert sentences(host, "boot", "mode", "armed") == [
        "the autopilot of vehicle 1 restarts; it was armed in GUIDED",
    ]


def test_boot_that_the_clock_shows_is_told_once(flight: Job, flying: Drone, loop: FastLoop, host: Host) -> None:
    flying.reboot()
    loop.pass_time(30.0)
    assert sentences(host, "boot", "mode", "armed") == ["the autopilot of vehicle 1 restarts; it was armed in GUIDED"]


def test_command_after_a_failsafe_hears_of_it(
    flying: Drone, copter: Vehicle, loop: FastLoop, pilotage: Pilotage
) -> None:
    flying.say(EKF, severity=CRITICAL)
    flying.pilot("LAND")
    loop.pass_time(5.0)
    asked_at = loop.time()
    with pytest.raises(ModeChanged, match="the vehicle is in LAND") as caught:
        pilotage.do(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=5.0)
    assert (caught.value.change["by"], caught.value.statustext) == ("failsafe", [EKF])
    assert loop.time() == asked_at


def test_refusal_of_a_disarmed_vehicle_is_not_explained_by_a_mode(
    drone: Drone, copter: Vehicle, loop: FastLoop, pilotage: Pilotage
) -> None:
    loop.pass_time(2.0)
    pilotage.do(copter.set_mode, "GUIDED")
    with pytest.raises(NotArmed, match="^the vehicle is not armed; `arm` it first$") as caught:
        pilotage.do(copter.takeoff, 10.0)
    assert caught.value.extras() == {}


def test_what_is_waited_for_is_told_when_the_host_ends(
    flight: Job, flying: Drone, loop: FastLoop, host: Host
) -> None:
    flying.pilot("LOITER")
    loop.settle()
    host.history.close()
    assert flight.is_told
    assert sentences(host, "mode") == ["vehicle 1 changes from GUIDED to LOITER, by the pilot or another station"]


# -- the trail ------------------------------------------------------------------------------------------


def test_our_own_switch_names_the_verb_and_its_client(
    flying: Drone, copter: Vehicle, loop: FastLoop, pilotage: Pilotage, host: Host
) -> None:
    pilotage.do(copter.set_mode, "BRAKE")
    loop.pass_time(SETTLED_AFTER + 1.0)
    assert sentences(host, "mode") == ["vehicle 1 changes from GUIDED to BRAKE, by set_mode0 of console"]


def test_vehicle_is_told_once_and_its_link_when_it_is_lost_and_back(drone: Drone, loop: FastLoop, host: Host) -> None:
    loop.pass_time(1.0)
    drone.power_off()
    loop.pass_time(8.0)
    drone.power_on()
    loop.pass_time(2.0)
    first, lost, back = sentences(host, "link")
    assert first == "vehicle 1 is heard; STABILIZE, disarmed"
    assert lost == "the link to vehicle 1 is lost: no heartbeat for 5.0 s; STABILIZE, disarmed"
    assert back == "the link to vehicle 1 is back; STABILIZE, disarmed"


def test_warnings_are_in_it_and_a_repeated_one_once(drone: Drone, loop: FastLoop, host: Host) -> None:
    for _ in range(5):
        drone.say("Battery 1 is low 9.90V used 312 mAh", severity=WARNING)
        drone.say("EKF3 IMU0 is using GPS", severity=mavlink.MAV_SEVERITY_INFO)
        loop.pass_time(30.0)
    assert sentences(host, "text") == ["vehicle 1 says: Battery 1 is low 9.90V used 312 mAh"]
    drone.power_off()  # its telemetry
    loop.pass_time(SAID_AGAIN)
    drone.say("Battery 1 is low 9.90V used 312 mAh", severity=WARNING)
    loop.settle()
    assert len(sentences(host, "text")) == 2


def test_vehicle_that_babbles_does_not_drown_what_was_commanded(drone: Drone, loop: FastLoop, host: Host) -> None:
    for number in range(10 * EVENTS_A_MINUTE):
        drone.say(f"warning {number}", severity=WARNING)
        loop.pass_time(0.05)
    assert len(sentences(host, "text")) == EVENTS_A_MINUTE
    loop.pass_time(60.0)
    drone.say("the last one", severity=WARNING)
    loop.settle()
    left_out = f"vehicle 1: {9 * EVENTS_A_MINUTE} events are left out, because they are too many"
    assert sentences(host, "text")[-2:] == [left_out, "vehicle 1 says: the last one"]


def test_event_has_the_time_at_which_it_was_shown(flying: Drone, loop: FastLoop, host: Host) -> None:
    flying.pilot("LOITER")
    loop.pass_time(SETTLED_AFTER / 2)
    assert sentences(host, "mode") == []
    loop.pass_time(SETTLED_AFTER)
    (entry,) = [entry for entry in host.audit.newest if entry.kind == "mode"]
    shown, written = (datetime.fromisoformat(time) for time in (entry.info["time"], entry.time))
    assert abs((shown - written).total_seconds()) < SETTLED_AFTER / 2


def test_hold_and_lease_are_in_it(drone: Drone, copter: Vehicle, host: Host, loop: FastLoop) -> None:
    from mavproxy_uavapi.core.roles import THE_PROMPT

    loop.call_soon(host.leases.take_hold, copter, THE_PROMPT, 0)
    loop.call_soon(host.leases.take_hold, copter, THE_PROMPT, 0)
    loop.call_soon(host.leases.take, copter, "10.0.0.5", 4.0)
    loop.call_soon(host.leases.take, copter, "10.0.0.5", 4.0)
    loop.settle()
    loop.call_soon(host.leases.release_hold, copter, THE_PROMPT)
    loop.call_soon(host.leases.take, copter, "10.0.0.5", 0.0)
    loop.settle()
    assert sentences(host, "authority", "lease") == [
        "console takes vehicle 1",
        "10.0.0.5 has vehicle 1 until 4 s pass without a call",
        "console releases vehicle 1",
        "10.0.0.5 gives its lease of vehicle 1 back",
    ]
