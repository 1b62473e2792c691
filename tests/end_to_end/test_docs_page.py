"""The documentation page in a real browser: it shows every endpoint, and one is tried from it."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import itertools
import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
from aiohttp import ClientSession

RIG_SPEEDUP = 2  # nobody flies far here, and each message costs processor time
CHROMIUM = "chromium"
QUIET = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"]
QUIET += ["--disable-component-update", "--disable-sync", "--no-first-run", "--remote-debugging-port=0"]
QUIET += ["--window-size=1300,1700"]
PATIENCE = 90.0  # s; a browser's start on a busy machine
TRY_IT = """
(async () => {
  const wait = async (look) => {
    for (let i = 0; i < 600; i++) { const found = look(); if (found) return found; await new Promise(r => setTimeout(r, 100)); }
    throw new Error("nothing came of " + look);
  };
  const block = await wait(() => document.querySelector("#operations-telemetry-get_telemetry_status"));
  block.querySelector(".opblock-summary-control").click();
  (await wait(() => block.querySelector("button.execute"))).click();
  const body = await wait(() => block.querySelector(".live-responses-table .response-col_description .highlight-code"));
  block.scrollIntoView();
  return [document.querySelectorAll(".opblock").length, body.innerText,
          [...document.querySelectorAll(".errors-wrapper")].map(e => e.innerText).join()];
})()
"""  # noqa: E501

# Every operation as the page itself would ask it: with its examples, and where it is a job, without waiting.
TRY_ALL = """
(async () => {
  while (!(window.ui && ui.specSelectors.specJson().get("paths"))) await new Promise(r => setTimeout(r, 100));
  const spec = ui.specSelectors.specJson().toJS();
  const parts = "multipart/form-data";
  const answers = {};
  for (const [path, methods] of Object.entries(spec.paths))
    for (const [method, told] of Object.entries(methods)) {
      const content = told.requestBody ? told.requestBody.content : {};
      const [type, body] = Object.entries(content)[0] || [];
      const parameters = {};
      for (const one of told.parameters) if (one.example !== undefined) parameters[one.name] = one.example;
      if (told.parameters.some(one => one.name === "wait")) parameters.wait = false;
      const example = body && body.example;
      const text_of = value => typeof value === "string" ? value : JSON.stringify(value);
      const given = type === parts ? {file: new File(["print('hello')"], "hello.py")} : example && text_of(example);
      const options = {spec, operationId: told.operationId, parameters, requestBody: given, requestContentType: type};
      const stop = new AbortController();
      const asked = ui.fn.buildRequest(options);
      if (type === parts) delete asked.headers["Content-Type"];  // the browser knows the form's boundary
      setTimeout(() => stop.abort(), 30000);
      const answer = await fetch(asked.url, {...asked, signal: stop.signal});
      const kind = answer.headers.get("Content-Type") || "";
      const text = kind.startsWith("application/json") ? await answer.text() : "";
      stop.abort();
      answers[`${method.toUpperCase()} ${path}`] = [answer.status, text.slice(0, 300)];
    }
  return answers;
})()
"""


class Page:
    """A browser's tab, by the DevTools protocol."""

    def __init__(self, socket) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)
        self.refused: list[str] = []

    async def ask(self, method, **params):
        number = next(self._numbers)
        await self._socket.send_json({"id": number, "method": method, "params": params})
        while True:
            reported = await self._socket.receive_json(timeout=PATIENCE)
            if reported.get("method") == "Log.entryAdded":
                self.refused.append(reported["params"]["entry"]["text"])
            if reported.get("method") == "Network.requestWillBeSent":
                self.refused += [
                    u for u in [reported["params"]["request"]["url"]] if not u.startswith((self.url, "data:"))
                ]
            if reported.get("id") == number:
                assert "error" not in reported, reported
                return reported["result"]

    async def look_at(self, url, script):
        self.url = url.rsplit("/", 1)[0]
        for domain in ("Page", "Log", "Network", "Runtime"):
            await self.ask(f"{domain}.enable")
        await self.ask("Page.navigate", url=url)
        return (await self.ask("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True))[
            "result"
        ]


@contextlib.contextmanager
def browser(directory: Path):
    command = [CHROMIUM, *QUIET, f"--user-data-dir={directory}", "about:blank"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        port = directory / "DevToolsActivePort"
        deadline = time.monotonic() + PATIENCE
        while not (port.exists() and port.read_text()):
            assert process.poll() is None and time.monotonic() < deadline, "the browser did not start"
            time.sleep(0.1)
        yield f"http://127.0.0.1:{port.read_text().split()[0]}"
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


async def tried(devtools, url, picture, script):
    async with ClientSession() as session:
        async with session.get(f"{devtools}/json") as answer:
            tab = next(tab for tab in await answer.json() if tab["type"] == "page")
        async with session.ws_connect(tab["webSocketDebuggerUrl"], max_msg_size=0) as socket:
            page = Page(socket)
            result = await page.look_at(url, script)
            shot = await page.ask("Page.captureScreenshot")
            picture.write_bytes(base64.b64decode(shot["data"]))
            return result, page.refused


@pytest.mark.long
@pytest.mark.needs("chromium")
def test_page_shows_all_endpoints_without_internet_and_one_can_be_tried(embedded_rig, tmp_path):
    described = embedded_rig.ok(embedded_rig.get("/openapi.json"))
    operations = sum(len(methods) for methods in described["paths"].values())
    with browser(tmp_path / "profile") as devtools:
        url = f"{embedded_rig.url}/docs"
        result, refused = asyncio.run(tried(devtools, url, tmp_path / "docs.png", TRY_IT))
    shown, body, errors = result["value"]
    assert shown == operations
    assert errors == ""
    assert json.loads(body[body.index("{") :])["info"]["vehicle_type"] == "copter"
    assert refused == []  # neither by the page's policy, nor for want of a network


@pytest.mark.needs("chromium")
def test_every_endpoint_takes_what_the_page_would_ask(embedded_rig, tmp_path):
    embedded_rig.set("allow_raw", "True")
    described = embedded_rig.ok(embedded_rig.get("/openapi.json"))
    operations = {f"{method.upper()} {path}" for path, methods in described["paths"].items() for method in methods}
    with browser(tmp_path / "profile") as devtools:
        url = f"{embedded_rig.url}/docs"
        result, refused = asyncio.run(tried(devtools, url, tmp_path / "docs.png", TRY_ALL))
    answers = result["value"]
    assert set(answers) == operations
    print("\n".join(f"{status} {name} {text}" for name, (status, text) in answers.items()))
    misunderstood = {name: answer for name, answer in answers.items() if answer[0] in (400, 401, 403, 405, 422)}
    assert misunderstood == {}
    assert [url for url in refused if "Failed to load resource" not in url] == []  # the browser's word for a 4xx


def test_page_and_its_files_are_served_with_their_policy(embedded_rig):
    for path in ("/docs", "/docs/", "/docs/swagger-ui.css", "/docs/swagger-ui-bundle.js", "/docs/start.js"):
        answer = embedded_rig.get(path)
        assert answer.status_code == 200, path
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert embedded_rig.get("/docs/..%2fsetup.py").status_code == 404
