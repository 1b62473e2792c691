"""Limits how often a caller may ask; callers that fail the door check get far less."""

from __future__ import annotations

import asyncio
import math

from aiohttp import web

from mavproxy_uavapi.core.errors import TooManyRequests
from mavproxy_uavapi.http.callers.call import SERVICE, Service
from mavproxy_uavapi.http.callers.caller import CALLER, Caller
from mavproxy_uavapi.http.contract.responses import Handler
from mavproxy_uavapi.http.contract.router import MATCH
from mavproxy_uavapi.http.door.access import may_use

REFUSAL_DELAY = 0.1  # s; a flood of refusals at once would delay what MAVProxy forwards
COMMANDS = ("/command/", "/movement/")  # paths that also command by GET


def stops(request: web.BaseRequest) -> bool:
    """Whether the request stops a vehicle, and its caller may; no limit refuses or delays it then."""
    route = request[MATCH].route
    return route is not None and route.stops and may_use(request, route)


async def yield_to_main_loop(request: web.BaseRequest, handler: Handler) -> web.StreamResponse:
    """Let MAVProxy's main loop finish its work, so that its messages do not wait for our answers.

    A command does not wait: it is short, and the vehicle must get it at once.
    """
    if request.method == "GET" and not request[MATCH].path.startswith(COMMANDS):
        await request[SERVICE].host.bridge.wait_for_main_loop()
    return await handler(request)


def _rate_key(caller: Caller, request: web.BaseRequest) -> str:
    """The key under which requests are counted: the caller and the vehicle. Unknown vehicles count as one."""
    system = request[MATCH].system
    return f"{caller.counted_as} {system if system in request[SERVICE].host.fleet.vehicles else 0}"


def rate_of(caller: Caller, service: Service) -> float:
    """The requests per second that a caller may send; 0 for no limit."""
    return service.settings.local_rate if caller.is_local else service.settings.max_rate


def seconds_to_wait(request: web.BaseRequest, caller: Caller) -> float:
    """Count a request; 0, or the seconds to wait if its caller asks more often than it may."""
    service = request[SERVICE]
    rate = rate_of(caller, service)
    return service.callers.take(_rate_key(caller, request), rate, service.host.clock()) if rate else 0.0


async def limit_rate(request: web.BaseRequest, handler: Handler) -> web.StreamResponse:
    """Refuse a caller that asks more often than it may, and let it wait for the refusal."""
    caller: Caller | None = request.get(CALLER)  # None for a reader of the documentation, counted by the door check
    if caller is not None and not stops(request):
        wait = seconds_to_wait(request, caller)
        if wait:
            rate = rate_of(caller, request[SERVICE])
            await asyncio.sleep(REFUSAL_DELAY)
            raise TooManyRequests(f"more than {rate:g} requests a second", math.ceil(wait))
    return await handler(request)
