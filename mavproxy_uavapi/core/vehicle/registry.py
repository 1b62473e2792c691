"""The vehicles that can be flown, each made at its first use."""

from __future__ import annotations

from collections.abc import Callable

from mavproxy_uavapi.core.airspace.store import Envelopes
from mavproxy_uavapi.core.airspace.traffic import Traffic
from mavproxy_uavapi.core.errors import NoVehicle
from mavproxy_uavapi.core.link.link import Link
from mavproxy_uavapi.core.telemetry.flight_modes import kind_of
from mavproxy_uavapi.core.telemetry.link_watch import LinkWatch
from mavproxy_uavapi.core.telemetry.pending_waits import PendingWaits
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.telemetry.vehicle_states import VehicleStates
from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_uavapi.core.vehicle.plane import Plane
from mavproxy_uavapi.core.vehicle.rover import Rover
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

CLASSES: dict[str, type[Vehicle]] = {"copter": Copter, "plane": Plane, "rover": Rover, "other": Vehicle}


class VehicleRegistry:
    """Vehicles by system id.

    Attributes:
        current: the system id that MAVProxy's own commands go to; 0 before it knows one.
        link_is_full: whether a serial link of MAVProxy's has no room for what can wait.
        streams_are_off: whether the operator has MAVProxy request no streams (`streamrate` -1).
        traffic: keeps the vehicles apart.

    Args:
        fleet: the state of each vehicle.
        link: sends messages.
        link_watch: knows whether a link is alive.
        pending: the waits on them.
        clock: monotonic seconds, the clock of arrivals.
        envelopes: those in force.
    """

    def __init__(
        self,
        fleet: VehicleStates,
        link: Link,
        link_watch: LinkWatch,
        pending: PendingWaits,
        clock: Callable[[], float],
        *,
        envelopes: Envelopes | None = None,
    ) -> None:
        self.current = 0
        self.link_is_full = self.streams_are_off = False
        self._fleet = fleet
        self._link = link
        self._link_watch = link_watch
        self._pending = pending
        self.clock = clock
        self._envelopes = Envelopes() if envelopes is None else envelopes
        self._vehicles: dict[int, Vehicle] = {}
        self._used: set[int] = set()
        self.traffic = Traffic(self.all)

    def resolve(self, system: int = 0) -> int:
        """That system id; for 0 MAVProxy's current one, or else the first that was heard, or 0."""
        return system or self.current or next(iter(self._fleet.vehicles), 0)

    def use(self, *systems: int) -> None:
        """Note that somebody flies or watches those vehicles from now on; 0 changes nothing."""
        self._used.update(system for system in systems if 0 < system < 256)

    def is_used(self, system: int) -> bool:
        """Whether it is MAVProxy's current vehicle, or one that somebody flies or watches."""
        return system in self._used or system == self.resolve()

    @property
    def is_deaf(self) -> bool:
        """Whether MAVProxy's main loop stands, or has not read what came meanwhile."""
        return self._pending.listening.is_behind

    def is_alive(self, vehicle: Vehicle) -> bool:
        """Whether its link is alive."""
        return self._link_watch.is_alive(vehicle.state)

    def find(self, system: int = 0) -> Vehicle:
        """The vehicle with that system id; 0 as for `resolve`.

        Raises:
            NoVehicle: none such was heard yet.
        """
        heard = self._fleet.vehicles
        system_id = self.resolve(system)
        if system_id not in heard:
            others = f"; heard so far: {', '.join(map(str, heard))}" if heard else ""
            raise NoVehicle(f"no vehicle {system_id or ''} on the link yet".replace("  ", " ") + others)
        state = heard[system_id]
        before = self._vehicles.get(system_id)
        if type(before) is CLASSES[kind_of(state.vehicle_type)]:
            return before
        vehicle = self._vehicles[system_id] = self._made(state)
        if before is not None:  # the autopilot knows its frame now, or came back with other firmware
            vehicle.continues(before)
        return vehicle

    def _made(self, state: VehicleState) -> Vehicle:
        make = CLASSES[kind_of(state.vehicle_type)]
        vehicle = make(state, self._link, self._pending, self.clock, lambda: self._envelopes.of(state.system))
        vehicle.guard.traffic = self.traffic
        return vehicle

    def all(self) -> list[Vehicle]:
        """The vehicles that were heard so far, the first one first."""
        return [self.find(system) for system in self._fleet.vehicles]

    def commandable(self, system: int = 0) -> Vehicle:
        """As `find`, and its link is alive; it is used from now on.

        Raises:
            NoVehicle, LinkLost.
            Busy: two autopilots have its system id.
        """
        vehicle = self.find(system)
        self.use(vehicle.state.system)
        self._link_watch.require_alive(vehicle.state)
        vehicle.state.require_one(self.clock())
        return vehicle
