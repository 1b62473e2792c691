from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.addresses import is_our_name
from mavproxy_uavapi.core.errors import Forbidden, Unauthorized
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.files.tokens import Token
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.door.security import check_caller, check_origin, check_page, has_token
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support import tokens
from tests.support.api_port import Port
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

HOST = {"Host": "127.0.0.1:8000"}


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Origin": "http://127.0.0.1:8000"},
        {"Sec-Fetch-Site": "same-origin", "Origin": "http://127.0.0.1:8000"},
        {"Sec-Fetch-Site": "none"},
        {"Host": "localhost:8000", "Origin": "http://localhost:8000"},
        {"Host": "[::1]:8000"},
        {"Host": "LOCALHOST"},
    ],
)
def test_our_own_pages_and_clients_without_an_origin_may_call(headers: dict[str, str]) -> None:
    check_origin({**HOST, **headers})


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": ""},
        {"Origin": "http://127.0.0.1:9999"},
        {"Origin": "http://localhost:8000"},
        {"Origin": "http://[::1"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
        {"Sec-Fetch-Site": "cross-site", "Origin": "http://127.0.0.1:8000"},
        {"Host": "evil.example:8000"},
        {"Host": "evil.example:8000", "Origin": "http://evil.example:8000"},
        {"Host": "127.0.0.1.evil.example"},
        {"Host": ""},
        {"Host": "[::1"},
        {"Host": "localhost@evil.example"},
    ],
)
def test_pages_of_other_sites_and_foreign_names_may_not(headers: dict[str, str]) -> None:
    with pytest.raises(Forbidden):
        check_origin({**HOST, **headers})


def test_request_without_a_host_is_refused() -> None:
    with pytest.raises(Forbidden):
        check_origin({})


@pytest.mark.parametrize(("host", "ours"), [("192.168.1.5:8000", True), ("drone.local", False), ("localhost", True)])
def test_addresses_and_localhost_are_our_names(host: str, ours: bool) -> None:
    assert is_our_name(host) is ours


@pytest.mark.parametrize(
    "headers",
    [{"Origin": "http://evil.example"}, {"Host": "evil.example"}, {"Host": "[::1"}, {"Sec-Fetch-Site": "cross-site"}],
    ids=["origin", "host", "bad host", "site"],
)
@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/command/arm"),
        ("POST", "/movement/go_to_ned"),
        ("GET", "/telemetry/gps"),
        ("GET", "/telemetry/stream"),
        ("GET", "/no/such/path"),
    ],
)
def test_every_path_is_403_for_a_page_of_another_site_and_nothing_is_sent(
    flying: Drone, api: Api, loop: FastLoop, method: str, path: str, headers: dict[str, str]
) -> None:
    answer = loop.run(api.ask(method, path, headers=headers))
    assert (answer.status, answer.body["code"]) == (403, "forbidden")
    assert flying.received == []


def test_page_of_another_site_may_not_open_a_websocket(flying: Drone, api: Api, loop: FastLoop) -> None:
    from aiohttp import WSServerHandshakeError

    async def connect() -> None:
        await api.client.ws_connect("/telemetry/stream", headers={"Origin": "http://evil.example"})

    with pytest.raises(WSServerHandshakeError) as caught:
        loop.run(connect())
    assert caught.value.status == 403


# -- a browser that names neither site nor origin: plain HTTP to a LAN address ------------------------------

LAN = {"Host": "192.168.1.5:8000"}
CHROMIUM = {"User-Agent": "Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 Chrome/140.0 Safari/537.36"}
PAGE = "text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,image/webp,*/*;q=0.8"
IMAGE = "image/avif,image/webp,image/apng,image/svg+xml,image/*,*/*;q=0.8"

