"""Flying the mission that a vehicle holds: AUTO from its first item, and how far it has come."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import time_limits
from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Busy, ModeChanged, Stale
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.mainloop.permit import Written
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.telemetry.flight_modes import MISSION_MODES, flies_mission
from mavproxy_uavapi.core.vehicle.touchdown import Touchdown
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

mavlink = mavutil.mavlink

AUTO = "AUTO"
LANDINGS = {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, mavlink.MAV_CMD_NAV_VTOL_LAND}
STARTING_MODES = (AUTO, "GUIDED")  # in any other mode the pilot has it; `guided` takes over
START_TIMEOUT = 10.0  # s until the vehicle must show that the mission runs
LONGEST = 4 * 3600.0  # s for a mission whose client gave no timeout: longer than any copter flies
END_SHOWN = 5.0  # s from the end of a final item until telemetry must show what follows it, such as a disarming
STANDS_WITHIN = 10.0  # s from its disarming until a vehicle that has landed must stand still
AFTER_MISSION = {"plane": "RTL"}  # the mode to which an autopilot goes on at the end of its mission
UNKNOWN_TOTAL = 65535
FARTHEST = 65535  # m; MAVLink's number for the distance to an item cannot say more
STATES = {
    mavlink.MISSION_STATE_UNKNOWN: "unknown",
    mavlink.MISSION_STATE_NO_MISSION: "no_mission",
    mavlink.MISSION_STATE_NOT_STARTED: "not_started",
    mavlink.MISSION_STATE_ACTIVE: "active",
    mavlink.MISSION_STATE_PAUSED: "paused",
    mavlink.MISSION_STATE_COMPLETE: "complete",
}


async def fly(vehicle: Vehicle, job: Job, until_complete: bool = False, timeout: float | None = None) -> None:
    """Fly the mission from its first item, in AUTO; done when it runs, or with `until_complete` at its end.

    On the ground the mission's first item must be a takeoff; the autopilot says so.

    Raises:
        NotArmed: arm it first; or it was disarmed before the end, or in flight.
        ModeChanged: it is in a pilot's mode, or left AUTO meanwhile.
        Busy: it has no mission.
        Superseded: a newer command took it, or the mission was changed meanwhile.
        OutsideEnvelope: the mission, or the way to it, leaves the envelope.
        Rejected, TimedOut, LinkLost.
    """
    changes = vehicle.waypoints.changes

    def startable() -> None:
        vehicle.waypoints.require_unchanged(changes)
        vehicle.require_armed()
        if vehicle.mode not in STARTING_MODES and not flies_mission(vehicle.mode):
            raise ModeChanged(f"the vehicle is in {vehicle.mode}; `guided` takes it over")

    startable()
    items = await vehicle.mission_to_fly(job)
    if not items:
        raise Busy("the vehicle has no mission; upload one first")
    startable()
    await vehicle.guard.look_at_mission(items, from_here=True)
    startable()
    await vehicle.command(job).take(Rank.ARM, lambda: vehicle.guard.require_mission(items, from_here=True))
    with vehicle.waypoints.beginning(changes):
        await begin(vehicle, job, startable)
    if until_complete:
        await _flown_to_its_end(vehicle, job, items, timeout or LONGEST)


async def begin(vehicle: Vehicle, job: Job, startable: Callable[[], None]) -> None:
    """Fly the mission from its first item, in AUTO, for a job that commands; done when it runs.

    Args:
        vehicle: which.
        job: who commands.
        startable: raises if the mission may not start; called until the vehicle is in AUTO.
    """
    vehicle.waypoints.changed_at = vehicle.clock()
    command = vehicle.command(job)
    await command.send(messages.set_mission_current(1), startable, command.note_mission)
    job.note_modes(MISSION_MODES, Written())  # also where the vehicle is in AUTO already
    if job.is_late:
        await vehicle.wait_for_heartbeat()  # a pilot may have taken it since the last heartbeat
    # One order, which switches to AUTO and begins: a second one would take the vehicle from a pilot who has it then.
    await command.switch_mode(AUTO, startable, order=messages.start_mission())
    current = vehicle.state.recent_field("MISSION_CURRENT", "mission_state")
    if vehicle.authority.paused or current == mavlink.MISSION_STATE_PAUSED:
        await vehicle.end_stop(job, vehicle.mode)
    started = vehicle.clock()

    def runs() -> bool | None:
        _held(vehicle)
        _report(vehicle, job)
        return True if _is_active(vehicle, started) else None

    await vehicle.waiting.until({"HEARTBEAT", "MISSION_CURRENT"}, runs, START_TIMEOUT, "begin its mission")
    vehicle.command(job).confirm()


def _held(vehicle: Vehicle) -> None:
    """Raise NotArmed or ModeChanged unless it flies its mission."""
    if not (vehicle.state.armed and flies_mission(vehicle.mode)):
        vehicle.held_by(AUTO)


def _is_active(vehicle: Vehicle, since: float) -> bool:
    """Whether a MISSION_CURRENT since `since` (s) shows a mission that runs, or has ended already.

    What shows an end must be a trip younger: the answer to the start may have overtaken one of the mission before.
    """
    received = vehicle.state.newest("MISSION_CURRENT")
    if received is None or received.at < since:
        return False
    if received.message.mission_state == mavlink.MISSION_STATE_UNKNOWN:  # an older autopilot
        return bool(received.message.seq >= 1)
    has_ended = received.message.mission_state == mavlink.MISSION_STATE_COMPLETE
    is_younger = received.at >= since + vehicle.state.trip.deadline
    return bool(received.message.mission_state == mavlink.MISSION_STATE_ACTIVE or (has_ended and is_younger))


async def _flown_to_its_end(vehicle: Vehicle, job: Job, items: Sequence[MissionItem], timeout: float) -> None:
    landings = {seq for seq, item in enumerate(items, 1) if item.command in LANDINGS}
    began = vehicle.clock()
    touchdown = Touchdown(time_limits.limits({}, {}))  # it checks after the disarming: nothing landed sinks then
    in_landing_at = in_final_at = -math.inf  # s; a vehicle that has landed and disarmed reports the first item again

    def ended() -> str | None:
        nonlocal in_landing_at, in_final_at
        _report(vehicle, job)
        if _is_complete(vehicle, began):
            return "complete"
        now = vehicle.clock()
        if vehicle.state.armed is False and now - in_landing_at <= END_SHOWN:
            return "disarmed"
        if vehicle.mode == AFTER_MISSION.get(vehicle.kind) and now - in_final_at <= END_SHOWN:
            return None  # what shows the end of the mission may come after the mode that follows it
        _held(vehicle)
        current = progress(vehicle)["current"]
        in_landing_at = now if current in landings else in_landing_at
        in_final_at = now if current in landings | {len(items)} else in_final_at
        return None

    def landed() -> bool | None:
        return vehicle.has_landed(touchdown, AUTO, *MISSION_MODES)

    names = {"HEARTBEAT", "MISSION_CURRENT", "MISSION_ITEM_REACHED"}
    if await vehicle.waiting.until(names, ended, timeout, "complete its mission") == "disarmed":
        await vehicle.waiting.until({"HEARTBEAT", "GLOBAL_POSITION_INT"}, landed, STANDS_WITHIN, "stand still")


def _is_complete(vehicle: Vehicle, began: float) -> bool:
    """Whether MISSION_CURRENT says so, a trip after `began` (s): see `_is_active`.

    With an older autopilot, which does not say it, whether the last item is reached.
    """
    mission = progress(vehicle)
    if mission["state"] == "unknown":
        return bool(mission["total"] and mission["last_reached"] == mission["total"])
    return bool(mission["state"] == "complete") and _is_active(vehicle, began)


def _report(vehicle: Vehicle, job: Job) -> None:
    try:
        mission = progress(vehicle)
    except Stale:  # nothing to report yet
        return
    numbers = {"item": mission["current"], "items": mission["total"], "distance_to_go": mission["distance_m"]}
    job.progress = {name: value for name, value in numbers.items() if value is not None}


def progress(vehicle: Vehicle) -> dict[str, Any]:
    """How far the mission has come.

    Returns:
        current, last_reached: item numbers, from 1; 0 and None before any.
        total: items besides home; None where the autopilot does not report it.
        state: of STATES.
        distance_m: horizontally to the current item, in AUTO; None elsewhere, where it is old, and from 65 km on.

    Raises:
        Stale: the autopilot has not reported it yet.
    """
    received = vehicle.state.newest("MISSION_CURRENT")
    if received is None:
        raise Stale(f"vehicle {vehicle.state.system} has not sent MISSION_CURRENT yet")
    current = received.message
    reached = vehicle.state.newest("MISSION_ITEM_REACHED")
    since_the_start = reached is not None and reached.at >= vehicle.waypoints.changed_at
    in_auto = vehicle.mode == AUTO
    return {
        "current": current.seq,
        "total": None if current.total == UNKNOWN_TOTAL else current.total,
        "last_reached": reached.message.seq if reached is not None and since_the_start else None,
        "state": STATES.get(current.mission_state, "unknown"),
        "mode": vehicle.mode,
        "distance_m": _distance(vehicle) if in_auto else None,
    }


def _distance(vehicle: Vehicle) -> int | None:
    distance = vehicle.state.recent_field("NAV_CONTROLLER_OUTPUT", "wp_dist")
    return None if distance == FARTHEST else distance


def recent_progress(vehicle: Vehicle) -> dict[str, Any] | None:
    """As `progress`; None if MISSION_CURRENT is old."""
    received = vehicle.state.newest("MISSION_CURRENT")
    return progress(vehicle) if received is not None and vehicle.state.is_recent(received) else None
