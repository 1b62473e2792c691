"""The ways that orders lead along, from where the vehicle is."""

from __future__ import annotations

import math

from mavproxy_uavapi.core.airspace import braking
from mavproxy_uavapi.core.airspace.envelope_check import Checked, EnvelopeCheck
from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.geodesy import moved, rotate
from mavproxy_uavapi.core.link import orders
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.core.mission.mission_legs import PathPoint


class OrderWays:
    """The ways of one vehicle's orders."""

    def __init__(self, vehicle: Checked, check: EnvelopeCheck) -> None:
        self._vehicle, self._check = vehicle, check

    def of(self, order: orders.VehicleOrder) -> list[PathPoint]:
        """The way that an order leads along, as far as it is known. Raises Stale."""
        if isinstance(order, orders.GoTo | orders.Climb):
            return self._to_place(order)
        if isinstance(order, orders.Fly):
            return self.at_velocity(order)
        return []

    def _to_place(self, order: orders.GoTo | orders.Climb) -> list[PathPoint]:
        here = self._check.here()
        if isinstance(order, orders.Climb):
            return [here, here._replace(up=order.alt)]
        target = order.target
        if isinstance(target, NedTarget):
            local = self._vehicle.local_position()
            lat, lon = moved(here.lat, here.lon, target.x - local.north, target.y - local.east)
            up = here.up + local.down - target.z
        else:
            lat, lon, up = target.lat, target.lon, target.alt
        return [here, PathPoint(lat, lon, 0.0 if self._check.drives else up)]

    def at_velocity(self, order: orders.Fly) -> list[PathPoint]:
        """The way that is flown until the autopilot drops the setpoint, and until it stands."""
        north, east, down = self.velocity(order)
        if math.hypot(north, east, down) < 1e-3:
            return self._way_to_rest()
        parameters, drives = self._vehicle.state.parameters, self._check.drives
        stopping = braking.of_rover(parameters) if drives else braking.of_guided(parameters)
        timeout = parameters.get("GUID_TIMEOUT", 3.0)
        on_its_way = max(braking.LATENCY, self._vehicle.state.trip.mean or 0.0)
        lasts = (timeout if not timeout < 0.1 else 0.1) + on_its_way
        here = self._check.here()
        on = stopping.to_rest((north, east, 0.0 if drives else -down), lasts)
        if not all(map(math.isfinite, on)):
            raise OutsideEnvelope("nobody can say how far it flies: a number that the vehicle reported is none")
        return [here, PathPoint(*moved(here.lat, here.lon, on[0], on[1]), here.up + on[2])]

    def _way_to_rest(self) -> list[PathPoint]:
        """The way that it needs to stand, from the velocity that it has."""
        here, velocity = self._check.here(), self._vehicle.position().velocity
        stopping = braking.of_rover if self._check.drives else braking.of_guided
        north, east, down = velocity
        to_rest = stopping(self._vehicle.state.parameters).to_rest
        north, east, up = to_rest((north, east, 0.0 if self._check.drives else -down), braking.LATENCY)
        if not all(map(math.isfinite, (north, east, up))):
            return [here]
        return [here, PathPoint(*moved(here.lat, here.lon, north, east), here.up + up)]

    def velocity(self, order: orders.Fly) -> tuple[float, float, float]:
        """m/s north, east, down."""
        north, east, down = order.velocity
        if order.by_heading:
            north, east = rotate(north, east, self._vehicle.attitude().yaw)
        return north, east, down
