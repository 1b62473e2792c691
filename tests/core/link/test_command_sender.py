from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import LinkLost, Rejected, TimedOut
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.command_sender import (
    ACK_TIMEOUT,
    IN_PROGRESS_TIMEOUT,
    LATE_ACK,
    SENDINGS,
    CommandSender,
    result_name,
)
from mavproxy_uavapi.core.mainloop.permit import DEFAULT, Permit
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink
SERVO = mavlink.MAV_CMD_DO_SET_SERVO
TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
HOME = mavlink.MAV_CMD_DO_SET_HOME
OK, DENIED, FAILED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_FAILED
BUSY, RUNNING = mavlink.MAV_RESULT_TEMPORARILY_REJECTED, mavlink.MAV_RESULT_IN_PROGRESS
COMMAND = messages.set_servo(1, 1500)


@pytest.fixture
def sender(host: Host, copter: Vehicle) -> CommandSender:
    return CommandSender(copter.state, host.link, copter.waiting)


@pytest.fixture
def send(loop: FastLoop, sender: CommandSender) -> Callable[..., float]:
    """Send a command and wait for its end; the seconds that it took."""

    def send(command: Any = COMMAND, **kwargs: Any) -> float:
        started = loop.time()
        loop.run(sender.send(command, **kwargs))
        return loop.time() - started

    return send


def confirmations(drone: Drone, number: int = SERVO) -> list[int]:
    return [command.confirmation for command in drone.commands(number)]


def test_accepted_command_is_sent_once(drone: Drone, send: Callable[..., float]) -> None:
    assert send() < 0.1
    assert confirmations(drone) == [0]
    assert drone.commands()[0].target_component == 1


def test_lost_ack_is_answered_by_sending_again_with_the_next_confirmation(
    drone: Drone, send: Callable[..., float]
) -> None:
    drone.answers[SERVO] = [None, None, OK]
    took = send()
    assert confirmations(drone) == [0, 1, 2]
    assert took == pytest.approx(2 * ACK_TIMEOUT, abs=0.1)


def test_silence_is_a_timeout_after_three_more_sendings(
    loop: FastLoop, drone: Drone, send: Callable[..., float]
) -> None:
    drone.answers[SERVO] = [None]
    started = loop.time()
    with pytest.raises(TimedOut, match="did not acknowledge DO_SET_SERVO, sent 4 times"):
        send()
    assert confirmations(drone) == [0, 1, 2, 3]
    assert loop.time() - started == pytest.approx(SENDINGS * ACK_TIMEOUT)