FOREIGN = {
    "image": {**CHROMIUM, "Accept": IMAGE, "Referer": "http://evil.example/"},
    "image without referer": {**CHROMIUM, "Accept": IMAGE},
    "script without referer": {**CHROMIUM, "Accept": "*/*"},
    "navigation": {**CHROMIUM, "Accept": PAGE, "Upgrade-Insecure-Requests": "1"},
    "style": {**CHROMIUM, "Accept": "text/css,*/*;q=0.1"},
    "prefetch": {**CHROMIUM, "Accept": "*/*", "Purpose": "prefetch"},
    "nameless image": {"Accept": IMAGE},
    "nameless navigation": {"Accept": PAGE},
    "nameless script": {"Accept": "application/javascript, */*;q=0.8"},
    "referer alone": {"Referer": "http://evil.example/page"},
    "our name in a path": {"Referer": "http://evil.example/192.168.1.5:8000/"},
    "our name in a login": {"Referer": "http://192.168.1.5:8000@evil.example/"},
    "our address, another port": {"Referer": "http://192.168.1.5:80/"},
    "empty referer": {"Referer": ""},
}
OURS = {
    "curl": {"User-Agent": "curl/8.5.0", "Accept": "*/*"},
    "requests": {"User-Agent": "python-requests/2.34", "Accept": "*/*", "Accept-Encoding": "gzip, deflate"},
    "no headers": {},
    "our own page": {**CHROMIUM, "Accept": "*/*", "Referer": "http://192.168.1.5:8000/docs"},
    "a trusted page": {**CHROMIUM, "Accept": "*/*", "Referer": "http://gs.example:3000/map"},
    "JSON wanted": {"User-Agent": "okhttp/4.12", "Accept": "application/json, text/plain, */*"},
    "PowerShell": {"User-Agent": "Mozilla/5.0 (Windows NT; en-US) WindowsPowerShell/5.1"},
    "judged by its origin": {**CHROMIUM, "Origin": "http://192.168.1.5:8000"},
    "judged by its site": {**CHROMIUM, "Accept": PAGE, "Sec-Fetch-Site": "none"},
}


@pytest.mark.parametrize("headers", FOREIGN.values(), ids=FOREIGN)
def test_command_that_a_foreign_page_can_have_sent_is_refused(headers: dict[str, str]) -> None:
    check_origin({**LAN, **headers})
    with pytest.raises(Forbidden):
        check_page({**LAN, **headers}, ("http://gs.example:3000",))


@pytest.mark.parametrize("headers", OURS.values(), ids=OURS)
def test_programs_and_our_own_pages_command(headers: dict[str, str]) -> None:
    check_page({**LAN, **headers}, ("http://gs.example:3000",))


@pytest.mark.parametrize("path", ["/command/disarm?force=true", "/command/arm", "/movement/stop"])
def test_picture_of_a_foreign_page_commands_nothing_and_sees_nothing(flying: Drone, api: Api, path: str) -> None:
    headers = {**CHROMIUM, "Accept": IMAGE}
    assert api.get(path, headers=headers).status == 403
    assert flying.received == []
    assert api.get("/telemetry/gps", headers=headers).status == 200


def test_token_or_a_referer_of_ours_lets_a_browser_command(flying: Drone, api: Api, service: Service) -> None:
    service.settings = ApiModuleSettings({"token": "t"}, environ={}).snapshot()
    headers = {**CHROMIUM, "Accept": "*/*", "Authorization": "Bearer t"}
    assert api.get("/command/brake", headers=headers).status == 200


@pytest.mark.parametrize("name", ["raspberrypi.lan", "RaspberryPi.lan:8000", "drone7", "drone7.:8000"])
def test_name_of_the_setting_is_ours(flying: Drone, api: Api, service: Service, name: str) -> None:
    assert api.get("/command/arm", headers={"Host": name}).status == 403
    service.settings = settings(names="raspberrypi.lan, drone7")
    origin = {"Host": name, "Origin": f"http://{name}"}
    assert api.get("/command/arm", headers=origin).status == 200
    assert api.get("/command/arm", headers={**origin, "Host": "evil.example"}).status == 403
    assert api.get("/command/arm", headers={**origin, "Origin": "http://evil.example"}).status == 403


def test_foreign_name_hears_of_the_setting(api: Api, service: Service) -> None:
    answer = api.get("/jobs", headers={"Host": "raspberrypi.lan"})
    assert "not host 'raspberrypi.lan': the setting `names`" in answer.body["detail"]
    assert "token" not in answer.body["detail"]


def test_right_token_makes_any_name_right(flying: Drone, api: Api, service: Service) -> None:
    """Behind a proxy with another name, whether it passes its Host on or not."""
    service.settings = settings(token="t", names="")
    for host, origin in (("drone.example", "https://drone.example"), ("127.0.0.1:8000", "https://drone.example")):
        headers = {"Host": host, "Origin": origin, "X-Forwarded-For": "192.0.2.1"}
        assert api.post("/command/brake", headers={**headers, "Authorization": "Bearer t"}).status == 200
        assert api.post("/command/brake", headers={**headers, "Authorization": "Bearer no"}).status in (401, 403)


