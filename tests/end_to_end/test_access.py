"""Who may call: tokens, networks, hosts and origins, with curl-like clients and a real browser's headers."""

from __future__ import annotations

import json
import socket
import ssl
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
import requests

from tests.support.ports import free_port

RIG_SPEEDUP = 2  # nobody flies far here, and each message costs processor time
TOKEN = "a-long-and-secret-word"


@pytest.fixture(scope="module")
def guarded(harness, tmp_path_factory):
    """A rig whose API wants a token, listening everywhere."""
    directory = tmp_path_factory.mktemp("guarded")
    rig = harness.Rig(directory, free_port())
    try:
        instance = harness.start_embedded(rig, speedup=RIG_SPEEDUP)
        command = harness.mavproxy_command(instance, harness.load(rig.port, host="0.0.0.0"))
        rig.mavproxy = rig.start("mavproxy", command, {"UAVAPI_TOKEN": TOKEN})
        rig.mavproxy.says("listening on")
        yield rig
    finally:
        rig.stop()


def test_without_the_token_nothing_is_answered(guarded):
    for headers in ({}, {"Authorization": "Bearer wrong"}, {"Authorization": f"Basic {TOKEN}"}):
        for path in ("/telemetry/status", "/command/arm", "/no/such/path"):
            answer = requests.get(guarded.url + path, headers=headers, timeout=10)
            assert answer.status_code == 401
            assert answer.json()["code"] == "unauthorized"
            assert answer.headers["WWW-Authenticate"] == "Bearer"


def test_with_the_token_all_is_answered(guarded, harness):
    headers = {"Authorization": f"Bearer {TOKEN}"}
    status = f"{guarded.url}/telemetry/status"
    harness.eventually(lambda: requests.get(status, headers=headers, timeout=10).status_code == 200)


def test_the_token_is_shown_nowhere(guarded):
    for line, end in (("uavapi set", "token"), ("uavapi config", "token"), ("uavapi status", "in flight")):
        assert TOKEN not in guarded.mavproxy.ask(line, end)
    assert TOKEN not in guarded.mavproxy.output()
    lines = [" ".join(process.info["cmdline"] or ()) for process in psutil.process_iter(["cmdline"])]
    assert any("mavproxy.py" in line for line in lines)
    assert not any(TOKEN in line for line in lines)


def test_the_token_cannot_be_taken_away_while_others_can_reach_the_port(guarded):
    guarded.mavproxy.ask("uavapi set token None", "everybody on that network")
    assert requests.get(guarded.url + "/telemetry/status", timeout=10).status_code == 401


def test_networks_that_are_named_need_no_token(guarded):
    guarded.mavproxy.ask("uavapi set allow_from 127.0.0.0/8", "listening on")
    assert requests.get(guarded.url + "/jobs", timeout=10).status_code == 200
    guarded.mavproxy.ask("uavapi set allow_from 10.0.0.0/8", "listening on")
    assert requests.get(guarded.url + "/jobs", timeout=10).status_code == 401


def test_host_beyond_this_machine_is_refused_with_the_reason(embedded_rig):
    printed = embedded_rig.mavproxy.ask("uavapi set host 0.0.0.0", "allow_open")
    assert "set a token" in printed
    printed = embedded_rig.mavproxy.ask("uavapi set allow_open true", "listening on")
    printed = embedded_rig.mavproxy.ask("uavapi set host 0.0.0.0", "WARNING")
    assert "everybody" in printed
    embedded_rig.mavproxy.ask("uavapi set host 127.0.0.1", "listening on http://127.0.0.1")
    embedded_rig.mavproxy.ask("uavapi set allow_open false", "listening on")


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
    ids=str,
)
def test_pages_of_other_sites_are_refused_for_every_verb(embedded_rig, headers):
    since = embedded_rig.control.ask("received", since=0)["last"]
    for method, path in (("GET", "/command/arm"), ("POST", "/command/arm"), ("GET", "/telemetry/gps")):
        answer = requests.request(method, embedded_rig.url + path, headers=headers, timeout=10)
        assert answer.status_code == 403
        assert answer.json()["code"] == "forbidden"
    received = embedded_rig.control.ask("received", since=since)["messages"]
    assert [m for m in received if m["name"] == "COMMAND_LONG" and m["fields"]["command"] == 400] == []


