"""Jobs and vehicles as answer bodies, for reads and streams alike."""

from __future__ import annotations

from typing import cast

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.oversight.leases import Lease
from mavproxy_uavapi.core.vehicle.readiness import condition
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.contract import answers
from mavproxy_uavapi.http.contract.responses import reason
from mavproxy_uavapi.http.contract.telemetry_views import gps


def report_of_job(job: Job, now: float) -> answers.JobView:
    """A job as an answer body; times in s."""
    return {
        "job": job.id,
        "verb": job.verb,
        "request": job.request,
        "client": job.client,
        "state": job.outcome_name,
        "progress": {**job.stage, **job.progress},
        "seconds": round((job.ended_at or now) - job.began_at, 3),
        "result": job.result,
        "error": None if job.error is None else error_of(job),
    }


def error_of(job: Job) -> answers.JobFailure:
    """Why the job failed, as in the answer of the blocking call."""
    assert job.error is not None
    error = job.error
    return cast(answers.JobFailure, {"status": error.status, **reason(error)})


def status_of(host: Host, vehicle: Vehicle) -> answers.StatusView:
    """Whether the vehicle is ready to fly, and why not."""
    return {"vehicle_type": vehicle.kind, **_condition(host, vehicle)}


def _condition(host: Host, vehicle: Vehicle) -> answers.ConditionView:
    return cast(answers.ConditionView, condition(vehicle, host.link_watch.is_alive(vehicle.state), host.clock()))


def report_of_vehicle(host: Host, vehicle: Vehicle) -> answers.VehicleView:
    """A vehicle as an answer body."""
    system, received = vehicle.state.system, vehicle.state.newest("GLOBAL_POSITION_INT")
    place = None if received is None else gps(received.message)
    return {
        "id": system,
        "type": vehicle.kind,
        **_condition(host, vehicle),
        "position": None if place is None else place["position"],
        "velocity": None if place is None else place["velocity"],
        "heading": None if place is None else place["heading"],
        "age_s": None if received is None else round(host.clock() - received.at, 3),
        "current": system == host.registry.resolve(),
        "paused": vehicle.authority.paused,
        "commanded_by": commander_of(vehicle),
        "held_by": operator_of(host, vehicle),
        "lease": _lease(host, vehicle),
    }


def _lease(host: Host, vehicle: Vehicle) -> answers.LeaseView | None:
    """Whose lease the vehicle is under, and the s that are left of it; None for nobody's."""
    lease = host.leases.of(vehicle)
    if lease is None:
        return None
    return {"client": lease.holder, "remaining_s": _remaining(host, lease)}


def report_of_authority(host: Host, vehicle: Vehicle) -> answers.HoldView:
    """Who holds and who commands a vehicle, as an answer body."""
    hold = host.leases.hold(vehicle)
    return {
        "vehicle": vehicle.state.system,
        "held_by": None if hold is None else hold.holder,
        "role": None if hold is None or hold.operator is None else hold.operator.role.word,
        "remaining_s": None if hold is None else _remaining(host, hold),
        "commanded_by": commander_of(vehicle),
    }


def operator_of(host: Host, vehicle: Vehicle) -> str | None:
    """The name of the operator who holds the vehicle; None if nobody does."""
    hold = host.leases.hold(vehicle)
    return None if hold is None else hold.holder


def _remaining(host: Host, lease: Lease) -> float | None:
    remaining = lease.remaining(host.clock())
    return None if remaining is None else round(remaining, 3)


def commander_of(vehicle: Vehicle) -> answers.CommanderView | None:
    """The job that flies the vehicle; None if there is none."""
    job = vehicle.authority.flies
    return None if job is None else {"job": job.id, "verb": job.verb, "client": job.client}
