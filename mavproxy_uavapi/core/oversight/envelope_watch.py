"""Stops a vehicle under our command before it leaves its envelope, or comes too near to another vehicle.

Of two vehicles under our command it stops the one with the lower rank; if the ranks are equal, the one with the later
command. It never touches a vehicle that its pilot flies, nor one that lands, returns or holds.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from collections.abc import Awaitable, Callable
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import braking
from mavproxy_uavapi.core.airspace.forecast import NearMiss
from mavproxy_uavapi.core.airspace.local_frame import Spot
from mavproxy_uavapi.core.airspace.space import TOUCH, Breach, Space, outside_by
from mavproxy_uavapi.core.airspace.store import Envelopes
from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.jobs import Ending, Job, JobBook
from mavproxy_uavapi.core.errors import ModeChanged, OutsideEnvelope, Stale, TimedOut, TooNear, UavApiError
from mavproxy_uavapi.core.geodesy import moved
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.mission.mission_legs import PathPoint
from mavproxy_uavapi.core.telemetry.flight_modes import flies_mission
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

log = logging.getLogger("uavapi.copter")
mavlink = mavutil.mavlink

CLIENT = "envelope"  # the client of the jobs that stop vehicles
INTERVAL = 0.25  # s between two positions, until two have arrived
SLOWEST = 0.3  # m/s; slower than this nothing is stopped
ASK_AGAIN = 30.0  # s until what a vehicle told once is asked for again: it may have changed, or been lost
ASKED, PAUSE = 10, 2.0  # times that home, or a mission, is asked for, and s between them
UPLOADS = ("MISSION_REQUEST_INT", "MISSION_REQUEST")  # what a vehicle says when its mission is changed
CORRIDOR, MISSION_CORRIDOR = 1.5, 3.0  # m beside a way that was allowed, in which the autopilot is trusted to stop
STANDS_WITHIN = 5.0  # s more than a stop should need, until it counts as failed
HEAR_FOR = 0.3  # s that a stop waits for a heartbeat, which it asks for; it begins so much earlier
FASTEST_CLOCK = 2.0  # s of the vehicle's clock in one of ours, up to which a stop waits
FASTER, MORE = 1.1, 1.0  # times a limit, and m/s more, up to which a vehicle may fly in a gust, or as it slows down
CHANGED = 0.5  # m/s more than a limit, likewise, of a vehicle whose speed another station has changed
SPEED_COMMANDS = {mavlink.MAV_CMD_DO_CHANGE_SPEED, mavlink.MAV_CMD_GUIDED_CHANGE_SPEED}
SPEED_PARAMETERS = ("WPNAV_SPEED", "WP_SPD", "WP_SPEED", "CRUISE_SPEED")
OWN = 5.0  # s after a speed of ours, in which an acknowledgement is taken for the answer to it
MARGIN = 1.0  # s more than it needs to stop, in which no vehicle comes too near to another


class EnvelopeWatch:
    """Looks at each position of each vehicle.

    Args:
        registry: the vehicles.
        jobs: all jobs; a stop is one.
        envelopes: those in force.
        announce: told each stop: the kind of the event, the system id, a sentence.
    """

    def __init__(
        self,
        registry: VehicleRegistry,
        jobs: JobBook,
        envelopes: Envelopes,
        announce: Callable[[str, int, str], None],
    ) -> None:
        self._registry = registry
        self._jobs = jobs
        self._envelopes = envelopes
        self._announce = announce
        self._stops: dict[int, Job] = {}
        self._due: set[int] = set()  # the systems that are about to be looked at
        self._tasks = HeldTasks()
        self._prepared: dict[int, tuple[int, int, int, bool]] = {}  # by system id: when and why it was asked
        self._parameters: dict[int, dict[str, float]] = {}  # as they were then, and have been reported since
        self._changed: dict[int, float] = {}  # in which mode another station has changed a speed: since when it is on

    def listen(self, state: VehicleState, message: Any) -> None:
        """A message from a vehicle."""
        if message.get_type() in UPLOADS and message.get_srcComponent() == state.component:
            vehicle = self._registry.find(state.system)
            if vehicle.waypoints.overhears(message):
                vehicle.guard.forget_mission()
        if not self._envelopes.of(state.system) and not self._registry.traffic.in_force:
            return
        if message.get_srcComponent() != state.component:
            return
        name = message.get_type()
        if name in ("COMMAND_ACK", "PARAM_VALUE"):
            self._note_speed(self._registry.find(state.system), message)
        elif name == "GLOBAL_POSITION_INT":
            vehicle = self._registry.find(state.system)
            self._prepare(vehicle)
            if state.system not in self._due:  # each in a callback of its own: many at once would hold the thread
                self._due.add(state.system)
                asyncio.get_running_loop().call_soon(self._look_at, vehicle)

    def _note_speed(self, vehicle: Vehicle, message: Any) -> None:
        """Note whether another station has changed a speed: by a command, of unknown value, or a parameter."""
        if message.get_type() == "COMMAND_ACK":
            is_accepted = message.command in SPEED_COMMANDS and message.result == mavlink.MAV_RESULT_ACCEPTED
            changed = is_accepted and vehicle.clock() - vehicle.guard.speed_sent_at > OWN
        elif not math.isfinite(message.param_value):
            return
        else:
            known = self._parameters.setdefault(vehicle.state.system, {})
            before = known.setdefault(message.param_id, message.param_value)
            changed = message.param_id.startswith(SPEED_PARAMETERS) and message.param_value > before
            known[message.param_id] = message.param_value
        if changed:
            self._changed[vehicle.state.system] = vehicle.state.mode_since

    def _look_at(self, vehicle: Vehicle) -> None:
        self._due.discard(vehicle.state.system)
        self.look(vehicle)

    def _prepare(self, vehicle: Vehicle) -> None:
        """Request what the envelope needs, after each boot and arming, and again: home, how it stops and lands."""
        unread = vehicle.flies_unread_mission
        key = vehicle.state.reboots, vehicle.state.armings, int(vehicle.clock() / ASK_AGAIN), unread
        if self._prepared.get(vehicle.state.system) != key:
            self._prepared[vehicle.state.system] = key
            self._parameters[vehicle.state.system] = dict(vehicle.state.parameters)
            self._tasks.start(self._ask(vehicle), "the questions for an envelope")

    async def _ask(self, vehicle: Vehicle) -> None:
        with contextlib.suppress(UavApiError):
            await vehicle.parameters.read(vehicle.stops_by)
            if vehicle.state.armed and not self._registry.link_is_full:
                await vehicle.parameters.ask_again()
        if self._registry.traffic.in_force:
            with contextlib.suppress(UavApiError):
                await vehicle.learn_rally()
        if vehicle.obeys_us and vehicle.flies_unread_mission:
            await _insist(vehicle.learn_mission)  # another station may still change it
        await _insist(vehicle.home)

    def closing_messages(self) -> list[tuple[Any, int]]:
        """The messages that stop the vehicles whose stop has not been shown, and the systems that they go to."""
        running = [job.vehicle for job in self._stops.values() if job.running]
        return [(vehicle.hold_message(), vehicle.state.system) for vehicle in running]

    async def close(self) -> None:
        """Cancel the requests that are not answered yet."""
        await self._tasks.end()

    def look(self, vehicle: Vehicle) -> None:
        """Stop the vehicle if it is ours and will leave, or come too near to another."""
        vehicle.guard.advance()
        if not self._may_stop(vehicle):
            return
        try:
            crossing = leaving(vehicle)
            changed = self._changed.get(vehicle.state.system) == vehicle.state.mode_since
            broken = too_fast(vehicle, changed=changed) if crossing is None else (crossing[0], crossing[1].what)
            near = None if broken else self._registry.traffic.nearing(vehicle, _until_it_stands(vehicle) + MARGIN)
        except Stale:
            return  # its position, or home, is not known: commands that move it are refused
        if broken is not None:
            space, what = broken
            details = {"what": what, "source": space.envelope.source}
            deed = f"break {what} of {space.envelope.source}"
            self._stop(vehicle, deed, "envelope", lambda sentence: OutsideEnvelope(sentence, details))
        elif near is not None:
            self._stop_one(vehicle, *near)

    def _may_stop(self, vehicle: Vehicle) -> bool:
        stop = self._stops.get(vehicle.state.system)
        is_free = not vehicle.authority.has_next  # else a stop has failed, and what waited for it has its turn
        return vehicle.flies_for_us and is_free and (stop is None or not stop.running)

    def _stop_one(self, vehicle: Vehicle, other: Vehicle, near_miss: NearMiss) -> None:
        """Of two vehicles stop the one with the lower rank; with equal ranks the one with the later command."""
        ours = [one for one in (vehicle, other) if self._may_stop(one) and _moves(one)]
        if not ours:
            return
        held = min(ours, key=lambda one: (one.authority.rank, -one.guard.ordered.at))
        kept_from = other if held is vehicle else vehicle
        what = f"vehicle {kept_from.state.system}"
        near = {"vehicle": kept_from.state.system, "in_s": round(near_miss.seconds, 1)}
        self._stop(held, f"come too near to {what}", "other vehicle", lambda sentence: TooNear(sentence, near))

    def _stop(self, vehicle: Vehicle, deed: str, before: str, error_of: Callable[[str], UavApiError]) -> None:
        system = vehicle.state.system
        mode, circles = vehicle.holding_mode, vehicle.circles
        sentence = f"vehicle {system} was about to {deed}: it is stopped ({mode})"
        kind = "envelope" if before == "envelope" else "separation"
        log.critical("%s", sentence)
        self._announce(kind, system, sentence)
        commander = vehicle.authority.flies
        flown_by = commander or vehicle.authority.commander

        async def body(job: Job) -> str:
            command = vehicle.command(job)
            await command.take(Rank.PROTECT)
            await self._hear_pilot(vehicle)
            await command.switch_mode(mode)
            if not circles:
                await _stand(vehicle, mode)
            command.confirm()
            return sentence

        job = self._jobs.begin(
            vehicle, f"brake at the {before}", {"why": deed}, body, client=CLIENT, outlives_client=True
        )
        job.protects = True
        if flown_by is not None:  # his lease goes on
            job.holder, job.operator = flown_by.holder, flown_by.operator
        self._stops[system] = job
        if commander is not None:
            commander.abort(error_of(sentence), Ending.SUPERSEDED)
        job.when_ended(lambda: self._tell_failure(job, kind, system))

    async def _hear_pilot(self, vehicle: Vehicle) -> None:
        """Ask for a heartbeat before the stop: the pilot may have taken the vehicle since the last one.

        The stop begins HEAR_FOR s earlier for that. On a link that is slower nobody can wait for the answer.

        Raises:
            ModeChanged: he has it, or it does not fly for us any more.
        """
        asked_at, system = vehicle.clock(), vehicle.state.system
        if hear_for(vehicle):
            with contextlib.suppress(TimedOut):
                await vehicle.ask_heartbeat(HEAR_FOR)
        if not vehicle.flies_for_us:
            raise ModeChanged(f"the pilot or a failsafe has vehicle {system}, in {vehicle.mode}")
        if vehicle.state.heartbeat_at <= asked_at:
            silent = asked_at - vehicle.state.heartbeat_at
            sentence = f"vehicle {system} is stopped unheard: its pilot may have taken it in the last {silent:.1f} s"
            log.critical("%s", sentence)
            self._announce("envelope", system, sentence)

    def _tell_failure(self, job: Job, kind: str, system: int) -> None:
        if isinstance(job.error, UavApiError):
            self._announce(kind, system, f"vehicle {system} was not stopped: {job.error}")


async def _insist(ask: Callable[[], Awaitable[object]]) -> None:
    """Ask until the vehicle answers, a few times."""
    for _ in range(ASKED):
        with contextlib.suppress(UavApiError):
            await ask()
            return
        await asyncio.sleep(PAUSE)


async def _stand(vehicle: Vehicle, mode: str) -> None:
    """Wait until it stands."""
    longest = STANDS_WITHIN + 2 * _until_it_stands(vehicle)

    def stands() -> bool | None:
        try:
            return None if _moves(vehicle) else True
        except Stale:
            return None  # a gap in the telemetry; the deadline still holds

    await vehicle.until(mode, {"GLOBAL_POSITION_INT"}, stands, longest, "stand")


def leaving(vehicle: Vehicle) -> tuple[Space, Breach] | None:
    """The envelope that the vehicle is about to leave, and what it will break; None while it stays inside.

    Raises:
        Stale: its position, or home, is not known.
    """
    here, velocity = vehicle.guard.check.here(), _velocity(vehicle)
    if math.hypot(*velocity) < SLOWEST:
        return None
    seconds = _until_it_brakes(vehicle)
    coasted = _moved(here, velocity, seconds)
    heard = seconds + hear_for(vehicle) * vehicle.state.time_ratio.ratio
    end = coasted if _keeps_way(vehicle, here, coasted) else _stopping_place(vehicle, here, velocity, heard)
    for space in vehicle.guard.check.spaces:
        if space.missing:
            continue
        frame, rules = vehicle.guard.check.rules(space, here, 0.0, lands=vehicle.glides)
        way = [frame.spot((stop.lat, stop.lon), stop.up) for stop in (here, end)]
        breach = space.breach(way, rules)
        if breach is not None and _gets_worse(way, rules):
            return space, breach
    return None


def too_fast(vehicle: Vehicle, *, changed: bool = False) -> tuple[Space, str] | None:
    """The envelope that the vehicle is faster than, whoever has changed its speed, and which limit; None for none.

    A plane does not count: it can stop nowhere. `changed`: whether another station has changed its speed.

    Raises:
        Stale: its position is not known.
    """
    if vehicle.guard.check.circle:
        return None
    north, east, up = _velocity(vehicle)
    speeds = {"speed": math.hypot(north, east), "climb": up, "descent": -up}
    for space in vehicle.guard.check.spaces:
        for name, speed in speeds.items():
            limit = getattr(space.envelope.limits, name)
            if limit is not None and speed > (limit + CHANGED if changed else limit * FASTER + MORE):
                return space, f"the highest {name}"
    return None


def _moves(vehicle: Vehicle) -> bool:
    return math.hypot(*_velocity(vehicle)) >= SLOWEST


def _until_it_stands(vehicle: Vehicle) -> float:
    """Seconds of the vehicle's clock from now until it stands, if it is stopped after its next position."""
    speed, parameters = math.hypot(*_velocity(vehicle)), vehicle.state.parameters
    circle = vehicle.guard.check.circle
    if circle:
        return _until_it_brakes(vehicle) + 2 * circle / max(speed, 1.0)
    stopping = braking.of(vehicle.kind, parameters)
    way = stopping.to_rest(_velocity(vehicle), 0.0)
    return _until_it_brakes(vehicle) + 2 * math.hypot(*way) / max(speed, SLOWEST)


