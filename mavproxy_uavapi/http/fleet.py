"""/fleet: one verb for several vehicles, with an answer for each."""

from __future__ import annotations

import asyncio
import contextlib
import functools
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, ClassVar, Literal

from aiohttp import web
from pydantic import ConfigDict, Field, create_model

from mavproxy_uavapi.core.control.start_gate import StartGate
from mavproxy_uavapi.core.errors import Invalid, NoVehicle, UavApiError, without_frames
from mavproxy_uavapi.http.auditing import audited
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.requests import Empty, Request, parse
from mavproxy_uavapi.http.responses import MULTI_STATUS, dumps, reason
from mavproxy_uavapi.http.route import POST, Route
from mavproxy_uavapi.http.router import Match

System = Annotated[int, Field(ge=1, le=255)]


class FleetRequest(Request):
    """The vehicles by system id, or all; the verb's parameters; and in `each` other values for single vehicles.

    With `all_or_none` nothing is sent before every vehicle has passed the checks of its verb; if one does not,
    nothing is sent to any.
    """

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    verb: ClassVar[type[Request]] = Empty  # what the verb itself takes
    vehicles: Annotated[list[System] | Literal["all"], Field(description="system ids, or all")] = "all"
    each: Annotated[dict[str, dict[str, Any]], Field(description="by system id: other values for one vehicle")] = {}
    all_or_none: Annotated[bool, Field(description="nothing is sent unless every vehicle can begin")] = False


def fleet_routes(routes: Iterable[Route]) -> list[Route]:
    """A route /fleet/… for each verb of the vehicles."""
    return [_fleet_route(route) for route in routes if route.job]


@functools.cache
def _model_for(verb: type[Request]) -> type[FleetRequest]:
    """The fleet's request for a verb with such parameters."""
    model = create_model(f"Fleet{verb.__name__}", __base__=FleetRequest, __doc__=FleetRequest.__doc__)
    model.verb = verb
    return model


def _fleet_route(route: Route) -> Route:
    name = route.path.rpartition("/")[2]

    async def action(call: Call) -> web.StreamResponse:
        return await _command(call, route)

    action.__doc__ = f"""`{route.path}` for several vehicles at once; answers when it has ended for all.

    200 if every vehicle has done it, else 207; `vehicles` has the answer of each.
    """
    # The call of each vehicle is in the audit trail.
    return Route(
        f"/fleet/{name}", action, _model_for(route.model), route.needs, POST, stops=route.stops, audited=False
    )


async def _command(call: Call, route: Route) -> web.StreamResponse:
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
    common = p.model_extra or {}
    params = {system: parse(route.model, "body", {**common, **p.each.get(str(system), {})}) for system in systems}
    gate = StartGate(len(systems)) if p.all_or_none else None
    answers = await asyncio.gather(*(_answer(call, route, system, params[system], gate) for system in systems))
    done = all(answer["status"] in (200, 202) for answer in answers)
    count = sum(answer["status"] in (200, 202) for answer in answers)
    body = {
        "device": "fleet",
        "result": f"{route.path} was {'done' if done else 'not done'} by all: {count} of {len(systems)} vehicles",
        "vehicles": dict(zip(map(str, systems), answers, strict=True)),
    }
    return web.json_response(body, status=200 if done else MULTI_STATUS, dumps=dumps)


async def _answer(
    call: Call, route: Route, system: int, params: Request, gate: StartGate | None
) -> Mapping[str, Any]:
    """One vehicle's answer: its status and body."""
    path = f"/fleet/{route.path.rpartition('/')[2]}"
    vehicle_call = Call(call.service, call.request, params, Match(path, system, route))
    try:
        with contextlib.nullcontext() if gate is None else gate.place(f"vehicle {system}"):
            answer = await audited(vehicle_call, route.action)
    except UavApiError as error:
        without_frames(error)
        return {"status": error.status, **reason(error)}
    if isinstance(answer, web.StreamResponse):  # 202
        assert vehicle_call.job is not None
        return {"status": answer.status, "job": vehicle_call.job.id}
    return {"status": 200, "result": answer["result"]}
