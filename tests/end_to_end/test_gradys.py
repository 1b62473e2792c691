"""The push to the ground station, from a real MAVProxy over real sockets."""

from __future__ import annotations

import itertools
import json
import re
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import requests

from tests.support.ground_station import Recorder
from tests.support.ports import free_port
from tests.support.processes import Rig


@pytest.fixture(scope="module")
def rig(harness, tmp_path_factory) -> Iterator:
    """A MAVProxy on the embedded vehicle in real time, with uavapi and gradys."""
    made = harness.embedded(tmp_path_factory.mktemp("gradys"), "--sysid=10", speedup=1)
    made.mavproxy.ask(f'module load gradys:{{"spool":"{made.directory}/spool.db"}}', "Loaded module gradys")
    yield made
    made.stop()


@pytest.fixture
def recorder(harness) -> Iterator[Recorder]:
    made = Recorder(free_port())
    yield made
    made.stop()


def report(rig: Rig) -> dict[str, Any]:
    """`GET /gradys/status`."""
    info: dict[str, Any] = rig.ok(rig.get("/gradys/status"))["info"]
    return info


def tell(rig: Rig, recorder: Recorder, scheme: str = "") -> str:
    """Have it push there; the station's URL."""
    address = f"{scheme}127.0.0.1:{recorder.server_port}"
    rig.mavproxy.ask(f"gradys set gs {address}", "gradys: pushing to")
    return address


def until_once_a_second(harness: Any, recorder: Recorder, count: int) -> None:
    """Wait until so many updates came a second after the one before; only one that was late is followed earlier."""

    def intervals() -> list[float]:
        times = [at for at, *_ in list(recorder.updates)]
        return [second - first for first, second in itertools.pairwise(times)]

    def regular() -> bool:
        return sum(abs(interval - 1.0) < 0.3 for interval in intervals()) >= count

    harness.eventually(regular, 60, f"{count} updates a second apart")
    apart = intervals()
    early, late = sum(interval < 0.7 for interval in apart), sum(interval > 1.3 for interval in apart)
    assert early <= late + 1, f"the first one may have been late: {apart}"


def test_the_form_is_that_of_the_original_once_a_second_on_one_connection(rig, recorder, harness):
    tell(rig, recorder)
    until_once_a_second(harness, recorder, 5)
    assert len({peer for _, peer, *_ in recorder.updates}) == 1
    _, _, headers, body = recorder.updates[5]
    assert headers["Content-Type"] == "application/x-www-form-urlencoded"
    number = r"-?\d+(\.\d+)?"
    assert re.fullmatch(
        rf"id=10&lat=-35\.36{number[2:]}&lng=149\.16{number[2:]}&alt={number}&ground_speed={number}&air_speed={number}"
        rf"&heading=\d+&battery_percent=\d+&ready_to_arm=(True|False)&device=uav&type=102&seq=\d+"
        rf"&ip=127\.0\.0\.1%3A{rig.port}%2F",
        body.decode(),
    )
    seqs = [int(form["seq"]) for form in recorder.forms]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))


def test_dropped_by_the_station_is_counted_separately_at_the_prompt_and_over_http(rig, recorder, harness):
    recorder.body = {"id": 1, "type": 101, "seq": 0, "lat": 0, "lng": 0, "alt": 0, "DATA": "0"}
    tell(rig, recorder)
    harness.eventually(lambda: report(rig)["dropped_by_station"] >= 2, what="two dropped updates")
    output = rig.mavproxy.ask("gradys status", "next is")
    assert "of them dropped by the station: no browser watches" in output
    assert report(rig)["round_trip_ms"]["last"] > 0
    rig.mavproxy.ask("gradys stats", "withheld")


def test_redirects_are_refused(rig, recorder, harness):
    elsewhere = Recorder(free_port())
    recorder.status = 307
    recorder.headers = {"Location": f"http://127.0.0.1:{elsewhere.server_port}/update-info/"}
    tell(rig, recorder)
    harness.eventually(lambda: "redirects" in (report(rig)["last_error"] or ""), what="the refusal")
    elsewhere.stop()
    assert elsewhere.updates == []


