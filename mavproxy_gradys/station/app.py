"""The station's HTTP API.

POST /update-info/       a device's position, as for the GrADyS ground station: form fields; answers type 103, or
                         type 101 if no browser watches: then the update was received but dropped
POST /readings           {"readings": [...]} -> {"acknowledged": [seq, ...]}; 409 if a number has another reading
GET  /devices            the newest update of each device, JSON; /devices.csv
GET  /fleet              every vehicle, from readings and updates
GET  /readings           JSON; /readings.csv; /readings.parquet;
                         ?device= &quantity= &from= &to= (s since 1970) &after=SEQ &limit=1000
GET  /history            a quantity for a plot; ?device= &quantity= &element= &from= &to= &parts=800
GET  /alarms             the alarms
GET  /watch              the changes, every second, as Server-Sent Events; the page uses it
GET  /metrics, /health   for Prometheus, and for a supervisor
GET  /                   the page
"""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware

from mavproxy_gradys.station.access import add_headers, require_token, same_site
from mavproxy_gradys.station.exports import ParquetMissing, csv_readings, csv_text, json_readings, parquet_readings
from mavproxy_gradys.station.fleet import FleetVehicle, changes
from mavproxy_gradys.station.fleet_watch import FleetWatch
from mavproxy_gradys.station.health import StationHealth
from mavproxy_gradys.station.history import history_view
from mavproxy_gradys.station.intake import Intake
from mavproxy_gradys.station.queries import MOST_EXPORTED, MOST_ROWS, history_query, reading_query
from mavproxy_gradys.station.reading_row import NumberTaken, decoded, reading_row
from mavproxy_gradys.station.store import pages
from mavproxy_gradys.station.updates import DEVICE_COLUMNS, TABLE_NAMES, Updates, newest_of_update, parse
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.streaming import MOST_OPEN, EventStream, SharedSlots, Slots, StreamingResponse, reset

RECEIVED, DROPPED = 103, 101
LARGEST_BODY = 4 * 1024 * 1024  # bytes; a sender halves its batch if it is larger
MOST_POSTED = 5000  # readings at once: while they are checked nobody else is answered
CHUNK = 64 * 1024  # bytes of a file that are sent at once
MOST_DOWNLOADS, MOST_HISTORIES = 8, 32  # at once
PAGE = Path(__file__).parent / "page"
FILES = ("fleet.js", "map.js", "plot.js", "style.css")