def test_page_that_asks_for_the_token_is_there_by_any_name(api: Api, loop: FastLoop, service: Service) -> None:
    service.settings = settings(token="t")

    async def status(path: str) -> int:
        headers = {"Host": "drone.example", "Accept": "text/html"}
        async with api.client.get(path, headers=headers) as response:
            return int(response.status)

    assert [loop.run(status(path)) for path in ("/", "/page/start.js", "/docs", "/jobs")] == [200, 200, 200, 401]
    answer = api.get("/jobs", headers={"Host": "drone.example"})
    assert "with the token any name is right" in answer.body["detail"]
    service.settings = settings()
    assert loop.run(status("/page/start.js")) == 403


# -- callers ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("header", ["Bearer t", "bearer  t ", "BEARER t"])
def test_token_is_known_however_its_scheme_is_written(header: str) -> None:
    assert has_token(header, "t")


@pytest.mark.parametrize("header", [None, "", "t", "Bearer", "Bearer T", "Bearer \udcff", "Basic t", "Bearer t t"])
def test_what_is_no_token_is_none(header: str | None) -> None:
    assert not has_token(header, "t")
    assert not has_token(header, "")


def settings(**values: Any) -> Any:
    return ApiModuleSettings(values, environ={}).snapshot()


def test_what_a_proxy_passes_on_needs_the_token_wherever_the_proxy_is() -> None:
    for header in ("X-Forwarded-For", "Forwarded", "X-Real-IP", "Via"):
        with pytest.raises(Forbidden, match="proxy"):
            check_caller("127.0.0.1", {header: "192.0.2.1"}, settings())
        with pytest.raises(Unauthorized):
            check_caller("10.0.0.1", {header: "x"}, settings(token="t", allow_from="10.0.0.0/8"))
        assert check_caller("127.0.0.1", {header: "x", "Authorization": "Bearer t"}, settings(token="t")).has_token


def test_network_is_known_however_its_addresses_are_written() -> None:
    check_caller("::ffff:10.0.0.5", {}, settings(token="t", allow_from="10.0.0.0/8"))
    with pytest.raises(Unauthorized):
        check_caller("::ffff:11.0.0.5", {}, settings(token="t", allow_from="10.0.0.0/8"))
    with pytest.raises(Forbidden):
        check_caller(None, {}, settings())


def test_setting_token_is_a_nameless_admin_and_a_named_one_decides(tmp_path: Path) -> None:
    file = tokens.write(tmp_path / "tokens", tokens.ALL)
    both = settings(token="t", tokens=file, allow_from="10.0.0.0/8")
    named = {b"tower-tower": Token("tower", Role.WATCH, frozenset(), b"")}
    caller = check_caller("10.0.0.1", tokens.bearer("tower"), both, named.get)
    assert (caller.role, caller.name, caller.flies(1)) == (Role.WATCH, "tower", False)
    for headers, remote in (({"Authorization": "Bearer t"}, "11.0.0.1"), ({}, "10.0.0.1")):
        caller = check_caller(remote, headers, both, named.get)
        assert (caller.role, caller.name, caller.flies(9)) == (Role.ADMIN, "", True)
        assert caller.operator.name == remote


def test_where_there_is_a_file_nobody_calls_without_a_token(tmp_path: Path) -> None:
    with_file = settings(tokens=str(tmp_path / "later"), allow_open=True)
    for remote in ("127.0.0.1", "192.0.2.1"):
        with pytest.raises(Unauthorized):
            check_caller(remote, {}, with_file)
    with pytest.raises(Forbidden):
        check_caller("192.0.2.1", {}, settings())
    assert check_caller("127.0.0.1", {}, settings()).role is Role.ADMIN


@pytest.mark.parametrize(
    "value", ["Bearer \xff", "Bearer \xff\xfe\x80", "\xff", "Bearer", "Bearer ", " ", "Basic \xe4"]
)
def test_bad_authorization_is_401_and_no_traceback(port: Port, caplog: pytest.LogCaptureFixture, value: str) -> None:
    answer = port.run(lambda: port.ask("GET", "/jobs", f"Authorization: {value}"))
    assert (answer.status, answer.body["code"]) == (401, "unauthorized")
    assert [record for record in caplog.records if record.exc_info] == []
