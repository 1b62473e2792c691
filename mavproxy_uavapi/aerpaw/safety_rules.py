"""What a safety checker allows: a region of polygons, speeds and altitudes. Pure, but for reading its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mavproxy_uavapi.aerpaw.constants import VEHICLE_TYPE_COPTER, VEHICLE_TYPE_ROVER
from mavproxy_uavapi.aerpaw.geofence import Point, do_intersect, inside, polygon_edges, read_geofence
from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.core.strict_json import is_finite_number, shown

Verdict = tuple[bool, str]  # whether it is allowed, and if not, the reason
ALLOWED: Verdict = (True, "")

VEHICLE_TYPES = (VEHICLE_TYPE_COPTER, VEHICLE_TYPE_ROVER)
NEEDED = ("vehicle_type", "max_speed", "min_speed", "include_geofences", "exclude_geofences")
NEEDED_BY_COPTERS = ("max_alt", "min_alt")


@dataclass(frozen=True)
class SafetyRules:
    """The limits of one vehicle.

    Attributes:
        vehicle_type: copter or rover.
        min_speed, max_speed: m/s.
        altitudes: least and greatest altitude of a copter, m above home; None for a rover.
        include: the vehicle stays in one of these polygons.
        exclude: it does not enter these.
    """

    vehicle_type: str
    min_speed: float
    max_speed: float
    altitudes: tuple[float, float] | None
    include: tuple[Sequence[Point], ...]
    exclude: tuple[Sequence[Point], ...]

    def check_waypoint(self, here: Coordinate, there: Coordinate) -> Verdict:
        """Whether the straight way from `here` to `there` is allowed."""
        if self.altitudes and not self.altitudes[0] <= there.alt <= self.altitudes[1]:
            return False, f"Invalid waypoint: {self._altitude_error(there.alt)}"
        home_of = next((fence for fence in self.include if inside(there.lon, there.lat, fence)), None)
        if home_of is None:
            return False, f"Invalid waypoint: {there} is outside of the geofence"
        if any(inside(there.lon, there.lat, zone) for zone in self.exclude):
            return False, f"Invalid waypoint: {there} is inside a no-go zone"
        if _crosses(home_of, here, there):
            return False, f"Invalid waypoint: the way from {here} to {there} leaves the geofence"
        if any(_crosses(zone, here, there) for zone in self.exclude):
            return False, f"Invalid waypoint: the way from {here} to {there} enters a no-go zone"
        return ALLOWED

    def check_speed(self, speed: float) -> Verdict:
        """Whether a speed (m/s) is allowed."""
        if self.min_speed <= speed <= self.max_speed:
            return ALLOWED
        return False, f"Invalid speed: {speed} m/s is not from {self.min_speed} to {self.max_speed} m/s"

    def check_altitude(self, altitude: float) -> Verdict:
        """Whether a takeoff to an altitude (m above home) is allowed."""
        if self.altitudes is None or self.altitudes[0] <= altitude <= self.altitudes[1]:
            return ALLOWED
        return False, f"Invalid takeoff altitude: {self._altitude_error(altitude)}"

    def _altitude_error(self, altitude: float) -> str:
        least, greatest = self.altitudes or (0.0, 0.0)
        return f"an altitude of {altitude} m is not from {least} to {greatest} m"

    @classmethod
    def from_mapping(cls, config: Mapping[str, Any], folder: Path) -> SafetyRules:
        """The rules of a configuration; its KML files are relative to `folder`.

        Raises:
            ValueError: a value is missing or invalid, or a KML file has no polygon.
            OSError: a KML file cannot be read.
        """
        kind = config.get("vehicle_type")
        needed = NEEDED + (NEEDED_BY_COPTERS if kind == VEHICLE_TYPE_COPTER else ())
        missing = [name for name in needed if name not in config]
        if missing:
            raise ValueError(f"{', '.join(missing)} must be set")
        if kind not in VEHICLE_TYPES:
            raise ValueError(f"vehicle_type is {kind!r}; it must be one of {', '.join(VEHICLE_TYPES)}")
        is_copter = kind == VEHICLE_TYPE_COPTER
        return cls(
            vehicle_type=kind,
            min_speed=_number(config, "min_speed"),
            max_speed=_number(config, "max_speed"),
            altitudes=(_number(config, "min_alt"), _number(config, "max_alt")) if is_copter else None,
            include=_fences(config, "include_geofences", folder),
            exclude=_fences(config, "exclude_geofences", folder),
        )


def _number(config: Mapping[str, Any], name: str) -> float:
    value = config[name]
    if not is_finite_number(value):
        raise ValueError(f"{name} is {shown(value)}, not a number")
    return float(value)


def _fences(config: Mapping[str, Any], name: str, folder: Path) -> tuple[list[Point], ...]:
    files = config[name]
    if not isinstance(files, list) or not all(isinstance(file, str) for file in files):
        raise ValueError(f"{name} is {shown(files)}, not a list of files")
    return tuple(read_geofence(str(folder / file)) for file in files)


def _crosses(polygon: Sequence[Point], here: Coordinate, there: Coordinate) -> bool:
    """Whether the way from `here` to `there` touches a side."""
    return any(
        do_intersect(a["lon"], a["lat"], b["lon"], b["lat"], here.lon, here.lat, there.lon, there.lat)
        for a, b in polygon_edges(polygon)
    )
