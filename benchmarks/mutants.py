"""Is each rule held by a test? Switches off one rule at a time, and runs the tests that should notice.

    python benchmarks/mutants.py [--family pilot] [--only NAME] [--list]

In a copy of the project, which is thrown away. Each mutant is a replacement in one file that matches exactly once.
The tests of the file, then those of its family, run until one fails; that test is named. Without a mutant they must pass. It
ends with a table, and with 1 if a mutant survives. `--list` only checks that all match.
"""

# ruff: noqa: E501  one rule, one line
from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
CORE = "mavproxy_uavapi/core/"
LONGEST = 240  # s of processor for the tests of one mutant; one that hangs is caught, too
ASLEEP = 1800  # s, likewise, for one that hangs and does nothing
COPIED = ("mavproxy_uavapi", "mavproxy_vision", "mavproxy_gradys", "tests", "examples", "docs", "benchmarks")

# Quickest first. A mutant may name a test of its own, which comes before these.
TESTS = {
    "rank": [
        "core/control",
        "core/vehicle",
        "rules/test_waiting_orders.py",
        "rules/test_one_commander.py",
        "rules/test_stop_meets_others.py",
        "rules/test_holds.py",
    ],
    "evidence": ["core/telemetry", "core/link", "core/control", "rules/test_slow_links.py"],
    "age": [
        "rules/test_standing_main_loop.py",
        "rules/test_late_switches.py",
        "core/mainloop/test_listening.py",
        "core/control/test_command.py",
        "core/vehicle/test_arming.py",
        "core/vehicle/test_guided.py",
        "core/mainloop/test_bridge.py",
    ],
    "pilot": [
        "core/control",
        "core/vehicle",
        "rules/test_pilots_switch.py",
        "rules/test_waiting_orders.py",
        "rules/test_late_switches.py",
        "rules/test_other_station.py",
        "rules/test_lost_targets.py",
        "rules/test_standing_main_loop.py",
        "rules/test_authority_machine.py::test_disarming_that_is_seen_undone_is_no_success",
        "rules/test_types_machine.py::test_mission_asked_for_in_auto_is_not_begun_over_the_pilots_guided",
        "rules/test_lease.py::test_guided_of_a_pilot_who_has_had_the_vehicle_back_is_his",
        "rules/test_hostile_moments.py::test_arm_that_waits_does_not_outlive_a_reboot",
        "vision/landing/test_envelope.py::test_a_pilot_who_takes_it_as_its_tag_leaves_the_envelope_keeps_it",
    ],
    "interrupt": [
        "core/control",
        "rules/test_authority_machine.py::"
        "test_stop_holds_although_the_mode_was_switched_there_and_back_before_it_was_written",
        "rules/test_authority_machine.py::test_hold_that_was_not_sent_yet_gives_way_to_no_lower_rank",
        "rules/test_stop_meets_others.py",
        "rules/test_hostile_moments.py",
    ],
    "confirm": [
        "core/control",
        "rules/test_authority_machine.py::test_stop_that_met_a_pilot_on_its_way_is_not_answered_with_success",
        "rules/test_authority_machine.py::"
        "test_older_switch_that_was_answered_is_no_reason_to_take_the_vehicle_from_its_pilot",
        "rules/test_protection.py",
        "core/link",
        "rules/test_overtaken_orders.py",
        "rules/test_late_evidence.py",
        "core/vehicle",
        "rules/test_types.py",
    ],
    "protection": ["rules/test_protection.py", "rules/test_envelope.py", "rules/test_hostile_moments.py"],
    "airspace": [
        "core/airspace",
        "rules/test_guard.py",
        "rules/test_envelope.py",
        "rules/test_standing_main_loop.py",
        "rules/test_separation.py",
    ],
    "lease": [
        "rules/test_lease.py",
        "rules/test_late_evidence.py",
        "rules/test_holds.py",
        "rules/test_protection.py",
    ],
    "endings": [
        "core/oversight",
        "core/control",
        "rules/test_lease.py",
        "rules/test_late_switches.py",
        "rules/test_other_station.py",
    ],
    "finite": ["core/link/test_link.py", "core/telemetry", "core/vehicle/test_vehicle.py", "rules/test_nonsense.py"],
}


class Mutant(NamedTuple):
    """A rule that is switched off: what stands there, and what is put in its place."""

    family: str
    name: str
    file: str
    old: str
    new: str


