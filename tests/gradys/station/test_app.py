"""The HTTP side, on an SQLite store."""

from __future__ import annotations

import asyncio
import contextlib
import csv
import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from aiohttp.test_utils import TestClient, TestServer

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.app import FILES, MOST_DOWNLOADS, MOST_HISTORIES, PAGE, Station
from mavproxy_gradys.station.fleet import AlarmLimits
from mavproxy_gradys.station.fleet_watch import FleetWatch
from mavproxy_gradys.station.health import STALLED, StationHealth
from mavproxy_gradys.station.intake import Intake
from mavproxy_gradys.station.sqlite_store import SqliteStore
from mavproxy_gradys.station.statistics import Statistics
from mavproxy_gradys.station.store import CHUNK
from mavproxy_gradys.station.updates import Updates, parse
from mavproxy_uavapi.core.streaming import MOST_OPEN
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.gradys.station.conftest import Clock
from tests.support.virtual_time import FastLoop

FORM = {"id": "10", "lat": "-15.84", "lng": "-47.9", "alt": "20.1", "device": "uav", "type": "102", "seq": "0"}


def reading(seq: Any, **members: Any) -> dict[str, Any]:
    return {
        "device": "uav-1",
        "id": "1",
        "seq": seq,
        "quantity": "alt",
        "representation": "m",
        "value": 1.5,
        "time": 5,
        **members,
    }


def test_devices_have_an_age_and_a_status(clock: Clock) -> None:
    updates, began = Updates(clock), clock.now
    updates.put(parse(FORM))
    for age, status in ((0.0, "active"), (6.0, "on_hold"), (11.0, "inactive")):
        clock.now = began + age
        (device,) = updates.devices()
        assert (device["id"], device["lat"], device["age_s"], device["status"]) == (10, -15.84, age, status)


@pytest.mark.parametrize("change", [{"lat": "None"}, {"id": ""}, {"seq": "1.5"}, {"lat": "nan"},
                                    {"alt": "inf"}, {"id": str(2**63)}])  # fmt: skip
def test_what_the_ground_station_cannot_read_this_cannot_either(change: dict[str, str]) -> None:
    with pytest.raises(ValueError):
        parse({**FORM, **change})
    with pytest.raises(KeyError):
        parse({"id": "1"})


