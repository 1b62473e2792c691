"""How often who may ask: those whom the door let in, and, far less often, those whom it did not."""

from __future__ import annotations

import math

from aiohttp import web

from mavproxy_uavapi.core.errors import TooManyRequests
from mavproxy_uavapi.http.call import SERVICE
from mavproxy_uavapi.http.caller import CALLER, Caller
from mavproxy_uavapi.http.responses import Handler
from mavproxy_uavapi.http.router import MATCH

COMMANDS = ("/command/", "/movement/")  # paths that command by GET too


def stops(request: web.BaseRequest) -> bool:
    """Whether the request stops a vehicle: it is refused for no limit, and waits for nobody."""
    route = request[MATCH].route
    return route is not None and route.stops


async def yield_to_main_loop(request: web.BaseRequest, handler: Handler) -> web.StreamResponse:
    """Let MAVProxy's main loop finish what it is at: its messages are not to wait for our answers.

    What commands does not wait: it is short, and a vehicle is to hear of it at once.
    """
    if request.method == "GET" and not request[MATCH].path.startswith(COMMANDS):
        await request[SERVICE].host.bridge.wait_for_main_loop()
    return await handler(request)


def _whose(caller: Caller, request: web.BaseRequest) -> str:
    """What is counted together: the requests of one caller about one vehicle. What was not heard is no vehicle."""
    system = request[MATCH].system
    return f"{caller.group} {system if system in request[SERVICE].host.fleet.vehicles else 0}"


async def at_a_bearable_rate(request: web.BaseRequest, handler: Handler) -> web.StreamResponse:
    """Refuse a caller who asks more often than he may."""
    service = request[SERVICE]
    caller: Caller | None = request.get(CALLER)  # None: a reader of the documentation, counted at the door
    if caller is None or stops(request):
        return await handler(request)
    rate = service.settings.local_rate if caller.is_local else service.settings.max_rate
    if rate:
        wait = service.callers.take(_whose(caller, request), rate, service.host.clock())
        if wait:
            raise TooManyRequests(f"more than {rate:g} requests a second", math.ceil(wait))
    return await handler(request)
