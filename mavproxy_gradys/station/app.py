"""The station's HTTP side.

POST /update-info/       a device's position, as the GrADyS ground station takes it: form fields; answers
                         type 103, or 101 when no browser watches: then the update was received but dropped
POST /readings           {"readings": [...]} -> {"acknowledged": [seq, ...]}
GET  /devices            JSON; /devices.csv
GET  /readings           JSON; /readings.csv; ?device= &quantity= &after=SEQ &limit=1000
GET  /watch              every second all devices, as Server-Sent Events: the page watches by it
GET  /                   the page
"""

from __future__ import annotations

import asyncio
import csv
import hmac
import io
import json
from collections.abc import Awaitable, Callable, Iterable, Sequence
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web

from mavproxy_gradys.station.page import PAGE
from mavproxy_gradys.station.store import COLUMNS, DEVICE_COLUMNS, PositionStore, parse, whole

RECEIVED, DROPPED = 103, 101
LARGEST_BODY = 16 * 1024 * 1024  # bytes
MOST_ROWS = 1_000_000
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Station:
    """The handlers.

    Args:
        store: devices and readings.
        watched: whether to answer as if a browser always watched.
        token: bearer token that senders must know; empty for none.
    """

    def __init__(self, store: PositionStore, watched: bool = False, token: str = "") -> None:
        self.store = store
        self._watched = watched
        self._token = token
        self._watchers = 0

    def app(self) -> web.Application:
        """The application."""
        app = web.Application(client_max_size=LARGEST_BODY, middlewares=[self._from_here, self._only_with_token])
        for path in ("/update-info/", "/update-info"):
            app.router.add_post(path, self.update)
        for path in ("/readings", "/readings/"):
            app.router.add_post(path, self.take)
            app.router.add_get(path, self.readings)
        app.router.add_get("/readings.csv", self.readings)
        app.router.add_get("/devices", self.devices)
        app.router.add_get("/devices.csv", self.devices)
        app.router.add_get("/watch", self.watch)
        app.router.add_get("/", self.page)
        return app

    @web.middleware
    async def _from_here(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse what a page of another site sends."""
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != request.host:
            return web.json_response({"detail": f"a page of {origin} may not call"}, status=403)
        return await handler(request)

    @web.middleware
    async def _only_with_token(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        given = request.headers.get("Authorization", "").removeprefix("Bearer ")
        if request.method == "POST" and self._token and not hmac.compare_digest(given.encode(), self._token.encode()):
            return web.json_response({"detail": "a bearer token is needed"}, status=401)
        return await handler(request)

    async def update(self, request: web.Request) -> web.Response:
        """Take a position. What the ground station cannot read it answers with 500, and so does this."""
        try:
            device = parse({name: str(value) for name, value in (await request.post()).items()})
        except (ValueError, KeyError) as error:
            return web.json_response({"detail": f"cannot read that: {error!r}"}, status=500)
        watched = self._watched or self._watchers > 0
        if watched:
            self.store.update(device)
        kind = RECEIVED if watched else DROPPED
        return web.json_response({"id": 1, "type": kind, "seq": 0, "lat": 0, "lng": 0, "alt": 0, "DATA": "0"})

    async def take(self, request: web.Request) -> web.Response:
        """Keep readings; acknowledged are just those that are on the disk."""
        try:
            given = json.loads(await request.read())
            numbers = self.store.add(given["readings"])
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            return web.json_response({"detail": f"cannot read that: {error}"}, status=400)
        return web.json_response({"acknowledged": numbers})

    async def devices(self, request: web.Request) -> web.Response:
        """Every device."""
        found = self.store.devices()
        if request.path.endswith(".csv"):
            return table(DEVICE_COLUMNS, ([device.get(name, "") for name in DEVICE_COLUMNS] for device in found))
        return web.json_response({"devices": found})

    async def readings(self, request: web.Request) -> web.Response:
        """Readings."""
        query = request.query
        try:
            after, limit = whole(query.get("after", "-1")), whole(query.get("limit", "1000"))
            if not 0 <= limit <= MOST_ROWS:
                raise ValueError(f"limit is from 0 to {MOST_ROWS}")
        except ValueError as error:
            return web.json_response({"detail": str(error)}, status=400)
        rows = self.store.readings(query.get("device", ""), query.get("quantity", ""), after, limit)
        if request.path.endswith(".csv"):
            return table(COLUMNS, rows)
        found = [dict(zip(COLUMNS, row, strict=True)) for row in rows]
        return web.json_response({"count": self.store.count(), "repeats": self.store.repeats, "readings": found})

    async def watch(self, request: web.Request) -> web.StreamResponse:
        """All devices once a second, while somebody looks."""
        response = web.StreamResponse(headers={"Content-Type": "text/event-stream", "Cache-Control": "no-store"})
        await response.prepare(request)
        self._watchers += 1
        try:
            while True:
                told = {"devices": self.store.devices(), "readings": self.store.count()}
                await response.write(f"data: {json.dumps(told)}\n\n".encode())
                await asyncio.sleep(1.0)
        except ConnectionResetError:
            return response
        finally:
            self._watchers -= 1

    async def page(self, request: web.Request) -> web.Response:
        """The fleet on a canvas."""
        return web.Response(text=PAGE, content_type="text/html")


def table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> web.Response:
    """Rows as CSV."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(columns)
    writer.writerows([json.dumps(cell) if isinstance(cell, list | dict) else cell for cell in row] for row in rows)
    body = text.getvalue().encode("utf-8", "replace")  # JSON may name half a letter, which UTF-8 has not
    return web.Response(body=body, content_type="text/csv", charset="utf-8")
