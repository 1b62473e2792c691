"""Handles the vehicle of a script that dies in flight (setting `on_script_exit`)."""

from __future__ import annotations

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.scripts.runs import Run

FLOWN_BY_SCRIPTS = "GUIDED"  # in any other mode a pilot has the vehicle, or it is already on its way down
# A landing or return that a dead script began stays the best for the vehicle; a half mission is of no use.
GOES_ON = {
    f"/{group}/{name}"
    for own, names in {"command": ("land", "land_at", "rtl"), "mission": ("waypoints", "fence", "rally")}.items()
    for name in names
    for group in (own, "fleet")
}


async def after_death(host: Host, sysid: int, run: Run, others: list[str]) -> str:
    """End the jobs that only this script requested, and apply the setting if no other client flies the vehicle.

    Args:
        host: the vehicles and the jobs.
        sysid: the vehicle; 0 is MAVProxy's current one.
        run: the dead script's run.
        others: other running scripts of that vehicle.

    Returns:
        What was done, or why nothing was done, for the log.
    """
    closing = None
    for job in host.jobs.running():
        if job.script == run.session and job.verb not in GOES_ON:
            job.end_with_script()
            closing = host.endings.closing(job) or closing
    if closing is None:
        try:
            vehicle = host.registry.commandable(sysid)
        except UavApiError as error:
            return f"nothing can be done: {error}"
        why_not = f"{others[0]} still runs" if others else _in_other_hands(vehicle)
        if why_not is not None:
            return f"left alone: {why_not}"
        policy = host.endings.on_script_exit
        closing = host.endings.apply_policy(
            vehicle, policy, f"after the death of {run.script}", f"script {run.script}"
        )
        if closing is None:
            return f"on_script_exit is {policy.value}: nothing is sent"
    return await _outcome(closing)


async def _outcome(closing: Job) -> str:
    try:
        return await closing.outcome()
    except UavApiError as error:
        return f"{closing.verb} ended: {error}"


def _in_other_hands(vehicle: Vehicle) -> str | None:
    if not vehicle.state.armed:
        return "the vehicle is not armed"
    if vehicle.mode != FLOWN_BY_SCRIPTS:
        return f"the vehicle is in {vehicle.mode}"
    flies = vehicle.authority.flies
    if flies is not None:
        return f"{flies.verb} flies the vehicle"
    return None if vehicle.obeys_us else "another ground station flies the vehicle"
