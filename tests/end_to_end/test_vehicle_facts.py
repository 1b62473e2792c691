"""What the project relies on in ArduCopter, flown on the embedded vehicle and on ArduPilot's own: they must be alike.

A ground station without MAVProxy talks to the vehicle directly. All seconds are the vehicle's.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.ports import free_instance, free_port
from tests.support.processes import SPEEDUP

pytestmark = pytest.mark.long

GUIDED, LOITER, LAND, BRAKE = 4, 5, 9, 17
ACCEPTED, FAILED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED, mavlink.MAV_RESULT_DENIED
PAUSE = mavlink.MAV_CMD_DO_PAUSE_CONTINUE
ON_GROUND = mavlink.MAV_LANDED_STATE_ON_GROUND
IN_AIR = mavlink.MAV_LANDED_STATE_IN_AIR
POSITION, VELOCITY, ACCELERATION = 0x0DF8, 0x0DC7, 0x0C3F
FORCE = 21196
LONGEST = 90.0
"""Wall seconds until a vehicle that shows nothing counts as broken."""
NO_ANSWER = 0.5
"""Wall seconds in which a vehicle that has nothing to say says nothing."""
SLOW = 0.2
WATCHED = {"EXTENDED_SYS_STATE": 50_000, "LOCAL_POSITION_NED": 50_000, "HEARTBEAT": 200_000, "SYS_STATUS": 200_000}


class Station:
    """A ground station of one vehicle."""

    def __init__(self, port: int) -> None:
        self._link = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", source_system=255, source_component=190)
        self._last: dict[str, Any] = {}
        self.send = self._link.mav
        assert self._until("HEARTBEAT"), f"no vehicle speaks on port {port}"
        for name, interval in WATCHED.items():
            self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, _number(name), interval)
        self.wait(
            lambda: self._newest("SYS_STATUS").onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
        )
        self.send.param_set_send(1, 1, b"DISARM_DELAY", 0, mavlink.MAV_PARAM_TYPE_REAL32)
        self.send.rc_channels_override_send(1, 1, 0, 0, 1000, 0, 0, 0, 0, 0)

    def close(self) -> None:
        self._link.close()

    def _hear(self) -> Any:
        message = self._link.recv_match(blocking=True, timeout=1.0)
        if message is not None and message.get_srcSystem() == 1:
            self._last[message.get_type()] = message
        return message

    def _until(self, name: str, seconds: float = LONGEST) -> Any:
        """The next message of that name; None when it does not come in wall seconds."""
        self._last.pop(name, None)
        deadline = time.monotonic() + seconds
        while name not in self._last and time.monotonic() < deadline:
            self._hear()
        return self._last.get(name)

    def _newest(self, name: str) -> Any:
        return self._last.get(name) or self._until(name)

    def wait(self, look: Callable[[], Any]) -> None:
        deadline = time.monotonic() + LONGEST
        while not look():
            assert time.monotonic() < deadline, "the vehicle does not get there"
            self._hear()

    def run(self, seconds: float) -> None:
        """Let time pass on the vehicle's clock."""
        start = self._newest("LOCAL_POSITION_NED").time_boot_ms
        self.wait(lambda: self._newest("LOCAL_POSITION_NED").time_boot_ms >= start + 1000 * seconds)

    def command(self, number: int, *parameters: float) -> int:
        """The result of the command, sent again while no acknowledgement comes: one that boots hears nothing."""
        padded = [*parameters, *([0.0] * (7 - len(parameters)))]
        deadline = time.monotonic() + LONGEST
        while time.monotonic() < deadline:
            self.send.command_long_send(1, 1, number, 0, *padded)
            ack = self._until("COMMAND_ACK", 10.0)
            if ack is not None and ack.command == number:
                return int(ack.result)
        raise AssertionError(f"no acknowledgement of command {number}")

    def mode(self, number: int) -> int:
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, number)

    def take_off(self, altitude: float = 10.0) -> int:
        return self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, altitude)

    def setpoint(self, mask: int, *vector: float) -> None:
        groups = {POSITION: 0, VELOCITY: 3, ACCELERATION: 6}
        fields = [0.0] * 9
        fields[groups[mask] : groups[mask] + 3] = vector
        self.send.set_position_target_local_ned_send(0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, mask, *fields, 0, 0)

    def requested(self, name: str, seconds: float = LONGEST) -> Any:
        """What REQUEST_MESSAGE brings; None when the vehicle says nothing in wall seconds."""
        assert self.command(mavlink.MAV_CMD_REQUEST_MESSAGE, _number(name)) == ACCEPTED
        return self._until(name, seconds)

    @contextlib.contextmanager
    def slowly(self) -> Iterator[None]:
        """Meanwhile a second of the vehicle takes five of ours: time to do something in it."""
        self._speed_up(SLOW)
        try:
            yield
        finally:
            self._speed_up(SPEEDUP)

    def _speed_up(self, factor: float) -> None:
        self.send.param_set_send(1, 1, b"SIM_SPEEDUP", factor, mavlink.MAV_PARAM_TYPE_REAL32)

    @property
    def landed_state(self) -> int:
        return int(self._newest("EXTENDED_SYS_STATE").landed_state)

    @property
    def altitude(self) -> float:
        return -float(self._newest("LOCAL_POSITION_NED").z)

    @property
    def armed(self) -> bool:
        return bool(self._newest("HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    def stand(self) -> None:
        """Armed in GUIDED on the ground, motors at idle, nothing paused."""
        if self._until("EXTENDED_SYS_STATE").landed_state != ON_GROUND:
            self.mode(LAND)
            self.wait(lambda: self.landed_state == ON_GROUND)
        self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, FORCE)
        self.mode(LOITER)
        assert self.mode(GUIDED) == ACCEPTED
        self.wait(lambda: self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == ACCEPTED)
        self.run(3.0)

    def fly(self, altitude: float = 10.0) -> None:
        """Hovering in GUIDED after a takeoff."""
        self.stand()
        assert self.take_off(altitude) == ACCEPTED
        self.wait(lambda: self.landed_state == IN_AIR)


def _number(name: str) -> int:
    return int(getattr(mavlink, f"MAVLINK_MSG_ID_{name}"))


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def station(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, harness: ModuleType
) -> Iterator[Station]:
    """A ground station and its vehicle, which the tests share."""
    directory: Path = tmp_path_factory.mktemp(request.param)
    rig = harness.Rig(directory, free_port())
    with contextlib.ExitStack() as stack:
        stack.callback(rig.stop)
        if request.param == "embedded":
            instance = harness.start_embedded(rig)
        else:
            instance = free_instance()
            command = harness.sim_vehicle(directory, instance, "--no-mavproxy")
            rig.start("sim_vehicle", command, harness.headless())
        yield stack.enter_context(contextlib.closing(_connected(5760 + 10 * instance)))


def _connected(port: int) -> Station:
    """A station as soon as the vehicle listens; sim_vehicle.py may take a while."""
    deadline = time.monotonic() + LONGEST
    while True:
        try:
            return Station(port)
        except OSError:
            if time.monotonic() > deadline:
                raise


HOLDS: dict[str, Callable[[Station], Any]] = {
    "zero velocity": lambda station: station.setpoint(VELOCITY, 0, 0, 0),
    "position": lambda station: station.setpoint(POSITION, 5, 0, -10),
    "pause": lambda station: station.command(PAUSE, 0),
    "BRAKE": lambda station: station.mode(BRAKE),
}


@pytest.mark.parametrize("hold", HOLDS)
def test_a_hold_in_the_first_second_of_a_takeoff_keeps_the_vehicle_down(station: Station, hold: str) -> None:
    station.stand()
    with station.slowly():
        assert station.take_off() == ACCEPTED
        station.run(0.3)
        assert station.landed_state == ON_GROUND
        HOLDS[hold](station)
    station.run(5.0)
    assert station.landed_state == ON_GROUND
    assert station.altitude < 0.3
    assert station.armed


def test_a_landing_in_the_first_second_of_a_takeoff_disarms(station: Station) -> None:
    station.stand()
    with station.slowly():
        assert station.take_off() == ACCEPTED
        station.run(0.3)
        assert station.mode(LAND) == ACCEPTED
    station.run(2.0)
    assert not station.armed


def test_only_another_mode_or_continuing_ends_a_pause(station: Station) -> None:
    station.stand()
    assert station.command(PAUSE, 0) == ACCEPTED
    assert station.take_off() == ACCEPTED
    assert station.mode(GUIDED) == ACCEPTED
    station.run(4.0)
    assert station.landed_state == ON_GROUND
    assert station.command(PAUSE, 1) == ACCEPTED
    station.run(4.0)
    assert station.altitude > 1.0
    station.command(PAUSE, 0)
    station.mode(BRAKE)
    station.mode(GUIDED)
    station.setpoint(POSITION, 0, 0, -8)
    station.wait(lambda: station.altitude > 7.5)


def test_setpoints_in_a_pause_are_flown_after_it(station: Station) -> None:
    station.fly()
    assert station.command(PAUSE, 0) == ACCEPTED
    station.setpoint(POSITION, 0, 0, -14)
    station.run(3.0)
    assert station.altitude == pytest.approx(10.0, abs=0.5)
    assert station.command(PAUSE, 1) == ACCEPTED
    station.wait(lambda: station.altitude > 13.0)


def test_the_targets_that_guided_reports(station: Station) -> None:
    station.fly()
    station.setpoint(POSITION, 3, 0, -11)
    station.run(0.5)
    local = station.requested("POSITION_TARGET_LOCAL_NED")
    assert (local.type_mask, local.x, local.z) == (POSITION, 3.0, -11.0)
    assert station.requested("POSITION_TARGET_GLOBAL_INT").type_mask == 0xF000 | POSITION
    station.stand()
    assert station.requested("POSITION_TARGET_LOCAL_NED").type_mask == 0x0C07
    with station.slowly():
        assert station.take_off() == ACCEPTED
        station.run(0.2)
        stale = station.requested("POSITION_TARGET_LOCAL_NED")
        assert (stale.type_mask, stale.x, stale.z) == (POSITION, 3.0, -11.0)
        assert station.requested("POSITION_TARGET_GLOBAL_INT", NO_ANSWER) is None
    station.wait(lambda: station.landed_state == IN_AIR)
    station.setpoint(ACCELERATION, 0.2, 0, 0)
    station.run(4.0)
    assert station.requested("POSITION_TARGET_LOCAL_NED").type_mask == ACCELERATION
    station.mode(BRAKE)
    assert station.requested("POSITION_TARGET_LOCAL_NED", NO_ANSWER) is None


def test_speeds_disarming_and_takeoffs_are_refused_alike(station: Station) -> None:
    station.fly()
    assert station.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 5) == ACCEPTED
    assert station.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 0) == DENIED
    assert station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == FAILED
    assert station.take_off(20) == FAILED
    station.mode(BRAKE)
    assert station.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 5) == FAILED
    assert station.command(PAUSE, 0) == FAILED
