"""The verbs that not every type of vehicle has. A type overrides those that it has."""

from __future__ import annotations

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import NotSupported
from mavproxy_uavapi.core.geodesy import rotate
from mavproxy_uavapi.core.link.messages import GlobalTarget, NedTarget, VelocityTarget
from mavproxy_uavapi.core.vehicle.base import BaseVehicle


class Verbs(BaseVehicle):
    """The verbs that a type of vehicle may lack; each raises NotSupported unless the type overrides it."""

    @classmethod
    def has(cls, verb: str) -> bool:
        """Whether this type of vehicle has the verb of that name."""
        return getattr(cls, verb, None) is not getattr(Verbs, verb, None)

    def lacks(self, verb: str) -> NotSupported:
        """The error for a verb that this type does not have."""
        return NotSupported(f"a {self.kind} does not have `{verb}`")

    async def takeoff(self, job: Job, alt: float, *, vtol: bool = False, timeout: float | None = None) -> None:
        """Climb from the ground to `alt` m above home; with `vtol` vertically, if a plane can do both."""
        raise self.lacks("takeoff")

    async def land(self, job: Job, timeout: float | None = None) -> None:
        """Land; done when it has disarmed."""
        raise self.lacks("land")

    async def land_at(self, job: Job, lat: float, lon: float, alt: float = 0.0, *, vtol: bool = False) -> None:
        """Begin to land at a place: degrees, and m above home."""
        raise self.lacks("land_at")

    async def rtl(self, job: Job, timeout: float | None = None) -> None:
        """Return to launch."""
        raise self.lacks("rtl")

    async def brake(self, job: Job) -> None:
        """Stop at once, and stay."""
        raise self.lacks("brake")

    async def stop(self, job: Job) -> None:
        """Stop the present movement, and stay."""
        raise self.lacks("stop")

    async def resume(self, job: Job) -> None:
        """Continue the movement that `stop` interrupted."""
        raise self.lacks("resume")

    async def go_to(
        self,
        job: Job,
        target: NedTarget | GlobalTarget,
        *,
        look_at_target: bool = False,
        heading: float | None = None,
        wait: bool = False,
        tolerance: float = 1.0,
        timeout: float | None = None,
    ) -> None:
        """Go to a position; with `wait`, done on arrival."""
        raise self.lacks("go_to")

    def require_guided_flight(self) -> None:
        """Raise NotArmed, ModeChanged or Busy unless it accepts movements now."""
        raise self.lacks("go_to")

    def ned_from_here(self, x: float, y: float, z: float) -> NedTarget:
        """The target `x` m north, `y` m east, `z` m down of here."""
        here = self.local_position()
        return NedTarget(here.north + x, here.east + y, here.down + z)

    def body_from_here(self, front: float, right: float, down: float) -> NedTarget:
        """The target `front`, `right`, `down` m from here, by the present heading."""
        north, east = rotate(front, right, self.attitude().yaw)
        return self.ned_from_here(north, east, down)

    def velocity_by_heading(self, front: float, right: float, down: float) -> VelocityTarget:
        """The velocity `front`, `right`, `down` in m/s, by the present heading."""
        return VelocityTarget(*rotate(front, right, self.attitude().yaw), down)

    async def travel(
        self,
        job: Job,
        velocity: VelocityTarget,
        *,
        look_at_target: bool = False,
        heading: float | None = None,
        duration: float | None = None,
    ) -> None:
        """Move at a velocity, for `duration` s on the vehicle's clock."""
        raise self.lacks("travel")

    async def set_heading(self, job: Job, heading: float, timeout: float | None = None) -> None:
        """Turn to `heading` degrees clockwise from north."""
        raise self.lacks("set_heading")

    async def set_yaw_rate(self, job: Job, rate: float, timeout: float | None = None) -> None:
        """Turn at `rate` deg/s, clockwise positive."""
        raise self.lacks("set_yaw_rate")

    async def set_reverse(self, job: Job, reverse: bool) -> None:
        """Drive backwards, or forwards again."""
        raise self.lacks("set_reverse")
