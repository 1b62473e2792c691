"""What a vehicle does when the job that flies it ends. Only this module decides that, from telemetry.

If another job or the pilot has the vehicle, nothing is sent. Else the table says what follows: a job like any other,
which commands by rank, sends until telemetry shows the effect, and ends when another job or the pilot commands.
"""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable, Collection, Mapping
from enum import Enum
from typing import Any

from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Ending, Job, JobBook
from mavproxy_uavapi.core.errors import LinkLost, ModeChanged, NotArmed, Paused
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.telemetry.flight_modes import (
    LANDING_MODES,
    RETURN_MODES,
    flies_mission,
    mode_names,
    mode_number,
)
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

log = logging.getLogger("uavapi.copter")


class Policy(Enum):
    """What a vehicle shall do when the job that flies it ends."""

    NOTHING = "nothing"  # it follows its last command
    HOLD = "hold"  # it stops and stays, a landing too
    SAFE = "safe"  # it stops and stays, unless the autopilot flies by itself
    LAND = "land"
    RTL = "rtl"


class Situation(Enum):
    """What telemetry shows."""

    UNKNOWN = "not known"  # no heartbeat, or none since it booted
    DISARMED = "disarmed"
    ARMING = "disarmed, with an order to arm on its way"
    IDLE = "stands on the ground"  # in a landing's mode, its motors idle
    GUIDED = "GUIDED"  # on the ground too: a climb begins there
    STOPPED = "stopped at its envelope, or before another vehicle"
    PAUSED = "held still, or about to be"  # by `stop`: `resume` would fly on to its target
    MISSION = "AUTO"
    TAKEOFF = "TAKEOFF"  # of a plane; a copter takes off in GUIDED
    LAND = "LAND, or a landing by its mission"
    RTL = "RTL"
    PILOTED = "its pilot's mode"


NOTHING = dict.fromkeys(Policy)
HOLD, LAND, RTL, DISARM = "hold", "land", "rtl", "disarm"
WHAT_FOLLOWS: Mapping[Situation, Mapping[Policy, str | None]] = {
    Situation.UNKNOWN: NOTHING,
    Situation.DISARMED: NOTHING,
    Situation.ARMING: {**dict.fromkeys(Policy, DISARM), Policy.NOTHING: None},
    Situation.IDLE: NOTHING,
    Situation.PILOTED: NOTHING,
    Situation.GUIDED: {**NOTHING, Policy.HOLD: HOLD, Policy.SAFE: HOLD, Policy.LAND: LAND, Policy.RTL: RTL},
    Situation.PAUSED: {**NOTHING, Policy.HOLD: HOLD, Policy.SAFE: HOLD, Policy.LAND: LAND, Policy.RTL: RTL},
    Situation.STOPPED: {**NOTHING, Policy.LAND: LAND, Policy.RTL: RTL},
    Situation.MISSION: {**NOTHING, Policy.HOLD: HOLD, Policy.LAND: LAND, Policy.RTL: RTL},
    Situation.TAKEOFF: {**NOTHING, Policy.HOLD: HOLD, Policy.LAND: LAND, Policy.RTL: RTL},
    Situation.LAND: {**NOTHING, Policy.HOLD: HOLD},
    Situation.RTL: {**NOTHING, Policy.HOLD: HOLD, Policy.LAND: LAND},
}
# Endings that somebody requests now, or that follow a new heartbeat (leases). They do not wait for a heartbeat.
AT_ONCE = {Ending.ABORTED, Ending.UNLOADED, Ending.LEASE_OVER}
# Endings that nobody requests: another station that has given the vehicle a target keeps it, and so does a failsafe.
UNREQUESTED = {Ending.CLIENT_GONE, Ending.SCRIPT_GONE, Ending.LEASE_OVER}
# After these errors the vehicle is not ours: the pilot, a client that stopped it, or a failsafe has it.
HAS_ANOTHER_MASTER = (ModeChanged, NotArmed, Paused, LinkLost)
FIXED: Mapping[Ending, Policy] = {
    Ending.DONE: Policy.NOTHING,
    Ending.FAILED: Policy.NOTHING,  # its pilot has it, or it flies on to its target
    Ending.SUPERSEDED: Policy.NOTHING,
    Ending.ABORTED: Policy.HOLD,
    Ending.UNLOADED: Policy.SAFE,
    Ending.DEFECT: Policy.SAFE,
}


