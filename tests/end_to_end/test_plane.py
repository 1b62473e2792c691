"""ArduPilot's plane in a real MAVProxy."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.sitl
FIELD = (-35.363261, 149.165230)  # degrees, where it stands at the beginning
SPEEDUP = 5


@pytest.fixture(scope="module")
def plane(harness: Any, tmp_path_factory: Any) -> Iterator[Any]:
    """ArduPilot's plane, with our module on its link."""
    rig, instance = harness.Rig(tmp_path_factory.mktemp("plane"), harness.free_port()), harness.free_instance()
    home = Path(os.environ["ARDUPILOT_HOME"])
    defaults = home / "Tools" / "autotest" / "models" / "plane.parm"
    command = [str(home / "build" / "sitl" / "bin" / "arduplane"), "--model=plane", f"-I{instance}"]
    try:
        rig.start("plane", [*command, f"--speedup={SPEEDUP}", f"--home={harness.HOME}", f"--defaults={defaults}"])
        rig.mavproxy = rig.start("mavproxy", harness.mavproxy_command(instance, harness.load(rig.port)))
        rig.wait_until_up(120)
        harness.eventually(lambda: rig.status()["ready_to_arm"], 60, "getting ready to arm")
        yield rig
    finally:
        rig.stop()


def height(plane):
    return plane.ok(plane.get("/telemetry/gps"))["info"]["position"]["relative_alt"]


def test_plane_takes_off_flies_circles_returns_lands_and_arms_again(plane, harness):
    plane.ok(plane.get("/command/arm"))
    plane.ok(plane.get("/command/takeoff", alt=60))
    assert height(plane) == pytest.approx(60, abs=15)
    assert plane.status()["mode"] == "GUIDED"
    plane.ok(plane.post("/movement/go_to_gps_wait", lat=FIELD[0] + 0.004, long=FIELD[1], alt=80))
    assert height(plane) == pytest.approx(80, abs=15)
    plane.ok(plane.post("/movement/go_to_gps", lat=FIELD[0] + 0.01, long=FIELD[1], alt=80))
    assert plane.ok(plane.get("/movement/stop"))["result"] == "Plane is loitering"
    assert plane.status()["mode"] == "LOITER"
    answer = plane.get("/command/land")
    assert (answer.status_code, answer.json()["code"]) == (409, "busy")
    assert plane.status()["mode"] == "LOITER"
    assert plane.ok(plane.get("/command/rtl"))["result"] == "Returned to launch"
    landing = plane.ok(plane.get("/command/land_at", lat=FIELD[0], long=FIELD[1]))
    assert landing["result"] == f"Landing mission started for coord ({FIELD[0]}, {FIELD[1]})"
    harness.eventually(lambda: plane.status()["armed"] is False, 120, "landing and disarming")
    assert plane.status()["landed_state"] == "on_ground"
    plane.ok(plane.get("/command/arm", timeout=60))
    plane.ok(plane.get("/command/disarm"))


@pytest.mark.parametrize("path", ["/movement/resume", "/movement/set_heading?heading=3"])
def test_what_a_plane_does_not_have_is_404(plane, path):
    answer = plane.get(path)
    assert (answer.status_code, answer.json()["code"]) == (404, "not_supported")
