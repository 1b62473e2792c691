"""A real browser: what a page of another site can do to the API, and what a page that is named may do."""

from __future__ import annotations

import contextlib
import http.server
import json
import re
import socket
import threading
from pathlib import Path
from string import Template
from typing import Any

import pytest

from tests.support import chromium
from tests.support.processes import Rig

RIG_SPEEDUP = 2  # nobody flies far here, and each message costs processor time
pytestmark = pytest.mark.needs("chromium")

EVIL = "evil.example"  # a name that the browser is told to find at 127.0.0.1
TIMEOUT = 90.0  # s for a browser to start, try everything, and tell; other tests share the machine
ARM = 400  # MAV_CMD_COMPONENT_ARM_DISARM
# A line of the browser's log about an answer; of a refused WebSocket it only keeps the status.
ANSWERED = re.compile(r'(?:"headers":\["HTTP/1\.1 |Unexpected response code: )(\d+)')
# Each try marks its request with ?client=NAME, which any path takes and the browser's own log of its traffic keeps.
PAGE = Template("""<!doctype html><meta charset="utf-8"><title>page</title><iframe name="sink"></iframe>
<script>
const api = "$api";
const sink = document.querySelector("iframe");
const read = async answer => answer.type === "opaque" ? "opaque" : `$${answer.status} $${await answer.text()}`;
const form = path => new Promise(done => {
  const form = document.createElement("form");
  Object.assign(form, {method: "post", action: api + path, target: "sink"});
  document.body.append(form);
  sink.onload = () => done("answered");
  form.submit();
});
const tries = {
  image: () => new Promise(done => {
    const image = new Image();
    image.onload = image.onerror = () => done("answered");
    image.src = api + "/command/arm?client=image";
  }),
  opaque: async () => read(await fetch(api + "/command/arm?client=opaque", {mode: "no-cors"})),
  fetch: async () => read(await fetch(api + "/command/arm?client=fetch")),
  form: () => form("/command/arm?client=form"),
  text: async () => read(await fetch(api + "/movement/drive?client=text", {
    method: "POST", mode: "no-cors", headers: {"Content-Type": "text/plain"}, body: '{"x": 1, "y": 1, "z": 0}'})),
  telemetry: async () => read(await fetch(api + "/telemetry/status?client=telemetry")),
  websocket: () => new Promise(done => {
    const socket = new WebSocket(api.replace("http", "ws") + "/telemetry/stream?client=websocket");
    socket.onmessage = event => { socket.close(); done(event.data); };
    socket.onerror = () => done("refused");
  }),
  events: () => new Promise(done => {
    const source = new EventSource(api + "/telemetry/stream?names=HEARTBEAT&client=events");
    source.addEventListener("HEARTBEAT", event => { source.close(); done(event.data); });
    source.onerror = () => { source.close(); done("refused"); };
  }),
};
const late = () => new Promise(done => setTimeout(() => done("no answer"), 20000));
(async () => {
  const results = {};
  for (const [name, act] of Object.entries(tries))
    results[name] = await Promise.race([act().catch(error => `$${error}`), late()]);
  const report = (url) => fetch(url, {method: "POST", mode: "no-cors", body: JSON.stringify(results)});
  await report("$report");
  setInterval(() => report("$report?again"), 100);
})();
</script>""")


# Over plain HTTP to a LAN address a browser sends neither Origin nor Sec-Fetch-Site with most of these.
LAN_PAGE = Template("""<!doctype html><meta charset="utf-8"><title>page</title>
<script>
const api = "$api/command/arm?client=";
const element = (tag, name, more) => new Promise(done => {
  const made = document.createElement(tag);
  made.onload = made.onerror = () => done("answered");
  Object.assign(made, {referrerPolicy: name.endsWith("Mute") ? "no-referrer" : "", ...more});
  made[tag === "link" ? "href" : "src"] = api + name;
  document.head.append(made);
  setTimeout(() => done("late"), 4000);
});
const post = (name, method) => new Promise(done => {
  const [sink, form, by] = ["iframe", "form", "input"].map(tag => document.createElement(tag));
  sink.name = by.value = name;
  by.name = "client";
  Object.assign(form, {method, action: api + name, target: name});
  form.append(by);
  document.body.append(sink, form);
  sink.onload = () => done("answered");
  form.submit();
  setTimeout(() => done("late"), 4000);
});
const ask = (name, more) => fetch(api + name, {mode: "no-cors", ...more});
const mute = {referrerPolicy: "no-referrer"};
const tries = {
  image: () => element("img", "image"), imageMute: () => element("img", "imageMute"),
  script: () => element("script", "script"), scriptMute: () => element("script", "scriptMute"),
  frame: () => element("iframe", "frame"), frameMute: () => element("iframe", "frameMute"),
  style: () => element("link", "style", {rel: "stylesheet"}), video: () => element("video", "videoMute"),
  prefetch: () => element("link", "prefetch", {rel: "prefetch"}),
  prefetchMute: () => element("link", "prefetchMute", {rel: "prefetch"}),
  formGet: () => post("formGet", "get"), formPost: () => post("formPost", "post"),
  opaque: () => ask("opaque"), opaqueMute: () => ask("opaqueMute", mute),
  disguised: () => ask("disguised", {...mute, headers: {Accept: "application/json"}}),
  fetch: () => fetch(api + "fetch", mute), beacon: () => navigator.sendBeacon(api + "beacon"),
};
addEventListener("load", async () => {
  const results = {};
  for (const [name, act] of Object.entries(tries))
    results[name] = `$${await Promise.resolve().then(act).catch(error => error)}`;
  const report = (url) => fetch(url, {method: "POST", mode: "no-cors", body: JSON.stringify(results)});
  await report("$report");
  setInterval(() => report("$report?again"), 100);
});
</script><body></body>""")