def test_pages_that_are_named_may_call_and_read(embedded_rig):
    page = "http://groundstation.example:3000"
    embedded_rig.mavproxy.ask(f"uavapi set cors_origins {page}", "listening on")
    try:
        headers = {"Origin": page, "Sec-Fetch-Site": "cross-site"}
        answer = requests.get(embedded_rig.url + "/telemetry/status", headers=headers, timeout=10)
        assert answer.status_code == 200
        assert answer.headers["Access-Control-Allow-Origin"] == page
        preflight = requests.options(embedded_rig.url + "/movement/drive", headers=headers, timeout=10)
        assert preflight.status_code == 204
        assert "POST" in preflight.headers["Access-Control-Allow-Methods"]
        other = requests.get(embedded_rig.url + "/jobs", headers={"Origin": "http://evil.example"}, timeout=10)
        assert other.status_code == 403
    finally:
        embedded_rig.mavproxy.ask("uavapi set cors_origins None", "listening on")


@pytest.mark.needs("openssl")
def test_tls(embedded_rig, tmp_path):
    key, cert = tmp_path / "key.pem", tmp_path / "cert.pem"
    subject = ["-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1"]
    subprocess.run(
        [
            "openssl",
            "req",
            "-x509",
            "-newkey",
            "rsa:2048",
            "-nodes",
            "-days",
            "2",
            *subject,
            "-keyout",
            key,
            "-out",
            cert,
        ],
        check=True,
        capture_output=True,
    )
    prompt = embedded_rig.mavproxy
    prompt.ask(f"uavapi set certfile {cert}", "both certfile and keyfile")
    prompt.ask("module unload uavapi", "Unloaded")
    load = f'module load uavapi:{{"port":{embedded_rig.port},"certfile":"{cert}","keyfile":"{key}"}}'
    try:
        prompt.ask(load, f"listening on https://127.0.0.1:{embedded_rig.port}")
        answer = requests.get(f"https://127.0.0.1:{embedded_rig.port}/jobs", verify=str(cert), timeout=10)
        assert answer.status_code == 200
        assert ssl.get_server_certificate(("127.0.0.1", embedded_rig.port))
    finally:
        prompt.ask("module unload uavapi", "Unloaded")
        prompt.ask(f'module load uavapi:{{"port":{embedded_rig.port}}}', "listening on http://")
        embedded_rig.wait_until_up()


def test_slow_headers_are_hung_up_on_and_hold_up_nobody(embedded_rig):
    slow = [socket.create_connection(("127.0.0.1", embedded_rig.port)) for _ in range(50)]
    try:
        for connection in slow:
            connection.sendall(b"GET /command/arm HTTP/1.1\r\nHost: 127.0.0.1\r\nX-A: ")
        before = time.monotonic()
        assert embedded_rig.get("/telemetry/status").status_code == 200
        assert time.monotonic() - before < 2
        slow[0].settimeout(20)
        assert slow[0].recv(1) == b""
        assert time.monotonic() - before < 15
    finally:
        for connection in slow:
            connection.close()


def test_more_than_the_allowed_rate_is_429(embedded_rig):
    embedded_rig.set("max_rate", "1.0")  # however slowly they are asked, 40 come faster
    try:
        statuses = [embedded_rig.get("/jobs").status_code for _ in range(40)]
        assert statuses[0] == 200 and 429 in statuses
    finally:
        embedded_rig.set("max_rate", "500.0")


