"""The module's settings: MPSettings at the prompt -> one frozen snapshot handed inward."""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from MAVProxy.modules.lib.mp_settings import MPSetting, MPSettings

from mavproxy_vision.apriltag.tag_layout import FAMILIES, NUMBER, Tag, parse_families, parse_tags
from mavproxy_vision.camera.calibration import load
from mavproxy_vision.camera.renderer import Look
from mavproxy_vision.camera.simulated import Timing, parse_placed
from mavproxy_vision.errors import BadSetting
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Mount
from mavproxy_vision.paths import path_of

METHODS = ("velocity", "landing_target")
ON_FAILURE = ("rtl", "land", "hold")
TURN, ARM = 360.0, 10.0  # degrees that a camera may be turned, and m that it may be off the vehicle's centre
YES = ("1", "true", "yes")
WRITTEN = {  # how values of a type are written; its constructor takes all that
    str: re.compile(r"(?s).*"),
    bool: re.compile(r"1|true|yes|0|false|no", re.IGNORECASE),
    int: re.compile(r"[-+]?[0-9]{1,9}"),
    float: re.compile(NUMBER),
}


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
        return parse_tags(self.tags, self.families[0])

    @functools.cached_property
    def model(self) -> CameraModel:
        """The calibration's camera, as its file was when it was first asked for, or one of the field of view."""
        if self.calibration:
            return load(path_of(self.calibration, "calibration"))
        return CameraModel.from_field_of_view(self.width, self.height, self.fov)

    @property
    def camera_mount(self) -> Mount:
        """How the camera sits on the vehicle."""
        angles = numbers(self.mount, "mount", TURN)
        roll, pitch, yaw = angles if len(angles) == 3 else (0.0, 0.0, angles[0])
        offset = numbers(self.offset, "offset", ARM)
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


def numbers(text: str, name: str, most: float) -> list[float]:
    """One number, or three with commas, between -`most` and `most`.

    Raises:
        BadSetting: neither, or beyond that.
    """
    parts = [part.strip() for part in text.split(",")]
    if len(parts) not in (1, 3) or not all(re.fullmatch(NUMBER, part) for part in parts):
        raise BadSetting(f"{name}: {text!r} is not one number, nor three with commas", name)
    found = [float(part) for part in parts]
    if max(abs(number) for number in found) > most:
        raise BadSetting(f"{name}: {text!r} goes beyond {most:g}", name)
    return found


def table() -> list[Any]:
    """The settings with their types, defaults and ranges, as MAVProxy knows them."""
    return [
        MPSetting("source", str, "", "camera:0, a path, URL or folder, sim, http; none for no camera"),
        MPSetting("family", str, "36h11", f"one or several of {', '.join(FAMILIES)}; landed on is the first"),
        MPSetting("tags", str, "0:0.30", "ID:SIZE or ID:SIZE@RIGHT,UP in m; the main tag first"),
        MPSetting("any_id", bool, False, "look for all ids of the families, not only for those of tags"),
        MPSetting("far", bool, False, "see a fifth farther, for a third more time"),
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


# What is looked at when one of some settings changes: each raises BadSetting.
CHECKS: tuple[tuple[set[str], Callable[[Settings], object]], ...] = (
    ({"source"}, lambda now: path_of(now.source, "source")),
    ({"directory"}, lambda now: path_of(now.directory, "directory")),
    ({"family", "tags"}, lambda now: now.tag_list),
    ({"calibration"}, lambda now: now.model),
    ({"mount", "offset"}, lambda now: now.camera_mount),
    ({"family", "sim_tags"}, lambda now: parse_placed(now.sim_tags, now.families[0])),
)


class ModuleSettings:
    """The settings of the loaded module: validated, whichever way they come in."""

    def __init__(self, given: Mapping[str, Any] | None = None) -> None:
        """Take `given` settings, all together.

        Raises:
            BadSetting: as `set`.
        """
        self.mp = MPSettings(table())
        self._take(given or {})

    def set(self, name: str, value: Any) -> None:
        """Set one; a value that is refused leaves everything as it was.

        Raises:
            BadSetting: unknown, of the wrong type, out of range, not to be understood, or against the others.
        """
        self._take({name: value})

    def _take(self, given: Mapping[str, Any]) -> None:
        values = {name: self._typed(name, value) for name, value in given.items()}
        wanted = replace(self.snapshot(), **values)
        for names, check in CHECKS:
            if not names.isdisjoint(values):
                check(wanted)
        for name, value in values.items():
            self.mp.set(name, value)

    def _typed(self, name: str, value: Any) -> Any:
        """The value as the setting's type has it; MPSettings would print lines of its own about a bad one."""
        if name not in self.mp.list():
            near = difflib.get_close_matches(name, self.mp.list(), n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(self.mp.list())}"
            raise BadSetting(f"no setting {name!r}; {hint}", name)
        setting = self.mp.get_setting(name)
        if setting.choice and value not in setting.choice:
            raise BadSetting(f"{name} = {value!r}: it is one of {', '.join(setting.choice)}", name)
        kind, limits = setting.type, setting.range
        written = isinstance(value, str | int | float) and WRITTEN[kind].fullmatch(str(value))
        typed = _converted(kind, str(value)) if written else None
        if typed is None or (limits and not limits[0] <= typed <= limits[1]):
            told = f" from {limits[0]} to {limits[1]}" if limits else ""
            raise BadSetting(f"{name} = {value!r}: it takes a {kind.__name__}{told}", name)
        return typed

    def snapshot(self) -> Settings:
        """The settings as they are now."""
        return Settings(**{name: self.mp.get(name) for name in self.mp.list()})


def _converted(kind: type, text: str) -> Any:
    return text.lower() in YES if kind is bool else kind(text)
