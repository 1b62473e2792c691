"""Jobs as a test sees them: who sent what, and what was known of the vehicle then."""

from __future__ import annotations

import contextvars
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.host import Host

ASKING = {
    mavlink.MAV_CMD_REQUEST_MESSAGE,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS,
}
READING = {"TIMESYNC", "PARAM_REQUEST_READ", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_ACK"}
the_job: contextvars.ContextVar[Job | None] = contextvars.ContextVar("the_job", default=None)


class Sent(NamedTuple):
    """A message of ours as it is on the wire: when it went out (s), whose it was, and what we knew of the vehicle."""

    at: float
    message: Any
    flight: Flight | None
    mode: str
    armed: bool | None

    @property
    def asks(self) -> bool:
        """Whether it only asks for something."""
        return self.message.get_type() in READING or self.command in ASKING

    @property
    def command(self) -> int:
        """Its MAV_CMD; 0 for none."""
        return int(getattr(self.message, "command", 0))

    @property
    def is_setpoint(self) -> bool:
        """Whether it is a movement's."""
        return bool(self.message.get_type().startswith("SET_POSITION_TARGET"))


@dataclass
class Flight:
    """A job, and what was seen of it.

    Attributes:
        mode, armed: what we knew of the vehicle when it began.
        sent: what it sent but for questions.
        ended_in: the mode that we knew when it ended.
        shown_at: when a heartbeat first showed the mode that it is to bring about (s).
        shown_since: since when all of them do (s).
    """

    job: Job
    mode: str
    armed: bool | None
    sent: list[Sent] = field(default_factory=list)
    ended_in: str = ""
    shown_at: float | None = None
    shown_since: float | None = None

    @property
    def verb(self) -> str:
        """Its path's last part, `vision/land`; the verb of what follows a flight."""
        path = self.job.verb.split()[0]
        return path[1:] if path.startswith("/vision/") else path.rpartition("/")[2]

    @property
    def follows(self) -> bool:
        """Whether it sees to a vehicle after a flight."""
        return not self.job.verb.startswith("/")

    def __str__(self) -> str:
        return f"{self.job.verb} {self.job.request} (job {self.job.id})"


def watch_jobs(host: Host, flights: dict[str, Flight], on_ended: list[Callable[[Flight], None]]) -> None:
    """Enter each job of `host` in `flights`, by its number, and have `the_job` say who sends."""
    jobs, begin = host.jobs, host.jobs.begin

    def watched(vehicle: Any, verb: str, request: Any, body: Any, **options: Any) -> Job:
        async def tagged(job: Job) -> str:
            the_job.set(job)
            return str(await body(job))

        job = begin(vehicle, verb, request, tagged, **options)
        if job.id not in flights:
            flights[job.id] = Flight(job, vehicle.mode, vehicle.state.armed)
        return job

    def ended(job: Job) -> None:
        flight = flights[job.id]
        flight.ended_in = job.vehicle.mode
        for look in on_ended:
            look(flight)

    jobs.begin = watched  # type: ignore[method-assign]
    jobs.on_ended.insert(0, ended)