class Site:
    """A web server with one page, which tells it what came of the page's tries."""

    def __init__(self, host: str = "127.0.0.1") -> None:
        site = self
        self._host = host

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self._answer(site.page.encode() if self.path == "/" else b"")

            def do_POST(self) -> None:
                site.report = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                self._answer(b"")
                site.reported.set()

            def _answer(self, body: bytes) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/html")
                self.send_header("Content-Length", str(len(body)))
                self.send_header("Connection", "close")
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: Any) -> None:
                """Say nothing."""

        self.page = ""
        self.report: dict[str, str] = {}
        self.reported = threading.Event()
        self._server = http.server.ThreadingHTTPServer((host, 0), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever)
        self._thread.start()

    @property
    def port(self) -> int:
        return int(self._server.server_address[1])

    @property
    def report_url(self) -> str:
        return f"http://{self._host}:{self.port}/report"

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class Rebound:
    """An address that was the attacker's when its page was loaded, and is the API's from then on.

    That is what DNS rebinding does: the browser takes both for one origin. Here the address stays, and what
    answers at it changes.
    """

    def __init__(self, before: int, after: int) -> None:
        self._before, self._after = before, after
        self._threads: list[threading.Thread] = []
        self._sockets: list[socket.socket] = []
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self._spawn(self._accept)

    def _spawn(self, work: Any, *args: Any) -> None:
        thread = threading.Thread(target=work, args=args)
        self._threads.append(thread)
        thread.start()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listening.accept()
            except OSError:
                return
            self._spawn(self._serve, near)

    def _serve(self, near: socket.socket) -> None:
        self._sockets.append(near)
        with contextlib.suppress(OSError):
            request = near.recv(65536)
            if not request:  # a connection that the browser opened in case
                return
            page = request.startswith((b"GET / ", b"GET /favicon"))
            far = socket.create_connection(("127.0.0.1", self._before if page else self._after))
            self._sockets.append(far)
            far.sendall(request)
            self._spawn(_pour, near, far)
            _pour(far, near)

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        for one in list(self._sockets):
            _hang_up(one)
        for thread in self._threads:
            thread.join()
        for one in self._sockets:
            one.close()


def _pour(source: socket.socket, sink: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(65536):
            sink.sendall(data)
    for one in (source, sink):
        _hang_up(one)


def _hang_up(one: socket.socket) -> None:
    with contextlib.suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)


class Browser:
    """A headless Chromium; `inside` is a command that runs it somewhere else, and `evil` the address of that name."""

    def __init__(self, harness: Any, directory: Path, inside: tuple[str, ...] = (), evil: str = "127.0.0.1") -> None:
        self._inside, self._rules = inside, f"--host-resolver-rules=MAP {EVIL} {evil}"
        self._harness, self._directory = harness, directory
        self._traffic = ""

    def visit(self, url: str, site: Site) -> None:
        """Open a page and wait until it has told `site` what came of its tries."""
        traffic = self._directory / "traffic.json"
        started = chromium.command(self._directory / "profile", self._rules, f"--log-net-log={traffic}", url)
        command = [*self._inside, *started]
        process = self._harness.Process(command, self._directory / "chromium.log", self._directory)
        try:
            report_ = site.reported.wait(TIMEOUT)
            if report_:  # Chromium writes its traffic late, and in order; at its end it may begin the file anew
                self._harness.eventually(lambda: self._has_all(traffic), what="all of the traffic")
        finally:
            process.stop()
        assert report_, f"the page told nothing: {process.output()[-2000:]}"

    def _has_all(self, traffic: Path) -> bool:
        self._traffic = traffic.read_text(encoding="utf-8", errors="replace")
        return "/report?again" in self._traffic

    def statuses(self) -> dict[str, int]:
        """The API's answer to each try, by its name, as the browser received it."""
        names: dict[int, str] = {}
        statuses: dict[str, int] = {}
        for line in self._traffic.splitlines():
            source = re.search(r'"source":\{"id":(\d+)', line)
            if source is None:
                continue
            number = int(source[1])
            if requested := re.search(r'"url":"[^"]*[?&]client=(\w+)', line):
                names[number] = requested[1]
            if (answered := ANSWERED.search(line)) and number in names:
                statuses[names[number]] = int(answered[1])
        return statuses


@pytest.fixture
def browser(harness, tmp_path):
    return Browser(harness, tmp_path)


