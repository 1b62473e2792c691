"""MAVLink for programs: by each way in, what they hear and say, and which of it moves a vehicle."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.rehearsal.program_link import ProgramLink, moves
from mavproxy_uavapi.rehearsal.virtual_time import VirtualLoop, run_in_virtual_time
from mavproxy_uavapi.sim import Options, Simulator

STEP = 0.02


class Program(asyncio.DatagramProtocol):
    """What a program has heard, by either protocol."""

    def __init__(self) -> None:
        self.heard: list[Any] = []
        self._parser = mavlink.MAVLink(None)

    def data_received(self, data: bytes) -> None:
        self.heard += self._parser.parse_buffer(data) or []

    def datagram_received(self, data: bytes, _address: Any) -> None:
        self.data_received(data)

    def heard_of(self, system: int) -> set[str]:
        return {one.get_type() for one in self.heard if one.get_srcSystem() == system}


async def connected(link: ProgramLink, way: str) -> tuple[Program, Any, Any]:
    """A program, how it sends, and its end of the connection."""
    loop, program = asyncio.get_running_loop(), Program()
    host, port = link.address.split(":")[1:]
    if way == "udp":
        transport, _ = await loop.create_datagram_endpoint(lambda: program, remote_addr=(host, int(port)))
        transport.sendto(b"it is there")
        return program, transport.sendto, transport
    made: Any = program
    if way == "tcp":
        stream, _ = await loop.create_connection(lambda: made, host, int(port))
    else:
        stream, _ = await loop.create_unix_connection(lambda: made, str(link.line))
    return program, stream.write, stream


@pytest.mark.parametrize("way", ["tcp", "udp", "line"])
def test_program_hears_the_vehicles_and_commands_them(tmp_path: Path, way: str) -> None:
    vehicles = [Simulator(Options(sysid=system, step=STEP)) for system in (1, 2)]
    orders: list[tuple[int, str]] = []

    async def passed(link: ProgramLink, seconds: float) -> None:
        for _ in range(round(seconds / STEP)):
            link.deliver()
            for vehicle in vehicles:
                vehicle.step()
            link.send()
            await asyncio.sleep(STEP)

    async def flown() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        link = ProgramLink(loop, vehicles, tmp_path / "line", lambda *order: orders.append(order))
        async with link.up():
            program, send, end = await connected(link, way)
            await passed(link, 3.0)
            assert program.heard_of(1) == program.heard_of(2) >= {"HEARTBEAT", "ATTITUDE"}
            encoder = mavlink.MAVLink(None, 255, 190)
            send(mavlink.MAVLink_set_mode_message(2, 1, 2).pack(encoder))
            send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(encoder))
            send(mavlink.MAVLink_manual_control_message(2, 0, 0, 0, 0, 0).pack(encoder))
            await asyncio.sleep(STEP)
            await passed(link, 1.0)
            assert [vehicle.vehicle.mode.name for vehicle in vehicles] == ["STABILIZE", "ALT_HOLD"]
            link.is_dead, heard = True, len(program.heard)
            send(mavlink.MAVLink_set_mode_message(2, 1, 0).pack(encoder))
            await passed(link, 1.0)
            end.close()
            assert vehicles[1].vehicle.mode.name == "ALT_HOLD"
            assert len(program.heard) == heard or way == "tcp"  # which holds back what was said before
        await asyncio.sleep(1.0)
        assert all(len(vehicle.links) == 0 for vehicle in vehicles)

    run_in_virtual_time(flown(), 10.0)
    assert orders == [(2, "SET_MODE"), (0, "MANUAL_CONTROL")]


@pytest.mark.parametrize(
    ("message", "is_order"),
    [
        (mavlink.MAVLink_set_mode_message(1, 1, 4), True),
        (mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 0, 5), True),
        (mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0, *[0] * 7), True),
        (mavlink.MAVLink_rc_channels_override_message(1, 1, *[1500] * 8), True),
        (mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 2, 0, 0, 0, 0, 0, -35.3, 149.1, 10), True),
        (mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 0, 0, 0, 0, 0, 0, -35.3, 149.1, 10), False),
        (mavlink.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0), True),
        (mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_DO_CHANGE_SPEED, 0, math.nan, *[0] * 6), True),
        (mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), False),
        (mavlink.MAVLink_param_request_list_message(1, 1), False),
        (mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, 30, 0, 0, 0, 0, 0, 0), False),
    ],
)  # fmt: skip
def test_what_makes_a_vehicle_fly_is_told_from_the_rest(message: Any, is_order: bool) -> None:
    assert moves(message) is is_order
