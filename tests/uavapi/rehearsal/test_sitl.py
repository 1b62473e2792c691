from __future__ import annotations

import json
import os
import socket
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.launcher.errors import OptionError
from mavproxy_uavapi.rehearsal.faults import fault_of
from mavproxy_uavapi.rehearsal.flight import Rehearsal
from mavproxy_uavapi.rehearsal.order import Order
from mavproxy_uavapi.rehearsal.record import Record
from mavproxy_uavapi.rehearsal.report import Rehearsed
from mavproxy_uavapi.rehearsal.rules import broken
from mavproxy_uavapi.rehearsal.sitl import Cable
from mavproxy_uavapi.rehearsal.virtual_time import run_in_virtual_time

SCRIPT = """
import os, time
import requests
from pymavlink import mavutil

def call(verb, **values):
    answer = requests.post(os.environ["UAVAPI_URL"] + verb, json=values)
    assert answer.ok, answer.text

link = mavutil.mavlink_connection(os.environ["UAVAPI_MAVLINK"])
assert link.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=10)
call("/command/arm")
call("/command/takeoff", alt=8)
begin = time.time()
time.sleep(20)
print("slept", round(time.time() - begin))
call("/command/rtl")
"""
MISSION = {
    "items": [
        {"command": "NAV_TAKEOFF", "alt": 10},
        {"command": "NAV_WAYPOINT", "lat": -35.3630, "long": 149.16523, "alt": 10},
        {"command": "NAV_LAND"},
    ]
}


def test_frames_come_whole_and_those_of_mavlink_1_not_at_all() -> None:
    encoder = mavlink.MAVLink(None, 1, 1)
    heartbeat = mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3)
    new, old = bytes(heartbeat.pack(encoder)), bytes(heartbeat.pack(encoder, force_mavlink1=True))
    with socket.create_server(("127.0.0.1", 0)) as server:
        cable = Cable(server.getsockname()[1], lambda: True)
        far, _ = server.accept()
        with far:
            far.sendall(old + new[:5])
            assert cable.drain() == b""
            far.sendall(new[5:] + old + new)
            got = b""
            while len(got) < 2 * len(new):
                got += cable.drain()
            assert got == new + new
        cable.close()


def test_copy_of_ardupilot_that_is_not_built_is_said(tmp_path: Path) -> None:
    async def up() -> None:
        async with Rehearsal(Order((tmp_path / "a.py",), ardupilot=tmp_path)).up():
            pytest.fail("there is none")

    with pytest.raises(OptionError, match="--ardupilot-path"):
        run_in_virtual_time(up(), 1.0)


def flown(file: Path, *faults: str) -> Record:
    async def fly() -> Record:
        path = Path(os.environ["ARDUPILOT_HOME"])
        rehearsal = Rehearsal(Order((file,), location="CMAC", ardupilot=path, speedup=5.0, looks_ahead=False))
        async with rehearsal.up():
            return await rehearsal.fly([fault_of(fault) for fault in faults])

    return run_in_virtual_time(fly(), 5.0)


@pytest.mark.sitl
@pytest.mark.parametrize(("name", "text"), [("a.py", SCRIPT), ("m.json", json.dumps(MISSION))])
def test_file_is_flown_on_sitl(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    record = flown(tmp_path / name)
    last = record.samples[1][-1]
    assert (record.failure, last.armed, last.landed) == ("", False, True), record.output
    assert record.highest(1) == pytest.approx(8 if name == "a.py" else 10, abs=1)
    assert not broken(record, Order(()).limits)
    assert "slept 20" in record.output or name != "a.py"


@pytest.mark.sitl
@pytest.mark.parametrize(
    ("fault", "is_seen"),
    [
        ("pilot_mode=LOITER@5m", lambda record: "LOITER" in {sample.mode for sample in record.samples[1]}),
        ("gps_loss@5m", lambda record: any("EKF" in said.text for said in record.said)),
        ("low_battery@5m", lambda record: any("attery" in said.text for said in record.said)),
    ],
)
def test_faults_begin_on_sitl(tmp_path: Path, fault: str, is_seen: object) -> None:
    (tmp_path / "m.json").write_text(json.dumps(MISSION))
    record = flown(tmp_path / "m.json", fault)
    assert Rehearsed((fault,), record, ()).not_judged == []
    assert callable(is_seen) and is_seen(record), record.said