def situation(vehicle: Vehicle, modes: Collection[str] = ()) -> Situation:
    """The situation that telemetry shows.

    Args:
        vehicle: the vehicle to look at.
        modes: modes that the ended job switched to; a landing or a mission in any other mode is the pilot's.
    """
    state, mode = vehicle.state, vehicle.next_mode
    if not state.armed:
        disarmed = Situation.ARMING if vehicle.arm_is_on_its_way else Situation.DISARMED
        return Situation.UNKNOWN if state.armed is None else disarmed
    if vehicle.is_protected:
        return Situation.STOPPED
    if mode == "GUIDED" and (vehicle.mode == mode or state.mode is None or vehicle.is_in_own_mode):
        return Situation.PAUSED if vehicle.authority.paused else Situation.GUIDED
    if mode == "GUIDED" or mode not in modes:  # out of a pilot's mode it comes to stand in GUIDED
        return Situation.PILOTED
    lands = mode in LANDING_MODES or (flies_mission(mode) and vehicle.lands_by_mission)
    if lands or mode in RETURN_MODES:
        flown = Situation.LAND if lands else Situation.RTL
        return Situation.IDLE if vehicle.stands else flown
    flown = Situation.MISSION if flies_mission(mode) else Situation.PILOTED
    if mode in vehicle.holding_modes and vehicle.mode != mode and vehicle.is_in_own_mode:
        flown = Situation.PAUSED  # as soon as its order arrives, which may be lost
    return Situation.TAKEOFF if mode == "TAKEOFF" else flown


