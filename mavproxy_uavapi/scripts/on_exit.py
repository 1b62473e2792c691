"""What the vehicle does when its script dies in flight (the setting `on_script_exit`)."""

from __future__ import annotations

from mavproxy_uavapi.errors import UavApiError
from mavproxy_uavapi.host.host import Host
from mavproxy_uavapi.vehicle.copter import Copter
from mavproxy_uavapi.vehicle.jobs import Job
from mavproxy_uavapi.vehicle.messages import VelocityTarget
from mavproxy_uavapi.vehicle.vehicle import Vehicle

FLOWN_BY_SCRIPTS = "GUIDED"  # in any other mode the vehicle is its pilot's, or on its way down already
HOLDING_MODES = {"plane": "LOITER", "rover": "HOLD"}


async def after_death(host: Host, sysid: int, action: str, script: str) -> str:
    """Do what is set, if the vehicle is in a script's hands: armed, in GUIDED, and nobody else's verb flies it.

    Args:
        host: the vehicles and the jobs.
        sysid: the vehicle; 0 is MAVProxy's current one.
        action: one of settings.ON_SCRIPT_EXIT.
        script: who died.

    Returns:
        What was done, or why nothing was, for the log.
    """
    if action == "nothing":
        return "on_script_exit is nothing"
    try:
        vehicle = host.hangar.commandable(sysid)
    except UavApiError as error:
        return f"nothing can be done: {error}"
    why_not = _in_other_hands(vehicle)
    if why_not is not None:
        return why_not

    async def body(job: Job) -> str:
        await _act(vehicle, action, job)
        return f"{action} is done"

    verb, client = f"on_script_exit={action}", f"script {script}"
    job = host.jobs.begin(vehicle.seat, verb, {"script": script}, body, client=client, outlives_client=True)
    try:
        return await job.outcome()
    except UavApiError as error:
        return f"{action} ended: {error}"


def _in_other_hands(vehicle: Vehicle) -> str | None:
    if not vehicle.state.armed:
        return "the vehicle is not armed"
    if vehicle.mode != FLOWN_BY_SCRIPTS:
        return f"the vehicle is in {vehicle.mode}, which is left alone"
    if vehicle.seat.job is not None and vehicle.seat.job.running:
        return f"{vehicle.seat.job.verb} flies the vehicle"
    return None


async def _act(vehicle: Vehicle, action: str, job: Job) -> None:
    if isinstance(vehicle, Copter):
        if action == "land":
            await vehicle.land(job)
        elif action == "rtl":
            await vehicle.rtl(job)
        else:  # stays in GUIDED, so that the next command finds it as the script left it
            await vehicle.travel(job, VelocityTarget(0, 0, 0))
        return
    holding = HOLDING_MODES.get(vehicle.kind, "RTL")
    await vehicle.set_mode(job, holding if action == "hold" else "RTL")
