"""The vehicles that a run simulates: their types, system ids, numbers and homes. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mavproxy_uavapi.launcher.locations import HomePosition
from mavproxy_uavapi.launcher.options import RunOptions

METRES_PER_DEGREE = 111_319.5  # of latitude


@dataclass(frozen=True)
class SimulatedVehicle:
    """One vehicle to simulate.

    Attributes:
        kind: copter, plane, quadplane or rover.
        sysid: its MAVLink system id.
        instance: its number, which sets its ports.
        home: its start position.
    """

    kind: str
    sysid: int
    instance: int
    home: HomePosition


def kinds(options: RunOptions) -> list[str]:
    """The type of each vehicle: `--vehicles copter:8,rover:2`, or `--count` times `--vehicle`."""
    if options.vehicles:
        return [kind for kind, count in options.vehicles for _ in range(count)]
    return [options.vehicle] * options.count


def fleet(options: RunOptions, home: HomePosition, instances: Sequence[int]) -> list[SimulatedVehicle]:
    """The vehicles, with system ids from `options.sysid` on, in a row to the east of `home`."""
    return [
        SimulatedVehicle(kind, options.sysid + number, instance, east_of(home, number * options.spacing))
        for number, (kind, instance) in enumerate(zip(kinds(options), instances, strict=True))
    ]


def east_of(home: HomePosition, metres: float) -> HomePosition:
    """The same home, `metres` further east."""
    return home._replace(lon=home.lon + metres / (METRES_PER_DEGREE * math.cos(math.radians(home.lat))))
