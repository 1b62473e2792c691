"""`aerpawlib.v1.util`: coordinates, geofences, .plan files and ports."""

from __future__ import annotations

import socket

from mavproxy_uavapi.aerpaw.geofence import (
    do_intersect,
    doIntersect,
    inside,
    lies_on_segment,
    liesOnSegment,
    orientation,
    read_geofence,
    readGeofence,
)
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED, Waypoint
from mavproxy_uavapi.aerpaw.plans import get_location_from_waypoint, read_from_plan, read_from_plan_complete

__all__ = [
    "Coordinate",
    "VectorNED",
    "Waypoint",
    "doIntersect",
    "do_intersect",
    "get_location_from_waypoint",
    "inside",
    "is_tcp_port_in_use",
    "is_udp_port_in_use",
    "liesOnSegment",
    "lies_on_segment",
    "orientation",
    "readGeofence",
    "read_from_plan",
    "read_from_plan_complete",
    "read_geofence",
]


def is_udp_port_in_use(host: str, port: int) -> bool:
    """Whether a UDP port of this machine is taken."""
    return _is_taken(socket.SOCK_DGRAM, host, port)


def is_tcp_port_in_use(host: str, port: int) -> bool:
    """Whether a TCP port of this machine is taken."""
    return _is_taken(socket.SOCK_STREAM, host, port)


def _is_taken(kind: socket.SocketKind, host: str, port: int) -> bool:
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, kind) as one:
        try:
            one.bind((host, port))
        except OSError:
            return True
    return False
