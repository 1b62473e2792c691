"""The one error tree; each error names its machine code and its HTTP status.

    UavApiError                500 internal
    |- BadRequest              400 bad_request
    |- Unauthorized            401 unauthorized
    |- Forbidden               403 forbidden
    |- NotFound                404 not_found
    |  `- NotSupported         404 not_supported
    |- Conflict                409 (one of its children)
    |  |- Superseded           409 superseded     a newer command took over
    |  |- StateChanged         409 (one of its children)
    |  |  |- ModeChanged       409 mode_changed   the pilot or a failsafe has the vehicle
    |  |  `- NotArmed          409 not_armed
    |  |- Busy                 409 busy           the state forbids it now
    |  |- NotRehearsed         409 not_rehearsed  the setting `rehearse` requires it
    |  |- Paused               409 paused         `stop` holds the vehicle
    |  |- OutsideEnvelope      409 outside_envelope
    |  |- TooNear              409 too_near       it would come too near to another vehicle
    |  |- Expired              409 expired        it could not be sent in time, so it was not sent
    |  `- Aborted              409 aborted
    |- Invalid                 422 invalid        nothing was sent
    |  `- SettingError         422 invalid        an unknown setting, or a value that it refuses
    |- TooManyRequests         429 too_many_requests
    |- Rejected                500 rejected       the autopilot refused
    |- ToolFailed              500 tool_failed    a program that we started failed
    |  |- ToolMissing          503 tool_missing   it is not installed
    |- Unavailable             503 (one of its children)
    |  |- LinkLost             503 link_lost
    |  |- NoVehicle            503 no_vehicle
    |  `- Stale                503 stale
    `- TimedOut                504 timeout

An error's text is a sentence that a pilot understands. `http/contract/responses.py` turns any into an answer; nothing
else uses the statuses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

SOURCES = (["query"], ["body"])
REBOOTED = "the autopilot rebooted meanwhile"
SOMEBODY = "the pilot or a failsafe"  # whose deed it was, as long as nobody knows better


class UavApiError(Exception):
    """Base of all errors of this project: a sentence, a machine code and an HTTP status."""

    status = 500
    code = "internal"
    is_audited = False  # whether the audit trail has an entry of its own for it

    @property
    def detail(self) -> str | list[dict[str, Any]]:
        """What the answer's `detail` says."""
        return str(self)

    def extras(self) -> dict[str, Any]:
        """Further members of the answer's body."""
        return {}


def without_frames(error: UavApiError) -> UavApiError:
    """The same error without traceback and causes, which would keep many objects alive while a job keeps it."""
    error.__cause__ = error.__context__ = None
    return error.with_traceback(None)


class BadRequest(UavApiError):
    """The request's body or one of its arguments cannot be used."""

    status, code = 400, "bad_request"


class Unauthorized(UavApiError):
    """A token is needed and is missing or wrong."""

    status, code = 401, "unauthorized"


class Forbidden(UavApiError):
    """A foreign origin or host, or a feature that is switched off."""

    status, code = 403, "forbidden"


class NotFound(UavApiError):
    """No such path, script, job, or message."""

    status, code = 404, "not_found"


class NotSupported(NotFound):
    """A verb that this type of vehicle does not have."""

    code = "not_supported"


class Conflict(UavApiError):
    """The state of the vehicle, or another commander, forbids it."""

    status, code = 409, "conflict"


class Superseded(Conflict):
    """A newer movement or flight command took over."""

    code = "superseded"


class StateChanged(Conflict):
    """The vehicle is not in the state that the verb needs.

    Attributes:
        change: how it came to that: `what` has changed, `from`, `to`, `time` (UTC), `mode`, `by` whom, and what was
            `last_sent`; empty where nobody knows.
        statustext: what the autopilot said then.
    """

    def __init__(
        self, sentence: str, change: Mapping[str, Any] | None = None, statustext: Sequence[str] = ()
    ) -> None:
        super().__init__(sentence)
        self._explained = sentence  # what the text begins with; others may have added to it
        self.change, self.statustext = dict(change or {}), list(statustext)

    def explain(self, change: Mapping[str, Any], statustext: Sequence[str], sentence: str | None = None) -> None:
        """Add why; `sentence` takes the place of the error's own."""
        self.change, self.statustext = dict(change), list(statustext)
        if sentence is not None:
            added = str(self).removeprefix(self._explained) if str(self).startswith(self._explained) else ""
            self.args, self._explained = (sentence + added,), sentence

    def extras(self) -> dict[str, Any]:
        """`change` and `statustext`, where they are known."""
        return {"change": self.change, "statustext": self.statustext} if self.change else {}


class ModeChanged(StateChanged):
    """The vehicle left the mode that the verb needs: the pilot or a failsafe has it now."""

    code = "mode_changed"


class Busy(Conflict):
    """The vehicle's state forbids it now."""

    code = "busy"


class NotRehearsed(Conflict):
    """The setting `rehearse` requires a rehearsal of it, which there is not."""

    code = "not_rehearsed"


class Paused(Conflict):
    """`stop` holds the vehicle still until `resume`."""

    code = "paused"


class Expired(Conflict):
    """A message waited too long for MAVProxy's main loop; it was not sent, and never will be."""

    code = "expired"

    @classmethod
    def after(cls, seconds: float) -> Expired:
        """For a message that was to be sent within that many s."""
        return cls(f"not sent: MAVProxy was busy for more than {seconds:g} s")