class FlightEndings:
    """Commands the vehicles whose jobs have ended.

    Attributes:
        on_disconnect: policy for a vehicle whose client hung up.
        on_script_exit: policy for a vehicle whose script died.
        on_lease_end: policy for a vehicle whose client let its lease run out.

    Args:
        jobs: all jobs.
    """

    def __init__(self, jobs: JobBook) -> None:
        self.on_disconnect = Policy.NOTHING
        self.on_script_exit = Policy.HOLD
        self.on_lease_end = Policy.HOLD
        self._jobs = jobs
        self._closing: dict[str, Job] = {}  # by the number of the job before
        jobs.on_ended.append(self._ended)

    def policy(self, job: Job) -> Policy:
        """The policy for the vehicle of a job that has ended."""
        assert job.ending is not None
        if job.ending is Ending.CLIENT_GONE:
            return Policy(job.on_disconnect) if job.on_disconnect else self.on_disconnect
        if job.ending is Ending.SCRIPT_GONE:
            return self.on_script_exit
        if job.ending is Ending.LEASE_OVER:
            return self.on_lease_end
        if job.ending is Ending.FAILED and job.steers and not isinstance(job.error, HAS_ANOTHER_MASTER):
            return Policy.SAFE
        return FIXED[job.ending]

    def closing(self, job: Job) -> Job | None:
        """The job that follows `job`; None when nothing is sent."""
        return self._closing.get(job.id)

    def _ended(self, job: Job) -> None:
        vehicle = job.vehicle
        if job in self._closing.values():
            return  # nothing follows what follows: a defect in it would begin it for ever
        if isinstance(vehicle, Vehicle) and job in (vehicle.authority.commander, vehicle.authority.interrupted):
            is_anothers = vehicle.next_mode == "GUIDED" and vehicle.has_foreign_target and not job.steers
            if job.ending in UNREQUESTED and (is_anothers or vehicle.may_be_a_failsafes):
                who = "another station" if is_anothers else "a failsafe"
                log.info("vehicle %d, after %s: %s has it", vehicle.state.system, job.verb, who)
                return
            at_once = job.ending in AT_ONCE
            policy, why = self.policy(job), f"after {job.verb}"
            closing = self._close(vehicle, policy, why, job.client, job.modes, at_once=at_once)
            if closing is not None:
                running = {number: follower for number, follower in self._closing.items() if follower.running}
                self._closing = running | {job.id: closing}

    def what_follows(self, vehicle: Vehicle, policy: Policy, modes: Collection[str] = ()) -> str | None:
        """The action that `apply_policy` would take now; None for none."""
        return WHAT_FOLLOWS[situation(vehicle, modes)][policy]

    def closing_messages(self) -> list[tuple[Any, int]]:
        """Messages that must be sent before the link is given back, and the systems that they go to.

        What telemetry shows already goes on without us, such as a return.
        """
        running = [job for job in self._closing.values() if job.running and not job.vehicle.authority.has_shown(job)]
        return [(_closing_message(job), job.vehicle.state.system) for job in running]

    def apply_policy(
        self, vehicle: Vehicle, policy: Policy, why: str, client: str, modes: Collection[str] = ()
    ) -> Job | None:
        """Start what policy and telemetry require for a vehicle that no job flies; None if nothing is sent.

        Its pilot may have chosen its mode, or another station its target: unless it obeys us, it is left alone.

        Args:
            vehicle: the vehicle to command.
            policy: what it shall do.
            why: the reason, for the log and the trail.
            client: the client in whose name the job runs.
            modes: modes that the ended job switched to.
        """
        if not vehicle.obeys_us or vehicle.may_be_a_failsafes:
            log.info("vehicle %d, %s: it is not ours, or a failsafe's: nothing is sent", vehicle.state.system, why)
            return None
        return self._close(vehicle, policy, why, client, modes, at_once=False)

    def _close(
        self, vehicle: Vehicle, policy: Policy, why: str, client: str, modes: Collection[str], *, at_once: bool
    ) -> Job | None:
        action = self.what_follows(vehicle, policy, modes)
        shown = situation(vehicle, modes).value
        log.info("vehicle %d, %s: %s, so %s", vehicle.state.system, why, shown, action or "nothing is sent")
        if action is None:
            return None
        verb = _verb(vehicle, action)
        since, was_stopped, waits = vehicle.state.mode_since, vehicle.is_protected, vehicle.authority.is_protected

        def follows() -> bool:
            if vehicle.state.mode_since != since and not vehicle.is_in_own_mode:
                return False  # whoever has switched it, to GUIDED too
            if vehicle.may_be_a_failsafes:
                return False
            if was_stopped:  # the one who stopped it commands no more
                return vehicle.mode in vehicle.holding_modes and vehicle.is_in_own_mode
            return self.what_follows(vehicle, policy, modes) == action

        async def body(job: Job) -> str:
            switches_mode = action != DISARM and not (action == HOLD and vehicle.stops_in_its_mode)
            if waits:
                await vehicle.command(job).wait_for_protection(since)
            elif switches_mode and not at_once:
                await vehicle.wait_for_heartbeat()  # a pilot may have taken it since the last heartbeat
            if (waits or (switches_mode and not at_once)) and not follows():
                raise ModeChanged(f"the vehicle is in {vehicle.mode} now: nothing is sent")
            await verb(job)
            return f"{action} is done"

        job = self._jobs.begin(vehicle, f"{action} {why}", {}, body, client=client, outlives_client=True)
        job.protects = True
        job.holder = job.operator = ""  # no client owns this flight, so no lease ends it
        if not waits:
            vehicle.authority.take(job, Rank.STOP)  # at once, because a command that comes now is newer
        return job


def _closing_message(job: Job) -> Any:
    vehicle, action = job.vehicle, job.verb.partition(" ")[0]
    if action == DISARM:
        return messages.disarm(force=False).to(vehicle.address, 0)
    if action != HOLD and action.upper() in mode_names(vehicle.state.vehicle_type):
        mode = mode_number(vehicle.state.vehicle_type, action)
        return messages.set_mode(mode).to(vehicle.address, 0)
    return vehicle.hold_message()


def _verb(vehicle: Vehicle, action: str) -> Callable[[Job], Awaitable[None]]:
    returns = vehicle.rtl if vehicle.has("rtl") else vehicle.land_or_return
    return {HOLD: vehicle.hold, LAND: vehicle.land_or_return, RTL: returns, DISARM: vehicle.disarm}[action]
