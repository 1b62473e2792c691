"""Readings from a real MAVProxy to a real receiver: outages, kill -9, a full disk."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
import requests

from tests.support.ports import free_port
from tests.support.processes import Rig

pytestmark = pytest.mark.long

KILLS = int(os.environ.get("GRADYS_KILLS", "3"))


class Receiver:
    """Our station as a process of its own, which can be ended and started again."""

    def __init__(self, rig: Rig, harness: Any, directory: Path) -> None:
        self._rig, self._harness = rig, harness
        self.port = free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self._database = directory / "station.db"
        self._process: Any = None
        self.start()

    def start(self) -> None:
        command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={self.port}"]
        self._process = self._rig.start("station", [*command, f"--database={self._database}"])
        mark = 0
        self._process.says("listening on", mark)
        self._harness.eventually(self.answers, what="the station's answer")

    def answers(self) -> bool:
        try:
            return requests.get(f"{self.url}/devices", timeout=2).ok
        except requests.ConnectionError:
            return False

    def stop(self) -> None:
        self._process.stop()

    def readings(self, **query: Any) -> list[dict[str, Any]]:
        answer = requests.get(f"{self.url}/readings", params={"limit": 1_000_000, **query}, timeout=30).json()
        readings: list[dict[str, Any]] = answer["readings"]
        return readings


def gradys(receiver: Receiver, directory: Path, **settings: Any) -> str:
    keywords = {"sink": f"{receiver.url}/readings", "spool": f"{directory}/spool.db", **settings}
    return "module load gradys:" + json.dumps(keywords, separators=(",", ":"))


@pytest.fixture(scope="module")
def rig(harness, tmp_path_factory) -> Iterator:
    made = harness.embedded(tmp_path_factory.mktemp("readings"), "--sysid=10", speedup=1)
    yield made
    made.stop()


@pytest.fixture
def receiver(rig, harness, tmp_path) -> Iterator[Receiver]:
    made = Receiver(rig, harness, tmp_path)
    yield made
    made.stop()


@pytest.fixture
def loaded(rig, receiver, tmp_path) -> Iterator:
    quantities = "position@1,alt=GLOBAL_POSITION_INT.relative_alt*0.001@0.5[m]"
    rig.mavproxy.ask(gradys(receiver, tmp_path, quantities=quantities), "Loaded module gradys")
    yield rig
    rig.mavproxy.ask("module unload gradys", "Unloaded module gradys")


def report(rig: Rig) -> dict[str, Any]:
    info: dict[str, Any] = rig.ok(rig.get("/gradys/status"))["info"]
    return info


def post(rig: Rig, value: float, quantity: str = "temperature") -> list[int]:
    body = {"quantity": quantity, "value": value, "representation": "degC"}
    numbers: list[int] = rig.ok(rig.post("/gradys/readings", **body))["seq"]
    return numbers


def test_sampled_and_posted_readings_arrive(loaded, receiver, harness):
    harness.eventually(lambda: report(loaded)["sinks"], what="the sink")
    (number,) = post(loaded, 21.5)
    harness.eventually(lambda: len(receiver.readings(quantity="alt")) >= 4, what="four samples")
    received = receiver.readings()
    samples = [r["seq"] for r in received if r["quantity"] == "alt"]
    assert samples == sorted(set(samples))  # what is posted is stored at once, before samples that wait half a second
    posted = next(r for r in received if r["seq"] == number)
    assert (posted["quantity"], posted["value"], posted["representation"]) == ("temperature", 21.5, "degC")
    assert (posted["device"], posted["id"]) == ("uav-10", "10")
    position = next(r for r in received if r["quantity"] == "position")["value"]
    assert position[0] == pytest.approx(-35.363, abs=0.01)
    csv = requests.get(f"{receiver.url}/readings.csv", timeout=5).text.splitlines()
    assert csv[0].startswith("device,seq,id,quantity") and len(csv) > 5


def test_what_a_receiver_cannot_take_is_refused_before_it_is_kept(loaded, harness):
    harness.eventually(lambda: loaded.get("/gradys/status").status_code == 200, what="the route")
    url = f"{loaded.url}/gradys/readings"
    headers = {"Content-Type": "application/json"}
    for body in ('{"quantity":"a","value":NaN}', '{"quantity":"a/b","value":1}', '{"quantity":"a"}', "{}", "[]", "x"):
        answer = requests.post(url, data=body, headers=headers, timeout=5)
        assert answer.status_code in (400, 422), body


def test_an_outage_costs_nothing_and_order_is_kept(loaded, receiver, harness):
    harness.eventually(receiver.readings, what="a reading")
    receiver.stop()
    posted = []
    for number in range(100):
        posted += post(loaded, number)
    spooled = harness.eventually(lambda: report(loaded)["sinks"][0]["last_error"] and report(loaded), what="an error")
    assert spooled["spooled"] >= 100 and spooled["oldest_unsent_s"] >= 0
    loaded.mavproxy.ask("gradys status", "cannot connect")
    receiver.start()
    loaded.mavproxy.ask("gradys flush", "tried now")
    harness.eventually(lambda: len(receiver.readings(quantity="temperature")) == 100, what="all hundred")
    received = receiver.readings(quantity="temperature")
    assert [r["seq"] for r in received] == posted
    assert [r["value"] for r in received] == list(range(100))
    everything = [r["seq"] for r in receiver.readings()]
    assert len(everything) == len(set(everything))


class Portal(ThreadingHTTPServer):
    """A captive portal: every request gets the login page, or is sent to it."""

    daemon_threads = True

    class Page(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            self.rfile.read(int(self.headers["Content-Length"]))
            moved = self.path == "/moved"
            self.send_response(302 if moved else 200)
            if moved:
                self.send_header("Location", "/login")
            page = b"" if moved else b"<html><form>Please log in</form></html>"
            self.send_header("Content-Length", str(len(page)))
            self.end_headers()
            self.wfile.write(page)

        do_GET = do_POST

        def log_message(self, *_: Any) -> None: ...

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), self.Page)
        self.url = f"http://127.0.0.1:{self.server_port}"


@pytest.fixture
def portal() -> Iterator[Portal]:
    with Portal() as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        yield made
        made.shutdown()
        thread.join()


@pytest.mark.parametrize("path", ["/readings", "/moved", "/moved#ack=status"])
def test_a_captive_portal_takes_nothing(rig, harness, receiver, portal, tmp_path, path):
    sink = f"{portal.url}{path}"
    rig.mavproxy.ask(gradys(receiver, tmp_path, sink=sink, quantities=""), "Loaded module gradys")
    try:
        posted = [number for value in range(10) for number in post(rig, value)]
        error = harness.eventually(lambda: report(rig)["sinks"][0]["last_error"], what="the error")
        assert "names no numbers" in error or "redirects to /login" in error
        assert report(rig)["spooled"] == 10
        rig.mavproxy.ask(f"gradys set sink {receiver.url}/readings", "gradys: no ground station")
        received = harness.eventually(lambda: len(receiver.readings()) == 10 and receiver.readings(), what="all ten")
        assert [reading["seq"] for reading in received] == posted
    finally:
        rig.mavproxy.ask("module unload gradys", "Unloaded module gradys")


@pytest.mark.long
def test_kill_9_loses_nothing_that_was_acknowledged(harness, tmp_path):
    """MAVProxy is killed at random moments while readings are posted; what was answered with 200 arrives."""
    rig = harness.Rig(tmp_path, free_port())
    chance = random.Random(1)
    promised: list[int] = []
    try:
        instance = harness.start_embedded(rig, "--sysid=10", speedup=1)
        receiver = Receiver(rig, harness, tmp_path)
        command = harness.mavproxy_command(
            instance, harness.load(rig.port), f"--cmd={gradys(receiver, tmp_path, quantities='position@0.1')}"
        )
        for _ in range(KILLS):
            promised += post_until_killed(harness, rig, command, chance.uniform(0.2, 2.0))
        rig.mavproxy = rig.start("mavproxy", command)
        harness.eventually(lambda: is_empty(rig), 60, "an empty spool")
        arrived = [r["seq"] for r in receiver.readings()]
        assert set(promised) <= set(arrived)
        assert len(arrived) == len(set(arrived))
        assert len(promised) > KILLS
    finally:
        rig.stop()


def post_until_killed(harness: Any, rig: Rig, command: list[str], seconds: float) -> list[int]:
    """Start MAVProxy, post readings for so long, and kill it; the numbers that it promised to keep."""
    mavproxy = rig.start("mavproxy", command)
    harness.eventually(lambda: serves(rig), 60, "the API")
    promised: list[int] = []
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        promised += post(rig, len(promised))
    mavproxy.popen.send_signal(signal.SIGKILL)
    mavproxy.popen.wait()
    rig.processes.remove(mavproxy)
    mavproxy.popen.stdin.close()
    return promised


def serves(rig: Rig) -> bool:
    try:
        return bool(rig.get("/gradys/status", timeout=2).status_code == 200)
    except requests.RequestException:
        return False


def is_empty(rig: Rig) -> bool:
    spooled = report(rig)["spooled"] if serves(rig) and report(rig)["spool"] is not None else None
    return spooled is not None and spooled < 10  # None while the file is being opened


@pytest.mark.skipif(shutil.which("mount") is None, reason="mount")
def test_a_full_disk_is_reported_and_nothing_else_suffers(harness, rig, tmp_path):
    disk = tmp_path / "small"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(disk)], check=False)
    if mounted.returncode:
        pytest.skip("only root can mount a small disk")
    try:
        sink = f"http://127.0.0.1:{free_port()}/readings"
        settings = {"sink": sink, "spool": f"{disk}/spool.db", "quantities": "position@0.1"}
        rig.mavproxy.ask("module load gradys:" + json.dumps(settings, separators=(",", ":")), "Loaded module gradys")
        text = "x" * 4000
        answers = [rig.post("/gradys/readings", quantity="text", value=text) for _ in range(80)]
        refused = [answer for answer in answers if answer.status_code == 503]
        assert refused and refused[-1].json()["code"] == "not_stored"
        assert rig.get("/telemetry/gps").status_code == 200
        with contextlib.suppress(OSError), (disk / "filler").open("wb", buffering=0) as filler:
            while True:
                filler.write(b"x")  # not even a sample fits any more
        before = report(rig)["quantities"][0]["taken"]

        def samples_wait():
            reported = report(rig)
            return reported["quantities"][0]["taken"] >= before + 8 and reported["spool"]["problem"]

        harness.eventually(samples_wait, what="samples that the disk does not take")
        rig.mavproxy.ask("gradys status", "NOT KEPT just now")
        output = rig.mavproxy.ask("module unload gradys", "Unloaded module gradys")
        assert re.search(r"\d+ readings are lost: .*full", output)
    finally:
        rig.mavproxy.ask("module unload gradys", "gradys")
        subprocess.run(["umount", str(disk)], check=False)
