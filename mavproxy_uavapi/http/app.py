"""The aiohttp application, and the server that listens for it."""

from __future__ import annotations

import functools
import logging
import socket
import ssl
from pathlib import Path
from typing import Any

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.http.auditing import audited
from mavproxy_uavapi.http.bodies import invite
from mavproxy_uavapi.http.call import ROUTE, SERVICE, Call, Service, parameters
from mavproxy_uavapi.http.connection import IDLE_TIMEOUT, LINGER, headers_are_here
from mavproxy_uavapi.http.docs_page import TABLE
from mavproxy_uavapi.http.listener import Listener, listening_socket
from mavproxy_uavapi.http.log_throttle import LogThrottle
from mavproxy_uavapi.http.rate_limits import BUCKET, STRANGERS, Bucket, at_a_bearable_rate, yield_to_main_loop
from mavproxy_uavapi.http.responses import REFUSED, Handler, errors_as_answers, success
from mavproxy_uavapi.http.route import Route
from mavproxy_uavapi.http.routes import ROUTES
from mavproxy_uavapi.http.security import THROTTLE, door, name_the_trusted

log = logging.getLogger("uavapi.http.server")
MAX_BODY = 1024 * 1024  # bytes
MIDDLEWARES = (headers_are_here, errors_as_answers, door, at_a_bearable_rate, yield_to_main_loop)
SHUTDOWN_TIMEOUT = 1.0  # s for answers that are being written when we stop


def make_app(service: Service) -> web.Application:
    """The application with every route, each with and without a trailing slash."""
    app = web.Application(client_max_size=MAX_BODY)
    app[SERVICE] = service
    app[TABLE] = ROUTES
    app[BUCKET], app[STRANGERS] = Bucket(), Bucket()
    app[THROTTLE] = LogThrottle(service.host.clock, log.warning)
    app[REFUSED] = service.host.audit.refused
    app.on_response_prepare.append(name_the_trusted)
    for route in ROUTES:
        for method in route.methods:
            for path in (route.path, route.path + "/"):
                app.router.add_route(method, path, _handler(route), expect_handler=_no_answer_yet)
    app.router.register_resource(rest := EveryPath("/{path}"))
    rest.add_route("*", _extension, expect_handler=_no_answer_yet)
    return app


class EveryPath(web.DynamicResource):
    """What no other route has, also what does not begin with a slash (`OPTIONS *`).

    What no route has would be answered by aiohttp itself, and its own answer to `Expect` comes before the door.
    An empty path, which only CONNECT has, is aiohttp's all the same.
    """

    def _match(self, path: str) -> dict[str, str] | None:
        return {"path": path}


def guarded(handler: Handler) -> Handler:
    """`handler` behind the middlewares, the first of them outermost.

    They are not given to the application: aiohttp would keep what it makes of them in a cache of the process, and
    with it the application of every reload.
    """
    for middleware in reversed(MIDDLEWARES):
        handler = functools.partial(middleware, handler=handler)
    return handler


def _handler(route: Route) -> Handler:
    async def handle(request: web.Request) -> web.StreamResponse:
        request[ROUTE] = route
        return await _behind_the_door(request)

    return handle


async def _extension(request: web.Request) -> web.StreamResponse:
    """A path that another module serves, which may be loaded and unloaded while we listen."""
    request[ROUTE] = request.app[SERVICE].host.extensions.get(request.path.rstrip("/"))
    return await _behind_the_door(request)


async def _no_answer_yet(_request: web.Request) -> None:
    """An `Expect: 100-continue` is answered behind the door (`invite`): nobody else is asked for his body."""


def methods_of(path: str) -> set[str]:
    """What may be asked of a path of ours: the methods of all routes that match it."""
    return {method for route in ROUTES if route.matches(path) for method in route.methods}


async def _answer(request: web.Request) -> web.StreamResponse:
    path = request.path.rstrip("/")
    route: Route | None = request[ROUTE]
    allowed = methods_of(path) if route is None else set(route.methods)
    if route is None and not allowed:
        raise NotFound("no such path")
    if route is None or request.method not in allowed:
        raise web.HTTPMethodNotAllowed(request.method, allowed)
    await invite(request)
    params = await parameters(request, route.model, body=request.method == "POST" and not route.raw)
    call = Call(request.app[SERVICE], request, params)
    with call.naming_source():
        answer = await (audited(call, route.action) if route.commands and route.trail else route.action(call))
    return answer if isinstance(answer, web.StreamResponse) else success(answer)


_behind_the_door = guarded(_answer)


def is_ours(record: logging.LogRecord) -> bool:
    """Whether a line of aiohttp's is about us, rather than about a client that speaks no HTTP, or has gone."""
    return record.exc_info is None or not isinstance(record.exc_info[1], HttpProcessingError | ConnectionError)


log.addFilter(is_ours)


class ApiServer:
    """A listening server; all methods belong to the asyncio thread."""

    def __init__(self, service: Service) -> None:
        self.service = service
        # A handler is cancelled when its client hangs up: that is how a verb learns that nobody awaits it.
        self._runner = web.AppRunner(
            make_app(service),
            access_log=None,
            logger=log,
            handler_cancellation=True,
            shutdown_timeout=SHUTDOWN_TIMEOUT,
            keepalive_timeout=IDLE_TIMEOUT,
            lingering_time=LINGER,
            auto_decompress=False,  # what is compressed is refused, and thrown away as it is
        )
        self._socket: socket.socket | None = None
        self._listener: Listener | None = None

    async def start(self) -> None:
        """Listen.

        Raises:
            OSError: the port is taken, there is no such address, or the TLS files cannot be read.
        """
        settings = self.service.settings
        tls = tls_context(settings.certfile, settings.keyfile) if settings.certfile else None
        await self._runner.setup()
        self._socket = listening_socket(settings.host, settings.port)
        factory: Any = self._runner.server
        throttle = self._runner.app[THROTTLE]
        self._listener = Listener(self._socket, factory, tls, lambda: self.service.settings.max_connections, throttle)

    async def stop(self) -> None:
        """End the verbs in flight, answer their clients, and close the port."""
        self.service.host.jobs.abort_remote("the API is stopping")
        if self._listener is not None:
            self._listener.close_port()
        await self._runner.cleanup()
        if self._listener is not None:
            self._listener.stop()
        if self._socket is not None:
            self._socket.close()

    def filenos(self) -> list[int]:
        """Descriptors of the port and of every connection."""
        return [] if self._listener is None else self._listener.filenos()


def tls_context(certfile: str, keyfile: str) -> ssl.SSLContext:
    """What a TLS server needs.

    Raises:
        OSError: a file cannot be read, or is no PEM of that kind.
    """
    for file in (certfile, keyfile):
        Path(file).open("rb").close()  # ssl's own error would not name the file
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(certfile, keyfile)
    return context
