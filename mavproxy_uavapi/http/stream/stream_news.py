"""Events of a stream: what has changed with a vehicle since the last look. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.telemetry.statustexts import StatusText
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.http.contract.reports import commander_of, operator_of, report_of_job

NAMES = (
    *("alive", "mode", "armed", "link", "authority", "statustext", "job", "tag", "picture", "readings", "delivered"),
    *("history", "flight"),
)
TEXTS_TOLD_FIRST = 20  # newest texts of a vehicle that a new listener gets
JOBS_TOLD_FIRST = 20

News = tuple[str, int, float, Mapping[str, object]]  # name, system, when by the host's clock (s), what


@dataclass
class _Seen:
    """A vehicle as it was at the last look."""

    mode: Any
    armed: Any
    alive: bool
    authority: dict[str, Any]
    text: StatusText | None


class NewsWatch:
    """Compares each vehicle and job with what they were.

    Args:
        host: the vehicles and their jobs.
    """

    def __init__(self, host: Host) -> None:
        self._host = host
        self._seen: dict[int, _Seen] = {}
        self._jobs: dict[str, tuple[Any, ...]] = {}

    def first(self) -> list[News]:
        """What a new listener must know: the last texts and jobs, and all jobs that run."""
        now = self._host.clock()
        news: list[News] = []
        for system, state in self._host.fleet.vehicles.items():
            texts = list(state.statustexts)[-TEXTS_TOLD_FIRST:]
            news += [("statustext", system, text.at, _of_text(text)) for text in texts]
        jobs = self._host.jobs.all()
        old, newest = jobs[:-JOBS_TOLD_FIRST], jobs[-JOBS_TOLD_FIRST:]
        for job in [job for job in old if job.running] + newest:
            news.append(("job", job.vehicle.state.system, now, report_of_job(job, now)))
        return news

    def everything(self) -> list[News]:
        """What is new of any vehicle and job since the last look."""
        news = [one for state in self._host.fleet.vehicles.values() for one in self.of_vehicle(state)]
        return news + list(self.of_jobs())

    def of_vehicle(self, state: VehicleState) -> list[News]:
        """What is new of one vehicle; nothing when it is looked at for the first time."""
        now = self._host.clock()
        vehicle = self._host.registry.find(state.system)
        authority = {
            "commanded_by": commander_of(vehicle),
            "held_by": operator_of(self._host, vehicle),
            "paused": vehicle.authority.paused,
        }
        newest = state.statustexts.newest
        seen = _Seen(state.mode, state.armed, self._host.link_watch.is_alive(state), authority, newest)
        before, self._seen[state.system] = self._seen.get(state.system), seen
        if before is None or before == seen:
            return []
        news: list[News] = []
        if seen.mode != before.mode and seen.mode is not None:
            news.append(("mode", state.system, now, {"mode": vehicle.mode}))
        if seen.armed != before.armed and seen.armed is not None:
            news.append(("armed", state.system, now, {"armed": seen.armed}))
        if seen.alive != before.alive:
            news.append(("link", state.system, now, {"alive": seen.alive}))
        if seen.authority != before.authority:
            news.append(("authority", state.system, now, authority))
        texts = state.statustexts.after(before.text)
        return news + [("statustext", state.system, text.at, _of_text(text)) for text in texts]

    def of_jobs(self) -> Iterator[News]:
        """The jobs that began, ended, or made progress."""
        now = self._host.clock()
        jobs: dict[str, tuple[Any, ...]] = {}
        for job in self._host.jobs.all():
            if not (job.running or job.is_told):  # it is heard in a moment why it ended
                jobs[job.id] = self._jobs.get(job.id, ())
                continue
            jobs[job.id] = (job.outcome_name, dict(job.stage), dict(job.progress))
            if jobs[job.id] != self._jobs.get(job.id):
                yield "job", job.vehicle.state.system, now, report_of_job(job, now)
        self._jobs = jobs


def _of_text(text: StatusText) -> dict[str, Any]:
    return {"severity": text.severity, "text": text.text}
