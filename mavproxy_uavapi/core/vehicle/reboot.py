"""Rebooting the autopilot."""

from __future__ import annotations

from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Busy
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

TIMEOUT = 30.0  # s until telemetry must show that it has booted


async def reboot(vehicle: Vehicle, job: Job) -> None:
    """Reboot the autopilot; done when its telemetry shows that it has booted.

    Raises:
        Busy: it is armed.
    """

    def require_disarmed() -> None:
        if vehicle.state.armed is not False:
            raise Busy("the vehicle is armed; disarm it first")

    require_disarmed()
    vehicle.authority.take(job, Rank.STOP)  # an arm that waits ends
    before = vehicle.state.reboots
    await vehicle.commands.send(
        messages.reboot(),
        vehicle.commanding(job, require_disarmed),
        shown=lambda: vehicle.state.reboots > before,
    )
    names = {"HEARTBEAT", "SYSTEM_TIME", "ATTITUDE"}
    await vehicle.waiting.until(names, lambda: vehicle.state.reboots > before or None, TIMEOUT, "boot again")
