"""Two vehicles in one MAVProxy: the silence, the crash and the flood of one leave the other's flight alone."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.ports import free_port
from tests.support.processes import Rig, eventually
from tests.support.several_vehicles import listed, several_vehicles

pytestmark = pytest.mark.long

BAD, GOOD, FLOODING = 1, 2, 9  # system ids
SPEEDUP = 5
LEG = 2000.0  # m; it takes 40 s or more of ours, and 15 s without a heartbeat are a lost link
TELEMETRY_SPEED = 4000  # messages/s of the flood
TURN = 0.01  # s


class Vehicles:
    """Both, and a link at which a third one may be heard."""

    def __init__(self, rig: Rig, vehicles: dict[int, Rig], flood_port: int) -> None:
        self.rig, self.vehicles, self.flood_port = rig, vehicles, flood_port

    def take_off(self, system: int) -> None:
        state = self.vehicles[system].control.ask("state")
        if state["landed"]:
            self.rig.ok(self.rig.get(f"/vehicles/{system}/command/arm"))
            self.rig.ok(self.rig.get(f"/vehicles/{system}/command/takeoff", alt=10))

    def fly(self, system: int) -> Any:
        """Begin a leg to the north or, from there, back."""
        target = {"x": 0.0 if self.north(system) > LEG / 2 else LEG, "y": 0.0, "z": -10.0}
        return self.rig.begin("POST", f"/vehicles/{system}/movement/go_to_ned_wait", target)

    def arrival(self, system: int, flight: Any) -> Any:
        """The answer to a leg, whose rest is flown faster."""
        self.vehicles[system].speed_up(2 * SPEEDUP)
        answer = flight.answer(120)
        self.vehicles[system].speed_up(SPEEDUP)
        return answer

    def north(self, system: int) -> float:
        """Where it truly is, m north of its start."""
        return float(self.vehicles[system].control.ask("state")["position"][0])


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Vehicles]:
    flood_port = free_port()
    directory: Path = tmp_path_factory.mktemp("neighbours")
    masters = ["--streamrate=2", f"--master=udp:127.0.0.1:{flood_port}"]
    with several_vehicles(directory, (BAD, GOOD), speedup=SPEEDUP, arguments=masters) as (rig, vehicles):
        made = Vehicles(rig, vehicles, flood_port)
        made.take_off(GOOD)
        yield made


@contextlib.contextmanager
def flood(port: int) -> Iterator[None]:
    """A vehicle that sends thousands of messages a second."""
    speaker = mavlink.MAVLink(None, srcSystem=FLOODING, srcComponent=1)
    copter, autopilot = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    frames = [mavlink.MAVLink_heartbeat_message(copter, autopilot, 1, 0, 3, 3).pack(speaker)]
    attitude = mavlink.MAVLink_attitude_message(0, 0.1, 0.1, 0.1, 0, 0, 0)
    frames += [attitude.pack(speaker) for _ in range(int(TELEMETRY_SPEED * TURN))]
    ended = threading.Event()

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            while not ended.wait(TURN):
                out.sendto(b"".join(frames), ("127.0.0.1", port))

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def is_heard(both: Vehicles, system: int) -> bool:
    return bool(listed(both.rig)[system]["link"]["alive"])


@pytest.mark.long
def test_silent_vehicle_loses_its_own_flight_only(both: Vehicles) -> None:
    both.take_off(BAD)
    flights = {system: both.fly(system) for system in (BAD, GOOD)}
    both.vehicles[BAD].control.fault("silence")
    lost = flights[BAD].answer(60)
    assert (lost.status_code, lost.json()["code"]) == (503, "link_lost")
    assert not flights[GOOD].is_answered()
    arrived = both.arrival(GOOD, flights[GOOD])
    assert arrived.status_code == 200, arrived.text
    both.vehicles[BAD].control.ask("clear")
    eventually(lambda: is_heard(both, BAD), what="the silent one's return")


@pytest.mark.long
def test_flooding_vehicle_keeps_no_command_from_another(both: Vehicles) -> None:
    with flood(both.flood_port):
        eventually(lambda: FLOODING in listed(both.rig), what="the flood's being heard")
        before, flight = both.north(GOOD), both.fly(GOOD)
        eventually(lambda: abs(both.north(GOOD) - before) > 20, what="its leg")
        both.rig.ok(both.rig.get(f"/vehicles/{GOOD}/movement/stop"))
        assert abs(both.north(GOOD) - before) < LEG - 20
        assert not flight.is_answered()
        both.rig.ok(both.rig.get(f"/vehicles/{GOOD}/movement/resume"))
        arrived = both.arrival(GOOD, flight)
    assert arrived.status_code == 200, arrived.text


def test_crashed_vehicle_is_missed_alone_and_found_again(both: Vehicles) -> None:
    flight = both.fly(GOOD)
    process = both.vehicles[BAD].processes[0]
    process.popen.kill()
    eventually(lambda: not is_heard(both, BAD), what="its being missed")
    assert not flight.is_answered()
    arrived = both.arrival(GOOD, flight)
    assert arrived.status_code == 200, arrived.text
    assert is_heard(both, GOOD)
    mark = process.mark()
    both.vehicles[BAD].start("sim", list(process.popen.args)).says("listening on tcp", mark)
    eventually(lambda: is_heard(both, BAD), what="its being heard again")
