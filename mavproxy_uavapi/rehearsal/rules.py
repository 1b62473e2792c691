"""What a rehearsal has broken. Pure: a record in, sentences out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.rehearsal.record import Asked, Record, Sample, metres

HARD = 2.0  # m/s down at the ground; ArduPilot's LAND_SPEED is 0.5
IN_THE_AIR = 1.0  # m above home
SLACK = 0.5  # m that a vehicle may be outside of its envelope: the stop at the border is no sharper
SAME_TIME = 0.3  # s between two samples that are of one moment
REACTION = 1.0  # s after the pilot's switch in which a script may not know of it yet
BREAKING = ("outside_envelope", "too_near")
FREE = ("/movement/stop",)  # a script may always ask for it: nothing is sent to a vehicle that its pilot has


@dataclass(frozen=True)
class Limits:
    """What a flight must keep besides what is always asked of it.

    Attributes:
        space: the envelope; None for none.
        separation: m between any two vehicles in the air; 0 for none.
        reserve: % that the battery must have at the end; 0 where it is not measured.
    """

    space: Space | None = None
    separation: float = 0.0
    reserve: float = 0.0


@dataclass(frozen=True)
class Broken:
    """A rule that was broken: its name, when (s on the vehicle's clock), by which vehicle, and a sentence."""

    rule: str
    at: float
    system: int
    sentence: str


RULES = ("ended", "ground", "pilot", "envelope", "separation", "battery")


def broken(record: Record, limits: Limits) -> list[Broken]:
    """Everything that was broken, in the order of time; each rule once for each vehicle."""
    found: dict[tuple[str, int], Broken] = {}
    for one in sorted(_all(record, limits), key=lambda one: one.at):
        found.setdefault((one.rule, one.system), one)
    return sorted(found.values(), key=lambda one: one.at)


def _all(record: Record, limits: Limits) -> Iterator[Broken]:
    for system, samples in record.samples.items():
        if not samples:
            continue
        if system not in record.switched_at:  # he flies it on
            yield from _ended(system, samples[-1])
        yield from _ground(system, samples)
        if limits.space is not None:
            yield from _envelope(system, samples, limits.space)
        if limits.reserve and samples[-1].battery is not None and samples[-1].battery < limits.reserve:
            sentence = f"{samples[-1].battery:.0f} % are left of the battery, less than {limits.reserve:g} %"
            yield Broken("battery", samples[-1].at, system, sentence)
    for asked in record.asked.values():
        yield from _asked(asked)
    for system, at in record.switched_at.items():
        yield from _pilot(system, at, record.asked.values())
    if limits.separation:
        yield from _separation(record, limits.separation)


def _ended(system: int, last: Sample) -> Iterator[Broken]:
    if last.armed and last.height > IN_THE_AIR:
        sentence = f"it is still in the air at the end, {last.height:.0f} m above home in {last.mode}"
        yield Broken("ended", last.at, system, sentence)


def _ground(system: int, samples: list[Sample]) -> Iterator[Broken]:
    for before, after in zip(samples, samples[1:], strict=False):
        if after.landed and not before.landed and before.sinking > HARD:
            yield Broken("ground", after.at, system, f"it meets the ground at {before.sinking:.1f} m/s")
        elif before.armed and not before.landed and before.height > IN_THE_AIR and not after.armed:
            yield Broken("ground", after.at, system, f"its motors stop {before.height:.0f} m above home")


def _envelope(system: int, samples: list[Sample], space: Space) -> Iterator[Broken]:
    home = (samples[0].lat, samples[0].lon)
    frame = space.frame(home)
    begin = frame.spot(home, 0.0)
    drives = not any(sample.armed and not sample.landed for sample in samples)
    rules = space.rules((begin.north, begin.east), on_ground=drives)
    for sample in samples:
        if not sample.is_under_way:
            continue
        breach = space.breach([frame.spot((sample.lat, sample.lon), sample.height)], rules, may_return=False)
        if breach is not None and breach.by > SLACK:
            by = f" by {breach.by:.1f} m" if math.isfinite(breach.by) else ""
            yield Broken(
                "envelope", sample.at, system, f"it breaks {breach.what}{by}, {sample.height:.0f} m above home"
            )
            return


def _asked(asked: Asked) -> Iterator[Broken]:
    """A way that the envelope or the separation has refused: on another day it may be no guard's."""
    if asked.code in BREAKING:
        rule = "envelope" if asked.code == "outside_envelope" else "separation"
        yield Broken(rule, asked.at, asked.system, f"{asked.verb} was refused: {asked.detail}")


def _pilot(system: int, at: float, asked: Iterable[Asked]) -> Iterator[Broken]:
    """What was asked for when the script had been told that the pilot has it, or could have known."""
    knows, later = False, []
    for one in asked:
        if one.system == system and one.at >= at:
            if one.verb not in FREE and (knows or one.at > at + REACTION):
                later.append(one)
            knows = True
        elif one.system == system:
            knows = one.code == "mode_changed"
    if later:
        verbs = ", ".join(dict.fromkeys(one.verb for one in later))
        count = f"{len(later)} more commands" if len(later) > 1 else "another command"
        yield Broken("pilot", later[0].at, system, f"the pilot had it, and the script gave {count}: {verbs}")


def nearest(record: Record) -> Iterator[tuple[float, float, int, int]]:
    """For each two vehicles that were in the air together: m, s, and their system ids, where they were nearest."""
    systems = sorted(record.samples)
    for number, first in enumerate(systems):
        for second in systems[number + 1 :]:
            pairs = _together(record.samples[first], record.samples[second])
            near = min(((metres(a, b), a.at) for a, b in pairs), default=None)
            if near is not None:
                yield (*near, first, second)


def _together(ours: list[Sample], theirs: list[Sample]) -> Iterator[tuple[Sample, Sample]]:
    """The samples of one moment in which both fly."""
    number = 0
    for sample in ours:
        while number < len(theirs) and theirs[number].at < sample.at - SAME_TIME:
            number += 1
        other = theirs[number] if number < len(theirs) else None
        if (
            other is not None
            and abs(other.at - sample.at) <= SAME_TIME
            and sample.is_under_way
            and other.is_under_way
        ):
            yield sample, other


def _separation(record: Record, least: float) -> Iterator[Broken]:
    for distance, at, first, second in nearest(record):
        if distance < least:
            yield Broken(
                "separation", at, first, f"it is {distance:.1f} m from vehicle {second}, less than {least:g} m"
            )
