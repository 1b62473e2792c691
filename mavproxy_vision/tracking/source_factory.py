"""Makes the camera source that the settings name."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mavproxy_vision.camera.gstreamer import Pipeline
from mavproxy_vision.camera.opencv_capture import Capture
from mavproxy_vision.camera.renderer import Renderer
from mavproxy_vision.camera.simulated import Carried, SimulatedCamera, nobody, parse_placed
from mavproxy_vision.camera.source import Folder, Posted, Source
from mavproxy_vision.settings import VisionSettings


def make_source(
    settings: VisionSettings, where: Any, clock: Callable[[], float], carried: Carried = nobody
) -> Source:
    """The source that the settings name.

    Raises:
        SettingError: one of the source's settings is invalid.
    """
    spec, latency = settings.source, settings.latency / 1000
    if spec == "sim":
        tags = parse_placed(settings.sim_tags, settings.families[0])
        renderer = Renderer(settings.model, settings.camera_mount, tags, settings.look)
        return SimulatedCamera(renderer, where, settings.timing, clock, carried=carried)
    if spec == "http":
        return Posted(latency, clock)
    path = os.path.expanduser(spec)
    if os.path.isdir(path):  # Path.is_dir raises on a long pipeline
        return Folder(Path(path), latency, settings.fps, clock)
    size = (settings.model.width, settings.model.height)
    is_file = os.path.isfile(path)
    if "!" in spec and not is_file:
        return Pipeline(spec, latency, size, clock, controls=settings.controls)
    camera = path if is_file else spec
    return Capture(camera, latency, size, settings.fps, clock, controls=settings.controls)