def rules(family: str, file: str, *rows: tuple[str, str, str]) -> list[Mutant]:
    """Rows of a name, what stands there, and its replacement."""
    return [Mutant(family, name, CORE + file, old, new) for name, old, new in rows]


MUTANTS = [
    *rules(
        "evidence", "vehicle/plane.py",
        ("a landing asks nothing first", "if self._vtol_state is not None:", "if False:"),
    ),
    *rules(
        "evidence", "link/message_waiter.py",
        ("one of two autopilots shows nothing", "            self.state.require_one(self.clock())\n", ""),
    ),
    *rules(
        "rank", "control/authority.py",
        ("a lower rank does not end what is on its way", "self.on_its_way and rank < self.rank:", "False:"),
        ("a stopped vehicle takes no movement", "if rank is Rank.MOVEMENT and self.paused and not", "if False and not"),
        ("who holds it is asked before a take", "        self.admit(rank)\n        job.require_permit()\n",
         "        self.admit(rank)\n"),
        ("who holds it is asked before a companion", "stopped_too=stopped_too)\n        job.require_permit()\n",
         "stopped_too=stopped_too)\n"),
        ("a verb is on its way until it is shown", "self._shown = job, rank, False", "self._shown = job, rank, True"),
        ("a commander supersedes a turn", "if rank > Rank.MOVEMENT or kind == YAW]", "if False]"),
        ("a superseded job has no right", '        raise Superseded(f"{job.verb} was superseded")', "        return"),
        ("a refused command changes nothing",
         "        allow()\n        if job is not self.commander:\n            self._sup",
         "        if job is not self.commander:\n            self._sup"),
        ("what waited takes from no newer one", "commander.is_newer_than(job) and", "False and"),
    ),
    *rules(
        "rank", "vehicle/vehicle.py",
        ("forced disarming ranks above all", "Rank.FORCE if force else Rank.STOP", "Rank.STOP"),
        ("a mode that stops ranks as a stop", "Rank.STOP if stops else Rank.ARM", "Rank.ARM"),
        ("arm outranks movements", "self.authority.take(job, Rank.ARM)", "self.authority.take(job, Rank.MOVEMENT)"),
    ),
    *rules(
        "interrupt", "control/authority.py",
        ("an interrupted job takes nothing", '            raise Paused(f"{job.verb} waits: the vehicle is stopped")',
         "            pass"),
        ("an interrupted job sends nothing",
         '            raise Paused(f"{job.verb} ended: the vehicle is stopped")', "            return"),
        ("a stop interrupts movements", "before.running and self.rank < Rank.STOP:", "False:"),
        ("resume gives the command back", "            self.commander, self.rank, self._shown = self._suspended\n",
         ""),
        ("a mode switch ends a pause", "and self._state.mode_since <= self._paused_at", ""),
    ),
    *rules(
        "interrupt", "control/command.py",
        ("an interrupted job waits for resume", "            if self._job is not authority.interrupted:\n",
         "            if True:\n"),
        ("disarming ends the wait for resume",
         '                raise NotArmed("the vehicle was disarmed while it was stopped")', "                return None"),
        ("the pilot ends the wait for resume",
         '                raise ModeChanged(f"the pilot or a failsafe switched the stopped vehicle to {name}")',
         "                return None"),
    ),
    *rules(
        "interrupt", "control/jobs.py",
        ("nobody joins an interrupted job", " and not self.is_interrupted", ""),
    ),
    *rules(
        "confirm", "control/mode_switch.py",
        ("an older heartbeat shows no switch", "math.inf if self.is_ambiguous else -math.inf", "-math.inf"),
        ("a switch that was undone is not shown", "left_again = self._has_shown and mode", "left_again = False and mode"),
        ("an older order may be overtaken", "if at < since and not any(", "if False and not any("),
    ),
    *rules(
        "confirm", "control/command.py",
        ("a stop outlasts our older orders", "        if not older:\n", "        if True:\n"),
        ("an older order that undid a stop is undone", "                return True\n            return False if clock()",
         "                return False\n            return False if clock()"),
    ),
    *rules(
        "confirm", "vehicle/copter.py",
        ("a stop that met a pilot is no success", "if self.state.mode_since > began and mode", "if False and mode"),
    ),
    *rules(
        "confirm", "control/command.py",
        ("an older order is undone where it is shown only", "one.is_shown() and sender", "sender"),
        ("a landing that waits for the border keeps its turn", "with vehicle.authority.keeping_turn(self._job):",
         "with contextlib.nullcontext():"),
    ),
    *rules(
        "pilot", "control/command.py",
        ("what begins leaves a pilot's GUIDED", "                vehicle.require_own_mode(since)\n            allow()",
         "                pass\n            allow()"),
    ),
    *rules(
        "confirm", "link/command_sender.py",
        ("an acknowledgement shows no mode", "            sent_at = self._waiting.clock()\n            with contextlib.supp",
         "            return\n            with contextlib.supp"),
        ("a heartbeat must follow the acknowledgements", "all(map(self._state.heartbeat_follows, acks))", "True"),
    ),
    *rules(
        "confirm", "vehicle/travelling.py",
        ("a stop ends when the vehicle stands", "lambda: self.has_stopped_since(since) or None", "lambda: True"),
        ("a position from before a stop shows nothing", 'self.stands_still and self.state.came_after(sent_at, "LOCAL_POSITION_NED")',
         "self.stands_still"),
    ),
    *rules(
        "confirm", "vehicle/guided.py",
        ("arrival is slow", "near and self.speed_by(target) <= ARRIVAL_SPEED", "near"),
        ("arrival is vertical, too", "horizontal <= tolerance and abs(up) <= tolerance", "horizontal <= tolerance"),
        ("what flies takes off once", 'raise Busy("the vehicle is flying already")', "pass"),
    ),
    *rules(
        "confirm", "vehicle/arming.py",
        ("arm is done when it is armed", "lambda: vehicle.state.armed or None", "lambda: True"),
        ("an arm of ours is undone", "while True:\n        sent_at", "for _ in (1,):\n        sent_at"),
    ),
    *rules(
        "confirm", "vehicle/vehicle.py",
        ("a fall is no landing", "if landing.fell:", "if False:"),
        ("a stop ends a waiting arm", "if not self.state.armed and (self.authority.on_its_way or self.arm_is_on_its_way):", "if False:"),
    ),
    *rules(
        "evidence", "telemetry/vehicle_state.py",
        ("a heartbeat left after the arrival, by the vehicle's clock",
         "return self.heartbeat_left >= self.trip.arrived_by(sent_at, self.time_ratio.ratio)", "return True"),
        ("without a clock two heartbeats count", "self.heartbeat_before_at >= sent_at + self.trip.longest", "True"),
        ("a heartbeat that waited tells nothing", ">= self.trip.time_at(at, self.time_ratio.ratio) - HEARTBEAT_PERIOD",
         "> 0"),
        ("an overtaken heartbeat does not count", "        if self._is_overtaken(sequence, left):\n",
         "        if False:\n"),
        ("an acknowledgement counts once", "        if not self.ack_is_copy:\n", "        self.ack_is_copy = False\n        if True:\n"),
        ("a heartbeat from before an order shows nothing",
         "came_at > sent_at + (0.0 if self.trip.mean is None else self.trip.deadline)", "True"),
        ("arming moves home", '            self.messages.pop("HOME_POSITION", None)\n        self.sys',
         "            pass\n        self.sys"),
        ("two autopilots are told apart", "        if self.are_two(now):\n", "        if False:\n"),
    ),
    *rules(
        "evidence", "telemetry/time_ratio.py",
        ("what was long on its way is no second clock", "self._newest[0] - self._returned_since >= LATE", "True"),
        ("a double that is gone is gone", "both_come = now - self._newest[0] <= LATE", "both_come = True"),
        ("whose double is gone keeps its clock", "if now - self._newest[0] > TWO_CLOCKS_FOR:", "if False:"),
    ),
    *rules(
        "evidence", "telemetry/trip.py",
        ("the slowest trip counts", "max(smoothed, max(self._slowest) + GRAIN)", "smoothed"),
        ("an overtaking answer dates nothing", "max(overtaking - (first.sent_at - sent_at), 0.0) * ratio", "0.0"),
        ("a boot forgets the clock", "            self.forget_clock()  # it has booted", "            pass"),
        ("two answers are two clocks", "if not pace * (asked_at", "if False and not (asked_at"),
        ("a doubled answer is no second clock", "<= pace * (now - asked_at) + GRAIN:", "<= pace * GRAIN:"),
    ),
    *rules(
        "evidence", "link/command_sender.py",
        ("a trip is measured by what was sent once", "and not confirmation and command.number", "and command.number"),
        ("what takes is sent again with evidence only", "if confirmation and command.takes:", "if False:"),
        ("a late acknowledgement tells what was done", "[counted:] if alone else []", "[counted:] if False else []"),
        ("what was counted is not late", "counted = len(self._answers(number, since)[0])", "counted = 0"),
        ("what takes is not sent again over a gap", "unbroken=not permit.stops", "unbroken=False"),
        ("a late acknowledgement proves nothing", "late = others if command.proven_by_ack else 0", "late = 0"),
        ("what was done and undone is not done again", "            if not others:  #", "            if False:  #"),
        ("what must not be repeated is not", "SENDINGS if command.repeatable else 1", "SENDINGS"),
    ),
    *rules(
        "evidence", "link/message_waiter.py",
        ("an acknowledgement to others is none of ours", "is_to(message, self._asker)", "True"),
        ("another component's acknowledgement is none", "message.get_srcComponent() == self._state.component and", ""),
    ),
    *rules(
        "age", "mainloop/bridge.py",
        ("a message expires", "self.loop.call_later(remaining, expire)", "self.loop.call_later(9e9, expire)"),
        ("what changed is checked again", "if permit.system and (is_late or", "if False and (is_late or"),
        ("the check is called again", "                permit.check()\n", ""),
        ("the airspace is asked again", "                permit.again()\n", ""),
        ("the links are read first", "return self._feeding or self.links_have_unread()", "return False"),
        ("a cancelled call never runs", "            claim.clear()\n            timer.cancel()", "            timer.cancel()"),
    ),
    *rules(
        "age", "mainloop/listening.py",
        ("a standing loop is no silence", "heard + STANDS, now", "heard + gap, now"),
        ("what waits is read before it is judged", "        elif behind_since is None:\n", "        else:\n"),
        ("waits are patient", "seconds = min(seconds - (self.seconds() - began), ", "seconds = min(0.0, "),
        ("waits are not patient for ever", "+ seconds + LONGEST_PATIENCE", "+ seconds + 9e9"),
        ("a link that is never empty is heard", "now - self._went_on_at > READ_LONGEST or", "False or"),
    ),
    *rules(
        "evidence", "telemetry/packet_loss.py",
        ("what is missing is known", "return any(noticed_at >= at for noticed_at in self._missing.values())",
         "return False"),
    ),
    *rules(
        "age", "telemetry/vehicle_state.py",
        ("what waited is old", "at = now if came_after is None else came_after", "at = now"),
        ("what waited tells no pace", "if not waited and self.time_ratio.update(", "if self.time_ratio.update("),
        ("what waited measures no trip", " and message.tc1 and not waited:", " and message.tc1:"),
    ),
    *rules(
        "age", "control/mode_switch.py",
        ("an unwritten switch is nobody's", " if request.written.value is not False}", "}"),
    ),
    *rules(
        "age", "control/command.py",
        ("another commander counts where it is written", "(vehicle.authority.epoch, self", "(0, self"),
        ("the end of its job counts where it is written", "epoch, self._job.running, ", "epoch, "),
        ("who switched it before a longer job takes it keeps it", "if since > self._job.began_at:", "if False:"),
        ("what waited hears the pilot", "elif vehicle.clock() - began > MOMENT:", "elif False:"),
        ("a second autopilot counts where it is written", ", vehicle.state.are_two(vehicle.clock())),", "),"),
        ("what stops lasts longer", "STOP_LASTS if stops else ORDER_LASTS", "ORDER_LASTS"),
    ),
    *rules(
        "age", "vehicle/reporting.py",
        ("an old position flies nothing", "if age is None or age > FRESH:", "if age is None:"),
    ),
    *rules(
        "age", "vehicle/base.py",
        ("an order to arm may be on its way", "self.state.armed is False and may_come", "False"),
        ("an unwritten order to arm is none", "self.arm_written.value is not False and ", ""),
    ),
    *rules(
        "pilot", "vehicle/reporting.py",
        ("a verb ends with its mode", "        if self.mode != mode:\n            raise ModeChanged(f\"the vehicle left",
         "        if False:\n            raise ModeChanged(f\"the vehicle left"),
        ("a verb ends with disarming", "        if not self.state.armed:  # the mode comes", "        if False:  # the mode"),
    ),
    *rules(
        "pilot", "vehicle/base.py",
        ("the pilot's switch ends what waited", "if self.state.mode_since != since and not self.is_in_own_mode:",
         "if False:"),
        ("what comes late hears him first", "        await self.waiting.heartbeat_after(self.clock())\n",
         "        return\n"),
    ),
    *rules(
        "pilot", "control/mode_switch.py",
        ("his switch ends ours", "if mode not in self._ours or left_again:", "if left_again:"),
        ("his mode is not ours", "<= since <= request.at + self._answered_within", "<= math.inf"),
        ("what was answered is not answered again", "        return not any(shown == mode and", "        return not any(False and"),
    ),
    *rules(
        "pilot", "control/command.py",
        ("he may switch while home is asked for",
         "if rank < Rank.STOP or self._job is vehicle.authority.commander:\n                vehicle.require_own_mode(since)\n",
         "if False:\n                pass\n"),
        ("a longer job that stops asks, too", " or self._job is vehicle.authority.commander:\n", ":\n"),
        ("he may switch while a verb asks for something", "vehicle.require_own_mode(authority.taken_in)", "pass"),
        ("who waits at a gate may still begin when it opens", "if await pass_gate(may_begin):", "if await pass_gate():"),
    ),
    *rules(
        "interrupt", "vehicle/copter.py",
        ("a stop holds from when it is written", ", self.authority.keep_pause\n", ",\n"),
    ),
    *rules(
        "interrupt", "vehicle/travelling.py",
        ("a hold is shown once it was sent", "if was_sent and", "if"),
    ),
    *rules(
        "pilot", "vehicle/guided.py",
        ("another station's target is its own", "return self.mode == GUIDED and self.own_target.is_foreign",
         "return False"),
        ("a lost target is not repeated over his switch", "if self.state.mode_since > began or not (", "if not ("),
    ),
    *rules(
        "pilot", "vehicle/arming.py",
        ("who switched an armed vehicle since the request keeps it", "(not was_armed or is_switched or", "(not was_armed or"),
        ("who switched a disarmed one keeps it", "        if is_switched:\n", "        if False:\n"),
        ("a disarming that is undone is no success", "    if vehicle.state.armed:\n        raise ModeChanged(\"the vehicle is",
         "    if False:\n        raise ModeChanged(\"the vehicle is"),
        ("who armed it keeps it", "(not was_armed or is_switched or vehicle.is_under_way)", "False"),
        ("who armed it while ours waited keeps it", "if vehicle.state.armed and not written.value:", "if False:"),
        ("who changes its battery stands beside it", "    if vehicle.state.rebooted_at > job.began_at:\n", "    if False:\n"),
        ("it is heard after a wait", "    if has_waited and not vehicle.state.armed:\n", "    if False:\n"),
    ),
    *rules(
        "pilot", "vehicle/vehicle.py",
        ("a return leaves a vehicle that he armed", "        self.require_disarmed()\n        return True",
         "        return True"),
    ),
    *rules(
        "protection", "oversight/envelope_watch.py",
        ("the border's brake outranks stops", "await command.take(Rank.PROTECT)", "await command.take(Rank.STOP)"),
        ("it protects", "        job.protects = True\n", ""),
        ("it hears the pilot first", "        if not vehicle.flies_for_us:\n            raise ModeChanged(f\"the pilot or",
         "        if False:\n            raise ModeChanged(f\"the pilot or"),
        ("it asks for a heartbeat", "        if hear_for(vehicle):\n", "        if False:\n"),
        ("it is done when the vehicle stands", "            if not circles:\n", "            if False:\n"),
        ("it leaves a pilot's vehicle alone", "return vehicle.flies_for_us and is_free", "return is_free"),
    ),
    *rules(
        "protection", "control/command.py",
        ("a landing waits for the border", "        if not vehicle.authority.is_protected:\n", "        if True:\n"),
        ("a landing that waited hears the pilot",
         "        vehicle.require_own_mode(since)\n        return True", "        return True"),
    ),
    Mutant("protection", "nobody deletes it", "mavproxy_uavapi/http/handlers/jobs.py", "    if job.protects and ", "    if False and "),
    *rules(
        "protection", "control/jobs.py",
        ("the API's end does not end it", " and not job.protects:", ":"),
    ),
    *rules(
        "airspace", "airspace/guard.py",
        ("every message passes the guard", "        self._guard.require(message)\n", ""),
        ("protected parameters", "if decides_where(order.name.upper()):", "if False:"),
        ("home stays in flight", "raise OutsideEnvelope(\"home cannot", "str(\"home cannot"),
        ("what nobody knows is refused", "            raise OutsideEnvelope(f\"nobody can say whether", "            str(f\"nobody can say"),
        ("ways keep apart", "            self.traffic.require(self._vehicle, way)\n", "            pass\n"),
        ("the envelope counts where it is written", "again=lambda: self._guard.require(message), ", ""),
        ("another envelope counts where it is written", "return permit.basis(), self._guard.basis", "return permit.basis()"),
        ("a newer envelope ends the trust in a way", " and self._still_allows()", ""),
        ("a changed mission is checked anew", "            self._checked_mission = None\n", "            pass\n"),
    ),
    *rules(
        "airspace", "airspace/mission_guard.py",
        ("no target is too far away", "    if not distance <= REACH:\n", "    if False:\n"),
        ("an unchecked mission is not flown", "        if self._checked_mission is None:\n            raise",
         "        if False:\n            raise"),
        ("a check grows old", "and self._vehicle.clock() - self._checked_mission[1] > CHECKED_FOR:", "and False:"),
    ),
    *rules(
        "airspace", "airspace/space.py",
        ("a place that is no number breaks it", "            if not all(map(math.isfinite, spot)):\n", "            if False:\n"),
    ),
    *rules(
        "lease", "oversight/leases.py",
        ("a call renews it", "                lease.ends_at = self._clock() + lease.seconds\n", "                pass\n"),
        ("a lost link ends none", "heard = vehicle.state.heard_since(lease.ends_at) and", "heard = True or"),
        ("a heartbeat from before its end shows nothing", "vehicle.state.heard_since(lease.ends_at)", "vehicle.state.heartbeat_at > lease.ends_at"),
        ("another's command ends it", "        if commander is None or not lease.covers(commander):\n",
         "        if commander is None:\n"),
        ("a landing goes on", "in (Situation.LAND, Situation.RTL):", "in ():"),
        ("the border's brake goes on", " and not commander.protects:", ":"),
        ("a refused call changes none", "        job.when_commanding(begun)\n", "        begun()\n"),
    ),
    *rules(
        "lease", "oversight/envelope_watch.py",
        ("the border keeps whose flight it was", "        if flown_by is not None:", "        if False:"),
    ),
    *rules(
        "lease", "oversight/leases.py",
        ("a hold keeps others off", "if holder is not None and operator.role <= holder.role:", "if False:"),
        ("an operator takes from his own role only by right",
         "        if holder is not None and not operator.takes_from(holder):\n"
         "            raise Busy(f\"{holder.name} holds vehicle {vehicle.state.system}; only",
         "        if False:\n            raise Busy(f\"{holder.name} holds vehicle {vehicle.state.system}; only"),
    ),
    *rules(
        "endings", "vehicle/base.py",
        ("a failsafe keeps it", "return self.state.is_failing and self.mode in self.failsafe_modes", "return False"),
    ),
    *rules(
        "endings", "vehicle/own_target.py",
        ("a plane's own place is no station's", "            return not self._is_where_it_began(reported)\n", "            return True\n"),
    ),
    *rules(
        "endings", "oversight/endings.py",
        ("a deleted flight holds", "    Ending.ABORTED: Policy.HOLD,\n", "    Ending.ABORTED: Policy.NOTHING,\n"),
        ("a defect is made safe", "    Ending.DEFECT: Policy.SAFE,\n", "    Ending.DEFECT: Policy.NOTHING,\n"),
        ("a stream that fails holds", "job.ending is Ending.FAILED and job.steers and", "False and"),
        ("a pilot's flight is left alone", "        if not vehicle.obeys_us or vehicle", "        if vehicle"),
        ("another station keeps its target", "is_anothers = vehicle.next_mode == \"GUIDED\" and", "is_anothers = False and"),
        ("a return goes on without us", " and not job.vehicle.authority.has_shown(job)]", "]"),
        ("a return that is on its way does, too", "if action != HOLD and action.upper()", "if False and action.upper()"),
        ("the pilot is heard first", "if switches_mode and not at_once:", "if False:"),
        ("a landing by the mission is one", " or (flies_mission(mode) and vehicle.lands_by_mission)", ""),
        ("an arm on its way is undone", "disarmed = Situation.ARMING if vehicle.arm_is_on_its_way", "disarmed = Situation.ARMING if False"),
        ("what is on the ground stays", "return Situation.IDLE if vehicle.stands else flown", "return flown"),
    ),
    *rules(
        "finite", "link/link.py",
        ("no number that is not finite is sent", "    if not is_finite(message):\n", "    if False:\n"),
    ),
    *rules(
        "finite", "telemetry/vehicle_state.py",
        ("what is not finite is not received", "        if name in FLOWN_BY and not is_finite(message):\n", "        if False:\n"),
    ),
    *rules(
        "finite", "telemetry/vehicle_states.py",
        ("MAVProxy's table is finite", "if math.isfinite(value)}", "}"),
    ),
    *rules(
        "finite", "telemetry/trip.py",
        ("a clock is finite", "        if not math.isfinite(vehicle_time):\n", "        if False:\n"),
    ),
]  # fmt: skip