class NotArmed(StateChanged):
    """The verb needs an armed vehicle."""

    code = "not_armed"


class OutsideEnvelope(Conflict):
    """It would leave the envelope; nothing was sent.

    `outside` says `what` it breaks, `at` which place (`lat`, `long` degrees, `alt` m above home), and `by` how much.
    """

    code = "outside_envelope"

    def __init__(self, sentence: str, outside: Mapping[str, Any] | None = None) -> None:
        super().__init__(sentence)
        self.outside = dict(outside or {})

    def extras(self) -> dict[str, Any]:
        """`outside`, where something is."""
        return {"outside": self.outside} if self.outside else {}


class TooNear(Conflict):
    """It would come too near to another vehicle; nothing was sent.

    `near` says to which `vehicle`, in how many s (`in_s`), and `at` which place (as of `OutsideEnvelope`).
    """

    code = "too_near"

    def __init__(self, sentence: str, near: Mapping[str, Any]) -> None:
        super().__init__(sentence)
        self.near = dict(near)

    def extras(self) -> dict[str, Any]:
        """`near`."""
        return {"near": self.near}


class Aborted(Conflict):
    """The verb was ended before it was done."""

    code = "aborted"


class Invalid(UavApiError):
    """A value of the wrong type or out of range; nothing was sent.

    `problems` are `{"loc": [...], "msg": str, "type": str}`, as web clients of typed APIs know them; `loc` is the
    path to the value. For a value that came by HTTP, `set_source` puts query or body before it.
    """

    status, code = 422, "invalid"

    def __init__(self, problems: Sequence[dict[str, Any]] | str, *loc: str) -> None:
        if isinstance(problems, str):
            problems = [{"loc": list(loc), "msg": problems, "type": "value_error"}]
        self.problems = list(problems)
        super().__init__()

    def __str__(self) -> str:
        return "; ".join(": ".join(filter(None, (".".join(map(str, p["loc"])), p["msg"]))) for p in self.problems)

    def set_source(self, source: str) -> None:
        """Note which part of a request had the values, unless that is known."""
        for problem in self.problems:
            if problem["loc"][:1] not in SOURCES:
                problem["loc"] = [source, *problem["loc"]]

    @property
    def detail(self) -> list[dict[str, Any]]:
        """The list of problems."""
        return self.problems


class SettingError(Invalid):
    """An unknown setting, or a value that it refuses; the text is one clear line.

    Also for the argument of a command or a line of a file. `loc` names it.
    """

    def __init__(self, sentence: str, *loc: str) -> None:
        super().__init__(sentence, *loc)
        self.loc = loc

    def __str__(self) -> str:
        return str(self.problems[0]["msg"])


class TooManyRequests(UavApiError):
    """More requests, or more verbs in flight, than one client or all clients may have.

    `retry_after` is in s.
    """

    status, code = 429, "too_many_requests"

    def __init__(self, sentence: str, retry_after: int = 1) -> None:
        super().__init__(sentence)
        self.retry_after = retry_after


class Rejected(UavApiError):
    """The autopilot refused: `ack` is the MAV_RESULT name, `statustext` its messages since the request."""

    status, code = 500, "rejected"

    def __init__(self, sentence: str, ack: str | None = None, statustext: Sequence[str] = ()) -> None:
        super().__init__(sentence)
        self.ack = ack
        self.statustext = list(statustext)

    def extras(self) -> dict[str, Any]:
        """`ack` where there was one, and `statustext`."""
        ack = {} if self.ack is None else {"ack": self.ack}
        return {**ack, "statustext": self.statustext}


class ToolFailed(UavApiError):
    """A program that we started (tmux, a camera tool) failed or is not installed: `stderr` has its own words."""

    status, code = 500, "tool_failed"

    def __init__(self, sentence: str, stderr: str = "") -> None:
        super().__init__(f"{sentence}: {stderr}" if stderr else sentence)
        self.stderr = stderr

    def extras(self) -> dict[str, Any]:
        """`stderr`, where it said something."""
        return {"stderr": self.stderr} if self.stderr else {}


class ToolMissing(ToolFailed):
    """That program is not installed on this machine."""

    status, code = 503, "tool_missing"


class Unavailable(UavApiError):
    """There is no vehicle to ask, or no fresh data."""

    status, code = 503, "unavailable"


class LinkLost(Unavailable):
    """No heartbeat from the vehicle within the link timeout."""

    code = "link_lost"

    @classmethod
    def since(cls, system: int, silent_for: float) -> LinkLost:
        """The error for vehicle `system`, which has been silent for that many seconds."""
        return cls(f"no heartbeat from vehicle {system} for {silent_for:.1f} s")


class NoVehicle(Unavailable):
    """No vehicle on the link yet."""

    code = "no_vehicle"


class Stale(Unavailable):
    """The requested data is older than its limit."""

    code = "stale"


class TimedOut(UavApiError):
    """No acknowledgement, or no arrival, in time."""

    status, code = 504, "timeout"

    def __init__(self, sentence: str, statustext: Sequence[str] = ()) -> None:
        super().__init__(sentence)
        self.statustext = list(statustext)

    def extras(self) -> dict[str, Any]:
        """`statustext`, where the autopilot said something meanwhile."""
        return {"statustext": self.statustext} if self.statustext else {}
