"""A station of several workers, with a real broker, a real database, a real MAVProxy and a real browser."""

from __future__ import annotations

import asyncio
import html
import json
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import requests

from tests.support.chromium import chromium
from tests.support.fleet import Broker, Fleet, Worker
from tests.support.fleet_faults import FaultyFleet
from tests.support.network_namespace import NetworkNamespace
from tests.support.ports import free_port
from tests.support.processes import eventually

pytestmark = pytest.mark.long

pytest.importorskip("asyncpg")
pytest.importorskip("paho.mqtt.client")
BROKER, DATABASE = pytest.mark.needs("mosquitto"), pytest.mark.needs("pg_lsclusters", "postgresql")
HOSTILE = "<img src=x onerror=document.title='owned'>"


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(tmp_path, 2)
    try:
        made.start()
        yield made
    finally:
        made.stop()


@pytest.fixture(params=["relay", "namespace"])
def namespace(request: pytest.FixtureRequest) -> Iterator[NetworkNamespace | None]:
    """The link of the vehicles that are cut off: None is a relay that is stopped."""
    if request.param == "relay":
        yield None
        return
    try:
        made = NetworkNamespace()
    except OSError as error:
        pytest.skip(str(error))
    yield made
    made.remove()


@pytest.mark.long
@BROKER
@DATABASE
def test_each_reading_is_one_row_whoever_dies(tmp_path: Path, namespace: NetworkNamespace | None) -> None:
    fleet = FaultyFleet(tmp_path, workers=2, vehicles=6, rate=5, namespace=namespace)
    try:
        fleet.start()
        fleet.suffer(random.Random(3), seconds=1, longest=2.0)  # each fault once
        audit = fleet.audit()
    finally:
        fleet.stop()
    kinds = {"worker", "broker", "database", "link", "spool", "clock", "midnight", "partition", "reader"}
    assert set(fleet.faults) == kinds
    assert audit.is_good and audit.sampled == audit.rows - audit.again > 50, audit


@BROKER
@DATABASE
def test_readings_of_a_mavproxy_reach_the_database(fleet: Fleet, harness: ModuleType, tmp_path: Path) -> None:
    rig = harness.embedded(tmp_path, "--sysid=10", speedup=1)
    try:
        sink = f"mqtt://127.0.0.1:{fleet.broker.port}/fleet/{{sysid}}/{{quantity}}#ack=station"
        settings = json.dumps({"sink": sink, "spool": f"{tmp_path}/spool.db"}, separators=(",", ":"))
        rig.mavproxy.ask(f"module load gradys:{settings}", "Loaded module gradys")
        count = "SELECT count(*) FROM readings WHERE device = 'uav-10' AND quantity = '{}'"
        positions = count.format("position")
        harness.eventually(lambda: int(fleet.database.sql(positions)) >= 3, what="three positions")
        fleet.database.kill()
        harness.eventually(lambda: fleet.workers[0].health()["status"] == "failing", what="its being noticed")
        body = {"readings": [{"quantity": "temperature", "value": n} for n in range(50)]}
        assert rig.post("/gradys/readings", **body).status_code == 200
        fleet.database.start()
        rig.mavproxy.ask("gradys flush", "tried now")
        harness.eventually(lambda: int(fleet.database.sql(count.format("temperature"))) == 50, 60, "all fifty")
        harness.eventually(lambda: rig.get("/gradys/status").json()["info"]["spooled"] < 5, what="an empty spool")
        for worker in fleet.workers:
            worker.wait()
            vehicles = requests.get(f"{worker.url}/fleet", timeout=10).json()["vehicles"]
            assert [vehicle["device"] for vehicle in vehicles] == ["uav-10"]
            assert vehicles[0]["lat"] == pytest.approx(-35.363, abs=0.01)
        doubled = "SELECT count(*) FROM (SELECT 1 FROM readings GROUP BY device, seq HAVING count(*) > 1) AS doubled"
        assert fleet.database.sql(doubled) == "0"
    finally:
        rig.stop()


@pytest.mark.long
@BROKER
@DATABASE
def test_a_worker_ends_at_a_signal_and_its_session_waits_for_it(fleet: Fleet) -> None:
    from paho.mqtt import publish

    worker, other = fleet.workers
    other.stop()
    worker.stop()
    assert worker.process is not None and worker.process.popen.returncode == 0
    reading = {"device": "uav-1", "quantity": "alt", "value": 1, "time": time.time()}
    messages = [("fleet/1/alt", json.dumps({**reading, "seq": n}), 1, False) for n in range(100)]
    publish.multiple(messages, port=fleet.broker.port)
    fleet.broker.stop()  # it writes down what it has
    fleet.broker.start()
    worker.start()
    other.start()
    worker.wait()
    other.wait()
    deadline = time.monotonic() + 20
    while fleet.database.sql("SELECT count(*) FROM readings") != "100":
        assert time.monotonic() < deadline
        time.sleep(0.2)


