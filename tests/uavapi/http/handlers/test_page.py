from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.handlers import page
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

FILES = sorted(f.relative_to(page.FOLDER).as_posix() for f in page.FOLDER.rglob("*") if f.is_file())
HTML = {"Accept": "text/html,application/xhtml+xml,*/*;q=0.8"}


@pytest.fixture(autouse=True)
def time_for_files(api: Api, loop: FastLoop) -> None:
    loop.real_wait = 2.0  # real s that the executor gets with its files before the clock jumps


def fetch(api: Api, loop: FastLoop, path: str, **headers: str) -> Any:
    async def ask() -> Any:
        async with api.client.get(path, headers={"Accept-Encoding": "identity", **headers}) as response:
            return response, await response.read()

    return loop.run(ask())


def test_browser_gets_the_page_and_a_program_what_it_always_got(api: Api, loop: FastLoop) -> None:
    response, body = fetch(api, loop, "/", **HTML)
    assert (response.status, response.content_type) == (200, "text/html")
    assert b"<hold-all " in body
    answer = api.get("/")
    assert (answer.status, answer.body["code"]) == (404, "not_found")


def test_each_file_comes_with_its_kind_and_policy_and_once(api: Api, loop: FastLoop) -> None:
    for name in FILES:
        response, body = fetch(api, loop, f"/page/{name}")
        assert (response.status, response.content_type) == (200, page.KINDS[Path(name).suffix])
        assert body == (page.FOLDER / name).read_bytes() or name == page.INDEX
        assert "default-src 'none'" in response.headers["Content-Security-Policy"]
        again, nothing = fetch(api, loop, f"/page/{name}", **{"If-None-Match": response.headers["ETag"]})
        assert (again.status, nothing) == (304, b""), name


def test_made_of_several_files_it_comes_once_and_compressed_if_taken(api: Api, loop: FastLoop) -> None:
    for name, made in page._all_made().items():
        path, accept = ("/", HTML) if name == page.INDEX else (f"/page/{name}", {})
        response, body = fetch(api, loop, path, **accept)
        assert (response.status, body) == (200, made.plain)
        response, body = fetch(api, loop, path, **accept, **{"Accept-Encoding": "gzip"})
        assert (response.headers.get("Content-Encoding"), body) == ("gzip", made.plain)  # the client has unpacked it
        assert int(response.headers["Content-Length"]) == len(made.compressed)
        assert "default-src 'none'" in response.headers["Content-Security-Policy"]
        tag = {"Accept-Encoding": "gzip", "If-None-Match": response.headers["ETag"]}
        assert fetch(api, loop, path, **accept, **tag)[0].status == 304


def test_files_need_no_token_and_nothing_else_goes_without(api: Api, loop: FastLoop, service: Service) -> None:
    service.settings = ApiModuleSettings({"token": "sesame"}, environ={}).snapshot()
    for name in FILES * 2:
        assert fetch(api, loop, f"/page/{name}")[0].status == 200
    assert fetch(api, loop, "/", **HTML)[0].status == 200
    assert api.get("/").status == 401
    assert api.get("/vehicles", headers=HTML).status == 401
    assert api.post("/fleet/brake", {}).status == 401


NO_FILES = ["..%2fapi.py", "%2e%2e", "x.js", "app.js%00", "__init__.py", "app", "a%2fb.js", "net", "net/", "net/x.js"]
WAYS_OUT = [
    "all/..%2fapp.js",
    "all/x.js",
    "all",
    "net/..%2fapp.js",
    "..%2fnet/api.js",
    "..%2fhttp/page.py",
    "..%2f__init__.py",
    "net//api.js",
    "net/..",
]


def test_other_files_are_404(api: Api) -> None:
    statuses = {name: api.get(f"/page/{name}").status for name in (*NO_FILES, *WAYS_OUT)}
    assert statuses == dict.fromkeys(statuses, 404)


def test_page_loads_only_what_it_has() -> None:
    index = (page.FOLDER / page.INDEX).read_text(encoding="utf-8")
    loaded = {page.INDEX, *re.findall(r'(?:src|href)="page/([^"]+)"', index)}
    (codes,) = re.findall(r'data-languages="([^"]*)"', index)
    loaded |= {f"languages/{code}.json" for code in codes.split()}
    for file in page.FOLDER.rglob("*.js"):
        for name in re.findall(r'(?:from |import |import\()"(\.[^"]+)"', file.read_text(encoding="utf-8")):
            loaded.add((file.parent / name).resolve().relative_to(page.FOLDER).as_posix())
    assert loaded == set(FILES)


@pytest.mark.parametrize("name", sorted({*FILES} - {*page.LANGUAGES}))
def test_file_is_short_and_asks_nobody_else(name: str) -> None:
    text = (page.FOLDER / name).read_text(encoding="utf-8")
    assert text.count("\n") < 300
    assert re.findall(r"https?://(?!www\.w3\.org/2000/svg)|innerHTML|\beval\b|document\.write", text) == []
