"""Answers a read that comes again on its connection, byte for byte the same, without parsing it again.

A program that polls sends the same bytes many times a second. Most of the work on them gives the same result each
time: parsing, the door check, the route, the parameters. A connection keeps that result for TRUSTED_FOR. What can
change is checked each time: the settings, the token, the caller's rate, the vehicle's message and its age.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from aiohttp import HttpVersion11, web

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.callers.caller import CALLER
from mavproxy_uavapi.http.contract.responses import dumps
from mavproxy_uavapi.http.contract.route import Route
from mavproxy_uavapi.http.door.rate_limits import seconds_to_wait
from mavproxy_uavapi.http.wire.connection import Connection

TRUSTED_FOR = 1.0  # s from a request that was parsed


def remember(call: Call, route: Route, response: web.Response) -> None:
    """Let the connection of a read answer it again.

    Args:
        call: the call.
        route: its route, whose answer shows one message.
        response: the answer, not sent yet.
    """
    request = call.request
    connection = Connection.of(request)
    plain = request.version == HttpVersion11 and request.keep_alive and not request.body_exists
    if connection is not None and plain and CALLER in request:
        connection.remember(Repeat(call, route, response).answer)


class Repeat:
    """A read that has been answered once.

    Args:
        call: that call.
        route: its route.
        response: its answer; the next ones have the same headers.
    """

    def __init__(self, call: Call, route: Route, response: web.Response) -> None:
        self._call = call
        self._route = route
        self._holder = call.holder
        self._response = response
        self._settings = call.service.settings
        self._clock: Callable[[], float] = call.service.host.clock
        self._until = self._clock() + TRUSTED_FOR
        self._head = b""

    def answer(self) -> bytes | None:
        """The answer with its headers; None if the request must go the usual way, which can also refuse it."""
        call = self._call
        if not self._counts() or seconds_to_wait(call.request, call.caller):
            return None
        body = self._body()
        if body is None:
            return None
        call.service.heard_from(call.caller, self._holder)
        return b"%sContent-Length: %d\r\n\r\n%s" % (self._head or self._make_head(), len(body), body)

    def _counts(self) -> bool:
        """Whether the result of the checks is young, and the settings and the token that led to it are in force."""
        service, token = self._call.service, self._call.caller.token
        return (
            self._clock() <= self._until
            and service.settings is self._settings
            and (token is None or service.token_of(token.digest) == token)
            and not service.host.bridge.busy
        )

    def _body(self) -> bytes | None:
        """The newest message as JSON; None if there is none, or it is too old."""
        call = self._call
        try:
            if call.known_vehicle.state.newest(call.message) is None:
                return None
            action: Any = self._route.action(call)
            action.send(None)
        except StopIteration as end:
            return dumps(end.value).encode()
        except UavApiError:
            return None
        raise AssertionError(f"{call.path} waited although {call.message} was there")

    def _make_head(self) -> bytes:
        headers = self._response.headers.items()
        lines = ["HTTP/1.1 200 OK", *(f"{name}: {value}" for name, value in headers if name != "Content-Length"), ""]
        self._head = "\r\n".join(lines).encode()
        return self._head
