from __future__ import annotations

import asyncio
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.telemetry.vehicle_state import Received, VehicleState
from mavproxy_vision.tracking.stream_rates import RANGEFINDER, TRUTH, Rates, in_flight

mavlink = mavutil.mavlink
PERIOD = 1 / TRUTH["SIM_STATE"]  # s


class Vehicle:
    """Hears SIM_STATE and ATTITUDE, and records what is requested."""

    def __init__(self) -> None:
        self.now = 100.0
        self.state = VehicleState(1, 1, mavlink.MAV_TYPE_QUADROTOR, self.now)
        self.address = Address(1, 1)
        self.requested: list[tuple[float, float]] = []
        self.rates = Rates(lambda: self.now)

    async def post(self, message: Any) -> None:
        self.requested.append((message.param1, 1e6 / message.param2))

    def hear(self, seconds: float, *names: str) -> None:
        """Messages of these names arrive at the rate that is needed."""
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            for name in names:
                if name in self.state.messages:
                    self.state.messages[name].renew(None, self.now)
                else:
                    self.state.messages[name] = Received(None, self.now)

    def look(self) -> None:
        with self.rates.at(TRUTH):
            asyncio.run(self.rates.look(self))  # type: ignore[arg-type]


@pytest.fixture
def vehicle() -> Vehicle:
    """A vehicle that sends both messages fast enough."""
    made = Vehicle()
    made.hear(2.0, "SIM_STATE", "ATTITUDE")
    return made


def test_a_message_that_comes_often_enough_is_not_requested(vehicle: Vehicle) -> None:
    vehicle.look()
    assert vehicle.requested == []


def test_a_pause_of_all_messages_requests_nothing(vehicle: Vehicle) -> None:
    vehicle.now += 0.4  # MAVProxy's main loop was busy
    vehicle.look()
    assert vehicle.requested == []


def test_a_message_that_stops_while_others_come_is_requested(vehicle: Vehicle) -> None:
    vehicle.hear(0.2, "ATTITUDE")
    vehicle.look()
    assert vehicle.requested == [(mavlink.MAVLINK_MSG_ID_SIM_STATE, TRUTH["SIM_STATE"])]


@pytest.mark.parametrize(("present", "asked"), [(None, False), (0, False), (RANGEFINDER | 1, True)])
def test_a_rangefinders_heights_are_asked_of_a_vehicle_that_has_one(
    vehicle: Vehicle, present: Any, asked: bool
) -> None:
    if present is not None:
        status = mavlink.MAVLink_sys_status_message(present, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
        vehicle.state.messages["SYS_STATUS"] = Received(status, vehicle.now)
    assert ("DISTANCE_SENSOR" in in_flight(vehicle.state)) is asked