class Station:
    """The handlers.

    Args:
        intake: stores readings, and counts them.
        watch: the fleet.
        health: the state of broker and database.
        watched: whether to answer as if a browser always watched.
        token: bearer token that senders must send; empty for none.
        public_name: a host name of it, besides its own and its addresses; empty for none.
        clock: s since 1970.
    """

    def __init__(
        self,
        intake: Intake,
        watch: FleetWatch,
        health: StationHealth,
        *,
        watched: bool = False,
        token: str = "",
        public_name: str = "",
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._intake = intake
        self._store = intake.store
        self._watch = watch
        self._health = health
        self._watched = watched
        self._access: list[Middleware] = [same_site(public_name), require_token(token)]
        self._clock = clock
        self._updates = Updates(clock)
        self._downloads = SharedSlots(MOST_DOWNLOADS, "downloads run")
        self._histories = Slots(MOST_HISTORIES, "histories are being read")
        self._streams = Slots(MOST_OPEN, "streams are open")

    def app(self) -> web.Application:
        """The application."""
        app = web.Application(client_max_size=LARGEST_BODY, middlewares=[errors_as_answers, *self._access])
        app.on_response_prepare.append(add_headers)
        for path in ("/update-info/", "/update-info"):
            app.router.add_post(path, self.update)
        for path in ("/readings", "/readings/"):
            app.router.add_post(path, self.take)
            app.router.add_get(path, self.readings)
        answers = {
            "/readings.csv": self.readings_csv,
            "/readings.parquet": self.readings_parquet,
            "/devices": self.devices,
            "/devices.csv": self.devices_csv,
            "/fleet": self.fleet,
            "/history": self.history,
            "/alarms": self.alarms,
            "/watch": self.watch,
            "/metrics": self.metrics,
            "/health": self.health,
            "/": self.page,
        }
        for path, answer in answers.items():
            app.router.add_get(path, answer)
        for file in FILES:
            app.router.add_get(f"/{file}", self.file)
        return app

    # -- in -----------------------------------------------------------------------------------------------

    async def update(self, request: web.Request) -> web.Response:
        """Take a position. A malformed one is answered with 500, as the ground station does."""
        now = self._clock()
        try:
            device = parse({name: str(value) for name, value in (await request.post()).items()})
            shown = list(newest_of_update(device, now))
        except KeyError as missing:
            return web.json_response({"detail": f"cannot read that: it has no {missing.args[0]}"}, status=500)
        except ValueError:
            return web.json_response({"detail": "cannot read that: a field is not a number"}, status=500)
        watched = self._watched or self._streams.count > 0
        if watched:
            self._updates.put(device)
            await self._store.show(shown)
        kind = RECEIVED if watched else DROPPED
        return web.json_response({"id": 1, "type": kind, "seq": 0, "lat": 0, "lng": 0, "alt": 0, "DATA": "0"})

    async def take(self, request: web.Request) -> web.Response:
        """Store readings; exactly those on the disk are acknowledged."""
        try:
            readings = decoded(await request.read())["readings"]
            if len(readings) > MOST_POSTED:
                return web.json_response({"detail": f"more than {MOST_POSTED} readings at once"}, status=413)
            rows = [reading_row(reading) for reading in readings]
        except (KeyError, TypeError) as error:
            raise ValueError('not {"readings": [...]}') from error
        with self._intake.storing():
            await self._intake.keep(rows)
        return web.json_response({"acknowledged": [row.seq for row in rows]})

    # -- out ----------------------------------------------------------------------------------------------

    async def devices(self, _request: web.Request) -> web.Response:
        """Every device that has sent an update."""
        return web.json_response({"devices": self._updates.devices()})

    async def devices_csv(self, _request: web.Request) -> web.Response:
        """The same as CSV, with the names of a flight's table (docs/data.md)."""
        rows = [[device.get(name, "") for name in DEVICE_COLUMNS] for device in self._updates.devices()]
        head = [TABLE_NAMES.get(name, name) for name in DEVICE_COLUMNS]
        return web.Response(body=csv_text([head, *rows]), content_type="text/csv", charset="utf-8")

    async def fleet(self, _request: web.Request) -> web.Response:
        """Every vehicle."""
        return web.json_response({"now": self._watch.now, "vehicles": list(map(vars, self._watch.vehicles))})

    async def alarms(self, _request: web.Request) -> web.Response:
        """The present alarms."""
        return web.json_response({"alarms": [alarm._asdict() for alarm in self._watch.alarms]})

    async def readings(self, request: web.Request) -> web.StreamResponse:
        """Readings as JSON."""
        query = reading_query(request.query, 1000, MOST_ROWS)
        counts = await self._store.counts()
        texts = json_readings(pages(self._store, query), counts)
        return await self._download(request, StreamingResponse("application/json; charset=utf-8"), texts)

    async def readings_csv(self, request: web.Request) -> web.StreamResponse:
        """Readings as CSV, in the order of the store."""
        query = reading_query(request.query, 1000, MOST_EXPORTED)
        response = download("text/csv; charset=utf-8", "readings.csv")
        return await self._download(request, response, csv_readings(pages(self._store, query)))

    async def _download(
        self, request: web.Request, response: StreamingResponse, texts: AsyncIterator[bytes]
    ) -> web.StreamResponse:
        """Send texts while they are read.

        Raises:
            NotStored: the first one cannot be read.
            TooManyRequests: too many downloads run.
        """
        with self._downloads.one_more_of(request.remote or ""):
            try:
                with contextlib.suppress(ConnectionError):  # the client has gone, or reads nothing
                    async for text in texts:
                        if not response.prepared:
                            await response.prepare(request)
                        await response.write(text)
            except UavApiError:
                if not response.prepared:
                    raise
                if request.transport is not None:
                    reset(request.transport)
        return response

    async def readings_parquet(self, request: web.Request) -> web.StreamResponse:
        """Readings as Parquet."""
        query = reading_query(request.query, 1000, MOST_EXPORTED)
        with self._downloads.one_more_of(request.remote or ""):
            try:
                file = await parquet_readings(pages(self._store, query))
            except ParquetMissing as missing:
                return web.json_response({"detail": str(missing)}, status=501)
            with file:
                response = download("application/vnd.apache.parquet", "readings.parquet")
                with contextlib.suppress(ConnectionError):  # the client has gone, or reads nothing
                    await response.prepare(request)
                    while part := file.read(CHUNK):
                        await response.write(part)
        return response

    async def history(self, request: web.Request) -> web.Response:
        """A quantity over time."""
        query = history_query(request.query, self._clock())
        with self._histories.one_more():
            view = history_view(await self._store.history(query), query.width)
        return web.json_response({"from": query.start, "to": query.end, **view})

    async def watch(self, request: web.Request) -> web.StreamResponse:
        """The fleet, once a second: first all vehicles, then what has changed of each, with its device."""
        with self._streams.one_more():
            response = EventStream()
            await response.prepare(request)
            known: dict[str, FleetVehicle] = {}
            with contextlib.suppress(ConnectionError):  # the browser has gone, or reads nothing
                while True:
                    pairs = [(known.get(vehicle.device), vehicle) for vehicle in self._watch.vehicles]
                    known = {vehicle.device: vehicle for vehicle in self._watch.vehicles}
                    news = [changes(before, vehicle) for before, vehicle in pairs if before != vehicle]
                    await response.write(f"data: {json.dumps(self._event(news))}\n\n".encode())
                    await self._watch.next_update()
        return response

    def _event(self, news: list[dict[str, Any]]) -> dict[str, Any]:
        watch = self._watch
        return {
            "now": watch.now,
            "vehicles": news,
            "count": len(watch.vehicles),
            "alarms": watch.alarms,
            "readings": watch.counts.stored,
            "problem": watch.problem,
        }

    async def metrics(self, _request: web.Request) -> web.Response:
        """Metrics for Prometheus."""
        try:
            from mavproxy_gradys.station.metrics import StationCollector, exposition  # noqa: PLC0415  an extra
        except ModuleNotFoundError as missing:
            detail = f"/metrics needs {missing.name}: pip install 'mavproxy-uavapi[fleet]'"
            return web.json_response({"detail": detail}, status=501)
        text = exposition(StationCollector(self._intake.statistics, self._watch, self._health))
        return web.Response(body=text, headers={"Content-Type": "text/plain; version=0.0.4; charset=utf-8"})

    async def health(self, _request: web.Request) -> web.Response:
        """Whether broker and database can be reached."""
        return web.json_response(self._health.report(), status=200 if self._health.is_good else 503)

    async def page(self, _request: web.Request) -> web.FileResponse:
        """The page."""
        return web.FileResponse(PAGE / "fleet.html", headers={"Cache-Control": "no-cache"})

    async def file(self, request: web.Request) -> web.FileResponse:
        """One of the page's own files."""
        return web.FileResponse(PAGE / request.path[1:], headers={"Cache-Control": "no-cache"})


@web.middleware
async def errors_as_answers(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Answer 400 to an invalid query, 409 to a number that is taken, and its own status to an error of ours."""
    try:
        return await handler(request)
    except NumberTaken as error:
        return web.json_response({"detail": str(error), "code": "number_taken"}, status=409)
    except ValueError as error:
        return web.json_response({"detail": f"cannot read that: {error}"}, status=400)
    except UavApiError as error:
        return web.json_response({"detail": str(error), "code": error.code}, status=error.status)


def download(kind: str, name: str) -> StreamingResponse:
    """An answer that a browser saves."""
    response = StreamingResponse(kind)
    response.headers["Content-Disposition"] = f'attachment; filename="{name}"'
    return response
