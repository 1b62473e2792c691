"""/fleet: one verb for several vehicles, with an answer for each."""

from __future__ import annotations

import asyncio
import contextlib
import functools
from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, Literal

from aiohttp import web
from pydantic import Field, SkipValidation, create_model
from typing_extensions import TypedDict

from mavproxy_uavapi.core.control.start_gate import StartGate
from mavproxy_uavapi.core.errors import Invalid, NoVehicle, UavApiError, without_frames
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import JobFailure, means
from mavproxy_uavapi.http.contract.parsing import parse
from mavproxy_uavapi.http.contract.requests import Empty, Request
from mavproxy_uavapi.http.contract.responses import MULTI_STATUS, dumps, reason
from mavproxy_uavapi.http.contract.route import POST, Route
from mavproxy_uavapi.http.contract.router import Match
from mavproxy_uavapi.http.door.auditing import audited

System = Annotated[int, Field(ge=1, le=255)]
Vehicles = Annotated[list[System] | Literal["all"], Field(description="system ids, or all")]


class OneDone(TypedDict):
    """A vehicle that has done it."""

    status: Annotated[int, means("200", 200)]
    result: Annotated[str, means("a sentence", "Armed vehicle")]


class OneAccepted(TypedDict):
    """A vehicle that goes on with it as a job."""

    status: Annotated[int, means("202", 202)]
    job: Annotated[str, means("of /jobs/{id}", "12")]


class FleetAnswer(TypedDict):
    """What became of it at each vehicle."""

    device: Literal["fleet"]
    result: Annotated[str, means("a sentence", "/command/arm was done by all: 1 of 1 vehicles")]
    vehicles: Annotated[
        dict[str, OneDone | OneAccepted | JobFailure],
        means("by system id", {"1": {"status": 200, "result": "Armed vehicle"}}),
    ]


class FleetRequest(Request):
    """The vehicles by system id, or `all`; the verb's parameters; and in `each` other values for single vehicles.

    With `all_or_none` nothing is sent before every vehicle has passed the checks of its verb; if one does not,
    nothing is sent to any.
    """

    verb: ClassVar[type[Request]] = Empty  # what the verb itself takes
    vehicles: Vehicles
    each: Annotated[dict[str, dict[str, Any]], Field(description="by system id: other values for one vehicle")] = {}
    all_or_none: Annotated[bool, Field(description="nothing is sent unless every vehicle can begin")] = False


class FleetHold(FleetRequest):
    """As every request to a fleet; it means all vehicles if it names none, because it does no more than hold them."""

    vehicles: Vehicles = "all"


def fleet_routes(routes: Iterable[Route]) -> list[Route]:
    """A route /fleet/… for each verb of the vehicles."""
    return [_fleet_route(route) for route in routes if route.job]


@functools.cache
def _model_for(verb: type[Request], base: type[FleetRequest]) -> type[FleetRequest]:
    """The fleet's request for a verb with such parameters, each of which may be in `each` instead."""
    own: dict[str, Any] = {}
    for name, field in verb.model_fields.items():
        kind: Any = (field.annotation, *field.metadata, SkipValidation)
        own[name] = (Annotated[kind], Field(default_factory=lambda: None, description=field.description))
    model_name = f"{base.__name__.removesuffix('Request')}{verb.__name__}"
    model = create_model(model_name, __base__=base, __doc__=base.__doc__, **own)
    model.verb = verb
    return model


def _fleet_route(route: Route) -> Route:
    name = route.path.rpartition("/")[2]

    async def action(call: Call) -> FleetAnswer | web.Response:
        return await _command(call, route)

    action.__doc__ = f"""`{route.path}` for several vehicles at once; answers when it has ended for all.

    200 if every vehicle has done it, else 207; `vehicles` has the answer of each.
    """
    # The call of each vehicle is in the audit trail.
    return Route(
        f"/fleet/{name}",
        action,
        _model_for(route.model, FleetHold if route.holds else FleetRequest),
        route.needs,
        POST,
        fleet=True,
        partly=True,
        of_vehicle=False,
        stops=route.stops,
        audited=False,
    )


async def _command(call: Call, route: Route) -> FleetAnswer | web.Response:
    """Call `route` for each vehicle."""
    p = call.params(FleetRequest)
    if p.all_or_none and call.is_async:
        raise Invalid(
            "`all_or_none` needs a waiting call: without wait=false and Prefer: respond-async", "all_or_none"
        )
    known = call.service.host.fleet.vehicles
    every = [call.named_system] if call.named_system else sorted(known)  # a path that names a vehicle means no other
    systems = every if p.vehicles == "all" else list(dict.fromkeys(p.vehicles))
    if not systems:
        raise NoVehicle("there is no vehicle yet") if p.vehicles == "all" else Invalid("it is empty", "vehicles")
    others = sorted(set(p.each) - set(map(str, systems)))
    if others:
        raise Invalid(f"not one of the vehicles: {', '.join(others)}", "each")
    params = {system: _params(route, p, system) for system in systems}
    gate = StartGate(len(systems)) if p.all_or_none else None
    answers = await asyncio.gather(*(_answer(call, route, system, params[system], gate) for system in systems))
    done = all(answer["status"] in (200, 202) for answer in answers)
    count = sum(answer["status"] in (200, 202) for answer in answers)
    body: FleetAnswer = {
        "device": "fleet",
        "result": f"{route.path} was {'done' if done else 'not done'} by all: {count} of {len(systems)} vehicles",
        "vehicles": dict(zip(map(str, systems), answers, strict=True)),
    }
    return body if done else web.json_response(body, status=MULTI_STATUS, dumps=dumps)


def _params(route: Route, fleet: FleetRequest, system: int) -> Request:
    """The verb's parameters for one vehicle: those of all, and its own from `each`."""
    common = {name: getattr(fleet, name) for name in fleet.model_fields_set & set(route.model.model_fields)}
    own = fleet.each.get(str(system), {})
    try:
        return parse(route.model, "body", {**common, **own})
    except Invalid as error:
        for problem in error.problems:
            if problem["loc"][1:] and problem["loc"][1] in own:
                problem["loc"][1:1] = ["each", str(system)]
        raise


async def _answer(
    call: Call, route: Route, system: int, params: Request, gate: StartGate | None
) -> OneDone | OneAccepted | JobFailure:
    """One vehicle's answer: its status and body."""
    path = f"/fleet/{route.path.rpartition('/')[2]}"
    vehicle_call = Call(call.service, call.request, params, Match(path, system, route), call.options)
    try:
        with contextlib.nullcontext() if gate is None else gate.place(f"vehicle {system}"):
            answer = await audited(vehicle_call, route.action)
    except UavApiError as error:
        without_frames(error)
        return {"status": error.status, **reason(error)}
    if isinstance(answer, web.StreamResponse):  # 202
        assert vehicle_call.job is not None
        return {"status": answer.status, "job": vehicle_call.job.id}
    return {"status": 200, "result": str(answer["result"])}
