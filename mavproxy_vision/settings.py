"""The module's settings: MPSettings at the prompt -> one frozen snapshot handed inward."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from MAVProxy.modules.lib.mp_settings import MPSetting, MPSettings

from mavproxy_vision.calibration import load
from mavproxy_vision.errors import BadSetting
from mavproxy_vision.geometry import Mount
from mavproxy_vision.model import CameraModel
from mavproxy_vision.rendering import Look
from mavproxy_vision.simulated import Timing, parse_placed
from mavproxy_vision.tags import FAMILIES, Tag, parse_families, parse_tags

METHODS = ("velocity", "landing_target")
ON_FAILURE = ("rtl", "land", "hold")


@dataclass(frozen=True)
class Settings:
    """A snapshot; `table` says what each means."""

    source: str
    family: str
    tags: str
    any_id: bool
    far: bool
    calibration: str
    fov: float
    width: int
    height: int
    fps: float
    latency: float
    mount: str
    offset: str
    gimbal: bool
    method: str
    attempts: int
    tolerance: float
    speed: float
    descent: float
    leash: float
    time_limit: float
    on_failure: str
    ground: float
    directory: str
    threads: int
    sim_tags: str
    sim_latency: float
    sim_jitter: float
    sim_dropout: float
    sim_noise: float
    sim_blur: float
    sim_exposure: float
    sim_occlusion: float

    @property
    def families(self) -> tuple[str, ...]:
        """The families to look for; the first one's tags are landed on."""
        return parse_families(self.family)

    @property
    def tag_list(self) -> tuple[Tag, ...]:
        """The target's tags, the main one first."""
        return parse_tags(self.tags)

    @property
    def model(self) -> CameraModel:
        """The calibration's camera, or one of the field of view."""
        if self.calibration:
            return load(Path(self.calibration).expanduser())
        return CameraModel.from_field_of_view(self.width, self.height, self.fov)

    @property
    def camera_mount(self) -> Mount:
        """How the camera sits on the vehicle."""
        angles = numbers(self.mount, "mount")
        roll, pitch, yaw = angles if len(angles) == 3 else (0.0, 0.0, angles[0])
        offset = numbers(self.offset, "offset")
        if len(offset) != 3:
            raise BadSetting("offset: forward,right,down in m, such as 0.1,0,0.05", "offset")
        return Mount(roll, pitch, yaw, (offset[0], offset[1], offset[2]), self.gimbal)

    @property
    def timing(self) -> Timing:
        """When the simulated camera's frames come."""
        jitter, dropout = self.sim_jitter / 1000, self.sim_dropout
        return Timing(self.fps, self.sim_latency / 1000, jitter, dropout, self.latency / 1000)

    @property
    def look(self) -> Look:
        """How good the simulated camera is."""
        return Look(self.sim_noise, self.sim_blur, self.sim_exposure, self.sim_occlusion)


def numbers(text: str, name: str) -> list[float]:
    """One number, or three with commas.

    Raises:
        BadSetting: neither.
    """
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) not in (1, 3):
        raise BadSetting(f"{name}: {text!r} is not one number, nor three with commas", name)
    return found


