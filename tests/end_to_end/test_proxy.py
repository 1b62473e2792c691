"""Behind nginx, at a path of its own: the page, /docs, a stream and the station, in a real browser."""

from __future__ import annotations

import asyncio
import json
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest
import requests

from tests.support.chromium import Page, chromium
from tests.support.page_pilot import BUTTON, Pilot
from tests.support.ports import free_port
from tests.support.processes import eventually

RIG_SPEEDUP = 2  # nobody flies far here, and each message costs processor time
pytestmark = [pytest.mark.needs("nginx", "nginx-light"), pytest.mark.long]
TOKEN = "a-long-and-secret-word"
# As docs/deploy.md has it. The API needs no more than the header by which a proxy is known; Host is another one here.
CONFIG = """
daemon off;
pid {folder}/nginx.pid;
error_log stderr;
events {{}}
http {{
  access_log off;
  client_body_temp_path {folder}/body;
  proxy_temp_path {folder}/proxy;
  fastcgi_temp_path {folder}/fastcgi;
  uwsgi_temp_path {folder}/uwsgi;
  scgi_temp_path {folder}/scgi;
  server {{
    listen 127.0.0.1:{port};
    location /drone/ {{
      proxy_pass {api}/;
      proxy_set_header X-Forwarded-For $remote_addr;
      proxy_read_timeout 1d;
    }}
    location /station/ {{
      proxy_pass {station}/;
      proxy_set_header Host $http_host;
    }}
  }}
}}
"""


class Behind(NamedTuple):
    """What is behind the proxy, and where: `drone` and `station` are URLs at the proxy."""

    rig: Any
    drone: str
    station: str


@pytest.fixture(scope="module")
def behind(harness: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Behind]:
    """An API with a token, and a station, behind nginx."""
    folder = tmp_path_factory.mktemp("proxy")
    rig = harness.Rig(folder, free_port())
    try:
        instance = harness.start_embedded(rig, speedup=RIG_SPEEDUP)
        command = harness.mavproxy_command(instance, harness.load(rig.port))
        rig.mavproxy = rig.start("mavproxy", command, {"UAVAPI_TOKEN": TOKEN})
        port, proxy = free_port(), free_port()
        command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={port}", f"--database={folder}/s.db"]
        rig.start("station", command)
        text = CONFIG.format(folder=folder, port=proxy, api=rig.url, station=f"http://127.0.0.1:{port}")
        (folder / "nginx.conf").write_text(text)
        rig.start("nginx", ["nginx", "-p", str(folder), "-c", str(folder / "nginx.conf")], with_sbin())
        rig.mavproxy.says("listening on")
        urls = [f"http://127.0.0.1:{proxy}/{name}" for name in ("drone", "station")]
        eventually(lambda: asked(f"{urls[0]}/telemetry/status") == 200, what="the API behind nginx")
        eventually(lambda: asked(f"{urls[1]}/health") == 200, what="the station behind nginx")
        yield Behind(rig, *urls)
    finally:
        rig.stop()


def with_sbin() -> dict[str, str]:
    return {"PATH": os.environ["PATH"] + ":/usr/sbin"}


def call(url: str, method: str = "GET", **content: Any) -> Any:
    return requests.request(method, url, headers={"Authorization": f"Bearer {TOKEN}"}, timeout=60, **content)


def asked(url: str) -> int:
    try:
        return int(call(url).status_code)
    except requests.ConnectionError:
        return 0


async def log_in(page: Page, url: str) -> None:
    """Open the page, and give it the token that it asks for."""
    await page.visit(url)
    await page.until("document.querySelector('token-dialog dialog')?.open")
    await page.evaluate(f"document.querySelector('token-dialog input').value = {TOKEN!r}")
    await page.evaluate("document.querySelector('token-dialog form').requestSubmit()")