@BROKER
@DATABASE
def test_a_worker_stores_a_long_queue_that_ignores_its_receive_maximum(tmp_path: Path) -> None:
    from paho.mqtt import publish

    fleet = Fleet(tmp_path, 1, "--batch=20")
    try:
        fleet.start()
        (worker,) = fleet.workers
        worker.stop()
        reading = {"device": "uav-1", "quantity": "alt", "value": 1, "time": time.time()}
        messages = [("fleet/1/alt", json.dumps({**reading, "seq": n}), 1, False) for n in range(2000)]
        publish.multiple(messages, port=fleet.broker.port)
        worker.start()
        count = "SELECT count(*) FROM readings"
        eventually(lambda: fleet.database.sql(count) == "2000", 60, "all rows")
        assert worker.metrics()["station_messages_dropped_total"] == 0
    finally:
        fleet.stop()


def tls_broker(directory: Path) -> Broker:
    """A broker with TLS and a password; its certificate is `certificate.pem`."""
    certificate, key, passwords = (directory / name for name in ("certificate.pem", "key.pem", "passwords"))
    make = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=broker"]
    make += ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)]
    for command in (make, ["mosquitto_passwd", "-b", "-c", str(passwords), "station", "s3cr:t"]):
        subprocess.run(command, check=True, capture_output=True)
    files = {"certfile": str(certificate), "keyfile": str(key), "password_file": str(passwords)}
    return Broker(directory, **files, allow_anonymous="false")


@BROKER
@pytest.mark.needs("openssl", "mosquitto_passwd")
def test_a_worker_reads_by_tls_with_a_password(tmp_path: Path) -> None:
    from paho.mqtt import publish

    broker, certificate = tls_broker(tmp_path), str(tmp_path / "certificate.pem")
    url = f"mqtts://station:{{}}@127.0.0.1:{broker.port}"
    trusted = f"--ca-file={certificate}"
    worker = Worker(tmp_path, "s.db", url.format("s3cr%3At"), trusted)
    refused = {
        "certificate": Worker(tmp_path, "a.db", url.format("s3cr%3At"), "--name=a"),
        "Not authorized": Worker(tmp_path, "b.db", url.format("wrong"), trusted, "--name=b"),
    }
    workers = [worker, *refused.values()]
    try:
        broker.start()
        for one in workers:
            one.start()
        worker.wait()
        for why, one in refused.items():
            eventually(lambda: why in one.health().get("broker", ""), 30, why)  # noqa: B023
        reading = {"device": "uav-1", "quantity": "alt", "value": 1, "time": time.time(), "seq": 7}
        publish.single(
            "fleet/1/alt", json.dumps(reading), 1, port=broker.port, hostname="127.0.0.1",
            auth={"username": "station", "password": "s3cr:t"}, tls={"ca_certs": certificate},
        )  # fmt: skip
        eventually(lambda: worker.metrics()["station_readings_stored_total"] == 1, what="the reading")
    finally:
        for one in workers:
            one.stop()
        broker.stop()


async def page_of(url: str, directory: Path) -> str:
    """What the page has become when it has drawn a history."""
    async with chromium(directory) as page:
        await page.ask("Page.navigate", url=url)
        await page.until("document.getElementById('note').textContent.includes('readings')")
        return str(await page.evaluate("document.documentElement.outerHTML"))


@pytest.mark.needs("chromium")
def test_what_devices_are_called_is_text_on_the_page(harness: ModuleType, tmp_path: Path) -> None:
    port = free_port()
    command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={port}", "--database=s.db"]
    station = harness.Process(command, tmp_path / "station.log", tmp_path)
    try:
        station.says("listening on")
        reading = {"device": HOSTILE, "quantity": HOSTILE, "representation": HOSTILE, "time": time.time()}
        body = {"readings": [{**reading, "seq": n, "value": n} for n in range(9)]}
        assert requests.post(f"http://127.0.0.1:{port}/readings", json=body, timeout=10).status_code == 200
        dom = asyncio.run(page_of(f"http://127.0.0.1:{port}/#{HOSTILE}", tmp_path))
    finally:
        station.stop()
    escaped = html.escape(HOSTILE, quote=False)
    assert f'<h2 id="device">{escaped}</h2>' in dom  # a link to the page has chosen it
    assert f">{escaped}</option>" in dom
    assert "<title>Fleet</title>" in dom and "<img" not in dom
    assert "9 readings, 0 gaps" in dom


@pytest.mark.needs("chromium")
def test_page_keeps_what_has_not_changed(harness: ModuleType, tmp_path: Path) -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={port}", "--database=s.db"]
    station = harness.Process(command, tmp_path / "station.log", tmp_path)

    def post(seq: int, quantity: str, value: float) -> None:
        reading = {"device": "uav-1", "seq": seq, "quantity": quantity, "value": value, "time": time.time()}
        assert requests.post(f"{url}/readings", json={"readings": [reading]}, timeout=10).status_code == 200

    async def row(page: Any, speed: str, battery: str) -> None:
        cells = "[...document.querySelectorAll('#rows .row span')].map(cell => cell.textContent)"
        await page.until(f'JSON.stringify({cells}.slice(3, 5)) === \'["{speed}","{battery}"]\'')

    async def look() -> None:
        async with chromium(tmp_path) as page:
            await page.ask("Page.navigate", url=url)
            await row(page, "4.5", "80")
            await asyncio.to_thread(post, 3, "battery", 70.0)
            await row(page, "4.5", "70")

    try:
        station.says("listening on")
        post(1, "speed", 4.5)
        post(2, "battery", 80.0)
        asyncio.run(look())
    finally:
        station.stop()