class Asker:
    """Asks a station: `ask("GET", "/readings")`; (status, text)."""

    def __init__(self, loop: FastLoop, client: TestClient[Any, Any], watch: FleetWatch, station: Station) -> None:
        self._loop, self._client, self.watch, self.station = loop, client, watch, station

    def __call__(self, method: str, path: str, **options: Any) -> tuple[int, str]:
        answer = self.whole(method, path, **options)
        return answer.status, answer.body.decode()

    def whole(self, method: str, path: str, **options: Any) -> Any:
        async def requested() -> Any:
            async with self._client.request(method, path, **options) as answer:
                return SimpleNamespace(status=answer.status, headers=answer.headers, body=await answer.read())

        return self._loop.run(requested())

    def json(self, path: str) -> Any:
        answer = self.whole("GET", path)
        assert answer.status == 200, answer.body
        return json.loads(answer.body)

    def unread(self, path: str) -> int:
        """How many bytes of an answer are left to a client that begins to read after two minutes."""

        async def begun() -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
            reader, writer = await asyncio.open_connection(self._client.host, self._client.port, limit=1024)
            writer.write(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            return reader, writer

        async def rest() -> int:
            count = 0
            with contextlib.suppress(ConnectionError):
                while part := await reader.read(65536):
                    count += len(part)
            writer.close()
            return count

        reader, writer = self._loop.run(begun())
        self._loop.pass_time(120.0)
        return int(self._loop.run(rest()))

    def raw(self, request: str) -> tuple[bytes, str]:
        """The beginning of an answer, and how its connection ends: `closed` or `reset`."""

        async def requested() -> tuple[bytes, str]:
            reader, writer = await asyncio.open_connection(self._client.host, self._client.port)
            writer.write(f"{request}\r\nHost: localhost\r\n\r\n".encode())
            head, end = await reader.read(100), "closed"
            try:
                await reader.read()
            except ConnectionResetError:
                end = "reset"
            writer.close()
            return head, end

        return cast(tuple[bytes, str], self._loop.run(requested()))

    def statuses(self, path: str, count: int) -> list[int]:
        """The statuses of those that are answered soon, of so many requests at once."""

        async def requested() -> list[int]:
            asked = [asyncio.ensure_future(self._client.get(path)) for _ in range(count)]
            done, rest = await asyncio.wait(asked, timeout=5)
            for one in rest:
                one.cancel()
            await asyncio.gather(*rest, return_exceptions=True)
            return [one.result().status for one in done]

        return list(self._loop.run(requested()))

    def look(self) -> None:
        self._loop.run(self.watch.update())

    @contextlib.contextmanager
    def stream(self, path: str) -> Iterator[Callable[[], Any]]:
        """A function that waits for the next event of a stream."""
        response = self._loop.run(self._client.get(path))

        async def event() -> Any:
            line, _ = await response.content.readline(), await response.content.readline()
            return json.loads(line.removeprefix(b"data: "))

        yield lambda: self._loop.run(event())
        response.close()


@pytest.fixture
def ask(
    loop: FastLoop, tmp_path: Path, clock: Clock, at_once: type, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Asker]:
    loop.real_wait = 0.05
    loop.set_default_executor(AtOnce())  # of threads its clock would know nothing
    monkeypatch.setattr("mavproxy_gradys.station.sqlite_store.ThreadPoolExecutor", at_once)
    store = SqliteStore(tmp_path / "station.db", clock)
    watch = FleetWatch(store, AlarmLimits(10, 20))
    options: dict[str, Any] = {"watched": True, "public_name": "fleet.example", "clock": clock}
    intake = Intake(store, Statistics(), clock, lambda: clock.now)
    station = Station(intake, watch, StationHealth(watch, intake), **options)

    async def start() -> TestClient[Any, Any]:
        client = TestClient(TestServer(station.app()))
        await client.start_server()
        return client

    client = loop.run(start())
    yield Asker(loop, client, watch, station)
    loop.run(client.close())
    loop.run(store.close())


def post(ask: Asker, *readings: dict[str, Any]) -> None:
    status, text = ask("POST", "/readings", data=json.dumps({"readings": readings}))
    assert status == 200, text


def test_readings_are_kept_once_each(ask: Asker) -> None:
    post(ask, reading(1), reading(2))
    status, text = ask("POST", "/readings", data=json.dumps({"readings": [reading(2), reading(3)]}))
    assert (status, json.loads(text)) == (200, {"acknowledged": [2, 3]})  # a repeat is acknowledged again
    listing = ask.json("/readings")
    assert [(kept["seq"], kept["value"]) for kept in listing["readings"]] == [(1, 1.5), (2, 1.5), (3, 1.5)]
    assert (listing["count"], listing["repeats"]) == (3, 1)


def test_what_is_not_kept_because_of_its_number_is_not_acknowledged(ask: Asker) -> None:
    post(ask, reading(1))
    status, text = ask("POST", "/readings", data=json.dumps({"readings": [reading(1, value=9), reading(2)]}))
    assert status == 409
    assert "another reading with the number 1" in json.loads(text)["detail"]
    assert ask.json("/readings")["count"] == 1


def test_a_batch_with_something_else_in_it_is_not_kept(ask: Asker) -> None:
    assert ask("POST", "/readings", data=json.dumps({"readings": [reading(5), reading("1")]}))[0] == 400
    assert ask.json("/readings")["count"] == 0


def test_of_more_readings_than_are_checked_in_a_moment_none_is_kept(ask: Asker) -> None:
    """While they are checked nobody else is answered; a sender halves its batch then."""
    body = json.dumps({"readings": [reading(seq) for seq in range(5001)]})
    assert ask("POST", "/readings", data=body)[0] == 413
    assert ask("POST", "/readings", data=io.BytesIO(b'{"readings": [' + b"[]," * 1_500_000 + b"[]]}"))[0] == 413
    assert ask.json("/readings")["count"] == 0


@pytest.mark.parametrize("query", ["limit=-1", f"limit={10**20}", f"after={10**20}", "after=x", "limit=1.5"])
def test_a_query_that_means_nothing_is_a_mistake_of_the_client(ask: Asker, query: str) -> None:
    assert ask("GET", f"/readings?{query}")[0] == 400


@pytest.mark.parametrize("body", [b'{"readings": ' + b"[" * 100_000, b"[]", b"", b'{"readings": [1]}'])
def test_a_body_that_holds_no_readings_is_a_mistake_of_the_client(ask: Asker, body: bytes) -> None:
    assert ask("POST", "/readings", data=body)[0] == 400


def test_history_and_its_gaps(ask: Asker, clock: Clock) -> None:
    began = clock.now - 600
    times = [began + n for n in range(600) if not 200 <= n < 300]
    post(ask, *(reading(n, value=n, time=at) for n, at in enumerate(times)))
    history = ask.json(f"/history?device=uav-1&quantity=alt&from={began}&to={clock.now}&parts=60")
    assert [part[4] for part in history["parts"]] == [10] * 50
    assert history["gaps"] == [[began + 199, began + 300]]
    assert len(history["late"]) == 49  # the newest ten are not: they are from 1 to 10 s old
    assert ask.json("/history?device=nobody&quantity=alt")["parts"] == []


@pytest.mark.parametrize("query", ["parts=0", "parts=9999", "element=-1", "element=x", "from=5&to=4", "to=nan",
                                   "device=%00", "from=1e300"])  # fmt: skip
def test_a_history_that_means_nothing_is_a_mistake_of_the_client(ask: Asker, query: str) -> None:
    assert ask("GET", f"/history?{query}")[0] == 400


def test_the_fleet_is_of_readings_and_of_updates(ask: Asker, clock: Clock) -> None:
    post(
        ask,
        reading(1, quantity="battery", value=15, time=clock.now),
        reading(2, quantity="position", value=[1, 2, 3]),
    )
    assert ask("POST", "/update-info/", data={**FORM, "heading": "90", "battery_percent": "x"})[0] == 200
    clock.now += 11
    ask.look()
    one, other = ask.json("/fleet")["vehicles"]
    assert (one["device"], one["lat"], one["alt"], one["battery"]) == ("uav-1", 1, 3, 15)
    assert (other["device"], other["lat"], other["heading"], other["battery"]) == ("uav-10", -15.84, 90, None)
    assert ask.json("/alarms")["alarms"] == [
        {"device": "uav-1", "kind": "silent"},
        {"device": "uav-1", "kind": "battery"},
        {"device": "uav-10", "kind": "silent"},
    ]
    metrics = ask("GET", "/metrics")[1]
    assert 'station_alarms{kind="silent"} 2.0' in metrics and "station_readings_stored_total 2.0" in metrics
    assert 'station_delay_seconds_bucket{le="+Inf"} 2.0' in metrics


def test_stream_has_all_of_a_vehicle_and_then_what_has_changed(ask: Asker, clock: Clock) -> None:
    post(ask, reading(1, quantity="position", value=[1, 2, 3], time=5), reading(1, device="uav-2", time=5))
    ask.look()
    with ask.stream("/watch") as event:
        vehicles = event()["vehicles"]
        assert [(shown["device"], shown["alt"], shown["quantities"]) for shown in vehicles] == [
            ("uav-1", 3, {"position": "m"}),
            ("uav-2", None, {"alt": "m"}),
        ]
        clock.now += 1
        post(ask, reading(2, quantity="position", value=[1, 2.5, 3], time=6))
        ask.look()
        assert event()["vehicles"] == [{"device": "uav-1", "lng": 2.5, "time": 6, "received": clock.now}]
        ask.look()
        assert event()["vehicles"] == []


def test_health_is_the_databases(ask: Asker, monkeypatch: pytest.MonkeyPatch) -> None:
    ask.look()
    assert (ask("GET", "/health")[0], ask.json("/health")["database"]) == (200, "ok")

    async def fail(*_: Any) -> None:
        raise NotStored("database: gone")

    monkeypatch.setattr(SqliteStore, "fleet", fail)
    monkeypatch.setattr(SqliteStore, "add", fail)
    ask.look()
    assert ask("GET", "/health")[0] == 503
    status, text = ask("POST", "/readings", data=json.dumps({"readings": [reading(1)]}))
    assert (status, json.loads(text)["code"]) == (503, "not_stored")


def test_a_database_that_hangs_is_not_healthy(ask: Asker, monkeypatch: pytest.MonkeyPatch) -> None:
    ask.look()
    monkeypatch.setattr(ask.station._store, "fleet", asyncio.Event().wait)
    ask.look()  # within a bound of its own
    status, text = ask("GET", "/health")
    assert status == 503
    assert "has not answered" in json.loads(text)["database"]


def test_csv_has_all_rows_and_no_formula(ask: Asker) -> None:
    post(ask, *(reading(n, value="=1+1", device="@cmd", time=n) for n in range(3000)))
    rows = list(csv.reader(io.StringIO(ask("GET", "/readings.csv?limit=5000")[1])))
    assert len(rows) == 3001 and rows[0][:3] == ["device", "seq", "id"]
    assert rows[1][0] == "'@cmd" and rows[1][5] == "'=1+1"
    assert rows[0][-3:] == ["lat", "lon", "relative_alt"] and rows[1][-3:] == ["", "", ""]
    assert len(ask("GET", "/readings.csv?limit=5000&from=2990")[1].splitlines()) == 11


def test_exports_have_positions_in_columns_as_the_tables_of_a_flight(ask: Asker) -> None:
    place = {"quantity": "position", "value": [-35.5, 149.25, 20.0]}
    post(ask, reading(1, **place), reading(2, quantity="position", value="unknown"), reading(3, value=[1, 2, 3]))
    rows = list(csv.DictReader(io.StringIO(ask("GET", "/readings.csv")[1])))
    found = [(row["lat"], row["lon"], row["relative_alt"]) for row in rows]
    assert found == [("-35.5", "149.25", "20.0"), ("", "", ""), ("", "", "")]
    ask("POST", "/update-info/", data={**FORM, "id": "10"})
    head = ask("GET", "/devices.csv")[1].splitlines()[0]
    assert head.startswith("id,device,lat,lon,relative_alt,heading,battery_percent,")
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(io.BytesIO(ask.whole("GET", "/readings.parquet").body)).to_pylist()
    assert [(row["lat"], row["lon"], row["relative_alt"]) for row in table] == [
        *((-35.5, 149.25, 20.0), (None, None, None)),
        (None, None, None),
    ]


def test_parquet_has_the_same_rows(ask: Asker) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    post(ask, *(reading(n, time=n) for n in range(3000)), reading(1, device="uav-2", value=[1, 2]))
    answer = ask.whole("GET", "/readings.parquet?limit=5000")
    assert answer.status == 200 and "attachment" in answer.headers["Content-Disposition"]
    table = parquet.read_table(io.BytesIO(answer.body))
    assert table.num_rows == 3001
    last = table.slice(3000).to_pylist()[0]
    assert (last["device"], last["value"], last["number"], last["time"].timestamp()) == ("uav-2", "[1, 2]", None, 5)
    empty = ask.whole("GET", "/readings.parquet?device=nobody")
    assert parquet.read_table(io.BytesIO(empty.body)).num_rows == 0


def test_parquet_without_its_library_says_what_to_install(ask: Asker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    status, text = ask("GET", "/readings.parquet")
    assert status == 501 and "pip install" in text


def test_the_page_loads_its_own_files_and_nothing_else(ask: Asker) -> None:
    page = ask.whole("GET", "/")
    assert "script-src 'self'" in page.headers["Content-Security-Policy"]
    assert page.headers["X-Content-Type-Options"] == "nosniff"
    html = page.body.decode()
    assert "onclick" not in html and "<script>" not in html and "style=" not in html and "//" not in html
    assert {path.name for path in PAGE.iterdir()} == {*FILES, "fleet.html"}
    for file in FILES:
        answer = ask.whole("GET", f"/{file}")
        assert answer.status == 200 and answer.headers["Content-Type"].startswith(("text/", "application/javascript"))
        assert not any(
            word in answer.body.decode() for word in ("innerHTML", "insertAdjacent", "document.write", "eval(")
        )
    assert ask("GET", "/../app.py")[0] == 404 and ask("GET", "/page/app.py")[0] == 404


def test_an_unpaired_surrogate_is_shown_as_a_question_mark(ask: Asker) -> None:
    body = json.dumps({"readings": [reading(1, value="\ud800", device="s")]})
    assert ask("POST", "/readings", data=body)[0] == 200
    assert ask("GET", "/readings?device=s")[0] == 200
    status, text = ask("GET", "/readings.csv")
    assert status == 200 and "s,1,1,alt,m,?,5.0" in text


def test_pages_of_other_sites_are_refused(ask: Asker) -> None:
    form = {"id": "1", "device": "uav", "lat": "1", "lng": "2"}
    assert ask("POST", "/update-info/", data=form, headers={"Origin": "http://evil.example"})[0] == 403
    assert ask("POST", "/update-info/", data=form, headers={"Origin": "null"})[0] == 403
    assert ask("GET", "/devices", headers={"Origin": "http://evil.example"})[0] == 403
    assert ask("POST", "/update-info/", data=form)[0] == 200


@pytest.mark.parametrize("origin", ["http://[", "http://\udcff"])
def test_an_origin_that_is_none_is_a_mistake_of_the_client(ask: Asker, origin: str) -> None:
    assert ask("GET", "/fleet", headers={"Origin": origin})[0] in (400, 403)


def test_a_position_that_is_no_number_is_not_taken(ask: Asker) -> None:
    assert ask("POST", "/update-info/", data={**FORM, "lat": "nan"})[0] == 500
    assert json.loads(ask("GET", "/devices")[1]) == {"devices": []}


@pytest.mark.parametrize("host", ["evil.example:8080", "localhost.evil.example", "[::1"])
def test_a_page_whose_name_was_rebound_to_us_reads_and_writes_nothing(ask: Asker, host: str) -> None:
    headers = {"Host": host, "Origin": f"http://{host}"}
    assert ask("GET", "/readings", headers=headers)[0] == 403
    assert ask("POST", "/readings", headers=headers, data=json.dumps({"readings": [reading(1)]}))[0] == 403


@pytest.mark.parametrize("host", ["fleet.example", "Fleet.Example:8080"])
def test_a_public_name_is_ours(ask: Asker, host: str) -> None:
    assert ask("GET", "/readings", headers={"Host": host})[0] == 200


def test_a_download_that_nobody_reads_ends(ask: Asker) -> None:
    for first in range(0, 4000, 250):
        post(ask, *(reading(first + number, value="x" * 2000) for number in range(250)))
    assert 0 < ask.unread("/readings.csv?limit=100000") < 6_000_000  # of 8


@pytest.mark.parametrize("version", ["1.0", "1.1"])
def test_a_part_is_no_whole(ask: Asker, monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    """By HTTP/1.0, which a proxy may speak, nothing but the connection tells."""
    post(ask, *(reading(number) for number in range(3 * CHUNK)))
    page, asked = SqliteStore.page, iter(range(10))

    async def page_or_failure(*arguments: Any) -> Any:
        if next(asked) == 2:
            raise NotStored("the database has gone")
        return await page(*arguments)

    monkeypatch.setattr(SqliteStore, "page", page_or_failure)
    head, end = ask.raw(f"GET /readings.csv HTTP/{version}")
    assert head.startswith(f"HTTP/{version} 200".encode())
    assert end == "reset"


def test_as_many_readings_as_asked_for_come_as_json(ask: Asker) -> None:
    for start in range(0, 5000, 1000):
        post(ask, *(reading(n, value=["x", [1.5, n], True][n % 3], time=5 + n) for n in range(start, start + 1000)))
    listing = ask.json("/readings?limit=1000000")
    assert [kept["seq"] for kept in listing["readings"]] == list(range(5000))
    received = listing["readings"][1]["received"]
    assert listing["readings"][1] == {**reading(1, value=[1.5, 1], time=6), "received": received}
    assert (listing["count"], listing["repeats"]) == (5000, 0)
    assert ask.json("/readings?limit=0")["readings"] == ask.json("/readings?device=nobody")["readings"] == []


def test_downloads_are_few_and_one_caller_has_not_all(ask: Asker) -> None:
    for start in range(0, 3000, 200):
        post(ask, *(reading(n, value="x" * 4000, time=5 + n) for n in range(start, start + 200)))
    with contextlib.ExitStack() as open_ones:
        for _ in range(MOST_DOWNLOADS // 2):
            open_ones.enter_context(ask.stream("/readings?limit=1000000"))
        for path in ("/readings", "/readings.csv", "/readings.parquet"):
            status, text = ask("GET", path)
            assert (status, json.loads(text)["code"]) == (429, "too_many_requests")
        assert ask("GET", "/fleet")[0] == 200
        post(ask, reading(9000))


def test_streams_are_as_few_as_those_of_the_api(ask: Asker) -> None:
    ask.look()
    ask.station._streams.count = MOST_OPEN - 1
    with ask.stream("/watch") as event:
        assert event()["count"] == 0
        assert ask("GET", "/watch")[0] == 429


def test_histories_are_few(ask: Asker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SqliteStore, "history", lambda *_: asyncio.sleep(600))
    assert ask.statuses("/history?device=a", MOST_HISTORIES + 5) == [429] * 5


def test_a_database_that_answers_and_stores_nothing_is_not_healthy(ask: Asker, clock: Clock) -> None:
    ask.look()
    assert ask("GET", "/health")[0] == 200
    with ask.station._intake.storing():
        clock.now += STALLED - 1.0
        assert ask("GET", "/health")[0] == 200
        clock.now += 2.0
        status, text = ask("GET", "/health")
        assert status == 503 and "have waited for 16 s" in json.loads(text)["database"]
        assert "station_oldest_batch_seconds 16.0" in ask("GET", "/metrics")[1]
    assert ask("GET", "/health")[0] == 200


def test_health_says_why_nothing_is_stored(ask: Asker, clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    async def full(*_: Any) -> int:
        raise NotStored("database: No space left on device")

    ask.look()
    with ask.station._intake.storing(), monkeypatch.context() as patch:
        patch.setattr(SqliteStore, "add", full)
        assert ask("POST", "/readings", data=json.dumps({"readings": [reading(1)]}))[0] == 503
        clock.now += STALLED + 1.0
        assert "to be stored: database: No space left" in json.loads(ask("GET", "/health")[1])["database"]
        patch.undo()
        post(ask, reading(1))
        assert json.loads(ask("GET", "/health")[1])["database"].endswith("to be stored")


def test_an_update_keeps_what_is_known_of_it_and_nothing_large(ask: Asker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.updates.MOST_DEVICES", 30)
    assert ask("POST", "/update-info/", data={**FORM, "device": "x" * 1000})[0] == 500
    for number in range(100):
        junk = {f"field-{number}": "x" * 10_000}
        assert ask("POST", "/update-info/", data={**FORM, **junk, "id": str(number)})[0] == 200
    devices = ask.json("/devices")["devices"]
    assert devices[-1]["id"] == 99 and {len(device) for device in devices} == {len(FORM) + 3}


def test_devices_are_bounded(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_gradys.station.updates.MOST_DEVICES", 30)
    updates = Updates(clock)
    for number in range(100):
        updates.put(parse({**FORM, "id": str(number)}))
        updates.put(parse(FORM))
    devices = {device["id"] for device in updates.devices()}
    assert len(devices) == 30 and {10, 99} <= devices