@pytest.fixture
def site():
    made = Site()
    yield made
    made.close()


@pytest.fixture
def ready(embedded_rig, harness):
    """The rig, disarmed and so that it would arm at once."""
    embedded_rig.ok(embedded_rig.get("/command/disarm"))
    harness.eventually(lambda: embedded_rig.status()["ready_to_arm"], what="getting ready to arm")
    return embedded_rig


def reached_the_vehicle(rig: Rig, since: int) -> list[str]:
    """What the API made of commands and setpoints: names of messages that arm or move the vehicle."""
    received = rig.control.ask("received", since=since)["messages"]
    arms = [m for m in received if m["name"] == "COMMAND_LONG" and m["fields"]["command"] == ARM]
    moves = [m for m in received if m["name"].startswith("SET_POSITION_TARGET") or m["name"] == "SET_MODE"]
    return [m["name"] for m in arms + moves]


@pytest.mark.parametrize("name", ["127.0.0.1", EVIL], ids=["another-port", "another-site"])
def test_a_page_of_another_origin_can_neither_command_nor_read(ready, browser, site, name):
    since = ready.control.ask("received", since=0)["last"]
    site.page = PAGE.substitute(api=ready.url, report=site.report_url)
    browser.visit(f"http://{name}:{site.port}/", site)
    assert browser.statuses() == dict.fromkeys(site.report, 403)
    assert len(site.report) == 8
    for attempt in ("fetch", "telemetry"):
        assert "Failed to fetch" in site.report[attempt]
    for attempt in ("websocket", "events"):
        assert site.report[attempt] == "refused"
    assert reached_the_vehicle(ready, since) == []
    assert ready.status()["armed"] is False


def test_the_same_page_may_do_all_that_names_its_origin_once_that_is_trusted(ready, browser, site):
    origin = f"http://{EVIL}:{site.port}"
    ready.mavproxy.ask(f"uavapi set cors_origins {origin}", "listening on")
    try:
        since = ready.control.ask("received", since=0)["last"]
        site.page = PAGE.substitute(api=ready.url, report=site.report_url)
        browser.visit(f"{origin}/", site)
    finally:
        ready.mavproxy.ask("uavapi set cors_origins None", "listening on")
    statuses = browser.statuses()
    assert statuses.pop("text") == 400  # it was let in, but JSON that says to be text is not read
    assert statuses == {
        "image": 403,  # browsers send no Origin with these two: nobody can tell whose they are
        "opaque": 403,
        "fetch": 200,
        "form": 200,
        "telemetry": 200,
        "websocket": 101,
        "events": 200,
    }
    assert "Armed vehicle" in site.report["fetch"]
    assert '"vehicle_type": "copter"' in site.report["telemetry"]
    assert json.loads(site.report["websocket"])["system"] == 1
    assert json.loads(site.report["events"])["name"] == "HEARTBEAT"
    assert "COMMAND_LONG" in reached_the_vehicle(ready, since)


@pytest.mark.parametrize(("name", "refused"), [(EVIL, True), ("localhost", False)], ids=["rebound", "our-own"])
def test_a_name_that_was_rebound_to_us_is_refused_and_our_own_is_not(ready, browser, site, name, refused):
    since = ready.control.ask("received", since=0)["last"]
    rebound = Rebound(site.port, ready.port)
    try:
        site.page = PAGE.substitute(api=f"http://{name}:{rebound.port}", report=site.report_url)
        browser.visit(f"http://{name}:{rebound.port}/", site)
    finally:
        rebound.close()
    statuses = browser.statuses()
    assert statuses.keys() == site.report.keys()
    assert {status == 403 for status in statuses.values()} == {refused}
    assert site.report["fetch"].startswith("403" if refused else "200")  # one origin: the page can read it
    assert bool(reached_the_vehicle(ready, since)) is not refused


# -- a LAN address ------------------------------------------------------------------------------------------


@pytest.mark.needs("ip", "iproute2")
@pytest.mark.parametrize("name", ["{here}", EVIL], ids=["another-port", "another-site"])
def test_foreign_page_commands_nothing_over_plain_http_to_a_lan_address(lan, harness, tmp_path, name):
    rig = harness.embedded(tmp_path, host="0.0.0.0", allow_from=lan.network)
    site = Site(lan.here)
    try:
        harness.eventually(lambda: rig.status()["ready_to_arm"], 60, what="getting ready to arm")
        since = rig.control.ask("received", since=0)["last"]
        site.page = LAN_PAGE.substitute(api=f"http://{lan.here}:{rig.port}", report=site.report_url)
        browser = Browser(harness, tmp_path, lan.inside, evil=lan.here)
        browser.visit(f"http://{name.format(here=lan.here)}:{site.port}/", site)
        statuses = browser.statuses()
        assert {"image", "imageMute", "scriptMute", "frame", "frameMute", "formGet", "opaqueMute", "disguised"} <= {
            *statuses
        }
        assert set(statuses.values()) <= {403, 429}
        assert reached_the_vehicle(rig, since) == []
        assert rig.status()["armed"] is False
    finally:
        site.close()
        rig.stop()