def test_a_token_goes_along_and_is_not_shown(rig, recorder, harness):
    rig.mavproxy.ask("gradys set token s3cret", "gradys: pushing to")
    tell(rig, recorder)
    harness.eventually(lambda: recorder.updates, what="an update")
    assert recorder.updates[0][2]["Authorization"] == "Bearer s3cret"
    assert "s3cret" not in rig.mavproxy.ask("gradys set token", "(set)")
    rig.mavproxy.ask("gradys set token None", "gradys: pushing to")


@pytest.fixture(scope="module")
def certificate(tmp_path_factory) -> Path:
    """A self-signed certificate for 127.0.0.1 and its key, in one file."""
    directory = tmp_path_factory.mktemp("tls")
    key, certificate = directory / "key.pem", directory / "certificate.pem"
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=station"]
    command += ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(command, check=True, capture_output=True)
    both = directory / "both.pem"
    both.write_text(key.read_text() + certificate.read_text())
    return both


@pytest.mark.needs("openssl")
def test_tls_needs_a_certificate_that_is_trusted(rig, harness, certificate):
    station = Recorder(free_port(), certificate)
    try:
        tell(rig, station, "https://")
        harness.eventually(lambda: "not trusted" in (report(rig)["last_error"] or ""), what="the refusal")
        assert station.updates == []
        rig.mavproxy.ask(f"gradys set ca_file {certificate}", "gradys: pushing to")
        harness.eventually(lambda: station.updates, what="an update over TLS")
        rig.mavproxy.ask("gradys set ca_file /no/such/file", "No such file")
        rig.mavproxy.ask("gradys set ca_file None", "gradys: pushing to")
    finally:
        station.stop()


def test_ipv6(rig, harness):
    try:
        station = Recorder(free_port(), host="::1")
    except OSError:
        pytest.skip("this machine has no IPv6 loopback")
    try:
        rig.mavproxy.ask(f"gradys set gs [::1]:{station.server_port}", "gradys: pushing to")
        harness.eventually(lambda: station.updates, what="an update over IPv6")
        assert station.forms[0]["ip"] == f"[::1]:{rig.port}/"
    finally:
        station.stop()


@pytest.mark.long  # in virtual time: tests/gradys/push/test_pusher.py
def test_several_stations_each_with_its_own_state_and_a_dead_one_delays_nobody(rig, recorder, harness):
    hanging = socket.create_server(("127.0.0.1", 0))  # accepts, and never answers
    refusing = f"127.0.0.1:{free_port()}"
    names = [f"127.0.0.1:{hanging.getsockname()[1]}", refusing, "no-such-host.invalid:80"]
    rig.mavproxy.ask(f"gradys set gs {','.join(names)},127.0.0.1:{recorder.server_port}", "gradys: pushing to")
    with hanging:
        until_once_a_second(harness, recorder, 7)
        stations = {station["station"]: station for station in report(rig)["stations"]}
        errors = [stations[f"http://{name}"]["last_error"] for name in names]
        assert "no answer within 3 s" in errors[0]
        assert "cannot connect" in errors[1]
        assert "no-such-host" in errors[2]
        assert stations[f"http://127.0.0.1:{recorder.server_port}"]["failed"] == 0
        assert statistics.median(_answer_time(rig) for _ in range(50)) < 1.0


def _answer_time(rig: Rig) -> float:
    began = time.monotonic()
    rig.ok(rig.get("/telemetry/gps"))
    return time.monotonic() - began


@pytest.mark.long  # in virtual time: tests/gradys/push/test_pusher.py
def test_no_fix_no_push_and_stale_no_push(harness, recorder, tmp_path):
    rig = harness.Rig(tmp_path, free_port())
    try:
        instance = harness.start_embedded(rig, "--sysid=7", speedup=1)
        gradys = json.dumps({"gs": f"127.0.0.1:{recorder.server_port}", "max_age": 2}, separators=(",", ":"))
        command = harness.mavproxy_command(instance, f"--cmd=module load gradys:{gradys}")
        rig.mavproxy = rig.start("mavproxy", command)
        harness.eventually(lambda: len(recorder.updates) >= 2, what="two updates")
        form = recorder.forms[-1]
        assert (form["id"], form["ip"]) == ("7", "127.0.0.1/")  # uavapi is not loaded
        rig.mavproxy.ask("gradys status", "ip names no API")
        rig.control.fault("silence", sending=True, receiving=False)
        mark = rig.mavproxy.mark()

        def nothing_to_send():
            rig.mavproxy.type("gradys status")
            return "nothing to send: the position of vehicle 7 is" in rig.mavproxy.output(mark)

        harness.eventually(nothing_to_send, 60, "the last position's being older than max_age")
        time.sleep(1.0)  # one may be on its way
        reported = len(recorder.updates)
        time.sleep(2.0)
        assert len(recorder.updates) == reported
    finally:
        rig.stop()


