"""The rules of the air, each stated once, as a judge of what `ScriptedWorld` sees.

They are written from the rules alone: nothing here asks the authority what it thinks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.control.command import CommandState
from tests.support.flights import Flight, Sent
from tests.support.scripted_world import ScriptedWorld

mavlink = mavutil.mavlink

FORCE, STOP, ARM, MOVEMENT = 4, 3, 2, 1
STOPPING_MODES = {"LAND", "RTL", "BRAKE"}
MODE_OF = {"land": "LAND", "rtl": "RTL", "brake": "BRAKE"}
BESIDE = {"set_heading", "set_yaw_rate", "resume", "set_home"}  # go beside a commander, and speeds do
GUIDED_ONLY = {"takeoff", "go_to_ned", "go_to_gps", "drive", "drive_body", "travel_at_ned", "travel_at_body"}
# Jobs of several verbs: from the takeoff on. What they switch to besides:
OF_SEVERAL = {"fly-track": {"RTL"}, "vision/mission": {"LAND", "RTL"}, "vision/land": {"LAND", "RTL"}}
GUIDED_ONLY |= OF_SEVERAL.keys() | {"vision/search"}
GUIDED_ONLY |= {f"{verb}_wait" for verb in GUIDED_ONLY if verb.startswith(("go", "drive"))}
ON_PURPOSE = {"land", "rtl", "brake", "guided", "set_mode", "disarm", "arm", "hold", "set_home"}
SPEED_MODES = {"GUIDED", "AUTO", "RTL"}
ENDS_STOP = {"resume", "guided", "set_mode", "land", "rtl", "brake", "takeoff"}
AUTOPILOTS = {"GUIDED", "AUTO", "LAND", "RTL", "BRAKE", "UNKNOWN"}  # every other mode is a pilot's

FLIGHT_LIMIT = 450.0  # s; landings, returns and the longest legs here, twice over and with their margin
QUICK_LIMIT = 60.0  # s; what is done by an ack and a heartbeat, others' of the same command before it
QUICK = {"brake", "guided", "set_mode", "disarm", "stop", "resume", "set_home", "hold"}
STOOD_FOR = 120.0  # s more for a job during which MAVProxy's main loop has stood
PILOT_NOTICED = 5.0  # s after which nothing that needs GUIDED runs on in a pilot's mode
STILL = 0.6  # m/s
JUST_NOW = 0.5  # s in which what somebody else did may have overtaken the answer
SENDINGS = 3  # of a place that is lost, besides the first one
LATE_SWITCH = 10.0  # s in which a mode may still come that an ended flight asked for
OLDER_ARRIVES = 5.0  # s from its sending in which an order may arrive
SHOWN_NOTICED = 0.6  # s from the heartbeat that shows a mode, in which the next one may be lost
STOP_SEEN = 1.5  # s after the answer


def rank(flight: Flight) -> int:
    """By the design's table."""
    verb, request = flight.verb, flight.job.request
    if verb == "disarm":
        return FORCE if request.get("force") else STOP
    if verb == "set_mode":
        return STOP if request["mode"] in STOPPING_MODES else ARM
    if verb in ("land", "rtl", "brake", "stop", "hold"):
        return STOP
    return ARM if verb in ("arm", "takeoff", "guided") else MOVEMENT


def goes_beside(flight: Flight) -> bool:
    """Whether it commands beside a movement."""
    return flight.verb in BESIDE or flight.verb.endswith("_speed")


def waits(flight: Flight) -> bool:
    """Whether it has not taken the vehicle yet: it asks it something before, for home or its mission."""
    return flight.job.vehicle.command(flight.job).state is CommandState.WAITING


def wanted_mode(flight: Flight) -> str:
    """The mode that it switches to, or needs; "" for none."""
    if flight.verb == "set_mode":
        return str(flight.job.request["mode"])
    if flight.verb in {"arm", "guided", "set_heading", "set_yaw_rate"} | GUIDED_ONLY:
        return "GUIDED"
    return MODE_OF.get(flight.verb, "BRAKE" if flight.verb in ("hold", "stop") else "")


