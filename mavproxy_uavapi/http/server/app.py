"""The HTTP application and its server."""

from __future__ import annotations

import asyncio
import errno
import functools
import logging
import socket
import ssl
from pathlib import Path
from typing import Any

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.core.streaming import CORS_HEADERS
from mavproxy_uavapi.http.callers.call import SERVICE, Call, Service, holder_of
from mavproxy_uavapi.http.callers.caller import CALLER
from mavproxy_uavapi.http.contract.responses import Handler, success
from mavproxy_uavapi.http.contract.router import MATCH, Router
from mavproxy_uavapi.http.door.access import require_own_vehicle, require_role
from mavproxy_uavapi.http.door.auditing import audited
from mavproxy_uavapi.http.door.rate_limits import limit_rate, yield_to_main_loop
from mavproxy_uavapi.http.door.security import cors_headers, door
from mavproxy_uavapi.http.routes import PAGE, ROUTES
from mavproxy_uavapi.http.server.error_answers import AnswersErrors, errors_as_answers
from mavproxy_uavapi.http.server.listener import Listener, listening_socket
from mavproxy_uavapi.http.server.repeat import remember
from mavproxy_uavapi.http.wire.bodies import invite, options_of, parameters
from mavproxy_uavapi.http.wire.connection import IDLE_TIMEOUT, LINGER, headers_are_here

log = logging.getLogger("uavapi.http.server")
MIDDLEWARES = (headers_are_here, errors_as_answers, door, limit_rate, yield_to_main_loop)
SHUTDOWN_TIMEOUT = 1.0  # s for unfinished answers when the server stops


def make_handler(service: Service, system: int = 0) -> Handler:
    """The handler of all requests.

    Args:
        service: the objects that the handlers work with.
        system: the system id for paths that name none; 0 for the one in the settings.
    """
    router = Router([*ROUTES, *PAGE], service.host.extensions, system)

    async def handle(request: web.BaseRequest) -> web.StreamResponse:
        request[SERVICE] = service
        request[MATCH] = router.find(request.method, request.path)
        origin = request.headers.get("Origin")
        if origin is not None and origin in service.settings.cors_origins:
            request[CORS_HEADERS] = cors_headers(origin)
        response = await _behind_the_door(request)
        if not response.prepared:
            response.headers.update(request.get(CORS_HEADERS, {}))
        return response

    return handle


class HttpServer(web.Server):
    """aiohttp's server, with our protocol."""

    def __call__(self) -> web.RequestHandler:
        """The protocol of a new connection."""
        return AnswersErrors(self, loop=self._loop, **self._kwargs)


async def make_server(service: Service, system: int = 0) -> web.Server:
    """aiohttp's server, not yet listening; arguments as for `make_handler`."""
    return HttpServer(
        make_handler(service, system),
        # A handler is cancelled when its client hangs up; so a verb learns that its client has gone.
        handler_cancellation=True,
        access_log=None,
        logger=log,
        keepalive_timeout=IDLE_TIMEOUT,
        lingering_time=LINGER,
        auto_decompress=False,  # compressed bodies are refused and discarded unread
    )


async def _answer(request: web.BaseRequest) -> web.StreamResponse:
    match = request[MATCH]
    if not match.allowed:
        raise NotFound("no such path")
    route = match.route
    if route is None:
        raise web.HTTPMethodNotAllowed(request.method, match.allowed)
    require_role(request, route, read_only=request[SERVICE].settings.read_only)
    require_own_vehicle(request, route)
    options = options_of(request, route)
    request[SERVICE].heard_from(request.get(CALLER), holder_of(request, options))
    request[SERVICE].host.registry.use(match.system)
    await invite(request)
    params = await parameters(request, route)
    call = Call(request[SERVICE], request, params, match, options)
    with call.naming_source():
        answer = await (audited(call, route.action) if route.commands and route.audited else route.action(call))
    if isinstance(answer, web.StreamResponse):
        return answer
    response = success(answer)
    if route.message:
        remember(call, route, response)
    return response


def _guarded(handler: Handler) -> Handler:
    for middleware in reversed(MIDDLEWARES):
        handler = functools.partial(middleware, handler=handler)
    return handler


_behind_the_door = _guarded(_answer)


def is_ours(record: logging.LogRecord) -> bool:
    """Whether an aiohttp log line is about us, not about a client that speaks no HTTP, has gone, or reads nothing."""
    error = None if record.exc_info is None else record.exc_info[1]
    unread = isinstance(error, OSError) and error.errno == errno.ETIMEDOUT  # the kernel closed the connection
    return not (unread or isinstance(error, HttpProcessingError | ConnectionError))


log.addFilter(is_ours)


class ApiServer:
    """A listening server; all methods belong to the asyncio thread."""

    def __init__(self, service: Service) -> None:
        self.service = service
        self._runners: list[web.ServerRunner] = []
        self._sockets: list[socket.socket] = []
        self._listener: Listener | None = None

    async def start(self) -> None:
        """Listen on each port of the settings.

        Raises:
            OSError: a port is taken, there is no such address, or the TLS files cannot be read.
        """
        settings = self.service.settings
        tls = tls_context(settings.certfile, settings.keyfile) if settings.certfile else None
        servers: dict[socket.socket, Any] = {}
        for port, system in settings.listening.items():
            self._sockets.append(listening_socket(settings.host, port))
            server = servers[self._sockets[-1]] = await make_server(self.service, system)
            self._runners.append(web.ServerRunner(server, shutdown_timeout=SHUTDOWN_TIMEOUT))
            await self._runners[-1].setup()
        most, throttle = (lambda: self.service.settings.max_connections), self.service.throttle
        self._listener = Listener(servers, tls, most, throttle)

    async def stop(self) -> None:
        """End the running jobs, answer their clients, and close the ports."""
        self.service.host.jobs.abort_remote("the API is stopping")
        if self._listener is not None:
            self._listener.close_ports()
        await asyncio.gather(*(runner.cleanup() for runner in self._runners))
        if self._listener is not None:
            self._listener.stop()
        for listening in self._sockets:
            listening.close()

    def filenos(self) -> list[int]:
        """Descriptors of the ports and of every connection."""
        return [] if self._listener is None else self._listener.filenos()


def tls_context(certfile: str, keyfile: str) -> ssl.SSLContext:
    """The TLS context of the server.

    Raises:
        OSError: a file cannot be read, is not a PEM file of that kind, or has a password.
    """
    for file in (certfile, keyfile):
        Path(file).open("rb").close()  # ssl's own error does not name the file
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(certfile, keyfile, password=_no_password)
    return context


def _no_password() -> str:
    """ssl calls it for an encrypted key; else it would ask at the terminal and hold up the asyncio thread."""
    raise ssl.SSLError(1, "the key has a password; `openssl pkey -in KEY -out NEW` writes it without one")
