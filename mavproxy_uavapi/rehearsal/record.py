"""What a rehearsal records: where the vehicles were, what was asked of them, what they said. Pure data."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

AT_REST = 0.5  # m/s: slower than this it stands


class Sample(NamedTuple):
    """The truth about a vehicle at one moment.

    Attributes:
        at: s since the beginning, on the vehicle's clock.
        lat, lon: degrees.
        height: m above home.
        speed: m/s.
        sinking: m/s down.
        mode: its name.
        armed, landed: whether it is.
        battery: %; None where it is not measured.
        item: the number of the mission's item that is flown; 0 for none.
    """

    at: float
    lat: float
    lon: float
    height: float
    speed: float
    sinking: float
    mode: str
    armed: bool
    landed: bool
    battery: float | None
    item: int

    @property
    def is_under_way(self) -> bool:
        """Whether it flies, or drives."""
        return self.armed and (not self.landed or self.speed > AT_REST)


@dataclass
class Said:
    """What happened at a vehicle: a text of the autopilot, a mode, an arming, a job, a fault of the rehearsal."""

    at: float  # s since the beginning, on the vehicle's clock
    system: int
    kind: str
    text: str


@dataclass
class Asked:
    """A verb that the file, or what followed it, asked for.

    Attributes:
        at: s since the beginning, on the vehicle's clock.
        system: the vehicle.
        job: its number.
        verb: its path.
        client: who began it.
        request: its parameters.
        state: running, succeeded or failed.
        code: the error's word; empty for none.
        detail: the result, or the error's sentence.
        seconds: that it took.
    """

    at: float
    system: int
    job: str
    verb: str
    client: str
    request: dict[str, Any]
    state: str = "running"
    code: str = ""
    detail: str = ""
    seconds: float = 0.0


class Loss(NamedTuple):
    """Where a vehicle would end if something were lost for good at a moment of the flight.

    Attributes:
        at: s since the beginning, on the vehicle's clock: when it is lost.
        system: the vehicle.
        what: of LOSSES.
        lat, lon: degrees, of its end.
        height: m above home.
        mode: its name.
        armed: whether it still is: then it stays in the air, or drives on.
        seconds: until then.
    """

    at: float
    system: int
    what: str
    lat: float
    lon: float
    height: float
    mode: str
    armed: bool
    seconds: float


LOSSES = {"link": "silence", "gps": "ekf_bad"}  # what is lost, and the fault of the embedded vehicle


@dataclass
class Record:
    """A rehearsal.

    Attributes:
        file: the name of what was flown.
        samples: by system id, in their order.
        asked: by job.
        said: in their order.
        losses: where the vehicles would have ended, by moment.
        switched_at: when the pilot took a vehicle over, by system id; s on its clock.
        exit_status: of the script; None for a mission, or if it was killed by the rehearsal.
        failure: why the file failed; empty if it did not.
        missed: the faults whose moment never came.
        output: the end of what it has printed.
    """

    file: str
    samples: dict[int, list[Sample]] = field(default_factory=dict)
    asked: dict[str, Asked] = field(default_factory=dict)
    said: list[Said] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)
    switched_at: dict[int, float] = field(default_factory=dict)
    exit_status: int | None = None
    failure: str = ""
    missed: tuple[str, ...] = ()
    output: str = ""

    @property
    def duration(self) -> float:
        """s from the first arming to the last landing, on the vehicles' clocks; 0 if nothing flew."""
        armed = [sample.at for samples in self.samples.values() for sample in samples if sample.armed]
        return max(armed) - min(armed) if armed else 0.0

    def distance(self, system: int) -> float:
        """m that the vehicle has flown."""
        samples = self.samples.get(system, [])
        return sum(metres(a, b) for a, b in zip(samples, samples[1:], strict=False))

    def from_start(self, loss: Loss) -> float:
        """m over the ground from where the vehicle was at the beginning to where it would end."""
        first = self.samples[loss.system][0]
        return level(first, first._replace(lat=loss.lat, lon=loss.lon))

    def highest(self, system: int) -> float:
        """m above home."""
        return max((sample.height for sample in self.samples.get(system, [])), default=0.0)


METRES_PER_DEGREE = 111_319.5  # of latitude


def level(a: Sample, b: Sample) -> float:
    """m from one to the other, over the ground."""
    east = (b.lon - a.lon) * math.cos(math.radians(a.lat))
    return math.hypot(b.lat - a.lat, east) * METRES_PER_DEGREE


def metres(a: Sample, b: Sample) -> float:
    """m from one to the other."""
    return math.hypot(level(a, b), b.height - a.height)