@pytest.mark.needs("chromium")
def test_page_flies_below_a_path_of_a_proxy(behind: Behind, tmp_path: Path) -> None:
    async def act() -> tuple[list[str], list[str]]:
        async with chromium(tmp_path) as page:
            pilot = Pilot(page, behind.rig)
            await log_in(page, f"{behind.drone}/")
            await pilot.sees_live()
            await pilot.sees("flight-status", "Ready to arm.")
            await pilot.hold("Arm")
            await pilot.sees("flight-status", "ARMED")
            await page.click(BUTTON.format(tag="button", label="Brake"))
            await pilot.sees("flight-status", "BRAKE")
            elsewhere = [url for url in page.requests if not url.startswith((f"{behind.drone}/", "data:", "blob:"))]
            return elsewhere, page.complaints

    elsewhere, complaints = asyncio.run(act())
    assert elsewhere == []
    assert complaints == []
    call(f"{behind.drone}/command/disarm")


@pytest.mark.needs("chromium")
@pytest.mark.parametrize("path", ["docs", "docs/"])
def test_documentation_tries_a_path_below_that_of_the_proxy(behind: Behind, tmp_path: Path, path: str) -> None:
    script = """(async () => {
      while (!(window.ui && ui.specSelectors.specJson().get("paths"))) await new Promise(r => setTimeout(r, 100));
      const spec = ui.specSelectors.specJson().toJS();
      const found = {spec, operationId: "get_telemetry_status", contextUrl: ui.specSelectors.url()};
      return ui.fn.buildRequest(found).url; })()"""

    async def act() -> tuple[str, list[str], list[str]]:
        async with chromium(tmp_path) as page:
            await page.visit(f"{behind.drone}/{path}")
            tried = await page.evaluate(script)
            elsewhere = [url for url in page.requests if not url.startswith((f"{behind.drone}/", "data:"))]
            return tried, elsewhere, page.complaints

    tried, elsewhere, complaints = asyncio.run(act())
    assert tried == f"{behind.drone}/telemetry/status"
    assert elsewhere == complaints == []


def test_events_are_not_collected_by_the_proxy(behind: Behind) -> None:
    url = f"{behind.drone}/telemetry/stream?names=HEARTBEAT"
    with requests.get(url, headers={"Authorization": f"Bearer {TOKEN}"}, stream=True, timeout=30) as answer:
        lines = answer.iter_lines()
        began, heard = time.monotonic(), [json.loads(line[5:]) for line in until_data(lines, 3)]
    assert [event["name"] for event in heard] == ["HEARTBEAT"] * 3
    assert time.monotonic() - began < 20  # nginx would wait for 4 kB, or for the end


def until_data(lines: Any, count: int) -> Iterator[bytes]:
    """The first so many lines of data."""
    for line in lines:
        if line.startswith(b"data:"):
            yield line
            count -= 1
            if not count:
                return


@pytest.mark.needs("chromium")
def test_station_shows_its_fleet_below_a_path_of_a_proxy(behind: Behind, tmp_path: Path) -> None:
    async def act() -> tuple[list[str], list[str], list[str]]:
        async with chromium(tmp_path) as page:
            await page.visit(f"{behind.station}/")
            await page.until("document.readyState === 'complete'")
            await page.until("!document.body.innerText.includes('waiting for the station')")
            elsewhere = [url for url in page.requests if not url.startswith((f"{behind.station}/", "data:"))]
            return elsewhere, page.complaints, page.failed_requests

    assert asyncio.run(act()) == ([], [], [])


def test_file_goes_through(behind: Behind) -> None:
    area = [[149.16, -35.37], [149.17, -35.37], [149.17, -35.36], [149.16, -35.36], [149.16, -35.37]]
    feature = {
        "type": "Feature",
        "properties": {"kind": "inclusion"},
        "geometry": {"type": "Polygon", "coordinates": [area]},
    }
    answer = call(f"{behind.drone}/envelope", "PUT", json={"type": "FeatureCollection", "features": [feature]})
    assert answer.status_code == 200, answer.text
    assert call(f"{behind.drone}/envelope", "DELETE").status_code == 200
