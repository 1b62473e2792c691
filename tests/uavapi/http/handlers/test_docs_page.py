from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.handlers import docs_page
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

FILE_WAIT = 2.0  # real s that the executor gets with its files before the clock jumps


@pytest.fixture(autouse=True)
def time_for_files(api: Api, loop: FastLoop) -> None:
    loop.real_wait = FILE_WAIT


def fetch(api: Api, loop: FastLoop, path: str, **kwargs: Any) -> Any:
    async def ask() -> Any:
        async with api.client.get(path, **kwargs) as response:
            return response, await response.read()

    return loop.run(ask())


@pytest.mark.parametrize("path", ["/docs", "/docs/"])
def test_page_loads_nothing_but_our_own_files(api: Api, loop: FastLoop, path: str) -> None:
    response, body = fetch(api, loop, path)
    assert (response.status, response.content_type) == (200, "text/html")
    assert b"http" not in body.replace(b"<html", b"")
    policy = response.headers["Content-Security-Policy"].split("; ")
    assert {"default-src 'none'", "script-src 'self'", "connect-src 'self'"} <= set(policy)


@pytest.mark.parametrize(("name", "kind"), [*docs_page.ASSETS.items(), ("start.js", "text/javascript")])
def test_files_come_with_their_kinds(api: Api, loop: FastLoop, name: str, kind: str) -> None:
    response, body = fetch(api, loop, f"/docs/{name}")
    assert (response.status, response.content_type) == (200, kind)
    assert body


@pytest.mark.parametrize("name", ["index.html", "..%2f__init__.py", "swagger-ui.css%00", "x"])
def test_other_files_are_404(api: Api, name: str) -> None:
    assert api.get(f"/docs/{name}").status == 404


def test_swagger_ui_is_one_that_knows_openapi_3_1(api: Api, loop: FastLoop) -> None:
    _, body = fetch(api, loop, "/docs/swagger-ui-bundle.js")
    assert b'PACKAGE_VERSION:"5.' in body


def test_without_the_package_the_page_says_what_to_install(
    api: Api, loop: FastLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(docs_page, "PACKAGE", "no_such_package")
    answer = api.get("/docs")
    assert answer.status == 404
    assert "pip install swagger-ui-py" in answer.body["detail"]
    assert api.get("/docs/swagger-ui.css").status == 404
    assert api.get("/openapi.json").status == 200


def test_documentation_needs_no_token_but_everything_else_does(api: Api, service: Service) -> None:
    service.settings = ApiModuleSettings({"token": "t"}, environ={}).snapshot()
    assert api.get("/openapi.json").status == 200
    assert api.get("/docs/nothing").status == 404
    assert api.get("/docsx").status == 401
    assert api.get("/telemetry/gps").status == 401


def test_documentation_is_not_for_pages_of_other_sites(api: Api) -> None:
    headers = {"Origin": "http://evil.example"}
    assert api.get("/openapi.json", headers=headers).status == 403
    assert api.get("/docs", headers=headers).status == 403
