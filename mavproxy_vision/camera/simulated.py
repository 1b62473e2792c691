"""`sim`: a camera that sees what a simulated vehicle's camera would see."""

from __future__ import annotations

import random
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision.apriltag.tag_layout import FAMILIES, ID, NUMBER, require_id, require_size
from mavproxy_vision.camera.renderer import PlacedTag, Renderer
from mavproxy_vision.camera.source import Frame
from mavproxy_vision.geometry.frames import Attitude, Vector

SHORTEST = 0.01  # s of latency: what is drawn must have been heard of
FARTHEST = 10_000.0  # m from home that a tag may lie
PATTERN = re.compile(
    rf"(?:(\w+):)?({ID}):({NUMBER})@({NUMBER}),({NUMBER})(?:,({NUMBER}))?"  # family, id, size, north, east, heading
)

Where = Callable[[float], tuple[Vector, Attitude] | None]


@dataclass(frozen=True)
class Timing:
    """When frames come.

    Attributes:
        rate: frames per second.
        latency: s from light to arrival.
        jitter: s, standard deviation of the latency.
        dropout: share of frames (0 to 1) that never arrive.
        told: the latency (s) that the module believes.
    """

    rate: float = 20.0
    latency: float = 0.08
    jitter: float = 0.01
    dropout: float = 0.0
    told: float = 0.08


class SimulatedCamera:
    """Draws what a camera on the vehicle sees, in step with the wall clock.

    Args:
        renderer: draws.
        where: position (m NED from home) and attitude at a host time; asked from the worker's thread.
        timing: rate and latency.
        clock: monotonic seconds.
        seed: of jitter and dropouts.
    """

    live = True

    def __init__(
        self,
        renderer: Renderer,
        where: Where,
        timing: Timing,
        clock: Callable[[], float] = time.monotonic,
        seed: int = 0,
    ) -> None:
        self.renderer, self.timing = renderer, timing
        self._where, self._clock = where, clock
        self._random = random.Random(seed)
        self._tick = 0.0

    def open(self) -> None:
        """Start the first frame now."""
        self._tick = self._clock()

    def read(self) -> Frame | None:
        """The next frame, when its time has come."""
        timing = self.timing
        now = self._clock()
        latency = self.latency()
        self._tick = max(self._tick + 1.0 / timing.rate, now - latency)
        time.sleep(max(self._tick + latency - now, 0.0))
        if self._random.random() < timing.dropout:
            return None
        frame = self.frame(self._tick, self._clock())
        return None if frame is None else replace(frame, received_at=self._clock())  # drawing takes its time

    def latency(self) -> float:
        """The next frame's latency, s."""
        return max(self._random.gauss(self.timing.latency, self.timing.jitter), SHORTEST)

    def frame(self, light: float, arrival: float) -> Frame | None:
        """What the camera saw at host time `light` (s), arriving at `arrival`; None when nobody knows."""
        pose = self._where(light)
        if pose is None:
            return None
        return Frame(self.renderer.render(*pose), arrival - self.timing.told, arrival)

    def close(self) -> None:
        """Nothing to let go."""


def parse_placed(text: str, family: str) -> tuple[PlacedTag, ...]:
    """Read `[FAMILY:]ID:SIZE@NORTH,EAST[,HEADING]`, separated by spaces or semicolons; empty is no tag.

    Raises:
        SettingError: it is no such list.
    """
    tags = []
    for word in re.split(r"[\s;]+", text.strip()):
        if not word:
            continue
        match = PATTERN.fullmatch(word)
        if match is None or (match[1] or family) not in FAMILIES:
            raise SettingError(f"sim_tags: {word!r} is not ID:SIZE@NORTH,EAST or …,HEADING", "sim_tags")
        tag = PlacedTag(match[1] or family, int(match[2]), *(float(part or 0) for part in match.groups()[2:]))
        require_id("sim_tags", tag.family, tag.id)
        require_size("sim_tags", tag.size)
        if not (max(abs(tag.north), abs(tag.east)) <= FARTHEST and abs(tag.heading) <= 360):
            raise SettingError(f"sim_tags: {word!r} lies too far away, or heads beyond 360 degrees", "sim_tags")
        tags.append(tag)
    return tuple(tags)