UPLOAD = """
import json, socket, sys, time, urllib.request
url = sys.argv[1]
body = b'--b\\r\\nContent-Disposition: form-data; name="file"; filename="a.py"\\r\\n\\r\\nprint(1)\\r\\n--b--\\r\\n'
kind = {"Content-Type": "multipart/form-data; boundary=b"}
def status(path, body=None, headers={}):
    try:
        return urllib.request.urlopen(urllib.request.Request(url + path, body, headers), timeout=10).status
    except urllib.error.HTTPError as error:
        return error.code
report = {"read": status("/jobs"), "upload": status("/mission/upload-script", body, kind)}
host, port = url.removeprefix("http://").split(":")
time.sleep(2)  # until the connections of those calls have ended
idle = [socket.create_connection((host, int(port))) for _ in range(60)]
def ended(one):
    one.setblocking(False)
    try:
        return one.recv(1) == b""
    except BlockingIOError:
        return False
    except ConnectionError:
        return True
def still_open():
    return sum(not ended(one) for one in idle)
deadline = time.monotonic() + 60
while still_open() > 20 and time.monotonic() < deadline:
    time.sleep(0.1)
time.sleep(1)
report["open"] = still_open()
report["read among idle ones"] = status("/jobs")
print(json.dumps(report))
"""


@pytest.mark.needs("ip", "iproute2")
def test_network_that_may_fly_has_a_share_of_the_connections_and_no_scripts(lan, harness, tmp_path):
    folders = {"scripts_path": str(tmp_path / "scripts"), "script_logs": str(tmp_path / "logs")}
    named = f"{lan.network},127.0.0.0/8"
    rig = harness.embedded(tmp_path, host="0.0.0.0", token=TOKEN, allow_from=named, speedup=RIG_SPEEDUP, **folders)
    try:
        url = f"http://{lan.here}:{rig.port}"

        def reported():
            command = [*lan.inside, sys.executable, "-c", UPLOAD, url]
            done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=150)
            assert done.returncode == 0, done.stderr
            return json.loads(done.stdout)

        assert reported() == {"read": 200, "upload": 403, "open": 20, "read among idle ones": 200}
        rig.mavproxy.ask(f"uavapi set allow_scripts_from {lan.network}", "listening on")
        assert reported()["upload"] == 200
    finally:
        rig.stop()


def descriptors_of(rig) -> int:
    return len(list(Path(f"/proc/{rig.mavproxy.pid}/fd").iterdir()))


@pytest.mark.long
def test_idle_strangers_leave_mavproxy_the_descriptors_to_connect_again(harness, tmp_path):
    """With a limit of 160 descriptors there is no room for as many connections as may be open."""
    rig = harness.Rig(tmp_path, free_port())
    owner = {"Authorization": f"Bearer {TOKEN}"}
    strangers = []
    try:
        instance = harness.start_embedded(rig, speedup=RIG_SPEEDUP)
        mavproxy = harness.mavproxy_command(instance, harness.load(rig.port))
        limited = ["prlimit", "--nofile=160:4096", *mavproxy]
        rig.mavproxy = rig.start("mavproxy", limited, {"UAVAPI_TOKEN": TOKEN})
        rig.mavproxy.says("listening on")
        gps = f"{rig.url}/telemetry/gps"

        def owner_reads():
            return requests.get(gps, headers=owner, timeout=10).status_code == 200

        def strangers_come():
            strangers.extend(socket.create_connection(("127.0.0.1", rig.port)) for _ in range(400))

        harness.eventually(owner_reads)
        strangers_come()
        assert owner_reads()
        assert descriptors_of(rig) <= 130
        rig.control.close()
        rig.control = None
        rig.processes[0].stop()  # the link blinks
        rig.mavproxy.says("vehicle 1: link lost")
        strangers_come()
        rig.start(
            "sim-again", [sys.executable, "-m", "mavproxy_uavapi.sim", f"--instance={instance}", "--speedup=10"]
        )
        harness.eventually(owner_reads, 60, "the return of the link")
        log = rig.mavproxy.output()
        assert "Traceback" not in log
        assert log.count("was closed for one of") + log.count("was refused") < 10
    finally:
        for one in strangers:
            one.close()
        rig.stop()


def test_too_large_a_body_is_refused(embedded_rig):
    answer = requests.post(
        embedded_rig.url + "/movement/drive",
        data=b" " * 2_000_000,
        headers={"Content-Type": "application/json"},
        timeout=10,
    )
    assert answer.status_code == 413
    answer = requests.get(embedded_rig.url + "/jobs", headers={"X-Long": "a" * 20_000}, timeout=10)
    assert answer.status_code == 400
