"""MAVLink coordinate frames to NED metres from the EKF origin."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import from_deg_e7, to_deg_e7

from .geodesy import Location, Ned, to_ned
from .mission import Item
from .vehicle import EmbeddedVehicle

AMSL_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
HOME_FRAMES = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
TERRAIN_FRAMES = (mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT)
GLOBAL_FRAMES = AMSL_FRAMES + HOME_FRAMES + TERRAIN_FRAMES
HIGHEST_ALTITUDE = 83000.0
"""Metres; ArduPilot stores altitudes in 24 bits of centimetres and refuses more."""


def valid_location(latitude_e7: int, longitude_e7: int, altitude: float) -> bool:
    """Whether a location in 1e-7 degrees and metres can be one on earth."""
    return (
        abs(latitude_e7) <= 900000000
        and abs(longitude_e7) <= 1800000000
        and math.isfinite(altitude)
        and abs(altitude) <= HIGHEST_ALTITUDE
    )


def global_target(
    vehicle: EmbeddedVehicle, frame: int, latitude_e7: int, longitude_e7: int, altitude: float
) -> Ned | None:
    """NED metres from the EKF origin, or None without an origin or for a frame that is not global.

    altitude is metres AMSL or above home by frame; the ground is flat here, so above terrain is above home.
    """
    origin = vehicle.estimator.origin
    if origin is None or frame not in GLOBAL_FRAMES:
        return None
    if frame not in AMSL_FRAMES:
        altitude += vehicle.home.altitude if vehicle.home is not None else origin.altitude
    return to_ned(origin, Location(from_deg_e7(latitude_e7), from_deg_e7(longitude_e7), altitude))


def item_target(vehicle: EmbeddedVehicle, item: Item, *, keeps_height: bool = False) -> Ned:
    """Where a mission item leads; without a latitude and longitude straight up or down from here.

    With keeps_height an altitude of 0, as whole centimetres, is the present one.
    """
    here = vehicle.estimator.location
    latitude = item.x if item.x or item.y else to_deg_e7(here.latitude)
    longitude = item.y if item.x or item.y else to_deg_e7(here.longitude)
    target = global_target(vehicle, item.frame, latitude, longitude, item.z)
    if target is None:
        return vehicle.estimator.position
    keeps = keeps_height and int(item.z * 100) == 0
    return target._replace(down=vehicle.estimator.position.down) if keeps else target


def nearest_landing(vehicle: EmbeddedVehicle, *, axes: int) -> int | None:
    """The number of the DO_LAND_START whose first place is nearest, over ground or (3 axes) in space; None for none.

    Those without a place are equal.
    """

    def way_to(seq: int) -> float:
        for item in vehicle.mission.items[seq:]:
            target = global_target(vehicle, item.frame, item.x, item.y, item.z) if item.x or item.y else None
            if target is not None:
                return math.dist(target[:axes], vehicle.estimator.position[:axes])
        return 0.0

    return min(vehicle.mission.landing_starts(), key=way_to, default=None)