def test_what_may_not_be_repeated_is_sent_once(drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[TAKEOFF] = [None]
    with pytest.raises(TimedOut, match="did not acknowledge NAV_TAKEOFF$"):
        send(messages.takeoff(10))
    assert confirmations(drone, TAKEOFF) == [0]


@pytest.mark.parametrize(
    "foreign",
    [
        {"component": 154},
        {"target": (254, 230)},
        {"target": (255, 191)},
        {"number": mavlink.MAV_CMD_DO_SET_RELAY},
    ],
    ids=["other component", "to another system", "to another component", "of another command"],
)
def test_foreign_ack_does_not_count(
    loop: FastLoop, drone: Drone, send: Callable[..., float], foreign: dict[str, Any]
) -> None:
    drone.answers[SERVO] = [None]
    loop.call_later(0.5, lambda: drone.acknowledge(**{"number": SERVO, "result": DENIED, **foreign}))
    with pytest.raises(TimedOut):
        send()


def test_ack_of_another_vehicle_does_not_count(
    loop: FastLoop, drone: Drone, make_drone: Callable[..., Drone], send: Callable[..., float]
) -> None:
    other = make_drone(2)
    drone.answers[SERVO] = [None]
    loop.call_later(0.5, other.acknowledge, SERVO, OK)
    with pytest.raises(TimedOut):
        send()


def test_ack_to_nobody_in_particular_counts(loop: FastLoop, drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[SERVO] = [None]
    loop.call_later(0.5, lambda: drone.acknowledge(SERVO, OK, target=(0, 0)))
    assert send() == pytest.approx(0.5, abs=0.05)


def test_ack_that_came_before_the_command_does_not_count(
    loop: FastLoop, drone: Drone, send: Callable[..., float]
) -> None:
    drone.acknowledge(SERVO, DENIED)
    loop.settle()
    assert send() < 0.1


OTHER = messages.set_servo(1, 1900)


@pytest.mark.parametrize("late", [OK, DENIED])
def test_late_ack_of_an_earlier_command_does_not_count(
    loop: FastLoop, drone: Drone, send: Callable[..., float], late: int
) -> None:
    drone.answers[SERVO] = [None]
    with pytest.raises(TimedOut):
        send()
    loop.call_later(0.5, drone.acknowledge, SERVO, late)  # of the first: the vehicle has not heard the second
    with pytest.raises(TimedOut):
        send(OTHER)


def test_answers_to_the_second_command_count_after_the_late_ones(drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[SERVO] = [None, None, None, None, OK]
    with pytest.raises(TimedOut):
        send()
    assert send(OTHER) < 0.5
    assert len(drone.commands(SERVO)) == 2 * SENDINGS + 1  # any of the first four acks may be the first command's


def test_late_ack_of_the_same_command_is_as_good_as_its_own(
    loop: FastLoop, drone: Drone, send: Callable[..., float]
) -> None:
    drone.answers[SERVO] = [None]
    with pytest.raises(TimedOut):
        send()
    loop.call_later(0.5, drone.acknowledge, SERVO, OK)
    assert send() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("late", [OK, DENIED])
def test_late_ack_tells_what_came_of_a_command_that_takes_the_vehicle(
    loop: FastLoop, drone: Drone, send: Callable[..., float], late: int
) -> None:
    drone.answers[ARM] = [None]
    loop.call_later(ACK_TIMEOUT + 0.1, drone.acknowledge, ARM, late)
    if late == OK:
        assert send(messages.disarm(force=False)) == pytest.approx(ACK_TIMEOUT + 0.1, abs=0.05)
    else:
        with pytest.raises(Rejected):
            send(messages.disarm(force=False))
    assert confirmations(drone, ARM) == [0]  # what it did may have been undone by the pilot


def test_ack_of_the_command_before_tells_nothing_of_one_that_was_lost(
    loop: FastLoop, drone: Drone, send: Callable[..., float]
) -> None:
    drone.answers[ARM] = [None, OK]
    drone.acknowledge(ARM, OK)
    loop.settle()
    send(messages.disarm(force=False))
    assert confirmations(drone, ARM) == [0, 1]


def test_older_ack_counts_no_second_time_for_what_takes_the_vehicle(
    loop: FastLoop, drone: Drone, send: Callable[..., float]
) -> None:
    drone.answers[ARM] = [None]
    with pytest.raises(TimedOut):
        send(replace(messages.arm(), repeatable=False))
    loop.call_later(0.5, drone.acknowledge, ARM, OK)  # of the first: the vehicle has not heard the second
    with pytest.raises(TimedOut):
        send(replace(messages.disarm(force=False), proven_by_ack=True))


@pytest.mark.parametrize(("answers", "is_measured"), [([OK], True), ([None, OK], False)])
def test_trip_is_measured_by_a_question_that_was_sent_once(
    drone: Drone, copter: Vehicle, send: Callable[..., float], answers: list[Any], is_measured: bool
) -> None:
    question = messages.request_message(messages.MESSAGE_IDS["HOME_POSITION"])
    drone.answers[question.number] = answers
    send(question)
    assert (copter.state.trip.mean is not None) is is_measured  # else nobody knows which one was answered


def test_what_was_acknowledged_and_is_not_shown_is_not_done_again(
    loop: FastLoop, drone: Drone, copter: Vehicle
) -> None:
    drone.answers[ARM] = [OK]  # it was armed, and its pilot has disarmed it since
    with pytest.raises(TimedOut, match="did not arm"):
        loop.run(copter._sender.send_until_shown(messages.arm(), DEFAULT, lambda: False, "arm"))
    assert confirmations(drone, ARM) == [0]


def test_ack_does_not_come_later_than_late(loop: FastLoop, drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[SERVO] = [None, None, None, None, OK]
    with pytest.raises(TimedOut):
        send()
    loop.pass_time(LATE_ACK + 0.1)
    send(OTHER)
    assert len(drone.commands(SERVO)) == SENDINGS + 1


def test_command_given_up_in_flight_leaves_its_late_ack_behind(
    loop: FastLoop, drone: Drone, sender: CommandSender, send: Callable[..., float]
) -> None:
    drone.answers[SERVO] = [None]
    task = loop.create_task(sender.send(COMMAND))
    loop.pass_time(0.1)
    task.cancel()
    loop.call_later(0.2, drone.acknowledge, SERVO, DENIED)
    loop.call_later(0.4, drone.acknowledge, SERVO, OK)
    assert send(OTHER) == pytest.approx(0.4, abs=0.05)


def test_in_progress_extends_the_wait(loop: FastLoop, drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[SERVO] = [RUNNING]
    loop.call_later(IN_PROGRESS_TIMEOUT - 1, drone.acknowledge, SERVO, RUNNING)
    loop.call_later(2 * IN_PROGRESS_TIMEOUT - 2, drone.acknowledge, SERVO, OK)
    assert send() == pytest.approx(2 * IN_PROGRESS_TIMEOUT - 2, abs=0.05)
    assert confirmations(drone) == [0]


def test_in_progress_and_accepted_in_one_batch(drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[SERVO] = [(RUNNING, OK)]
    assert send() < 0.1


def test_in_progress_and_denied_in_one_batch(drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[SERVO] = [(RUNNING, DENIED)]
    with pytest.raises(Rejected):
        send()


def test_refusal_carries_the_result_and_the_texts_since_the_command(
    loop: FastLoop, drone: Drone, send: Callable[..., float]
) -> None:
    drone.say("long ago")
    loop.pass_time(5.0)
    drone.answers[SERVO] = [DENIED]
    drone.says[SERVO] = ["Servo: no such channel", "Servo: sorry"]
    with pytest.raises(Rejected) as caught:
        send()
    assert caught.value.ack == "MAV_RESULT_DENIED"
    assert caught.value.statustext == ["Servo: no such channel", "Servo: sorry"]
    assert str(caught.value) == (
        "the vehicle refused DO_SET_SERVO (MAV_RESULT_DENIED): Servo: no such channel; Servo: sorry"
    )


def test_refusal_carries_texts_shortly_after_the_ack(
    loop: FastLoop, drone: Drone, send: Callable[..., float]
) -> None:
    drone.answers[SERVO] = [DENIED]
    loop.call_later(0.3, drone.say, "Servo: no such channel")
    with pytest.raises(Rejected) as caught:
        send()
    assert caught.value.statustext == ["Servo: no such channel"]


def test_refusal_carries_a_long_text_whose_chunks_come_after_the_ack(
    loop: FastLoop, drone: Drone, send: Callable[..., float]
) -> None:
    drone.answers[SERVO] = [DENIED]
    loop.call_later(0.1, lambda: drone.say("s" * 50, id=3, chunk_seq=0))
    loop.call_later(0.2, lambda: drone.say("orry", id=3, chunk_seq=1))
    with pytest.raises(Rejected) as caught:
        send()
    assert caught.value.statustext == ["s" * 50 + "orry"]


def test_refusal_does_not_carry_what_another_component_says(
    loop: FastLoop, drone: Drone, send: Callable[..., float]
) -> None:
    drone.answers[SERVO] = [DENIED]
    loop.call_later(0.1, lambda: drone.say("gimbal: hello", component=154))
    loop.call_later(0.2, drone.say, "Servo: no such channel")
    with pytest.raises(Rejected) as caught:
        send()
    assert caught.value.statustext == ["Servo: no such channel"]


def test_silent_refusal_is_reported_soon(loop: FastLoop, drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[SERVO] = [FAILED]
    started = loop.time()
    with pytest.raises(Rejected) as caught:
        send()
    assert (caught.value.ack, caught.value.statustext) == ("MAV_RESULT_FAILED", [])
    assert loop.time() - started < 1.0


def test_patient_command_is_repeated_until_it_is_accepted(drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[HOME] = [BUSY, FAILED, OK]
    took = send(messages.set_home_here())
    assert confirmations(drone, HOME) == [0, 0, 0]
    assert took == pytest.approx(2.0, abs=0.2)


def test_repeating_a_patient_command_ends(loop: FastLoop, drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[HOME] = [BUSY]
    started = loop.time()
    with pytest.raises(Rejected, match="TEMPORARILY_REJECTED"):
        send(messages.set_home_here(), retry_for=5.0)
    assert loop.time() - started == pytest.approx(5.0, abs=1.1)


def test_patient_command_that_is_denied_is_not_repeated(drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[HOME] = [DENIED]
    with pytest.raises(Rejected):
        send(messages.set_home_here())
    assert len(drone.commands(HOME)) == 1


def test_command_that_is_not_patient_is_not_repeated(drone: Drone, send: Callable[..., float]) -> None:
    drone.answers[SERVO] = [BUSY]
    with pytest.raises(Rejected):
        send()
    assert len(drone.commands(SERVO)) == 1


def test_same_commands_go_in_turn_and_different_ones_do_not_wait(
    loop: FastLoop, drone: Drone, sender: CommandSender
) -> None:
    drone.answers[SERVO] = [None]
    tasks = [loop.create_task(sender.send(messages.set_servo(channel, 1500))) for channel in (1, 2)]
    other = loop.create_task(sender.send(messages.yaw_to(90)))
    loop.pass_time(1.0)
    assert [command.param1 for command in drone.commands(SERVO)] == [1]
    assert other.done()
    drone.acknowledge(SERVO, DENIED)
    loop.pass_time(1.0)
    assert [command.param1 for command in drone.commands(SERVO)] == [1, 2]
    assert isinstance(tasks[0].exception(), Rejected)
    drone.acknowledge(SERVO, OK)
    loop.settle()
    assert tasks[1].result() is None


def test_cancelled_command_lets_the_next_one_through(loop: FastLoop, drone: Drone, sender: CommandSender) -> None:
    drone.answers[SERVO] = [None, OK]
    first = loop.create_task(sender.send(messages.set_servo(1, 1500)))
    second = loop.create_task(sender.send(messages.set_servo(2, 1500)))
    loop.pass_time(0.1)
    first.cancel()
    loop.run(second)
    assert [command.param1 for command in drone.commands(SERVO)] == [1, 2, 2]  # the first ack may be the late one


def test_link_loss_ends_the_wait_and_nothing_more_is_sent(
    loop: FastLoop, drone: Drone, send: Callable[..., float], host: Host
) -> None:
    drone.answers[SERVO] = [RUNNING]
    drone.power_off()
    with pytest.raises(LinkLost):
        send()
    loop.pass_time(20.0)
    assert confirmations(drone) == [0]
    assert len(host.pending) == 0


def test_results_are_reported_by_name() -> None:
    assert result_name(mavlink.MAV_RESULT_UNSUPPORTED) == "MAV_RESULT_UNSUPPORTED"
    assert result_name(99) == "MAV_RESULT_99"


@pytest.mark.parametrize(("waits", "heard"), [(0.5, False), (2.5, True)])
def test_what_takes_the_vehicle_hears_a_heartbeat_after_a_long_gate(
    loop: FastLoop, drone: Drone, copter: Vehicle, send: Callable[..., float], waits: float, heard: bool
) -> None:
    passed_at: list[float] = []

    async def gate() -> None:
        if not passed_at:
            await asyncio.sleep(waits)
            passed_at.append(loop.time())

    beats: list[float] = []
    permit = Permit(check=lambda: beats.append(copter.state.heartbeat_at))
    send(messages.arm(), permit=permit, gate=gate)
    assert (beats[0] > passed_at[0]) is heard
