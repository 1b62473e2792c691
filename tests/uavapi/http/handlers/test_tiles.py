from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.pictures import png_header


@pytest.fixture(autouse=True)
def time_for_files(api: Any, loop: Any) -> None:
    loop.real_wait = 2.0  # real s that the executor gets with its files before the clock jumps


@pytest.fixture
def picture(tmp_path: Path, service: Any) -> bytes:
    """The only tile of the map: 1/0/1."""
    file = tmp_path / "1" / "0" / "1.png"
    file.parent.mkdir(parents=True)
    file.write_bytes(png_header(256, 256))
    service.settings = ApiModuleSettings({"tiles": str(tmp_path)}, environ={}).snapshot()
    return file.read_bytes()


def fetch(api: Any, loop: Any, path: str, **headers: str) -> Any:
    async def ask() -> Any:
        async with api.client.get(path, headers=headers) as response:
            return response, await response.read()

    return loop.run(ask())


def test_tile_comes_as_a_picture_and_once(api: Any, loop: Any, picture: bytes) -> None:
    assert api.get("/tiles").body == {"result": "success", "least": 1, "most": 1}
    response, body = fetch(api, loop, "/tiles/1/0/1")
    assert (response.status, response.content_type, body) == (200, "image/png", picture)
    assert "sandbox" in response.headers["Content-Security-Policy"]
    again, nothing = fetch(api, loop, "/tiles/1/0/1", **{"If-None-Match": response.headers["ETag"]})
    assert (again.status, nothing) == (304, b"")


@pytest.mark.parametrize("path", ["1/0/0", "1/2/1", "1/0/x", "1/0/-1", "25/0/0", "1/0/1.png", "..%2f1/0/1", "1/0/²"])
def test_what_is_no_tile_is_404(api: Any, picture: bytes, path: str) -> None:
    assert api.get(f"/tiles/{path}").status == 404


def test_there_is_no_map_by_default(api: Any) -> None:
    assert api.get("/tiles").body == {"result": "success", "least": None, "most": None}
    assert api.get("/tiles/0/0/0").status == 404
