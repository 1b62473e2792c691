"""Who changed a vehicle's mode, or disarmed it, by what the autopilot says around that moment. Pure."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.audit import name_of
from mavproxy_uavapi.core.errors import REBOOTED, SOMEBODY, ModeChanged, StateChanged
from mavproxy_uavapi.core.telemetry.statustexts import StatusText
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.text import line_of

mavlink = mavutil.mavlink

BEFORE, AFTER = 2.0, 1.0  # s around a change, in which a text tells of it
ORDERED_WITHIN = 1.5  # s from an order's ack, or a move of the switch, to the heartbeat that shows the mode
MOST_TEXTS = 3  # in a sentence
ABOUT_ARMING = ("PreArm:", "Arm:")  # how texts begin that tell of the next flight
# What ArduPilot says when it starts. Its clock, which shows a reboot for certain, may come seconds later.
BOOTED = re.compile(r"^(Initialising Ardu|ArduPilot Ready|Calibrating barometer|EKF\d IMU\d initialised|Ardu\w+ V\d)")
FAILSAFE = re.compile("failsafe|fence|breach|crash|vibration|thrust loss|parachute|out of control", re.IGNORECASE)
SET_MODE = 11  # the message SET_MODE, as its ack names it
ORDERS = {
    "mode": {mavlink.MAV_CMD_DO_SET_MODE, SET_MODE},
    "armed": {mavlink.MAV_CMD_COMPONENT_ARM_DISARM},
    "boot": {mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN},
}


class Author(Enum):
    """Who did it: the value is for callers."""

    CLIENT = "client"  # a job of ours
    FAILSAFE = "failsafe"
    STATION = "station"  # MAVProxy's prompt, or another ground station
    REBOOT = "reboot"
    PILOT = "pilot"  # by the switch of the radio
    UNKNOWN = "unknown"


@dataclass
class VehicleChange:
    """A change of a vehicle that its messages showed.

    Attributes:
        what: `mode`, `armed` or `boot`.
        system: the vehicle's system id.
        at: when it was shown (s).
        before, after: modes; or `armed`, `disarmed`, `booted`.
        mode: the mode in which it is; for a boot, was.
        was: what it was before: `armed in GUIDED`.
        job: the job that did it; None where none of ours did.
        last_sent: what was sent to the vehicle last: `message`, `seconds_before`, and the `job`, `verb` and `client`.
        in_flight: whether the vehicle was in the air.
    """

    what: str
    system: int
    at: float
    before: str
    after: str
    mode: str
    was: str
    job: Any = None
    last_sent: dict[str, Any] | None = None
    in_flight: bool = False


@dataclass(frozen=True)
class Cause:
    """Why a vehicle changed.

    Attributes:
        author: who did it.
        who: the same in words.
        texts: what the autopilot said around that moment, oldest first.
        telling: those of `texts` that matter, for a sentence.
    """

    author: Author
    who: str
    texts: tuple[str, ...] = ()
    telling: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """The telling texts in brackets, behind a space; empty without any."""
        return f" ({line_of('; '.join(self.telling))})" if self.telling else ""


def cause_of(change: VehicleChange, state: VehicleState, switch_moved_at: float) -> Cause:
    """Why a vehicle changed, as far as it is known now.

    Args:
        change: the change.
        state: its state, with its texts and acks.
        switch_moved_at: when the radio's mode switch moved last (s).
    """
    around = [text for text in state.statustexts if change.at - BEFORE <= text.at <= change.at + AFTER]
    texts, telling = tuple(text.text for text in around), _telling(around)
    if change.job is not None:
        return Cause(Author.CLIENT, f"{name_of(change.job.verb)} of {change.job.client}", texts)
    if change.what != "boot" and any(BOOTED.search(text) for text in texts):
        return Cause(Author.REBOOT, "a reboot", texts)
    if any(FAILSAFE.search(text) for text in telling):
        return Cause(Author.FAILSAFE, "a failsafe", texts, telling)
    if change.what == "armed":  # a landing ends so, whatever the autopilot says besides
        telling = ()
    if change.what == "mode" and abs(switch_moved_at - change.at) <= ORDERED_WITHIN:
        return Cause(Author.PILOT, "the pilot", texts, telling)
    if _is_ordered(change, state):
        return Cause(Author.STATION, "MAVProxy's prompt or another station", texts, telling)
    # ArduPilot says of each failsafe what it does; a text that is lost may be such a one.
    unheard = bool(telling) or state.packets.has_any_since(change.at - BEFORE)
    return Cause(Author.UNKNOWN, SOMEBODY if unheard else "the pilot or another station", texts, telling)


def _telling(texts: Sequence[StatusText]) -> tuple[str, ...]:
    """The most severe texts, the last ones; none of those that a later one begins with."""
    texts = [text for text in texts if not text.text.startswith(ABOUT_ARMING)]
    severest = min((text.severity for text in texts), default=mavlink.MAV_SEVERITY_INFO)
    if severest >= mavlink.MAV_SEVERITY_INFO:
        return ()
    said = list(dict.fromkeys(text.text for text in texts if text.severity == severest))
    kept = [text for n, text in enumerate(said) if not any(later.startswith(text) for later in said[n + 1 :])]
    return tuple(kept[-MOST_TEXTS:])


def _is_ordered(change: VehicleChange, state: VehicleState) -> bool:
    """Whether the autopilot has acknowledged an order to do that, which is none of ours."""
    return any(
        ack.command in ORDERS[change.what]
        and ack.result == mavlink.MAV_RESULT_ACCEPTED
        and abs(at - change.at) <= ORDERED_WITHIN
        for at, ack in state.acks
    )


def shown_boot(change: VehicleChange) -> VehicleChange:
    """The boot of which a change is what came after it."""
    before = change.was.partition(" in ")[0]
    return replace(change, what="boot", before=before, after="booted", in_flight=False)


def explain(error: StateChanged, change: VehicleChange, cause: Cause, time: str) -> None:
    """Have an error of the moment say why.

    Args:
        error: an error that the change has caused, or that came just before a boot was shown.
        change, cause: see there.
        time: of the change, UTC.
    """
    sentence = str(error)
    if cause.author is Author.REBOOT:
        change = shown_boot(change)
    if change.what == "boot":
        sentence = REBOOTED
    elif isinstance(error, ModeChanged):
        sentence = sentence.replace(SOMEBODY, cause.who)
    elif cause.author is not Author.UNKNOWN:
        sentence += f", by {cause.who}"
    error.explain(report_of(change, cause, time), cause.texts, sentence + cause.words)


def report_of(change: VehicleChange, cause: Cause, time: str) -> dict[str, Any]:
    """A change and who did it, for callers."""
    what: dict[str, Any] = {"what": change.what, "from": change.before, "to": change.after, "time": time}
    if change.in_flight:
        what["in_the_air"] = True
    return {**what, "mode": change.mode, "by": cause.author.value, "last_sent": change.last_sent}


def sentence_of(change: VehicleChange, cause: Cause) -> str:
    """A change in words, with its cause."""
    vehicle = f"vehicle {change.system}"
    if change.what == "boot":
        return f"the autopilot of {vehicle} restarts; it was {change.was}{cause.words}"
    if change.what == "mode":
        return f"{vehicle} changes from {change.before} to {change.after}, by {cause.who}{cause.words}"
    deed = "arms" if change.after == "armed" else f"disarms{' in the air' if change.in_flight else ''}"
    by = "" if cause.author is Author.UNKNOWN else f", by {cause.who}"
    return f"{vehicle} {deed} in {change.mode}{by}{cause.words}"
