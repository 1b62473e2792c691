"""How often who may ask: those whom the door let in, and, far less often, those whom it did not."""

from __future__ import annotations

import math

from aiohttp import web

from mavproxy_uavapi.core.errors import TooManyRequests
from mavproxy_uavapi.http.call import ROUTE, SERVICE
from mavproxy_uavapi.http.caller import CALLER, Caller
from mavproxy_uavapi.http.responses import Handler

BURST = 2.0  # s of the long-run rate that a client may use up at once
CLIENTS_KEPT = 1000
STRANGERS_RATE = 10.0  # requests/s of one address that the door does not let in
COMMANDS = ("/command/", "/movement/")  # paths that command by GET too


class Bucket:
    """A token bucket for each client. Pure: the clock is an argument."""

    def __init__(self) -> None:
        self._used: dict[str, tuple[float, float]] = {}  # client -> (tokens used up, at)

    def take(self, client: str, rate: float, now: float) -> float:
        """Take one request of `client`; 0, or the seconds to wait when it has used up its share.

        Args:
            client: who it is (`caller.group_of`).
            rate: requests per second in the long run.
            now: s.
        """
        used, at = self._used.pop(client, (0.0, now))
        used = max(0.0, used - (now - at) * rate)
        capacity = max(BURST * rate, 1.0)
        if used + 1 > capacity:
            self._used[client] = used, now
            return (used + 1 - capacity) / rate
        self._used[client] = used + 1, now
        if len(self._used) > CLIENTS_KEPT:
            del self._used[next(iter(self._used))]
        return 0.0


BUCKET = web.AppKey("bucket", Bucket)  # of those whom the door let in
STRANGERS = web.AppKey("strangers", Bucket)


def stops(request: web.Request) -> bool:
    """Whether the request stops a vehicle: it is refused for no limit, and waits for nobody."""
    route = request.get(ROUTE)
    return route is not None and route.stops and request.method in route.methods


@web.middleware
async def yield_to_main_loop(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Let MAVProxy's main loop finish what it is at: its messages are not to wait for our answers.

    What commands does not wait: it is short, and a vehicle is to hear of it at once.
    """
    if request.method == "GET" and not request.path.startswith(COMMANDS):
        await request.app[SERVICE].host.bridge.wait_for_main_loop()
    return await handler(request)


@web.middleware
async def at_a_bearable_rate(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Refuse a caller who asks more often than he may."""
    service = request.app[SERVICE]
    caller: Caller | None = request.get(CALLER)  # None: a reader of the documentation, counted at the door
    if caller is None or stops(request):
        return await handler(request)
    rate = service.settings.local_rate if caller.is_local else service.settings.max_rate
    if rate:
        wait = request.app[BUCKET].take(caller.group, rate, service.host.clock())
        if wait:
            raise TooManyRequests(f"more than {rate:g} requests a second", math.ceil(wait))
    return await handler(request)