def table() -> list[Any]:
    """The settings with their types, defaults and ranges, as MAVProxy knows them."""
    return [
        MPSetting("source", str, "", "camera:0, a path, URL or folder, sim, http; none for no camera"),
        MPSetting("family", str, "36h11", f"one or several of {', '.join(FAMILIES)}; landed on is the first"),
        MPSetting("tags", str, "0:0.30", "ID:SIZE or ID:SIZE@RIGHT,UP in m; the main tag first"),
        MPSetting("any_id", bool, False, "look for all ids of the families, not only for those of tags"),
        MPSetting("far", bool, False, "see a fifth farther, for one and a half times the time"),
        MPSetting("calibration", str, "", "file that `vision calibrate` wrote; replaces fov, width, height"),
        MPSetting("fov", float, 56.145, "degrees, horizontal", range=(5, 170)),
        MPSetting("width", int, 640, "px", range=(64, 8192)),
        MPSetting("height", int, 480, "px", range=(48, 8192)),
        MPSetting("fps", float, 20.0, "frames per second", range=(0.5, 240)),
        MPSetting("latency", float, 80.0, "ms from light to our having the frame", range=(0, 2000)),
        MPSetting("mount", str, "0", "degrees: yaw, or roll,pitch,yaw; yaw 90: top of the image to the right"),
        MPSetting("offset", str, "0,0,0", "m of the lens forward,right,down of the vehicle's centre"),
        MPSetting("gimbal", bool, False, "a gimbal keeps the camera level"),
        MPSetting("method", str, "velocity", "velocity (GUIDED) or landing_target (LAND with PLND)", choice=METHODS),
        MPSetting("attempts", int, 5, "times of looking for the tag", range=(1, 100)),
        MPSetting("tolerance", float, 0.12, "m off the tag within which it may touch down", range=(0.02, 5)),
        MPSetting("speed", float, 1.5, "m/s, horizontally", range=(0.1, 10)),
        MPSetting("descent", float, 1.0, "m/s, at most", range=(0.1, 3)),
        MPSetting("leash", float, 15.0, "m that a search may go away", range=(0.5, 500)),
        MPSetting("time_limit", float, 180.0, "s for a landing or a search", range=(5, 3600)),
        MPSetting(
            "on_failure", str, "rtl", "rtl, land or hold when there is no landing on the tag", choice=ON_FAILURE
        ),
        MPSetting("ground", float, 0.0, "m by which the tag lies higher than home", range=(-500, 500)),
        MPSetting("directory", str, "", "where tracks, plots and snapshots go; none for MAVProxy's log directory"),
        MPSetting("threads", int, 1, "of OpenCV", range=(1, 16)),
        MPSetting("sim_tags", str, "0:0.30@8,-5", "ID:SIZE@NORTH,EAST[,HEADING] of home"),
        MPSetting("sim_latency", float, 80.0, "ms", range=(10, 1000)),
        MPSetting("sim_jitter", float, 10.0, "ms, standard deviation", range=(0, 200)),
        MPSetting("sim_dropout", float, 0.0, "share of the frames", range=(0, 1)),
        MPSetting("sim_noise", float, 5.0, "standard deviation, of 255", range=(0, 60)),
        MPSetting("sim_blur", float, 0.7, "px", range=(0, 10)),
        MPSetting("sim_exposure", float, 1.0, "factor", range=(0.05, 5)),
        MPSetting("sim_occlusion", float, 0.0, "share of each tag that is covered", range=(0, 1)),
    ]


CHECKED: dict[str, Callable[[Settings], object]] = {
    "family": lambda now: now.families,
    "tags": lambda now: now.tag_list,
    "calibration": lambda now: now.model,
    "mount": lambda now: now.camera_mount,
    "offset": lambda now: now.camera_mount,
    "sim_tags": lambda now: parse_placed(now.sim_tags, now.families[0]),
}


class ModuleSettings:
    """The settings of the loaded module: validated, whichever way they come in."""

    def __init__(self, given: dict[str, Any] | None = None) -> None:
        """Take `given` settings.

        Raises:
            BadSetting: as `set`.
        """
        self.mp = MPSettings(table())
        for name, value in dict(given or {}).items():
            self.set(name, value)

    def set(self, name: str, value: Any) -> None:
        """Set one.

        Raises:
            BadSetting: unknown, of the wrong type, out of range, or not to be understood.
        """
        if name not in self.mp.list():
            near = difflib.get_close_matches(name, self.mp.list(), n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(self.mp.list())}"
            raise BadSetting(f"no setting {name!r}; {hint}", name)
        setting, before = self.mp.get_setting(name), self.mp.get(name)
        if setting.choice and value not in setting.choice:
            raise BadSetting(f"{name} = {value!r}: it is one of {', '.join(setting.choice)}", name)
        if not self.mp.set(name, value):
            limits = f" from {setting.range[0]} to {setting.range[1]}" if setting.range else ""
            raise BadSetting(f"{name} = {value!r}: it takes a {setting.type.__name__}{limits}", name)
        try:
            if name in CHECKED:
                CHECKED[name](self.snapshot())
        except BadSetting:
            self.mp.set(name, before)
            raise

    def snapshot(self) -> Settings:
        """The settings as they are now."""
        return Settings(**{name: self.mp.get(name) for name in self.mp.list()})
