"""The settings of the module `vision`."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Set
from dataclasses import asdict, dataclass, fields
from typing import Any

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.settings import ModuleSettings, setting
from mavproxy_uavapi.core.values import NUMBER, path_of
from mavproxy_vision.apriltag.tag_layout import FAMILIES, Tag, parse_families, parse_tags
from mavproxy_vision.camera.calibration import load
from mavproxy_vision.camera.controls import LONGEST, Controls, parse_controls
from mavproxy_vision.camera.renderer import Look
from mavproxy_vision.camera.simulated import Timing, parse_placed
from mavproxy_vision.camera.source import masked_source
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Mount

SOURCES = "camera:0, a path, URL or folder, sim, http"  # as `make_source` knows them
METHODS = ("velocity", "landing_target")
TARGETS = ("resting", "moving")
SIMULATED = "sim"  # the source
OF_THIS_MACHINE = ("source", "vehicle", "directory", "threads")  # they decide nothing about a flight
ON_FAILURE = ("rtl", "land", "hold")
TURN, ARM = 360.0, 10.0  # largest turn of a camera in degrees, and its largest offset from the vehicle's centre in m


@dataclass(frozen=True)
class VisionSettings:
    """A snapshot of the settings, each with its row of the table: what it means, and in which unit."""

    source: str = setting(str, "", f"{SOURCES}; none for no camera")
    vehicle: int = setting(int, 0, "system id that carries it; 0: MAVProxy's current one", range=(0, 255))
    family: str = setting(str, "36h11", f"one or several of {', '.join(FAMILIES)}; landings use the first")
    tags: str = setting(str, "0:0.30", "ID:SIZE or ID:SIZE@RIGHT,UP in m; the main tag first")
    any_id: bool = setting(bool, False, "look for all ids of the families, not only for those of tags")
    far: bool = setting(bool, False, "see a fifth farther, for a third more time")
    calibration: str = setting(str, "", "file that `vision calibrate` wrote; replaces fov, width, height")
    fov: float = setting(float, 56.145, "degrees, horizontal", range=(5, 170))
    width: int = setting(int, 640, "px", range=(64, 8192))
    height: int = setting(int, 480, "px", range=(48, 8192))
    fps: float = setting(float, 20.0, "frames per second", range=(0.5, 240))
    exposure: str = setting(str, "", f"ms up to {LONGEST:g}, or auto; empty leaves it to the camera")
    gain: str = setting(str, "", "in the camera's units; of libcamerasrc a factor; empty leaves it")
    brightness: str = setting(str, "", "in the camera's units; of libcamerasrc -1 to 1; empty leaves it")
    latency: float = setting(float, 80.0, "ms from capture to arrival", range=(0, 2000))
    mount: str = setting(str, "0", "degrees: yaw, or roll,pitch,yaw; yaw 90: top of the image to the right")
    offset: str = setting(str, "0,0,0", "m of the lens forward,right,down of the vehicle's centre")
    gimbal: bool = setting(bool, False, "a gimbal keeps the camera level")
    method: str = setting(str, "velocity", "velocity (GUIDED) or landing_target (LAND with PLND)", choice=METHODS)
    target: str = setting(str, "resting", "resting, or moving: lands on a tag that moves", choice=TARGETS)
    attempts: int = setting(int, 5, "searches before a landing fails", range=(1, 100))
    tolerance: float = setting(float, 0.12, "m off the tag within which it may touch down", range=(0.02, 5))
    speed: float = setting(float, 1.5, "m/s, horizontally, of a search and a landing", range=(0.1, 10))
    mission_speed: float = setting(float, 0.0, "m/s on the way of a mission; 0: the vehicle's own", range=(0, 30))
    descent: float = setting(float, 1.0, "m/s, at most", range=(0.1, 3))
    leash: float = setting(float, 15.0, "m that a search may go away", range=(0.5, 500))
    time_limit: float = setting(float, 180.0, "s for a landing or a search", range=(5, 3600))
    on_failure: str = setting(str, "rtl", "rtl, land or hold when there is no landing on the tag", choice=ON_FAILURE)
    ground: float = setting(float, 0.0, "m by which the tag lies higher than home", range=(-500, 500))
    directory: str = setting(str, "", "where tracks, plots and snapshots go; none for MAVProxy's log directory")
    threads: int = setting(int, 1, "threads of OpenCV", range=(1, 16))
    sim_tags: str = setting(str, "0:0.30@8,-5", "ID:SIZE@NORTH,EAST[,HEADING] of home, or ID:SIZE@vSYSTEM")
    sim_latency: float = setting(float, 80.0, "ms", range=(10, 1000))
    sim_jitter: float = setting(float, 10.0, "ms, standard deviation", range=(0, 200))
    sim_dropout: float = setting(float, 0.0, "share of the frames", range=(0, 1))
    sim_noise: float = setting(float, 5.0, "standard deviation, of 255", range=(0, 60))
    sim_blur: float = setting(float, 0.7, "px", range=(0, 10))
    sim_exposure: float = setting(float, 1.0, "factor", range=(0.05, 5))
    sim_occlusion: float = setting(float, 0.0, "share of each tag that is covered", range=(0, 1))

    @property
    def shown_source(self) -> str:
        """The source without its passwords."""
        return masked_source(self.source)

    @property
    def changed(self) -> dict[str, Any]:
        """Those that decide how a flight goes and are not as usual; of a simulated camera only where there is one."""
        usual = {one.name: one.metadata["row"][1] for one in fields(self)}
        left_out = (*OF_THIS_MACHINE, *(() if self.source == SIMULATED else ("sim_",)))
        return {
            name: value
            for name, value in asdict(self).items()
            if value != usual[name] and not name.startswith(left_out)
        }

    @property
    def families(self) -> tuple[str, ...]:
        """The families to look for; landings use the tags of the first one."""
        return parse_families(self.family)

    @property
    def tag_list(self) -> tuple[Tag, ...]:
        """The target's tags, the main one first."""
        return parse_tags(self.tags, self.families[0])

    @functools.cached_property
    def model(self) -> CameraModel:
        """The calibration's camera, as its file was at the first read, or one with the field of view."""
        if self.calibration:
            return load(path_of(self.calibration, "calibration"))
        return CameraModel.from_field_of_view(self.width, self.height, self.fov)

    @property
    def camera_mount(self) -> Mount:
        """The camera's position and orientation on the vehicle."""
        angles = numbers(self.mount, "mount", TURN)
        roll, pitch, yaw = angles if len(angles) == 3 else (0.0, 0.0, angles[0])
        offset = numbers(self.offset, "offset", ARM)
        if len(offset) != 3:
            raise SettingError("offset: forward,right,down in m, such as 0.1,0,0.05", "offset")
        return Mount(roll, pitch, yaw, (offset[0], offset[1], offset[2]), self.gimbal)

    @property
    def controls(self) -> Controls:
        """What the camera is asked for."""
        return parse_controls(self.exposure, self.gain, self.brightness)

    @property
    def timing(self) -> Timing:
        """The timing of the simulated camera's frames."""
        jitter, dropout = self.sim_jitter / 1000, self.sim_dropout
        return Timing(self.fps, self.sim_latency / 1000, jitter, dropout, self.latency / 1000)

    @property
    def look(self) -> Look:
        """The image quality of the simulated camera."""
        return Look(self.sim_noise, self.sim_blur, self.sim_exposure, self.sim_occlusion)