def _gets_worse(way: list[Spot], rules: Any) -> bool:
    before = outside_by(way[0], rules)
    return before <= TOUCH or outside_by(way[1], rules) > before + TOUCH


def _velocity(vehicle: Vehicle) -> tuple[float, float, float]:
    """m/s north, east, up."""
    north, east, down = vehicle.position().velocity
    return north, east, 0.0 if vehicle.guard.check.drives else -down


def _until_it_brakes(vehicle: Vehicle) -> float:
    """Seconds of the vehicle's clock from the newest position until a stop after the next one has an effect."""
    received = vehicle.state.messages["GLOBAL_POSITION_INT"]
    interval = INTERVAL if received.interval is None else received.interval
    on_its_way = max(braking.OURS, vehicle.state.trip.mean or 0.0)  # the position, and the stop
    return (interval + on_its_way) * max(vehicle.state.time_ratio.ratio, 0.1) + braking.ITS_OWN


def hear_for(vehicle: Vehicle) -> float:
    """Seconds for which a stop at the border waits for the pilot's heartbeat.

    0 on a link that is too slow for it, and for a simulated vehicle whose clock runs so fast that it costs metres.
    """
    is_quick = vehicle.state.trip.deadline <= HEAR_FOR and vehicle.state.time_ratio.ratio <= FASTEST_CLOCK
    return HEAR_FOR if is_quick else 0.0


