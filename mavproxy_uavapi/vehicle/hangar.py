"""The vehicles that can be flown, each made when it is first asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mavproxy_uavapi.errors import LinkLost, NoVehicle
from mavproxy_uavapi.vehicle.copter import Copter
from mavproxy_uavapi.vehicle.modes import kind_of
from mavproxy_uavapi.vehicle.vehicle import Vehicle

if TYPE_CHECKING:
    from mavproxy_uavapi.host.host import Host

CLASSES: dict[str, type[Vehicle]] = {"copter": Copter}


class Hangar:
    """Vehicles by system id, over the host's fleet."""

    def __init__(self, host: Host) -> None:
        self.host = host
        self._vehicles: dict[int, Vehicle] = {}

    def find(self, system: int = 0) -> Vehicle:
        """The vehicle with that system id; 0 is MAVProxy's current one, or else the first that was heard.

        Raises:
            NoVehicle: none such was heard yet.
        """
        fleet = self.host.fleet.vehicles
        wanted = system or self.host.target or next(iter(fleet), 0)
        if wanted not in fleet:
            heard = f"; heard so far: {', '.join(map(str, fleet))}" if fleet else ""
            raise NoVehicle(f"no vehicle {wanted or ''} on the link yet".replace("  ", " ") + heard)
        state = fleet[wanted]
        make = CLASSES.get(kind_of(state.vehicle_type), Vehicle)
        vehicle = self._vehicles.get(wanted)
        if type(vehicle) is not make:  # the first time, or the autopilot came back with other firmware
            vehicle = self._vehicles[wanted] = make(state, self.host.link, self.host.pending, self.host.clock)
        return vehicle

    def commandable(self, system: int = 0) -> Vehicle:
        """As `find`, and its link is alive.

        Raises:
            NoVehicle, LinkLost.
        """
        vehicle = self.find(system)
        if not self.host.is_alive(vehicle.state):
            raise LinkLost.since(vehicle.state.system, self.host.clock() - vehicle.state.heartbeat_at)
        return vehicle
