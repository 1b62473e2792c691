"""Records of rehearsals, made by hand."""

from __future__ import annotations

from typing import Any

from mavproxy_uavapi.rehearsal.record import Asked, Record, Sample

HOME = (-35.363261, 149.165230)
DEGREES_PER_METRE = 1 / 111_319.5


def sample(at: float, north: float = 0.0, height: float = 0.0, **more: Any) -> Sample:
    """A vehicle so many m north of home; in the air and armed where it is above the ground."""
    flies = height > 0
    usual = {"speed": 0.0, "sinking": 0.0, "mode": "GUIDED", "armed": flies, "landed": not flies}
    values: dict[str, Any] = {**usual, "battery": None, "item": 0, **more}
    return Sample(at, HOME[0] + north * DEGREES_PER_METRE, HOME[1], height, **values)


def asked(at: float, verb: str, **more: Any) -> Asked:
    """A verb of vehicle 1."""
    return Asked(at, 1, f"{at:g}", verb, "127.0.0.1", {}, **more)


def record(*samples: Sample, commands: tuple[Asked, ...] = (), **more: Any) -> Record:
    """The record of vehicle 1."""
    return Record("a.py", {1: list(samples)}, {one.job: one for one in commands}, **more)
