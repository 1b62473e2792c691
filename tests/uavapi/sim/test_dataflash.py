"""The embedded vehicle's logs: what is in them, and the log protocol as ArduPilot has it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pymavlink import DFReader
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options, Simulator
from mavproxy_uavapi.sim.dataflash import KEPT
from tests.uavapi.sim.conftest import STEP, Ground

WHOLE = 0xFFFFFFFF
BOOTED_AT = 1_790_000_000.0  # unix s


def hop(ground: Ground) -> None:
    """Arm, and disarm again."""
    assert ground.arm() == 0
    ground.run(1.0)
    ground.copter.disarm_now()
    ground.run(0.1)


@pytest.fixture
def landed(new_ground: type[Ground]) -> Ground:
    """A vehicle that has been armed twice."""
    ground = new_ground()
    ground.simulator = Simulator(Options(step=STEP), epoch=BOOTED_AT)
    ground.link = ground.simulator.open_link("test")
    ground.fly()
    ground.mode(5)
    ground.local((5.0, 0.0, -10.0))
    ground.run(3.0)
    ground.copter.disarm_now()
    ground.run(30.0)
    ground.mode(4)
    hop(ground)
    ground.run(1.0)
    ground.heard.clear()
    return ground


def entries(ground: Ground, first: int = 0, last: int = 0xFFFF) -> list[tuple[int, int, int, int]]:
    ground.send(mavlink.MAVLink_log_request_list_message(1, 1, first, last))
    listed = [m for m in ground.run(0.5) if m.get_type() == "LOG_ENTRY"]
    return [(m.id, m.num_logs, m.last_log_num, m.size) for m in listed]


def pieces(ground: Ground, number: int, start: int = 0, count: int = WHOLE, seconds: float = 5.0) -> list[Any]:
    ground.send(mavlink.MAVLink_log_request_data_message(1, 1, number, start, count))
    return [m for m in ground.run(seconds) if m.get_type() == "LOG_DATA"]


def bytes_of(messages: list[Any]) -> bytes:
    return b"".join(bytes(m.data[: m.count]) for m in messages)


def test_vehicle_that_never_flew_has_no_log(ground: Ground) -> None:
    assert entries(ground) == [(0, 0, 0, 0)]
    assert pieces(ground, 1) == []


def test_each_flight_is_a_log(landed: Ground) -> None:
    first, second = landed.simulator.dataflash.logs
    assert entries(landed) == [(1, 2, 2, len(first.data)), (2, 2, 2, len(second.data))]
    assert entries(landed, 2, 2) == [(2, 2, 2, len(second.data))]
    assert bytes_of(pieces(landed, 1)) == first.data
    assert bytes_of(pieces(landed, 1, 90, 200)) == first.data[90:290]
    assert (first.began - BOOTED_AT) == pytest.approx(6.0, abs=1.0)


def test_log_is_one_that_pymavlink_reads(landed: Ground, tmp_path: Path) -> None:
    file = tmp_path / "1.bin"
    file.write_bytes(landed.simulator.dataflash.logs[0].data)
    messages: dict[str, list[Any]] = {}
    log = DFReader.DFReader_binary(str(file))
    while (message := log.recv_msg()) is not None:
        messages.setdefault(message.get_type(), []).append(message)
    assert set(messages) == {"FMT", "MSG", "MODE", "ATT", "GPS"}
    assert "Copter" in messages["MSG"][0].Message
    assert [m.Mode for m in messages["MODE"]] == [4, 5]
    assert max(m.Alt for m in messages["GPS"]) == pytest.approx(594.0, abs=1.0)
    assert messages["GPS"][0].Lat == pytest.approx(-35.363261, abs=1e-6)
    assert messages["ATT"][0].Yaw == pytest.approx(-7.0, abs=0.1)
    assert messages["GPS"][0]._timestamp == pytest.approx(BOOTED_AT + 6.0, abs=1.0)
    log.close()


def test_armed_vehicle_sends_no_log_and_says_so_once(landed: Ground) -> None:
    landed.send(mavlink.MAVLink_log_request_data_message(1, 1, 1, 0, WHOLE))
    assert landed.arm() == 0
    assert [m for m in landed.run(1.0) if m.get_type() == "LOG_DATA"] == []
    assert entries(landed) == entries(landed) == []
    assert landed.texts().count("Disarm for log download") == 1
    landed.copter.disarm_now()
    assert "LOG_DATA" in {m.get_type() for m in landed.run(1.0)}, "an ArduPilot goes on"


def test_one_transfer_at_a_time(landed: Ground) -> None:
    other = landed.simulator.open_link("other")
    landed.send(mavlink.MAVLink_log_request_data_message(1, 1, 1, 0, WHOLE))
    landed.run(0.02)
    landed.send(mavlink.MAVLink_log_request_data_message(1, 1, 2, 0, WHOLE), other)
    landed.send(mavlink.MAVLink_log_request_data_message(1, 1, 2, 0, WHOLE))
    assert entries(landed) == []
    assert {m.id for m in landed.of("LOG_DATA")} == {1}
    assert landed.texts().count("Log download in progress") == 2
    landed.send(mavlink.MAVLink_log_request_end_message(1, 1))
    assert len(entries(landed)) == 2


def test_oldest_log_goes_and_an_erase_takes_all(landed: Ground) -> None:
    first, second = landed.simulator.dataflash.logs
    for _ in range(KEPT - 1):
        hop(landed)
    kept = landed.simulator.dataflash.logs
    assert (len(kept), kept[0]) == (KEPT, second)
    landed.send(mavlink.MAVLink_log_erase_message(1, 1))
    assert entries(landed) == [(0, 0, 0, 0)]


def test_boot_ends_a_log_and_keeps_all(landed: Ground) -> None:
    assert landed.arm() == 0
    landed.run(0.5)
    landed.simulator.reboot_soon()
    landed.run(0.1)
    assert len(entries(landed)) == 3