def numbers(text: str, name: str, most: float) -> list[float]:
    """One number, or three with commas, between -`most` and `most`.

    Raises:
        SettingError: the text is neither, or out of range.
    """
    parts = [part.strip() for part in text.split(",")]
    if len(parts) not in (1, 3) or not all(re.fullmatch(NUMBER, part) for part in parts):
        raise SettingError(f"{name}: {text!r} is not one number, nor three with commas", name)
    values = [float(part) for part in parts]
    if max(abs(number) for number in values) > most:
        raise SettingError(f"{name}: {text!r} goes beyond {most:g}", name)
    return values


# The check of each setting after a change; each raises SettingError.
CHECKS: tuple[tuple[set[str], Callable[[VisionSettings], object]], ...] = (
    ({"source"}, lambda now: path_of(now.source, "source")),
    ({"directory"}, lambda now: path_of(now.directory, "directory")),
    ({"family", "tags"}, lambda now: now.tag_list),
    ({"calibration"}, lambda now: now.model),
    ({"exposure", "gain", "brightness"}, lambda now: now.controls),
    ({"mount", "offset"}, lambda now: now.camera_mount),
    ({"family", "sim_tags"}, lambda now: parse_placed(now.sim_tags, now.families[0])),
)


class VisionModuleSettings(ModuleSettings[VisionSettings]):
    """The settings of the loaded module."""

    module, snapshot_class = "vision", VisionSettings

    def check(self, settings: VisionSettings, changed: Set[str]) -> None:
        """Check the changed settings and those that depend on them."""
        for names, look in CHECKS:
            if not names.isdisjoint(changed):
                look(settings)

    def shown(self, name: str) -> str:
        """As any setting; the source without its passwords."""
        text = super().shown(name)
        return masked_source(text) if name == "source" else text
