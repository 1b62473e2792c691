"""Exposure, gain and brightness of a camera: what is asked for, and what the camera took."""

from __future__ import annotations

import re
from collections.abc import Set
from dataclasses import asdict, dataclass
from typing import Any

import cv2

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.values import NUMBER

AUTOMATIC = "auto"
LONGEST = 1000.0  # ms of exposure
REFUSED = "refused"
NO_SUCH = "not of this source"
V4L2_MANUAL = 1.0  # of V4L2's control exposure_auto
V4L2_AUTOMATIC = (3.0, 0.0)  # aperture priority, which most cameras have, and fully automatic
V4L2_UNIT = 0.1  # ms; V4L2's control exposure_time_absolute counts these
LIBCAMERA = "libcamerasrc"
# The properties of libcamerasrc; not every version has each of them.
PROPERTIES = {"exposure": "exposure-time", "gain": "analogue-gain", "brightness": "brightness"}


@dataclass(frozen=True)
class Controls:
    """What a camera is asked for; it keeps its own value where this has None.

    Attributes:
        exposure: ms; 0 for automatic exposure.
        gain, brightness: in the camera's units; libcamera's gain is a factor, its brightness is -1 to 1.
    """

    exposure: float | None = None
    gain: float | None = None
    brightness: float | None = None

    @property
    def requested(self) -> dict[str, float]:
        """The values that are asked for, by name."""
        return {name: value for name, value in asdict(self).items() if value is not None}

    def without_effect(self, why: str) -> dict[str, str]:
        """The same answer for each value that is asked for."""
        return dict.fromkeys(self.requested, why)


NO_CONTROLS = Controls()


def parse_controls(exposure: str, gain: str, brightness: str) -> Controls:
    """The controls of three settings; an empty text asks for nothing.

    Raises:
        SettingError: a text is not a number, or the exposure is out of range.
    """
    time = 0.0 if exposure == AUTOMATIC else _number("exposure", exposure)
    if time is not None and exposure != AUTOMATIC and not 0 < time <= LONGEST:
        raise SettingError(f"exposure: {exposure} is not above 0 and at most {LONGEST:g} ms", "exposure")
    return Controls(time, _number("gain", gain), _number("brightness", brightness))


def _number(name: str, text: str) -> float | None:
    if text and not re.fullmatch(NUMBER, text):
        raise SettingError(f"{name}: {text!r} is not a number", name)
    return float(text) if text else None


def set_v4l2(capture: Any, controls: Controls) -> dict[str, str]:
    """Set the controls of a V4L2 camera that OpenCV has opened.

    Returns:
        What the camera has now, read back from it, by name.
    """
    taken: dict[str, str] = {}
    if controls.exposure == 0:
        is_set = any(capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, way) for way in V4L2_AUTOMATIC)
        taken["exposure"] = AUTOMATIC if is_set else REFUSED
    elif controls.exposure is not None:
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, V4L2_MANUAL)  # a camera without automatic exposure refuses this
        count = _set_and_read(capture, cv2.CAP_PROP_EXPOSURE, max(round(controls.exposure / V4L2_UNIT), 1))
        taken["exposure"] = REFUSED if count is None else f"{count * V4L2_UNIT:g} ms"
    for name, number in (("gain", cv2.CAP_PROP_GAIN), ("brightness", cv2.CAP_PROP_BRIGHTNESS)):
        if name in controls.requested:
            value = _set_and_read(capture, number, controls.requested[name])
            taken[name] = REFUSED if value is None else f"{value:g}"
    return taken


def _set_and_read(capture: Any, number: int, value: float) -> float | None:
    """The value that the camera has after the request; None if it refuses."""
    return float(capture.get(number)) if capture.set(number, value) else None


def is_libcamera(pipeline: str) -> bool:
    """Whether a pipeline begins with libcamera's camera."""
    return pipeline.split()[:1] == [LIBCAMERA]


def with_properties(pipeline: str, controls: Controls, known: Set[str]) -> tuple[str, dict[str, str]]:
    """A pipeline of libcamerasrc with the controls as its properties.

    GStreamer does not read them back, so the answer says what is requested.

    Args:
        pipeline: its properties win over the controls.
        controls: the request.
        known: the properties that this version of libcamerasrc has.

    Returns:
        The pipeline, and by name what is requested.
    """
    source, taken = pipeline.partition("!")[0], {}
    added: list[str] = []
    for name, value in controls.requested.items():
        member, mode = PROPERTIES[name], f"{PROPERTIES[name]}-mode"
        automatic = name == "exposure" and value == 0
        if re.search(rf"\b{member}\s*=", source):
            taken[name] = "set in the pipeline"
        elif member not in known:
            taken[name] = f"this {LIBCAMERA} has no {member}"
        elif automatic:
            added += [f"{mode}=auto"] if mode in known else []
            taken[name] = AUTOMATIC
        else:
            added += [f"{mode}=manual"] if mode in known else []
            added.append(f"{member}={round(1000 * value) if name == 'exposure' else f'{value:g}'}")
            taken[name] = f"{value:g} ms requested" if name == "exposure" else f"{value:g} requested"
    return pipeline.replace(LIBCAMERA, " ".join([LIBCAMERA, *added]), 1), taken
