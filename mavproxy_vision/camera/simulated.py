"""The source `sim`: it renders the view of a simulated vehicle's camera."""

from __future__ import annotations

import random
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision.apriltag.tag_layout import FAMILIES, ID, NUMBER, require_id, require_size
from mavproxy_vision.camera.renderer import PlacedTag, Renderer
from mavproxy_vision.camera.source import Frame, Image
from mavproxy_vision.geometry.frames import Attitude, Vector

SHORTEST = 0.01  # s of latency: the pose for the frame must have arrived
COST_KEPT = 0.9  # of the time that a picture took to draw, for the next one
FARTHEST = 10_000.0  # m from home to a tag
PATTERN = re.compile(
    # family, id, size, then system id of a vehicle, or north, east, heading
    rf"(?:(\w+):)?({ID}):({NUMBER})@(?:v({ID})|({NUMBER}),({NUMBER})(?:,({NUMBER}))?)"
)

Where = Callable[[float], tuple[Vector, Attitude] | None]
Carried = Callable[[int, float], tuple[float, float, float] | None]


def place_of(tag: PlacedTag, carried: Carried, time: float) -> tuple[float, float, float] | None:
    """North, east (m from home) and heading (degrees) of a tag at host time `time`; None while unknown."""
    return carried(tag.carrier, time) if tag.carrier else (tag.north, tag.east, tag.heading)


def nobody(_system: int, _time: float) -> None:
    """No vehicle carries tags."""


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
        carried: gives north, east (m from home) and heading (degrees) of another vehicle, by system id and host time.
    """

    live = True

    def __init__(
        self,
        renderer: Renderer,
        where: Where,
        timing: Timing,
        clock: Callable[[], float] = time.monotonic,
        carried: Carried = nobody,
    ) -> None:
        self._placed, self._carried = renderer.tags, carried
        self.renderer, self.timing = renderer, timing
        self._where, self._clock = where, clock
        self._random = random.Random(0)
        self._tick = 0.0
        self._cost = 0.0  # s that a picture takes to draw, lately

    def open(self) -> None:
        """Start the first frame now."""
        self._tick = self._clock()

    def read(self) -> Frame | None:
        """Wait until the next frame is due and return it; None for a dropout or an unknown pose."""
        latency = self.latency()
        # A picture is drawn within its latency: a real camera's take no time of ours, and these are not to be later.
        lead = max(latency - self._cost, SHORTEST)
        now = self._clock()
        self._tick = max(self._tick + 1.0 / self.timing.rate, now - lead)
        time.sleep(max(self._tick + lead - now, 0.0))
        if self.is_lost():
            return None
        begun, due = self._clock(), self._tick + latency
        frame = self.frame(self._tick, due)
        now = self._clock()
        self._cost = max(now - begun, COST_KEPT * self._cost)
        time.sleep(max(due - now, 0.0))
        return None if frame is None else replace(frame, received_at=self._clock())

    def latency(self) -> float:
        """The next frame's latency, s."""
        return max(self._random.gauss(self.timing.latency, self.timing.jitter), SHORTEST)

    def frame(self, light: float, arrival: float) -> Frame | None:
        """The view at host time `light` (s) as a frame that arrives at `arrival`; None if the pose is unknown."""
        pose = self.pose(light)
        return None if pose is None else self.made(self.renderer.render(*pose), arrival)

    def pose(self, light: float) -> tuple[Vector, Attitude] | None:
        """Where the vehicle is at host time `light` (s), with the tags where they are then; None while unknown."""
        pose = self._where(light)
        if pose is not None and any(tag.carrier for tag in self._placed):
            self.renderer.tags = tuple(self._tags_at(light))
        return pose

    def made(self, image: Image, arrival: float) -> Frame:
        """A picture as a frame that arrives at host time `arrival` (s)."""
        return Frame(image, arrival - self.timing.assumed_latency, arrival)

    def is_lost(self) -> bool:
        """Whether the next frame never arrives."""
        return self._random.random() < self.timing.dropout

    def _tags_at(self, light: float) -> Iterator[PlacedTag]:
        for tag in self._placed:
            place = place_of(tag, self._carried, light)
            if place is not None:
                yield replace(tag, north=place[0], east=place[1], heading=place[2])

    def close(self) -> None:
        """Do nothing: there is nothing to release."""


def parse_placed(text: str, family: str) -> tuple[PlacedTag, ...]:
    """Parse `[FAMILY:]ID:SIZE@NORTH,EAST[,HEADING]` or `…@vSYSTEM`, separated by spaces or semicolons; or nothing.

    Raises:
        SettingError: the text is not such a list.
    """
    tags = []
    for word in re.split(r"[\s;]+", text.strip()):
        if not word:
            continue
        match = PATTERN.fullmatch(word)
        if match is None or (match[1] or family) not in FAMILIES:
            raise SettingError(f"sim_tags: {word!r} is not ID:SIZE@NORTH,EAST or …,HEADING, or @vSYSTEM", "sim_tags")
        size, north, east, heading = (float(part or 0) for part in (match[3], *match.groups()[4:]))
        tag = PlacedTag(match[1] or family, int(match[2]), size, north, east, heading, int(match[4] or 0))
        require_id("sim_tags", tag.family, tag.id)
        require_size("sim_tags", tag.size)
        if not (max(abs(tag.north), abs(tag.east)) <= FARTHEST and abs(tag.heading) <= 360):
            raise SettingError(f"sim_tags: {word!r} lies too far away, or heads beyond 360 degrees", "sim_tags")
        tags.append(tag)
    return tuple(tags)
