"""/jobs: the running verbs and the last ones that ended."""

from __future__ import annotations

import contextlib

from mavproxy_uavapi.core.control.command import CommandState
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Aborted, Busy, NotFound, UavApiError
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract import answers
from mavproxy_uavapi.http.contract.reports import report_of_job


def _job(call: Call) -> Job:
    job = call.service.host.jobs.get(call.names["id"])
    if job is None or not _is_meant(call, job):
        raise NotFound(f"there is no job {call.names['id']}")
    return job


def _is_meant(call: Call, job: Job) -> bool:
    """Whether the job is for the vehicle that the path names; always true if it names none."""
    return call.named_system in (0, job.vehicle.state.system)


async def list_jobs(call: Call) -> answers.JobsView:
    """All running jobs and the last ones that ended; under /vehicles/{sysid} only those of that vehicle."""
    host = call.service.host
    return {"jobs": [report_of_job(job, host.clock()) for job in host.jobs.all() if _is_meant(call, job)]}


async def show_job(call: Call) -> answers.JobView:
    """One job: its state, progress, and result or error."""
    return report_of_job(_job(call), call.service.host.clock())


async def abort_job(call: Call) -> answers.AbortedJob:
    """Abort a job; a vehicle that it flies stops and holds its place."""
    job, host = _job(call), call.service.host
    call.require_right(job.vehicle.state.system)
    if not job.running:
        raise Busy(f"job {job.id} ({job.verb}) has ended already")
    if job.protects and job.vehicle.command(job).state is not CommandState.CONFIRMED:
        raise Busy(f"job {job.id} ({job.verb}) protects the vehicle; it cannot be ended before it has done so")
    job.abort(Aborted(f"{job.verb} was aborted by DELETE /jobs/{job.id}"))
    closing = host.endings.closing(job)
    if closing is None:
        return {**report_of_job(job, host.clock()), "then": "nothing is sent"}
    with contextlib.suppress(UavApiError):  # the job that follows reports it
        await closing.outcome()
    return {**report_of_job(job, host.clock()), "then": closing.result or str(closing.error)}
