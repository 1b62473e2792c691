from __future__ import annotations

import re
import zipfile
from base64 import b64encode
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.handlers import manual
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

THEME = "document.body.dataset.theme = 'auto';"
FILES = {
    "index.html": f"<!doctype html><script>{THEME}</script><script src='_static/scripts/furo.js'></script>",
    "docs/pt-BR/README.html": "<!doctype html>Olá",
    "_static/scripts/furo.js": "furo()",
    "_images/page-light.png": "a picture",
    "objects.inv": "no file for a browser",
}


@pytest.fixture(autouse=True)
def time_for_files(api: Api, loop: FastLoop) -> None:
    loop.real_wait = 2.0  # real s that the executor gets with its files before the clock jumps


def write(file: Path, files: dict[str, str]) -> None:
    with zipfile.ZipFile(file, "w") as packed:
        for name, text in files.items():
            packed.writestr(manual.ROOM + name, text)


@pytest.fixture
def there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A manual as a bundle has it."""
    file = tmp_path / "own" / "manual.zip"
    file.parent.mkdir()
    write(file, FILES)
    monkeypatch.setattr(manual, "OWN", file)
    return file


def fetch(api: Api, loop: FastLoop, path: str, **headers: str) -> Any:
    async def ask() -> Any:
        async with api.client.get(path, headers=headers, allow_redirects=False) as response:
            return response, await response.read()

    return loop.run(ask())


@pytest.mark.parametrize(
    ("path", "name", "kind"),
    [
        ("/manual/", "index.html", "text/html"),
        ("/manual/index.html?q=takeoff&check_keywords=yes&area=default", "index.html", "text/html"),
        ("/manual/docs/pt-BR/README.html", "docs/pt-BR/README.html", "text/html"),
        ("/manual/_static/scripts/furo.js?v=46bd48cc", "_static/scripts/furo.js", "text/javascript"),
        ("/manual/_images/page-light.png", "_images/page-light.png", "image/png"),
    ],
)
def test_files_come_with_their_kinds_and_once(
    api: Api, loop: FastLoop, there: Path, path: str, name: str, kind: str
) -> None:
    response, body = fetch(api, loop, path)
    assert (response.status, response.content_type, body) == (200, kind, FILES[name].encode())
    again, nothing = fetch(api, loop, path, **{"If-None-Match": response.headers["ETag"]})
    assert (again.status, nothing) == (304, b"")


def test_a_page_runs_only_its_own_scripts_and_may_search(api: Api, loop: FastLoop, there: Path) -> None:
    response, _ = fetch(api, loop, "/manual/")
    policy = response.headers["Content-Security-Policy"].split("; ")
    inline = b64encode(sha256(THEME.encode()).digest()).decode()
    assert {f"script-src 'self' 'sha256-{inline}'", "default-src 'none'", "form-action 'self'"} <= set(policy)
    assert response.headers["X-Content-Type-Options"] == "nosniff"


def test_its_links_lead_into_it_below_a_path_of_a_proxy_too(api: Api, loop: FastLoop, there: Path) -> None:
    response, _ = fetch(api, loop, "/manual")
    assert (response.status, response.headers["Location"]) == (307, "manual/")


@pytest.mark.parametrize(
    "path",
    [
        "/manual/no.html",
        "/manual/objects.inv",
        "/manual/..%2fmanual.zip",
        "/manual/..%2f..%2fsecret.html",
        "/manual/docs/..%2f..%2f..%2fsecret.html",
        "/manual/%2e%2e/secret.html",
        "/manual/docs",
        "/manual/docs/",
        "/manual/a/b/c/index.html",
        "/manual/index.html%00",
    ],
)
def test_nothing_else_is_served(api: Api, there: Path, path: str) -> None:
    (there.parents[1] / "secret.html").write_text("a secret")
    (there.parent / "secret.html").write_text("a secret")
    assert api.get(path).status == 404


def test_a_new_manual_takes_the_place_of_the_old_one(api: Api, loop: FastLoop, there: Path) -> None:
    fetch(api, loop, "/manual/")
    write(there, {"index.html": "the next version"})
    assert fetch(api, loop, "/manual/")[1] == b"the next version"


def test_where_no_bundle_is_the_owner_puts_it_among_the_state(
    api: Api, loop: FastLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(manual, "OWN", tmp_path / "none.zip")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    place = tmp_path / "mavproxy-uavapi" / "manual.zip"
    for path in ("/manual", "/manual/", "/manual/index.html"):
        answer = api.get(path)
        assert answer.status == 404
        assert str(place) in answer.body["detail"]
    place.parent.mkdir()
    write(place, FILES)
    assert fetch(api, loop, "/manual/")[0].status == 200


@pytest.mark.parametrize("spoilt", [b"no zip", b"PK\x05\x06", b""])
def test_a_file_that_is_no_zip_is_said(api: Api, there: Path, spoilt: bytes) -> None:
    there.write_bytes(spoilt)
    answer = api.get("/manual/")
    assert answer.status == 404
    assert "cannot be read" in answer.body["detail"]


def test_a_damaged_zip_is_said(api: Api, there: Path) -> None:
    with zipfile.ZipFile(there, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("manual/index.html", "text " * 1000)
    content = bytearray(there.read_bytes())
    content[50:60] = b"\xff" * 10
    there.write_bytes(content)
    answer = api.get("/manual/")
    assert answer.status == 404
    assert re.search("cannot be read: .+", answer.body["detail"])


def test_it_needs_no_token_and_is_not_for_pages_of_other_sites(
    api: Api, loop: FastLoop, service: Service, there: Path
) -> None:
    assert fetch(api, loop, "/manual/", Origin="http://evil.example")[0].status == 403
    service.settings = ApiModuleSettings({"token": "t"}, environ={}).snapshot()
    assert fetch(api, loop, "/manual")[0].status == 307
    assert fetch(api, loop, "/manual/docs/pt-BR/README.html")[0].status == 200
    assert api.get("/manuals").status == 401
