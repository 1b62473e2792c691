from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.launcher import options
from mavproxy_uavapi.settings import SECTIONS, ApiModuleSettings


def test_defaults_are_safe() -> None:
    settings = ApiModuleSettings().snapshot()
    assert (settings.host, settings.port, settings.sysid) == ("127.0.0.1", 8000, 0)
    assert (settings.link_timeout, settings.max_age) == (5.0, 5.0)


def test_snapshot_does_not_change() -> None:
    settings = ApiModuleSettings()
    before = settings.snapshot()
    settings.set("port", 9000)
    assert (before.port, settings.snapshot().port) == (8000, 9000)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "localhost"])
def test_loopback_may_be_listened_on(host: str) -> None:
    assert ApiModuleSettings({"host": host}).snapshot().host == host


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::", "10.0.0.1"])
def test_network_may_not_be_listened_on(host: str) -> None:
    with pytest.raises(SettingError, match="everybody on that network could fly the vehicle"):
        ApiModuleSettings({"host": host})


@pytest.mark.parametrize("host", ["drone.local", "", "127.0.0.1.evil.example"])
def test_host_is_an_address(host: str) -> None:
    with pytest.raises(SettingError, match="is not an IP address"):
        ApiModuleSettings({"host": host})


def test_names_are_host_names(ini: Callable[[str], str]) -> None:
    file = ini("[api]\nnames = raspberrypi.lan, drone_7\n")
    assert ApiModuleSettings({"config": file}).snapshot().names == ("raspberrypi.lan", "drone_7")
    assert ApiModuleSettings({"names": "None"}).snapshot().names == ()
    for wrong in ("raspberrypi.lan:8000", "http://raspberrypi.lan", "*", ".lan"):
        with pytest.raises(SettingError, match="is not a host name such as raspberrypi.lan, without a port"):
            ApiModuleSettings({"names": wrong})


def test_ini_file_of_the_original_service_loads(ini: Callable[[str], str]) -> None:
    file = ini(
        "[api]\nport = 8123\nsysid = 7\nuav_connection = 127.0.0.1:17171\nconnection_type = udpin\n"
        "gradys_gs = None\nscripts_path = ~/scripts\npython_path = python3\nvehicle = copter\n"
        "[simulated]\nardupilot_path = ~/ardupilot\nlocation = AbraDF\ngs_connection = []\nspeedup = 1\n"
        "headless = yes\n"
        "[logs]\nlog_console = COPTER\nlog_path = None\ndebug = []\nscript_logs = ~/logs\n"
        "[mode]\nsimulated = false\nvehicle = copter\n[udp]\nudp = false\n"
    )
    settings = ApiModuleSettings({"config": file}).snapshot()
    assert (settings.port, settings.sysid) == (8123, 7)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[api]\nprot = 1\n", "no key 'prot' in \\[api\\]"),
        ("[simulated]\nspedup = 1\n", "no key 'spedup' in \\[simulated\\]; did you mean speedup\\?"),
        ("[apy]\nport = 1\n", "no section \\[apy\\]; did you mean api\\?"),
        ("[api]\nport = high\n", "it takes a whole number"),
        ("[api]\nhost = 0.0.0.0\n", "everybody on that network"),
        ("[api]\nuav_conection = x\n", "did you mean uav_connection\\?"),
    ],
)
def test_file_that_means_nothing_is_refused_in_one_line(ini: Callable[[str], str], text: str, words: str) -> None:
    with pytest.raises(SettingError, match=words) as caught:
        ApiModuleSettings({"config": ini(text)})
    assert "\n" not in str(caught.value)


VALUES = {
    "firmware": "4.6",
    "connection_type": "tcp",
    "vehicle": "rover",
    "vehicles": "copter:2",
    "log_console": "API",
    "debug": "API",
}
VALUES |= {"host": "127.0.0.1", "gradys_gs": "127.0.0.1:5000", "location": "AbraDF", "uav_connection": "127.0.0.1:1"}
VALUES["firmware"] = "4.6"


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("row", options.TABLE, ids=lambda row: row.name)
def test_key_of_the_launcher_is_read_by_both_in_any_section(
    ini: Callable[[str], str], row: Any, section: str
) -> None:
    names = {"certfile": ("certfile", "keyfile"), "keyfile": ("certfile", "keyfile")}.get(row.name, (row.name,))
    file = ini("".join([f"[{section}]\n", *(f"{name} = {VALUES.get(name, '1')}\n" for name in names)]))
    assert row.name in options.read_ini(Path(file), {})
    ApiModuleSettings({"config": file}, environ={})


