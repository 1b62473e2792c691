from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.pictures import png_header
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api


@pytest.fixture(autouse=True)
def time_for_files(api: Api, loop: FastLoop) -> None:
    loop.real_wait = 2.0  # real s that the executor gets with its files before the clock jumps


@pytest.fixture
def picture(tmp_path: Path, service: Service) -> bytes:
    """The only tile of the map: 1/0/1."""
    file = tmp_path / "1" / "0" / "1.png"
    file.parent.mkdir(parents=True)
    file.write_bytes(png_header(256, 256))
    service.settings = ApiModuleSettings({"tiles": str(tmp_path)}, environ={}).snapshot()
    return file.read_bytes()


def fetch(api: Api, loop: FastLoop, path: str, **headers: str) -> Any:
    async def ask() -> Any:
        async with api.client.get(path, headers=headers) as response:
            return response, await response.read()

    return loop.run(ask())


def test_tile_comes_as_a_picture_and_once(api: Api, loop: FastLoop, picture: bytes) -> None:
    assert api.get("/tiles").body == {"result": "success", "least": 1, "most": 1}
    response, body = fetch(api, loop, "/tiles/1/0/1")
    assert (response.status, response.content_type, body) == (200, "image/png", picture)
    assert "sandbox" in response.headers["Content-Security-Policy"]
    again, nothing = fetch(api, loop, "/tiles/1/0/1", **{"If-None-Match": response.headers["ETag"]})
    assert (again.status, nothing) == (304, b"")


@pytest.mark.parametrize("path", ["1/0/0", "1/2/1", "1/0/x", "1/0/-1", "25/0/0", "1/0/1.png", "..%2f1/0/1", "1/0/²"])
def test_what_is_no_tile_is_404(api: Api, picture: bytes, path: str) -> None:
    assert api.get(f"/tiles/{path}").status == 404


def test_there_is_no_map_by_default(api: Api) -> None:
    assert api.get("/tiles").body == {"result": "success", "least": None, "most": None}
    assert api.get("/tiles/0/0/0").status == 404


SOURCE = {"tile_source": "https://tiles.example.org/{z}/{x}/{y}.png", "tile_licence": "(c) who drew it"}


def put(api: Api, loop: FastLoop, path: str, body: bytes, kind: str = "image/png") -> int:
    async def ask() -> int:
        async with api.client.put(path, data=body, headers={"Content-Type": kind}) as response:
            return int(response.status)

    return int(loop.run(ask()))


def test_an_area_is_kept_only_where_the_owner_has_named_a_source(
    api: Api, loop: FastLoop, service: Service, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    picture = png_header(256, 256)
    assert put(api, loop, "/tiles/1/0/1", picture) == 403
    assert not any(tmp_path.iterdir())
    service.settings = ApiModuleSettings(SOURCE, environ={}).snapshot()
    assert api.get("/tiles").body == {
        "result": "success",
        "least": None,
        "most": None,
        "source": SOURCE["tile_source"],
        "licence": SOURCE["tile_licence"],
    }
    assert put(api, loop, "/tiles/1/0/1", picture) == 200
    assert put(api, loop, "/tiles/1/0/2", picture) == 400
    assert put(api, loop, "/tiles/1/0/1", b"<svg/>") == 400
    assert fetch(api, loop, "/tiles/1/0/1")[1] == picture
    assert (api.get("/tiles").body["least"], api.get("/tiles").body["most"]) == (1, 1)
    service.settings = ApiModuleSettings({}, environ={}).snapshot()
    assert api.get("/tiles/1/0/1").status == 404


def test_the_page_may_ask_the_source_and_nobody_else(api: Api, loop: FastLoop, service: Service) -> None:
    page = lambda: fetch(api, loop, "/", Accept="text/html")[0].headers  # noqa: E731
    before = page()
    service.settings = ApiModuleSettings(SOURCE, environ={}).snapshot()
    after = page()
    assert "connect-src 'self';" in before["Content-Security-Policy"]
    assert "connect-src 'self' https://tiles.example.org;" in after["Content-Security-Policy"]
    assert before["ETag"] != after["ETag"]
