from __future__ import annotations

import os
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.companion import autopilot


@pytest.fixture
def port() -> Iterator[tuple[int, str]]:
    """A serial port: what is written to the first end comes out of it."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    yield ours, os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


def heartbeat(system: int, kind: int, autopilot_kind: int) -> bytes:
    message = mavlink.MAVLink_heartbeat_message(kind, autopilot_kind, 0, 0, 0, 3)
    return bytes(message.pack(mavlink.MAVLink(None, system, 1)))


def test_an_autopilot_is_heard_and_a_ground_station_is_not(port: tuple[int, str]) -> None:
    station = heartbeat(255, mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID)
    rover = heartbeat(7, mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    sender = threading.Timer(0.1, os.write, (port[0], station + rover))
    sender.start()
    assert autopilot.hear(port[1], [57600], 5.0) == (port[1], 57600, 7, "rover")
    sender.join()


def test_a_silent_port_is_tried_at_each_rate(port: tuple[int, str]) -> None:
    assert autopilot.hear(port[1], [57600, 115200], 0.05) is None


def test_a_port_that_is_missing_is_an_error() -> None:
    with pytest.raises(OSError, match="no-such-port"):
        autopilot.hear("/dev/no-such-port", [57600], 0.05)


def test_autopilots_come_before_other_devices_by_their_first_interface(tmp_path: Path) -> None:
    by_id, uart = tmp_path / "by-id", tmp_path / "serial0"
    by_id.mkdir()
    for name in ("usb-FTDI_Radio-if00-port0", "usb-CubePilot_CubeOrange-if02", "usb-CubePilot_CubeOrange-if00"):
        (by_id / name).touch()
    uart.touch()
    found = [Path(one).name for one in autopilot.ports(by_id, uart)]
    assert found[:2] == ["usb-CubePilot_CubeOrange-if00", "usb-CubePilot_CubeOrange-if02"] and found[-1] == "serial0"
    assert autopilot.ports(tmp_path / "none", tmp_path / "none") == []


def test_usb_ids_are_those_of_the_device_above_the_port(tmp_path: Path) -> None:
    device, interface = tmp_path / "usb1", tmp_path / "usb1" / "1-1:1.0"
    interface.mkdir(parents=True)
    (device / "idVendor").write_text("2dae\n")
    (device / "idProduct").write_text("1016\n")
    (tmp_path / "tty" / "ttyACM0").mkdir(parents=True)
    (tmp_path / "tty" / "ttyACM0" / "device").symlink_to(interface)
    assert autopilot.usb_ids("/dev/ttyACM0", tmp_path / "tty") == ("2dae", "1016")
    assert autopilot.usb_ids("/dev/ttyAMA0", tmp_path / "tty") is None