def test_routes_are_served_whichever_module_was_loaded_first_and_go_with_it(harness, tmp_path):
    rig = harness.Rig(tmp_path, free_port())
    try:
        instance = harness.start_embedded(rig, speedup=1)
        rig.mavproxy = rig.start("mavproxy", harness.mavproxy_command(instance))
        rig.mavproxy.says("Received", timeout=60)
        rig.mavproxy.ask("module load gradys", "Loaded module gradys")
        rig.mavproxy.ask(f'module load uavapi:{{"port":{rig.port}}}', "listening on")
        rig.wait_until_up()
        assert report(rig)["running"] is True
        rig.mavproxy.ask("module unload gradys", "Unloaded module gradys")
        assert rig.get("/gradys/status").status_code == 404
        rig.mavproxy.ask("module load gradys", "Loaded module gradys")
        assert rig.get("/gradys/status").status_code == 200
    finally:
        rig.stop()


@pytest.mark.long  # in virtual time: tests/gradys/test_module.py
def test_stop_and_start(rig, recorder, harness):
    tell(rig, recorder)
    harness.eventually(lambda: recorder.updates, what="an update")
    rig.mavproxy.ask("gradys stop", "gradys: stopped")
    time.sleep(1.0)  # one may be on its way
    reported = len(recorder.updates)
    time.sleep(2.5)
    assert len(recorder.updates) == reported
    assert report(rig)["running"] is False
    rig.mavproxy.ask("gradys start", "gradys: pushing to")
    harness.eventually(lambda: len(recorder.updates) > reported, what="an update")


@pytest.mark.parametrize(
    "line,answer",
    [
        ("gradys set gs 10.0.0.5:many", "gradys: "),
        ("gradys set gss 1", "did you mean gs?"),
        ("gradys set period nan", "from 0.1 to 3600"),
        ("gradys set period 0", "from 0.1 to 3600"),
        ("gradys set sink ftp://x", "begins with"),
        ("gradys set quantities alt=NONSENSE", "is not NAME=MESSAGE.field"),
        ("gradys sett", "did you mean set?"),
    ],
)
def test_a_mistake_at_the_prompt_is_one_clear_line(rig, line, answer):
    output = rig.mavproxy.ask(line, answer)
    assert "Traceback" not in output


def test_the_original_stations_program_and_ours_agree(rig, harness, tmp_path):
    """Our station answers 101 until somebody watches, 103 then."""
    port = free_port()
    command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={port}", f"--database={tmp_path}/s.db"]
    station = rig.start("station", command)
    station.says("listening on")
    rig.mavproxy.ask(f"gradys set gs 127.0.0.1:{port}", "gradys: pushing to")
    url = f"http://127.0.0.1:{port}"
    harness.eventually(lambda: report(rig)["dropped_by_station"] >= 1, what="a dropped update")
    assert requests.get(f"{url}/devices", timeout=5).json() == {"devices": []}
    with requests.get(f"{url}/watch", stream=True, timeout=5) as watching:
        assert watching.status_code == 200
        device = harness.eventually(lambda: requests.get(f"{url}/devices", timeout=5).json()["devices"])[0]
    assert (device["id"], device["device"], device["type"], device["status"]) == (10, "uav", 102, "active")
    assert "uav" in requests.get(f"{url}/devices.csv", timeout=5).text
    broken = requests.post(f"{url}/update-info/", data={"id": "1", "lat": "None", "device": "uav"}, timeout=5)
    assert broken.status_code == 500
    assert requests.post(f"{url}/update-info/", json={"id": 1}, timeout=5).status_code == 500
    station.stop()
