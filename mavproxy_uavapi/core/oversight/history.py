"""What happens to the vehicles, for the trail: modes, arming, boots, links, warnings; and why a flight ended."""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from pymavlink import mavutil

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import ModeChanged, StateChanged
from mavproxy_uavapi.core.oversight.causes import (
    Author,
    Cause,
    VehicleChange,
    cause_of,
    explain,
    report_of,
    sentence_of,
    shown_boot,
)
from mavproxy_uavapi.core.telemetry.flight_modes import LANDING_MODES, RETURN_MODES, flies_mission, mode_name
from mavproxy_uavapi.core.telemetry.statustexts import StatusText
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

mavlink = mavutil.mavlink

REASON_WITHIN = 0.1  # s that the clients of an ended job wait for the autopilot's words: ArduPilot queues them
SETTLED_AFTER = 1.0  # s until the trail has a change: what tells of it has come then
OF_THE_MOMENT = 0.5  # s before a job's begin; an older change has not ended it
WORST = mavlink.MAV_SEVERITY_WARNING  # texts of it, and worse ones, are in the trail
SAID_AGAIN = 600.0  # s after which the trail has a text once more
TEXTS_KNOWN = 100  # of a vehicle
ARMED_WITHIN = 5.0  # s from an order to arm or disarm to the heartbeat that shows it
ONE_BOOT = 60.0  # s in which it is told once that an autopilot has rebooted
CLEAR = (Author.CLIENT, Author.FAILSAFE, Author.REBOOT)  # authors that no later text makes clearer
MODE_CHANNELS = ("FLTMODE_CH", "MODE_CH")  # parameters: the channel of the mode switch
SWITCH_MOVES = 80  # microseconds by which a switch moves at least
MINUTE = 60.0  # s
EVENTS_A_MINUTE = 60  # of a vehicle, that the trail takes: one that babbles does not drown what was commanded
HEARD = {"HEARTBEAT", "STATUSTEXT", "RC_CHANNELS"}


class Note(Protocol):
    """Adds an event to the trail."""

    def __call__(self, kind: str, system: int, sentence: str, *, ago: float = 0.0, **info: Any) -> None:
        """See `Host.note`."""


@dataclass
class _LastSeen:
    """A vehicle as it was at its last heartbeat."""

    mode: int | None
    armed: bool | None
    reboots: int
    in_flight: bool = False
    text: StatusText | None = None
    said: dict[str, float] = field(default_factory=dict)  # when each text was noted last (s)
    switch: int | None = None  # microseconds
    switch_moved_at: float = -math.inf
    changes: dict[str, VehicleChange] = field(default_factory=dict)  # the newest of each kind
    booted_at: float = -math.inf  # when it was known last that it had rebooted (s)
    noted_at: deque[float] = field(default_factory=deque)  # when the events of the last minute were noted (s)
    left_out: int = 0  # events since then

    def words(self, vehicle_type: int) -> str:
        """What it was: `armed in GUIDED`."""
        armed = {True: "armed", False: "disarmed", None: "armed or not"}[self.armed]
        return f"{armed} in {mode_name(vehicle_type, self.mode)}"


