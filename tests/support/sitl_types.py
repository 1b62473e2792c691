"""ArduPilot's vehicles of each type as processes, with our module in a real MAVProxy."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from tests.support.ports import free_instance, free_port
from tests.support.processes import HOME, Rig, load, mavproxy_command

BINARIES = {"copter": "arducopter", "plane": "arduplane", "quadplane": "arduplane", "rover": "ardurover"}
DEFAULTS = {
    "copter": "default_params/copter.parm",
    "plane": "models/plane.parm",
    "quadplane": "default_params/quadplane.parm",
    "rover": "default_params/rover.parm",
}
SPEEDUP = 5


def ardupilot_type(directory: Path, kind: str, *, speedup: int = SPEEDUP, **settings: Any) -> Rig:
    """A rig with ArduPilot's copter, plane, quadplane or rover, which is ready to arm."""
    rig, instance = Rig(directory, free_port()), free_instance()
    home = Path(os.environ["ARDUPILOT_HOME"])
    defaults = home / "Tools" / "autotest" / DEFAULTS[kind]
    command = [str(home / "build" / "sitl" / "bin" / BINARIES[kind]), f"--model={kind}", f"-I{instance}"]
    try:
        rig.start(kind, [*command, f"--speedup={speedup}", f"--home={HOME}", f"--defaults={defaults}"])
        rig.mavproxy = rig.start("mavproxy", mavproxy_command(instance, load(rig.port, **settings)))
        rig.wait_until_up(120)
        rig.until(lambda: rig.status()["ready_to_arm"], 60, "getting ready to arm")
    except BaseException:
        rig.stop()
        raise
    return rig