def _stopping_place(
    vehicle: Vehicle, here: PathPoint, velocity: tuple[float, float, float], seconds: float
) -> PathPoint:
    circle = vehicle.guard.check.circle
    if circle:  # it circles: no farther ahead than a radius
        speed = math.hypot(*velocity[:2])
        more = circle / speed if speed > SLOWEST else 0.0
        return _moved(here, velocity, seconds + more)
    stopping = braking.of(vehicle.kind, vehicle.state.parameters)
    north, east, up = stopping.to_rest(velocity, seconds)
    return PathPoint(*moved(here.lat, here.lon, north, east), here.up + up)


def _moved(here: PathPoint, velocity: tuple[float, float, float], seconds: float) -> PathPoint:
    north, east, up = (seconds * speed for speed in velocity)
    return PathPoint(*moved(here.lat, here.lon, north, east), here.up + up)


def _keeps_way(vehicle: Vehicle, here: PathPoint, coasted: PathPoint) -> bool:
    """Whether it flies along a way that was allowed, at the end of which the autopilot stops by itself."""
    corridor = vehicle.guard.check.circle or (MISSION_CORRIDOR if flies_mission(vehicle.mode) else CORRIDOR)
    return all(vehicle.guard.is_on_way(stop, corridor) for stop in (here, coasted))