def applied(root: Path, mutant: Mutant) -> str:
    """The mutated text of its file.

    Raises:
        ValueError: it does not match exactly once.
    """
    text = (root / mutant.file).read_text(encoding="utf-8")
    if text.count(mutant.old) != 1:
        raise ValueError(f"{mutant.name}: {text.count(mutant.old)} matches in {mutant.file}")
    return text.replace(mutant.old, mutant.new)


def failing(root: Path, files: Iterable[str], longest: float = LONGEST) -> str:
    """The first test of these files that fails; "" for none. `longest`: s until they hang."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "-m",
        "not long and not sitl",
    ]
    tests = [f"tests/{one}" for one in files]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    try:
        done = subprocess.run(
            [*command, *tests],
            cwd=root,
            env=environment,
            capture_output=True,
            text=True,
            timeout=ASLEEP,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(longest), int(longest))),
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "it hangs"
    if done.returncode in (0, -signal.SIGXCPU, -signal.SIGKILL):
        return "it hangs" if done.returncode else ""
    found = re.search(r"^(?:FAILED|ERROR) tests/(\S+)", done.stdout, re.MULTILINE)
    return found[1] if found else f"pytest ended with {done.returncode}: {done.stderr[-200:]}"


def own_tests(mutant: Mutant) -> list[str]:
    """The test file that mirrors the mutated one, if there is one: the first to notice."""
    folder, _, name = mutant.file.removeprefix("mavproxy_uavapi/").rpartition("/")
    own = f"{folder}/test_{name}"
    return [own] if (ROOT / "tests" / own).exists() else []


def caught_by(root: Path, mutant: Mutant) -> str:
    """The test that notices; "" for none."""
    file = root / mutant.file
    before = file.read_text(encoding="utf-8")
    file.write_text(applied(root, mutant), encoding="utf-8")
    try:
        own = own_tests(mutant)
        return (failing(root, own) if own else "") or failing(root, TESTS[mutant.family])
    finally:
        file.write_text(before, encoding="utf-8")


def main() -> int:
    """Run; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--family", choices=TESTS)
    parser.add_argument("--only", help="a part of a name")
    parser.add_argument("--list", action="store_true", help="only check that each matches once")
    options = parser.parse_args()
    chosen = [one for one in MUTANTS if options.family in (None, one.family) and (options.only or "") in one.name]
    wrong = []
    for one in chosen:
        try:
            applied(ROOT, one)
        except ValueError as error:
            wrong.append(str(error))
    print(f"{len(chosen)} mutants", *wrong, sep="\n")
    if wrong or options.list:
        return bool(wrong)
    survivors = 0
    with tempfile.TemporaryDirectory() as directory:
        root = Path(directory)
        for name in COPIED:
            shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
        for file in ROOT.glob("*.*"):
            if file.is_file():
                shutil.copy(file, root)
        used = dict.fromkeys(file for one in chosen for file in TESTS[one.family])
        failed = failing(root, used, len({one.family for one in chosen}) * LONGEST)
        if failed:
            print(f"{failed} fails without a mutant, too")
            return 1
        for one in chosen:
            began = time.monotonic()
            by = caught_by(root, one)
            survivors += not by
            print(f"{one.family:10} {one.name:58} {by or 'SURVIVES'}  {time.monotonic() - began:.0f} s", flush=True)
    print(f"{survivors} of {len(chosen)} survive")
    return bool(survivors)


if __name__ == "__main__":
    sys.exit(main())
