"""The documentation page in a real browser: it shows every endpoint, and one is tried from it."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.support.chromium import chromium
from tests.support.processes import Rig

pytestmark = pytest.mark.long

RIG_SPEEDUP = 2  # nobody flies far here, and each message costs processor time
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
  const shared = one => one.$ref ? spec.components.parameters[one.$ref.split("/").pop()] : one;
  for (const [path, methods] of Object.entries(spec.paths).filter(([path]) => !path.startsWith("/vehicles/{sysid}/")))
    for (const [method, told] of Object.entries(methods)) {
      const content = told.requestBody ? told.requestBody.content : {};
      const [type, body] = Object.entries(content)[0] || [];
      const parameters = {};
      const asked_for = told.parameters.map(shared);
      for (const one of asked_for) if (one.example !== undefined) parameters[one.name] = one.example;
      if (asked_for.some(one => one.name === "wait")) parameters.wait = false;
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


class Tried(NamedTuple):
    """What came of a script on the page."""

    value: Any
    complaints: list[str]
    elsewhere: list[str]  # requests to other servers


async def tried(rig: Rig, directory: Path, script: str) -> Tried:
    async with chromium(directory) as page:
        await page.visit(f"{rig.url}/docs", 1300, 1700)
        value = await page.evaluate(script)
        elsewhere = [url for url in page.requests if not url.startswith((rig.url, "data:"))]
        return Tried(value, page.complaints, elsewhere)


@pytest.mark.long
@pytest.mark.needs("chromium")
def test_page_shows_all_endpoints_without_internet_and_one_can_be_tried(embedded_rig: Rig, tmp_path: Path) -> None:
    described = embedded_rig.ok(embedded_rig.get("/openapi.json"))
    operations = sum(len(methods) for methods in described["paths"].values())
    result = asyncio.run(tried(embedded_rig, tmp_path, TRY_IT))
    shown, body, errors = result.value
    assert shown == operations
    assert errors == ""
    assert json.loads(body[body.index("{") :])["info"]["vehicle_type"] == "copter"
    assert (result.complaints, result.elsewhere) == (
        [],
        [],
    )  # nothing was refused, and it needs no network


@pytest.mark.needs("chromium")
def test_every_endpoint_takes_what_the_page_would_ask(embedded_rig: Rig, tmp_path: Path) -> None:
    embedded_rig.set("allow_raw", "True")
    described = embedded_rig.ok(embedded_rig.get("/openapi.json"))
    paths = {path: item for path, item in described["paths"].items() if not path.startswith("/vehicles/{sysid}/")}
    operations = {f"{method.upper()} {path}" for path, item in paths.items() for method in item}
    result = asyncio.run(tried(embedded_rig, tmp_path, TRY_ALL))
    answers = result.value
    assert set(answers) == operations
    print("\n".join(f"{status} {name} {text}" for name, (status, text) in answers.items()))
    misunderstood = {name: answer for name, answer in answers.items() if answer[0] in (400, 401, 403, 405, 422)}
    assert misunderstood == {}
    assert (result.complaints, result.elsewhere) == ([], [])


def test_page_and_its_files_are_served_with_their_policy(embedded_rig):
    for path in ("/docs", "/docs/", "/docs/swagger-ui.css", "/docs/swagger-ui-bundle.js", "/docs/start.js"):
        answer = embedded_rig.get(path)
        assert answer.status_code == 200, path
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert embedded_rig.get("/docs/..%2fsetup.py").status_code == 404
