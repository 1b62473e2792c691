from __future__ import annotations

from typing import Any

import pytest

from mavproxy_gradys.net.addresses import api_note, checked_ip, ip_field, own_address, station, stations
from mavproxy_gradys.net.resolver import Resolver
from mavproxy_uavapi.core.errors import SettingError
from tests.support.virtual_time import FastLoop


@pytest.mark.parametrize(
    "text,url,host,port",
    [
        ("10.0.0.5:8000", "http://10.0.0.5:8000", "10.0.0.5", 8000),
        ("gs.local", "http://gs.local", "gs.local", 80),
        ("[2001:db8::5]:8000", "http://[2001:db8::5]:8000", "2001:db8::5", 8000),
        ("https://gs.example/", "https://gs.example", "gs.example", 443),
        ("http://10.0.0.5:80", "http://10.0.0.5:80", "10.0.0.5", 80),
    ],
)
def test_a_station_as_people_write_it(text: str, url: str, host: str, port: int) -> None:
    address = station(text)
    assert (address.url, address.host, address.port) == (url, host, port)
    assert address.update_url == f"{url}/update-info/"


@pytest.mark.parametrize(
    "text",
    [
        "10.0.0.5:many",
        "10.0.0.5:70000",
        "::1:8000",
        "ftp://x",
        "http://",
        "a b:80",
        "x:1/path",
        "u:p@x:1",
        "a..b:80",
        f"{'x' * 70}.lan:80",
        "[fe80::1%eth0]:8000",
    ],
)
def test_what_is_no_station_is_refused(text: str) -> None:
    with pytest.raises(SettingError):
        station(text)


def test_several_stations_are_listed_once_each() -> None:
    assert [s.host for s in stations("a:1, b:1,,a:1")] == ["a", "b"]
    assert stations("") == ()


@pytest.mark.parametrize(
    "setting,own,api,field",
    [
        ("", "192.0.2.2", ("0.0.0.0", 8000), "192.0.2.2:8000/"),
        ("", "2001:db8::2", ("::", 8000), "[2001:db8::2]:8000/"),
        ("", "fe80::2%eth0", ("::", 8000), "[fe80::2]:8000/"),
        ("", "192.0.2.2", None, "192.0.2.2/"),
        ("192.0.2.9", "", ("0.0.0.0", 8000), "192.0.2.9:8000/"),
        ("http://192.0.2.9:81/", "", ("0.0.0.0", 8000), "192.0.2.9:81/"),
        ("[2001:db8::2]", "", ("::", 8000), "[2001:db8::2]:8000/"),
        ("uav.local", "", None, "uav.local/"),
    ],
)
def test_ip_has_no_scheme_and_ends_in_a_slash(setting: str, own: str, api: Any, field: str) -> None:
    assert ip_field(setting, own, api) == field


def test_ip_that_no_station_could_call_is_refused() -> None:
    for text in ("a b", "x/y", "http://", "x:many"):
        with pytest.raises(SettingError):
            checked_ip(text)


def test_the_note_says_when_the_station_cannot_command_us() -> None:
    assert "not listening" in api_note(None, "10.0.0.5")
    assert "127.0.0.1 only" in api_note(("127.0.0.1", 8000), "10.0.0.5")
    assert api_note(("127.0.0.1", 8000), "localhost") == ""
    assert api_note(("0.0.0.0", 8000), "10.0.0.5") == ""


def test_own_address_is_that_of_the_interface_that_reaches_the_station(loop: FastLoop) -> None:
    names = Resolver()
    assert loop.run(own_address(names, "127.0.0.1", 9)) == "127.0.0.1"
    with pytest.raises(OSError):
        loop.run(own_address(names, "no.such.host.invalid", 9))
