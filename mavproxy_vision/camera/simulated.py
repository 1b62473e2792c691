"""The source `sim`: it renders the view of a simulated vehicle's camera."""

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

SHORTEST = 0.01  # s of latency: the pose for the frame must have arrived
FARTHEST = 10_000.0  # m from home to a tag
PATTERN = re.compile(
    rf"(?:(\w+):)?({ID}):({NUMBER})@({NUMBER}),({NUMBER})(?:,({NUMBER}))?"  # family, id, size, north, east, heading
)

Where = Callable[[float], tuple[Vector, Attitude] | None]


@dataclass(frozen=True)
class Timing:
    """When frames arrive.

    Attributes:
        rate: frames per second.
        latency: s from capture to arrival.
        jitter: s, standard deviation of the latency.
        dropout: share of frames (0 to 1) that never arrive.
        assumed_latency: the latency (s) that the module assumes.
    """

    rate: float = 20.0
    latency: float = 0.08
    jitter: float = 0.01
    dropout: float = 0.0
    assumed_latency: float = 0.08


class SimulatedCamera:
    """Renders the view of a camera on the vehicle, on the wall clock.

    Args:
        renderer: the renderer.
        where: gives position (m NED from home) and attitude at a host time; called from the worker's thread.
        timing: rate and latency.
        clock: monotonic seconds.
        seed: for jitter and dropouts.
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
        """Wait until the next frame is due and return it; None for a dropout or an unknown pose."""
        timing = self.timing
        now = self._clock()
        latency = self.latency()
        self._tick = max(self._tick + 1.0 / timing.rate, now - latency)
        time.sleep(max(self._tick + latency - now, 0.0))
        if self._random.random() < timing.dropout:
            return None
        frame = self.frame(self._tick, self._clock())
        return None if frame is None else replace(frame, received_at=self._clock())  # rendering takes time

    def latency(self) -> float:
        """The next frame's latency, s."""
        return max(self._random.gauss(self.timing.latency, self.timing.jitter), SHORTEST)

    def frame(self, light: float, arrival: float) -> Frame | None:
        """The view at host time `light` (s) as a frame that arrives at `arrival`; None if the pose is unknown."""
        pose = self._where(light)
        if pose is None:
            return None
        return Frame(self.renderer.render(*pose), arrival - self.timing.assumed_latency, arrival)

    def close(self) -> None:
        """Do nothing: there is nothing to release."""


def parse_placed(text: str, family: str) -> tuple[PlacedTag, ...]:
    """Parse `[FAMILY:]ID:SIZE@NORTH,EAST[,HEADING]`, separated by spaces or semicolons; empty means no tag.

    Raises:
        SettingError: the text is not such a list.
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