class Judge:
    """Looks at what is sent and at what ends, and remembers what is against the rules.

    Attributes:
        broken: what was seen: the rule's name, and what broke it.
        is_blind: whether a second autopilot makes all that is seen doubtful; then two rules count only.
        touched_at: when somebody else last did something to the vehicle, or its link (s).
    """

    def __init__(self, world: ScriptedWorld) -> None:
        self.broken: list[str] = []
        self.is_blind = False
        self.touched_at = -math.inf
        self._world = world
        self._held: tuple[float, float] | None = None  # `stop` was answered: when, and when its mode began
        self._piloted_since: float | None = None
        self._at_send: list[Callable[[Sent], str | None]] = [
            self.an_ended_job_sends_nothing,
            self.nothing_lower_goes_out_while_a_stop_is_on_its_way,
            self.a_stopped_vehicle_gets_no_setpoint,
            self.in_a_pilots_mode_only_what_is_meant_for_it,
            self.who_loses_the_mode_sends_nothing_more,
            self.arm_leaves_a_vehicle_alone_that_others_armed,
            self.every_number_is_finite,
            self.two_autopilots_are_sent_nothing,
        ]
        self._at_end: list[Callable[[Flight], str | None]] = [
            self.success_is_what_the_vehicle_does,
            self.only_its_own_rank_supersedes_a_stop_on_its_way,
            self.nothing_is_busy_with_what_has_been_shown,
            self.nothing_fails_by_a_defect,
        ]
        self._at_times: list[Callable[[], str | None]] = [
            self.one_commands,
            self.every_job_ends_in_time,
            self.the_pilot_ends_what_needs_guided,
            self.a_stopped_vehicle_stands,
            self.no_task_dies_unheard,
        ]
        world.on_send.append(self._sent)
        world.on_ended.append(self._ended)
        world.host.listeners.append(self._heard)

    def touched(self) -> None:
        """Somebody else did something to the vehicle, or its link."""
        self.touched_at = self._world.now

    def look(self) -> None:
        """At any time."""
        mode = self._world.known.mode
        if mode in AUTOPILOTS:
            self._piloted_since = None
        elif self._piloted_since is None:
            self._piloted_since = self._world.now
        self._judge([(rule, rule()) for rule in self._at_times])

    def _heard(self, state: Any, message: Any, now: float) -> None:
        if message.get_type() == "HEARTBEAT":
            for one in self._world.running:
                if not (one.sent and self._shows(one)):
                    one.shown_since = None
                    continue
                one.shown_at = one.shown_at or now
                one.shown_since = one.shown_since or now

    def _sent(self, sent: Sent) -> None:
        self._judge([(rule, rule(sent)) for rule in self._at_send])
        takes_off = getattr(sent.message, "command", 0) == mavlink.MAV_CMD_NAV_TAKEOFF
        if sent.flight is not None and (sent.flight.verb in ENDS_STOP or takes_off):
            self._held = None

    def _ended(self, flight: Flight) -> None:
        self._judge([(rule, rule(flight)) for rule in self._at_end])
        state = self._world.known.state
        if flight.verb == "stop" and flight.job.error is None and flight.ended_in == "GUIDED" and not self.is_blind:
            self._held = self._world.now, state.mode_since

    def _judge(self, verdicts: list[tuple[Callable[..., Any], str | None]]) -> None:
        now = self._world.now
        if self.is_blind:
            seen = (self.two_autopilots_are_sent_nothing, self.nothing_fails_by_a_defect, self.no_task_dies_unheard)
            verdicts = [(rule, what) for rule, what in verdicts if rule in seen]
        self.broken += [f"{rule.__name__}, at {now:.2f} s: {what}" for rule, what in verdicts if what]

    @property
    def stopped(self) -> bool:
        """Whether a `stop` that was answered with 200 holds."""
        return self._held is not None and self._world.known.state.mode_since == self._held[1]

    # -- what is sent -----------------------------------------------------------------------------------------

    def an_ended_job_sends_nothing(self, sent: Sent) -> str | None:
        if sent.flight is None:
            return f"{sent.message} by nobody"
        if sent.flight.job.running or self._repeats(sent):
            return None
        return f"{sent.message} by {sent.flight}: {sent.flight.job.error}"

    def _repeats(self, sent: Sent) -> bool:
        """Whether it is the newest place of a movement that is done as soon as it was sent, and was lost on its way,
        or a speed that goes with that.

        Nobody has commanded the vehicle since, nor switched its mode or disarmed it.
        """
        flight = sent.flight
        places = [before for before in flight.sent if before.is_setpoint]
        is_speed = getattr(sent.message, "command", 0) == mavlink.MAV_CMD_DO_CHANGE_SPEED and len(places) > 1
        if (
            flight.job.error is not None
            or not places
            or not (is_speed or str(places[-1].message) == str(sent.message))
        ):
            return False
        newer = [one for one in self._world.flights.values() if int(one.job.id) > int(flight.job.id) and one.sent]
        is_ours = sent.mode == "GUIDED" and sent.armed and self._world.known.state.mode_since <= places[0].at
        return is_ours and len(places) <= SENDINGS and not [one for one in newer if not goes_beside(one)]

    def nothing_lower_goes_out_while_a_stop_is_on_its_way(self, sent: Sent) -> str | None:
        for one in self._world.running:
            on_its_way = rank(one) >= STOP and one is not sent.flight and one.sent and not self._is_shown(one)
            if on_its_way and (sent.flight is None or rank(sent.flight) < rank(one)):
                return f"{sent.message} by {sent.flight} while {one} is on its way"
        return None

    def _is_shown(self, flight: Flight) -> bool:
        return flight.shown_at is not None or self._shows(flight)

    def _shows(self, flight: Flight) -> bool:
        if flight.verb == "hold" and any(sent.is_setpoint for sent in flight.sent):
            return True  # zero velocities: a newer movement replaces them
        expected = wanted_mode(flight)
        return flight.verb != "stop" and expected != "" and self._world.known.mode == expected

    def a_stopped_vehicle_gets_no_setpoint(self, sent: Sent) -> str | None:
        if not self.stopped or not sent.is_setpoint or sent.flight.verb in ("guided", "set_mode", "hold", "resume"):
            return None
        return f"{sent.message} by {sent.flight}"

    def in_a_pilots_mode_only_what_is_meant_for_it(self, sent: Sent) -> str | None:
        if sent.mode in AUTOPILOTS or sent.flight is None:
            return None
        verb = sent.flight.verb
        if verb in OF_SEVERAL and (not sent.armed or self._world.known.state.landed):
            return None  # it begins as `arm` does
        late = self._modes_on_their_way(sent.flight)
        if verb == "stop" and late & {"GUIDED", "AUTO", sent.mode}:
            return None  # it stops what a switch of ours is about to begin, or has begun
        if verb not in ON_PURPOSE or (verb == "arm" and sent.flight.armed and not self._world.known.state.landed):
            return f"{sent.message} in {sent.mode} by {sent.flight}"
        return None

    def who_loses_the_mode_sends_nothing_more(self, sent: Sent) -> str | None:
        flight = sent.flight
        if flight is None or flight.verb in ("disarm", "set_home") or sent.mode == "UNKNOWN":
            return None
        if flight.verb.endswith("_speed"):
            return None if sent.mode in SPEED_MODES else f"{sent.message} in {sent.mode} by {flight}"
        order = getattr(sent.message, "command", 0)
        if rank(flight) >= STOP and order == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and not sent.message.param1:
            return None  # it undoes an arming of ours, in whatever mode
        own = {flight.mode, wanted_mode(flight), *OF_SEVERAL.get(flight.verb, ())}
        at_once = self._world.known.state.mode_since == flight.job.began_at  # nobody knows which came first
        if sent.mode in own or flight.mode == "UNKNOWN" or at_once:
            return None
        if sent.mode in self._modes_on_their_way(flight):  # ours, and older than this flight: nobody took the vehicle
            return None
        return f"{sent.message} by {flight}, which began in {flight.mode}, in {sent.mode}"

    def _modes_on_their_way(self, flight: Flight) -> set[str]:
        """The modes that flights which have ended asked for before that one began."""
        requested = [one for one in self._world.flights.values() if one.sent and not one.job.running]
        late = [one for one in requested if flight.job.began_at - one.sent[-1].at <= LATE_SWITCH]
        return {mode for one in late for mode in (wanted_mode(one), *OF_SEVERAL.get(one.verb, ()))}

    def arm_leaves_a_vehicle_alone_that_others_armed(self, sent: Sent) -> str | None:
        if sent.flight is None or sent.flight.verb != "arm" or sent.flight.armed or not sent.armed:
            return None
        if sent.mode == "GUIDED" and getattr(sent.message, "command", 0) == mavlink.MAV_CMD_DO_SET_MODE:
            return None  # it is in that mode already
        return f"{sent.message} by {sent.flight} to a vehicle that was armed meanwhile"

    def every_number_is_finite(self, sent: Sent) -> str | None:
        values = [getattr(sent.message, name) for name in sent.message.get_fieldnames()]
        bad = [value for value in values if isinstance(value, float) and not math.isfinite(value)]
        return str(sent.message) if bad else None

    def two_autopilots_are_sent_nothing(self, sent: Sent) -> str | None:
        if not self._world.known.state.are_two(sent.at):
            return None
        return f"{sent.message} by {sent.flight}, to two autopilots"

    # -- what ends ----------------------------------------------------------------------------------------------

    def success_is_what_the_vehicle_does(self, flight: Flight) -> str | None:
        unheard = JUST_NOW + self._world.way + self._world.jitter
        state, mode = self._world.known.state, flight.ended_in
        is_doubtful = mode == "UNKNOWN" or self._world.now - self.touched_at < unheard
        if flight.job.error is not None or is_doubtful:  # it has booted, or somebody has done something
            return None
        shown = {
            "land": state.armed is False,
            "rtl": state.armed is False,
            "disarm": state.armed is False,
            "arm": state.armed is True and mode == "GUIDED",
            "takeoff": state.armed is True and mode == "GUIDED",
        }.get(flight.verb, True)
        if flight.verb in ("brake", "guided", "set_mode"):
            shown = mode == wanted_mode(flight)
        return None if shown else f"{flight} is done: {mode}, armed: {state.armed}"

    def only_its_own_rank_supersedes_a_stop_on_its_way(self, flight: Flight) -> str | None:
        error = flight.job.error
        if getattr(error, "code", "") != "superseded" or rank(flight) < STOP or self._is_shown(flight):
            return None
        by = max(self._world.flights.values(), key=lambda one: int(one.job.id))
        named = [one for one in self._world.running if str(error).endswith(f"superseded by {one.job.verb}")]
        if any(rank(one) >= STOP for one in named or [by]):
            return None
        return f"{flight}: {error}"

    def nothing_is_busy_with_what_has_been_shown(self, flight: Flight) -> str | None:
        verb, on_its_way, _ = str(flight.job.error).partition(" is on its way")
        since = self._world.now - SHOWN_NOTICED - self._world.known.state.trip.deadline
        if since < self._world.stands_until:
            return None  # nobody has read what shows it
        for one in self._world.running:
            switches = one.verb in ("land", "rtl", "brake", "guided", "set_mode")
            switches &= wanted_mode(one) != one.mode  # no heartbeat shows a switch to the mode that it is in
            is_shown = one.shown_since is not None and one.shown_since < since and not self._may_be_undone(one)
            if on_its_way and one.job.verb == verb and switches and is_shown:
                return f"{flight}: {flight.job.error}"
        return None

    def _may_be_undone(self, stop: Flight) -> bool:
        """Whether an older order of ours may still arrive, and undo what has been shown."""
        since = self._world.now - OLDER_ARRIVES
        older = [one for one in self._world.flights.values() if int(one.job.id) < int(stop.job.id)]
        return rank(stop) >= STOP and any(
            sent.at >= since and not sent.is_setpoint for one in older for sent in one.sent
        )

    def nothing_fails_by_a_defect(self, flight: Flight) -> str | None:
        code = getattr(flight.job.error, "code", "")
        return f"{flight}: {flight.job.error!r}" if code == "internal" else None

    # -- at any time ----------------------------------------------------------------------------------------------

    def one_commands(self) -> str | None:
        commanders = [one for one in self._world.running if not goes_beside(one) and (one.sent or not waits(one))]
        stops = [one for one in commanders if one.verb == "stop"] or self._world.known.authority.paused
        allowed = 2 if stops else 1  # what a stop interrupts waits for its end
        return f"{[str(one) for one in commanders]}" if len(commanders) > allowed else None

    def every_job_ends_in_time(self) -> str | None:
        now = self._world.now
        for one in self._world.running:
            quick = one.verb in QUICK or one.verb.endswith("_speed")
            limit = QUICK_LIMIT if quick else FLIGHT_LIMIT
            if one is self._interrupted():
                continue
            limit += STOOD_FOR * (one.job.began_at <= self._world.stands_until)
            if now - one.job.began_at > limit:
                return f"{one} runs for {now - one.job.began_at:.0f} s"
        return None

    def _interrupted(self) -> Flight | None:
        job = self._world.known.authority.interrupted
        return None if job is None else self._world.flights[job.id]

    def the_pilot_ends_what_needs_guided(self) -> str | None:
        since = self._piloted_since
        now = self._world.now
        if since is None or now - since < PILOT_NOTICED or now < self._world.stands_until:
            return None  # whoever waits for an answer looks when it comes
        flying = [one for one in self._world.running if one.verb in GUIDED_ONLY and not waits(one)]
        left = [one for one in flying if one.job.began_at < since]
        return f"{left[0]} goes on in {self._world.known.mode}" if left else None

    def a_stopped_vehicle_stands(self) -> str | None:
        world = self._world
        now = world.now
        if not self.stopped or world.drone.mode != "GUIDED" or now - self._held[0] < STOP_SEEN:
            return None
        if self.touched_at > self._held[0] - 30.0:
            return None
        return f"it flies at {world.speed:.1f} m/s" if world.speed > STILL else None

    def no_task_dies_unheard(self) -> str | None:
        defects, self._world.loop.defects = self._world.loop.defects, []
        return str(defects[0]) if defects else None