def test_each_key_that_is_ignored_is_reported_in_one_line(ini: Callable[[str], str]) -> None:
    keys = {"api": ["uav_connection", "connection_type", "gradys_gs", "vehicle", "udp"]}
    keys["simulated"] = ["simulated", "ardupilot_path", "location", "speedup", "headless", "gs_connection"]
    file = ini("".join(f"[{section}]\n" + "".join(f"{name} = 1\n" for name in keys[section]) for section in keys))
    notes = ApiModuleSettings({"config": file}).notes
    assert [note.removeprefix(f"{file}: ").split()[0] for note in notes] == [*keys["api"], *keys["simulated"]]
    assert notes[0].endswith("uav_connection is ignored here, MAVProxy has the link (--master)")


def test_address_and_access_need_a_restart_of_the_server() -> None:
    settings = ApiModuleSettings()
    before = settings.snapshot()
    settings.set("script_grace", 3)
    settings.set("log_console", "API")
    assert settings.snapshot().listens_as(before)
    settings.set("token", "secret")
    assert not settings.snapshot().listens_as(before)


def test_ports_name_the_vehicle_at_each() -> None:
    settings = ApiModuleSettings({"ports": "8001:1, 8002:2"}, environ={}).snapshot()
    assert settings.listening == {8000: 0, 8001: 1, 8002: 2}
    assert ApiModuleSettings({"ports": "8000:7"}, environ={}).snapshot().listening == {8000: 7}


@pytest.mark.parametrize(
    "text", ["8001", "8001:", ":1", "8001:0", "8001:256", "70000:1", "0:1", "8001:1,8001:2", "a:b"]
)
def test_ports_that_mean_nothing_are_refused(text: str) -> None:
    with pytest.raises(SettingError):
        ApiModuleSettings({"ports": text}, environ={}).snapshot()


def test_rate_that_is_set_is_for_this_machine_too() -> None:
    settings = ApiModuleSettings(environ={})
    assert (settings.snapshot().max_rate, settings.snapshot().local_rate) == (500.0, 0.0)
    settings.set("max_rate", "10")
    assert (settings.snapshot().max_rate, settings.snapshot().local_rate) == (10.0, 10.0)
    with pytest.raises(SettingError):
        settings.set("max_rate", "0")
    assert settings.snapshot().local_rate == 10.0
    assert ApiModuleSettings(environ={"UAVAPI_MAX_RATE": "500"}).snapshot().local_rate == 500.0


def test_networks_that_may_run_scripts_are_networks() -> None:
    snapshot = ApiModuleSettings({"allow_scripts_from": "10.0.0.0/8, fd00::/8"}, environ={}).snapshot()
    assert [str(network) for network in snapshot.allow_scripts_from] == ["10.0.0.0/8", "fd00::/8"]
    with pytest.raises(SettingError, match="allow_scripts_from: 'here' is not a network"):
        ApiModuleSettings({"allow_scripts_from": "here"}, environ={})


@pytest.mark.parametrize(
    ("keywords", "url"),
    [
        ({}, "http://127.0.0.1:8000"),
        ({"host": "0.0.0.0", "token": "t", "port": 81}, "http://127.0.0.1:81"),
        ({"host": "::", "token": "t"}, "http://[::1]:8000"),
        ({"host": "192.168.1.5", "token": "t"}, "http://192.168.1.5:8000"),
        ({"certfile": "c", "keyfile": "k"}, "https://127.0.0.1:8000"),
    ],
)
def test_address_is_one_that_this_machine_can_reach(keywords: dict[str, Any], url: str) -> None:
    assert ApiModuleSettings(keywords, environ={}).snapshot().local_url == url
