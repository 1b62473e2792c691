from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.errors import Forbidden
from mavproxy_uavapi.http.security import check_origin, is_our_name

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
    flying: Any, api: Any, loop: Any, method: str, path: str, headers: dict[str, str]
) -> None:
    answer = loop.run(api.ask(method, path, headers=headers))
    assert (answer.status, answer.body["code"]) == (403, "forbidden")
    assert flying.got == []


def test_page_of_another_site_may_not_open_a_websocket(flying: Any, api: Any, loop: Any) -> None:
    from aiohttp import WSServerHandshakeError

    async def connect() -> None:
        await api.client.ws_connect("/telemetry/stream", headers={"Origin": "http://evil.example"})

    with pytest.raises(WSServerHandshakeError) as caught:
        loop.run(connect())
    assert caught.value.status == 403