class VehicleHistory:
    """Compares each vehicle with what it was. Asyncio thread only.

    Args:
        registry: the vehicles.
        clock: monotonic seconds, the clock of arrivals.
        loop: where the timers run.
        note: adds an event to the trail.
        utc: gives the UTC, ISO 8601, of a time on the clock.
    """

    def __init__(
        self,
        registry: VehicleRegistry,
        clock: Callable[[], float],
        loop: asyncio.AbstractEventLoop,
        note: Note,
        utc: Callable[[float], str],
    ) -> None:
        self._registry, self._clock, self._loop = registry, clock, loop
        self._note, self._utc = note, utc
        self._seen: dict[int, _LastSeen] = {}
        self._timers: dict[Callable[[], None], asyncio.TimerHandle] = {}
        self._asked: dict[int, list[Callable[[], None]]] = {}  # by system: jobs whose reason is yet to be heard

    def listen(self, state: VehicleState, message: Any) -> None:
        """A message from a vehicle, which its state has taken."""
        seen = self._seen.get(state.system)
        if seen is not None and state.reboots != seen.reboots:
            self._take_boot(state, seen)
        name = message.get_type()
        if name not in HEARD or message.get_srcComponent() != state.component:
            return
        if seen is None:
            seen = self._seen[state.system] = _LastSeen(state.mode, state.armed, state.reboots)
            seen.text = state.statustexts.newest
            self._note("link", state.system, f"vehicle {state.system} is heard{self._as_it_is(state)}")
        if name == "HEARTBEAT":
            self._take_heartbeat(state, seen)
        elif name == "RC_CHANNELS":
            self._take_switch(state, seen, message)
        else:
            self._take_texts(state, seen)

    def take_link(self, state: VehicleState, is_alive: bool, silent_for: float) -> None:
        """A link was lost, or is back; the vehicle was silent for so many s."""
        lost = f"the link to vehicle {state.system} is lost: no heartbeat for {silent_for:.1f} s"
        deed = f"the link to vehicle {state.system} is back" if is_alive else lost
        self._note("link", state.system, f"{deed}{self._as_it_is(state)}", alive=is_alive)

    def explain(self, job: Job) -> None:
        """Have the error of a job that has ended say why its vehicle changed; its clients wait for that a moment."""
        error, system = job.error, job.vehicle.state.system
        if not isinstance(error, StateChanged):
            return
        change = self._cause_of_end(error, system)
        if change is None:
            return
        if change.at < job.began_at - OF_THE_MOMENT:
            self._explain_older(error, change)
            return
        remaining = change.at + REASON_WITHIN - self._clock()
        if remaining <= 0 or self._is_clear(change):
            self._explain(error, change)
            return

        def told() -> None:
            self._asked[system].remove(heard)
            self._explain(error, self._cause_of_end(error, system) or change)
            job.tell()

        def heard() -> None:
            if self._is_clear(self._cause_of_end(error, system) or change):
                self._cancel(told)
                told()

        job.wait_for_reason()
        self._asked.setdefault(system, []).append(heard)
        self._later(remaining, told)

    def _cause_of_end(self, error: StateChanged, system: int) -> VehicleChange | None:
        """The newest change of a vehicle that an error can be about; None for none."""
        what = "mode" if isinstance(error, ModeChanged) else "armed"
        known = self._seen[system].changes if system in self._seen else {}
        changes = [known[kind] for kind in (what, "boot") if kind in known and known[kind].after != "armed"]
        return max(changes, key=lambda change: change.at, default=None)

    def close(self) -> None:
        """Tell what is still waited for."""
        for action in list(self._timers):
            self._cancel(action)
            action()

    # -- changes ------------------------------------------------------------------------------------------

    def _take_boot(self, state: VehicleState, seen: _LastSeen) -> None:
        now, mode = self._clock(), mode_name(state.vehicle_type, seen.mode)
        if now - seen.booted_at > ONE_BOOT:
            after = [
                change for change in seen.changes.values() if now - change.at <= SETTLED_AFTER
            ]  # shown before it
            was = after[-1].was if after else seen.words(state.vehicle_type)
            self._add(
                state, VehicleChange("boot", state.system, now, was.partition(" in ")[0], "booted", mode, was), seen
            )
            seen.booted_at = now
            self._hear(state.system)
        seen.reboots, seen.mode, seen.armed, seen.in_flight = state.reboots, None, None, False

    def _take_heartbeat(self, state: VehicleState, seen: _LastSeen) -> None:
        vehicle, mode = self._registry.find(state.system), mode_name(state.vehicle_type, state.mode)
        was = seen.words(state.vehicle_type)
        if None not in (seen.mode, state.mode) and seen.mode != state.mode:
            before = mode_name(state.vehicle_type, seen.mode)
            change = VehicleChange("mode", state.system, state.mode_since, before, mode, mode, was)
            commander = vehicle.authority.commander
            if vehicle.mode_requests.chose_the_mode and commander is not None and mode in commander.modes:
                change.job = commander
            self._add(state, change, seen)
        if None not in (seen.armed, state.armed) and seen.armed != state.armed:
            words = ("disarmed", "armed")
            before, after = words[bool(seen.armed)], words[bool(state.armed)]
            change = VehicleChange("armed", state.system, state.heartbeat_at, before, after, mode, was)
            change.in_flight = seen.in_flight and _may_not_land(vehicle)
            change.job = _orderer(vehicle, self._clock())
            self._add(state, change, seen)
        seen.mode, seen.armed, seen.in_flight = state.mode, state.armed, vehicle.is_under_way

    def _add(self, state: VehicleState, change: VehicleChange, seen: _LastSeen) -> None:
        change.last_sent = self._last_sent(self._registry.find(state.system), change.at)
        seen.changes[change.what] = change

        def settled() -> None:
            if change.what != "boot" and seen.booted_at >= change.at:
                return  # it shows what the vehicle is after the boot
            cause, told = self._cause(change), change
            if cause.author is Author.REBOOT:
                seen.booted_at = self._clock()
                told = shown_boot(change)
            sentence, report = sentence_of(told, cause), report_of(told, cause, self._utc(change.at))
            more = {"statustext": list(cause.texts)} if cause.texts else {}
            self._tell(seen, told.what, change.system, sentence, ago=self._clock() - change.at, **report, **more)

        self._later(SETTLED_AFTER, settled)

    def _cause(self, change: VehicleChange) -> Cause:
        seen, state = self._seen[change.system], self._registry.find(change.system).state
        return cause_of(change, state, seen.switch_moved_at)

    def _is_clear(self, change: VehicleChange) -> bool:
        """Whether nothing that is heard yet makes it clearer why."""
        return change.what == "boot" or self._cause(change).author in CLEAR

    def _explain(self, error: StateChanged, change: VehicleChange) -> None:
        explain(error, change, self._cause(change), self._utc(change.at))

    def _explain_older(self, error: StateChanged, change: VehicleChange) -> None:
        cause = self._cause(change)
        error.explain(report_of(change, cause, self._utc(change.at)), cause.texts)

    @staticmethod
    def _last_sent(vehicle: Vehicle, at: float) -> dict[str, Any] | None:
        """What a job of ours sent to the vehicle last."""
        job = vehicle.authority.flies or vehicle.authority.commander
        if job is None or job.last_sent is None:
            return None
        name, sent_at = job.last_sent
        sent = {"message": name, "seconds_before": round(max(at - sent_at, 0.0), 1)}
        return {**sent, "job": job.id, "verb": job.verb, "client": job.client}

    def _tell(self, seen: _LastSeen, kind: str, system: int, sentence: str, **more: Any) -> None:
        """Add an event to the trail unless the vehicle had too many in the last minute; the next tells how many."""
        now = self._clock()
        while seen.noted_at and now - seen.noted_at[0] >= MINUTE:
            seen.noted_at.popleft()
        if len(seen.noted_at) >= EVENTS_A_MINUTE:
            seen.left_out += 1
            return
        if seen.left_out:
            self._note(
                "text", system, f"vehicle {system}: {seen.left_out} events are left out, because they are too many"
            )
            seen.left_out = 0
        seen.noted_at.append(now)
        self._note(kind, system, sentence, **more)

    # -- what else tells of them --------------------------------------------------------------------------

    def _take_texts(self, state: VehicleState, seen: _LastSeen) -> None:
        for text in state.statustexts.after(seen.text):
            seen.text = text
            if text.severity <= WORST and text.at - seen.said.get(text.text, -math.inf) > SAID_AGAIN:
                seen.said[text.text] = text.at
                if len(seen.said) > TEXTS_KNOWN:
                    del seen.said[next(iter(seen.said))]
                sentence = f"vehicle {state.system} says: {text.text}"
                self._tell(seen, "text", state.system, sentence, severity=text.severity)
        self._hear(state.system)

    def _hear(self, system: int) -> None:
        """See whether it is known now why jobs of a vehicle have ended."""
        for heard in list(self._asked.get(system, ())):
            heard()

    def _take_switch(self, state: VehicleState, seen: _LastSeen, message: Any) -> None:
        channel = next((int(state.parameters[name]) for name in MODE_CHANNELS if name in state.parameters), 0)
        pulse = getattr(message, f"chan{channel}_raw", 0)
        if not pulse:
            return
        if seen.switch is not None and abs(pulse - seen.switch) >= SWITCH_MOVES:
            seen.switch_moved_at = self._clock()
        seen.switch = pulse

    @staticmethod
    def _as_it_is(state: VehicleState) -> str:
        armed = {True: ", armed", False: ", disarmed", None: ""}[state.armed]
        height = "" if state.position is None or not state.armed else f", {state.position.alt:.0f} m above home"
        return f"; {mode_name(state.vehicle_type, state.mode)}{armed}{height}"

    # -- timers -------------------------------------------------------------------------------------------

    def _later(self, seconds: float, action: Callable[[], None]) -> None:
        def run() -> None:
            del self._timers[action]
            action()

        self._timers[action] = self._loop.call_later(seconds, run)

    def _cancel(self, action: Callable[[], None]) -> None:
        self._timers.pop(action).cancel()


def _may_not_land(vehicle: Vehicle) -> bool:
    """Whether it was no landing that ended its flight: it is not on the ground, and nothing lands it."""
    on_ground = vehicle.state.field("EXTENDED_SYS_STATE", "landed_state") == mavlink.MAV_LANDED_STATE_ON_GROUND
    lands = vehicle.mode in LANDING_MODES | RETURN_MODES or flies_mission(vehicle.mode)
    return not (on_ground or lands)


def _orderer(vehicle: Vehicle, now: float) -> Job | None:
    """Our job that has just ordered to arm or disarm; None if none has."""
    job: Job | None = vehicle.authority.commander
    if job is None or job.last_sent is None:
        return None
    name, at = job.last_sent
    return job if name == "COMPONENT_ARM_DISARM" and now - at <= ARMED_WITHIN else None
