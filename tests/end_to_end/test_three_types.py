"""A copter, a plane and a rover in one MAVProxy, commanded one by one and all at once."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.ports import free_instance, free_port
from tests.support.processes import HOME, SPEEDUP, Rig, headless, load, mavproxy_command

TYPES = {"copter": "ArduCopter", "plane": "ArduPlane", "rover": "Rover"}  # by system id, from 1
TOGETHER = SPEEDUP / 3  # three vehicles send MAVProxy what one does at SPEEDUP; more, and acks come seconds late
NEAR = {"lat": -35.36342, "long": 149.1655, "alt": 0}  # 30 m from home


def start(rig: Rig, made_by: str, instance: int, system: int, kind: str) -> None:
    """Start a vehicle."""
    if made_by == "embedded":
        command = [sys.executable, "-m", "mavproxy_uavapi.sim", f"--instance={instance}", f"--home={HOME}"]
        more = [f"--vehicle={kind}", f"--sysid={system}", f"--speedup={TOGETHER:g}"]
        rig.start(kind, [*command, *more]).says("listening on tcp")
    else:
        script = str(Path(os.environ["ARDUPILOT_HOME"], "Tools", "autotest", "sim_vehicle.py"))
        (rig.directory / kind).mkdir()
        command = [sys.executable, script, "-v", TYPES[kind], "-N", "-w", f"-I{instance}", f"--sysid={system}"]
        more = ["--speedup=5", "-l", HOME, "--use-dir", str(rig.directory / kind), "--no-mavproxy"]
        rig.start(kind, [*command, *more], headless())


@pytest.fixture(params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def rig(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Rig]:
    """Three vehicles of three types behind one MAVProxy."""
    rig = Rig(tmp_path, free_port())
    try:
        first = free_instance(len(TYPES))
        instances = range(first, first + len(TYPES))
        for number, kind in enumerate(TYPES):
            start(rig, request.param, instances[number], number + 1, kind)
        rig.mavproxy = rig.start("mavproxy", mavproxy_command(instances, load(rig.port)))
        rig.wait_until_up(120)
        yield rig
    finally:
        rig.stop()


def listed(rig: Rig) -> dict[int, Any]:
    return {vehicle["id"]: vehicle for vehicle in rig.ok(rig.get("/vehicles"))["vehicles"]}


@pytest.mark.long
def test_three_types_in_one_mavproxy(rig: Rig) -> None:
    rig.until(lambda: len(listed(rig)) == len(TYPES), 60, "three vehicles")
    assert [listed(rig)[system]["type"] for system in (1, 2, 3)] == list(TYPES)
    assert rig.post("/fleet/arm", vehicles="all", timeout=240).json()["result"].endswith("3 of 3 vehicles")
    rig.ok(rig.get("/vehicles/1/command/arm"))  # a copter that waits for the others disarms
    rig.ok(rig.get("/vehicles/1/command/takeoff", alt=10, timeout=240))
    rig.ok(rig.get("/vehicles/2/command/takeoff", alt=40, timeout=240))
    rig.ok(rig.post("/vehicles/3/movement/go_to_gps_wait", timeout=240, **NEAR))
    assert rig.get("/vehicles/3/command/takeoff", alt=10).json()["code"] == "not_supported"
    refusal = rig.get("/vehicles/2/command/land").json()
    assert refusal["code"] == "busy", refusal  # its mission has no landing
    assert {vehicle["mode"] for vehicle in listed(rig).values()} == {"GUIDED"}
    home = rig.post("/fleet/rtl", vehicles="all", timeout=400).json()
    assert [home["vehicles"][system]["status"] for system in "123"] == [200, 200, 200], home
    assert not listed(rig)[1]["armed"]
