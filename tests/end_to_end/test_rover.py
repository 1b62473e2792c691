"""ArduPilot's rover in a real MAVProxy: it says ACTIVE wherever it stands."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.sitl


@pytest.fixture(scope="module")
def rover(harness, tmp_path_factory) -> Iterator:
    """ArduPilot's rover, with our module on its link."""
    made, instance = harness.Rig(tmp_path_factory.mktemp("rover"), harness.free_port()), harness.free_instance()
    home = Path(os.environ["ARDUPILOT_HOME"])
    defaults = home / "Tools" / "autotest" / "default_params" / "rover.parm"
    command = [str(home / "build" / "sitl" / "bin" / "ardurover"), "--model=rover", f"-I{instance}"]
    try:
        made.start(
            "rover", [*command, f"--speedup={harness.SPEEDUP}", f"--home={harness.HOME}", f"--defaults={defaults}"]
        )
        made.mavproxy = made.start("mavproxy", harness.mavproxy_command(instance, harness.load(made.port)))
        made.wait_until_up(120)
        yield made
    finally:
        made.stop()


def test_rover_that_stands_armed_in_manual_is_armed_for_guided_and_disarmed(rover):
    rover.ok(rover.get("/command/arm"))
    rover.ok(rover.get("/command/set_mode", mode="MANUAL"))
    status = rover.status()
    assert (status["mode"], status["armed"], status["landed_state"]) == ("MANUAL", True, "on_ground")
    rover.ok(rover.get("/command/arm"))
    assert rover.status()["mode"] == "GUIDED"
    rover.ok(rover.get("/command/set_mode", mode="MANUAL"))
    rover.ok(rover.get("/command/disarm"))
    assert rover.status()["armed"] is False
