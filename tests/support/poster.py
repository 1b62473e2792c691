"""Somebody else's camera: draws what a lens under the vehicle would show, and posts it to `/vision/frame`.

What is in front of the lens, and what is wrong with it, can be changed at any time. It hangs on a gimbal, so that the
vehicle's tilt does not matter; where the vehicle is it takes from its telemetry, on ArduPilot and the embedded
vehicle alike.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import requests

from mavproxy_vision.camera.renderer import Look, PlacedTag, Renderer
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector

PERIOD = 0.06  # s between two frames
FORESEEN = 0.5  # s of the vehicle's clock that it is taken to move on as it did
SIZE, FIELD_OF_VIEW = (480, 360), 56.145


class Poster:
    """Posts frames as long as the context lasts.

    Attributes:
        answers: the HTTP statuses of all posts.
        height: of the lens above the ground in the newest frame, m.
        frozen: whether it posts the same frame again and again.
        hidden: called with the height (m); true hides all tags.
        covered: called with the height (m); true has something lie over half of each tag.

    Args:
        rig: the vehicle and its API.
        tags: what lies on the ground, in m NED of the vehicle's EKF.
        speedup: seconds of the vehicle for each of ours.
        mount: how it truly hangs (degrees), whatever the settings say.
    """

    def __init__(self, rig: Any, *tags: PlacedTag, speedup: float, mount: float = 0.0) -> None:
        self._rig, self._speedup, self._stop = rig, speedup, threading.Event()
        self._model = CameraModel.from_field_of_view(*SIZE, FIELD_OF_VIEW)
        self._mount, self._tags = Mount(yaw=mount, gimbal=True), tags
        self._clear = self._renderer(Look(), tags)
        self._covered = self._renderer(Look(occlusion=0.5), tags)
        self._bare = self._renderer(Look(), ())
        self._session = requests.Session()
        self._thread = threading.Thread(target=self._run, name="poster")
        self._data = b""
        self._reported: dict[str, dict[str, Any]] = {}
        self.answers: list[int] = []
        self.height = math.nan
        self.frozen = False
        self.hidden: Callable[[float], bool] = lambda _: False
        self.covered: Callable[[float], bool] = lambda _: False

    def _renderer(self, look: Look, tags: tuple[PlacedTag, ...]) -> Renderer:
        return Renderer(self._model, self._mount, tags, look)

    def __enter__(self) -> Poster:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(10)

    def _run(self) -> None:
        while not self._stop.wait(PERIOD):
            light = time.monotonic()
            if not self.frozen or not self._data:
                self._data = self._picture()
            query = {"latency": 1000 * (time.monotonic() - light)}
            answer = self._session.post(self._rig.url + "/vision/frame", params=query, data=self._data, timeout=10)
            self.answers.append(answer.status_code)

    def _picture(self) -> bytes:
        place, attitude = self._message("LOCAL_POSITION_NED"), self._message("ATTITUDE")
        here = vector(place["x"], place["y"], place["z"])
        here += vector(place["vx"], place["vy"], place["vz"]) * place["age"]
        self.height = -float(here[2])
        renderer = self._covered if self.covered(self.height) else self._clear
        renderer = self._bare if self.hidden(self.height) else renderer
        image = renderer.render(here, Attitude(yaw=attitude["yaw"] + attitude["yawspeed"] * attitude["age"]))
        return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()

    def _message(self, name: str) -> dict[str, Any]:
        """A message's fields, and the vehicle's seconds since then as `age`, for as long as that tells anything.

        While nobody hears the vehicle, the camera goes on showing what it showed.
        """
        answer = self._session.get(f"{self._rig.url}/telemetry/message/{name}", timeout=10)
        if answer.status_code == 503 and name in self._reported:
            return self._reported[name]
        body = answer.json()
        self._reported[name] = {**body["info"], "age": min(body["age_s"] * self._speedup, FORESEEN)}
        return self._reported[name]


def tag_near(rig: Any, north: float = 0.6, east: float = -0.5, number: int = 0, size: float = 0.30) -> PlacedTag:
    """A tag so many metres from where the vehicle is now."""
    x, y, _ = rig.ned()
    return replace(PlacedTag("36h11", number, size, 0.0, 0.0), north=x + north, east=y + east)
