"""A ground station in the same process: sends real MAVLink to a `Simulator` and keeps what comes back."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options, Simulator

READY = 6.0
STEP = 0.04  # s; flights differ by centimetres from those with the simulator's own
POSITION_ONLY = 0b110111111000
VELOCITY_ONLY = 0b110111000111


class Ground:
    """Speaks as system 255, component 190."""

    def __init__(self, options: Options | None = None) -> None:
        self.simulator = Simulator(replace(options or Options(), step=STEP))
        self.link = self.simulator.open_link("test")
        self.heard: list[Any] = []
        self._encoder = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)

    @property
    def copter(self) -> Any:
        return self.simulator.copter

    @property
    def body(self) -> Any:
        return self.simulator.copter.body

    def send(self, message: Any, link: Any = None) -> None:
        """Over the wire format, so that fields are what a socket would give."""
        decoded = mavlink.MAVLink(None).parse_buffer(message.pack(self._encoder))
        self.simulator.receive(link or self.link, decoded[0])

    def run(self, seconds: float) -> list[Any]:
        """Let time pass; the messages of that time."""
        fresh = self.link.messages()
        for _ in range(max(1, round(seconds / self.simulator.options.step))):
            self.simulator.step()
            fresh += self.link.messages()
        self.heard += fresh
        return fresh

    def command(self, command: int, *parameters: float) -> int | None:
        """COMMAND_LONG; the result of its ack, None without one."""
        padded = [*parameters, *([0.0] * (7 - len(parameters)))]
        self.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *padded))
        return self.result_of(command)

    def command_int(
        self, command: int, frame: int, parameters: tuple[float, ...], place: tuple[int, int, float]
    ) -> int | None:
        self.send(mavlink.MAVLink_command_int_message(1, 1, frame, command, 0, 0, *parameters, *place))
        return self.result_of(command)

    def result_of(self, command: int) -> int | None:
        acks = [m for m in self.run(0.01) if m.get_type() == "COMMAND_ACK" and m.command == command]
        return acks[0].result if acks else None

    def mode(self, number: int) -> int | None:
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, number)

    def arm(self) -> int | None:
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def texts(self) -> list[str]:
        return [m.text for m in self.heard if m.get_type() == "STATUSTEXT"]

    def of(self, name: str) -> list[Any]:
        return [m for m in self.heard if m.get_type() == name]

    def local(self, vector: tuple[float, ...], mask: int = POSITION_ONLY, frame: int = 1, **fields: float) -> None:
        """SET_POSITION_TARGET_LOCAL_NED with vector as position or velocity by mask."""
        position = vector if mask & 0x07 == 0 else (0.0, 0.0, 0.0)
        velocity = vector if mask & 0x07 else fields.pop("velocity", (0.0, 0.0, 0.0))
        acceleration = fields.pop("acceleration", (0.0, 0.0, 0.0))
        yaw, rate = fields.pop("yaw", 0.0), fields.pop("yaw_rate", 0.0)
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, mask, *position, *velocity, *acceleration, yaw, rate
            )
        )

    def fly(self, altitude: float = 10.0) -> None:
        """Ready, GUIDED, armed and hovering at altitude."""
        self.run(READY)
        assert self.mode(4) == 0
        assert self.arm() == 0
        assert self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, altitude) == 0
        self.run(10.0 + altitude)
        assert self.body.down == pytest.approx(-altitude, abs=0.1)
        self.heard.clear()

    def check_sanity(self) -> None:
        """Whatever it was sent: it can tell all that it tells, and is at a place."""
        self.send(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 20, 1))
        self.run(0.5)
        self.link.drain()
        encoder = mavlink.MAVLink(None, srcSystem=1)
        for name in self.simulator.telemetry._builders:
            message = self.simulator.telemetry.build(name)
            if message is not None:
                message.pack(encoder)
        body = self.simulator.vehicle.body
        assert all(map(math.isfinite, (*body.position, *body.velocity, body.yaw, body.roll, body.pitch)))

    @property
    def heading(self) -> float:
        return math.degrees(self.body.yaw) % 360


@pytest.fixture
def ground() -> Ground:
    """A vehicle that has just booted."""
    return Ground()


@pytest.fixture
def flying() -> Ground:
    """A vehicle hovering in GUIDED at 10 m."""
    station = Ground()
    station.fly()
    return station


@pytest.fixture
def standing(ground: Ground) -> Ground:
    """Armed in GUIDED on the ground, motors at idle for a while."""
    ground.run(READY)
    ground.mode(4)
    ground.arm()
    ground.run(3.0)
    return ground


@pytest.fixture
def new_ground() -> type[Ground]:
    """For tests with their own options."""
    return Ground
