from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.settings import ApiModuleSettings, SettingError


@pytest.fixture
def ini(tmp_path: Path) -> Any:
    """Write an INI file."""

    def write(text: str) -> str:
        file = tmp_path / "uavapi.ini"
        file.write_text(text, encoding="utf-8")
        return str(file)

    return write


def test_defaults_are_safe() -> None:
    settings = ApiModuleSettings().snapshot()
    assert (settings.host, settings.port, settings.sysid) == ("127.0.0.1", 8000, 0)
    assert (settings.link_timeout, settings.max_age) == (5.0, 5.0)


def test_values_are_taken_as_text_too() -> None:
    settings = ApiModuleSettings({"port": "8001", "max_age": "2.5", "host": "localhost"}).snapshot()
    assert (settings.port, settings.max_age, settings.host) == (8001, 2.5, "localhost")


def test_snapshot_does_not_change() -> None:
    settings = ApiModuleSettings()
    before = settings.snapshot()
    settings.set("port", 9000)
    assert (before.port, settings.snapshot().port) == (8000, 9000)


def test_misspelt_setting_is_answered_with_the_nearest() -> None:
    with pytest.raises(SettingError, match=r"^no setting 'prot'; did you mean port\?$"):
        ApiModuleSettings({"prot": 8001})


def test_unknown_setting_is_answered_with_all_there_are() -> None:
    with pytest.raises(SettingError, match=r"^no setting 'xyz'; there are host, port, sysid, .*max_age"):
        ApiModuleSettings({"xyz": 1})


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("port", "http", "it takes a int from 1 to 65535"),
        ("port", 0, "from 1 to 65535"),
        ("port", 70000, "from 1 to 65535"),
        ("sysid", 256, "from 0 to 255"),
        ("sysid", -1, "from 0 to 255"),
        ("link_timeout", 0.5, "from 1 to 60"),
        ("link_timeout", "nan", "from 1 to 60"),
        ("max_age", float("nan"), "it takes a float from 0.1 to 3600"),
        ("max_age", "inf", "from 0.1 to 3600"),
        ("max_age", None, "it takes a float"),
    ],
)
def test_bad_value_is_one_clear_line_and_changes_nothing(name: str, value: Any, words: str) -> None:
    settings = ApiModuleSettings()
    before = settings.snapshot()
    with pytest.raises(SettingError) as caught:
        settings.set(name, value)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{name} = ")
    assert "\n" not in str(caught.value)
    assert settings.snapshot() == before


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "localhost"])
def test_loopback_may_be_listened_on(host: str) -> None:
    assert ApiModuleSettings({"host": host}).snapshot().host == host


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::", "10.0.0.1"])
def test_network_may_not_be_listened_on(host: str) -> None:
    with pytest.raises(SettingError, match="anybody on that network could fly the vehicle"):
        ApiModuleSettings({"host": host})


@pytest.mark.parametrize("host", ["drone.local", "", "127.0.0.1.evil.example"])
def test_host_is_an_address(host: str) -> None:
    with pytest.raises(SettingError, match="is not an IP address"):
        ApiModuleSettings({"host": host})


def test_ini_file_of_the_original_service_loads(ini: Any) -> None:
    file = ini(
        "[api]\nport = 8123\nsysid = 7\nuav_connection = 127.0.0.1:17171\nconnection_type = udpin\n"
        "gradys_gs = None\nscripts_path = ~/scripts\npython_path = python3\nvehicle = copter\n"
        "[simulated]\nardupilot_path = ~/ardupilot\nlocation = AbraDF\ngs_connection = []\nspeedup = 1\n"
        "headless = yes\n"
        "[logs]\nlog_console = COPTER\nlog_path = None\ndebug = []\nscript_logs = ~/logs\n"
    )
    settings = ApiModuleSettings({"config": file}).snapshot()
    assert (settings.port, settings.sysid) == (8123, 7)


def test_settings_that_are_given_win_over_the_file(ini: Any) -> None:
    file = ini("[api]\nport = 8123\nsysid = 7\n")
    settings = ApiModuleSettings({"port": 9000, "config": file}).snapshot()
    assert (settings.port, settings.sysid) == (9000, 7)


@pytest.mark.parametrize("unset", ["", "None", "[]"])
def test_unset_values_leave_the_default(ini: Any, unset: str) -> None:
    assert ApiModuleSettings({"config": ini(f"[api]\nport = {unset}\n")}).snapshot().port == 8000


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[api]\nprot = 1\n", "no key 'prot' in \\[api\\]"),
        ("[simulated]\nport = 1\n", "no key 'port' in \\[simulated\\]"),
        ("[apy]\nport = 1\n", "no section \\[apy\\]; there are api, simulated, logs"),
        ("[api]\nport = high\n", "it takes a int"),
        ("[api]\nhost = 0.0.0.0\n", "anybody on that network"),
        ("port = 1\n", "no section headers"),
        ("[api]\nport = 1\nport = 2\n", "already exists"),
    ],
)
def test_file_that_means_nothing_is_refused_in_one_line(ini: Any, text: str, words: str) -> None:
    with pytest.raises(SettingError, match=words) as caught:
        ApiModuleSettings({"config": ini(text)})
    assert "\n" not in str(caught.value)


def test_missing_file_is_noticed(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"nowhere\.ini: No such file"):
        ApiModuleSettings({"config": str(tmp_path / "nowhere.ini")})


def test_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "uavapi.ini"
    file.write_bytes(b"[api]\nport = \xff\xfe\n")
    with pytest.raises(SettingError, match="uavapi.ini"):
        ApiModuleSettings({"config": str(file)})


def test_percent_signs_are_taken_as_they_are(ini: Any) -> None:
    assert ApiModuleSettings({"config": ini("[logs]\nscript_logs = /tmp/%Y\n")}).snapshot().port == 8000


def origins(settings: ApiModuleSettings) -> dict[str, str]:
    return {line.split()[0]: line.split()[-1] for line in settings.listing()}


def test_later_origins_win_and_each_is_told(ini: Any) -> None:
    file = ini("[api]\nport = 8001\nmax_age = 1\nscript_grace = 1\nlink_timeout = 1\n")
    environ = {"UAVAPI_MAX_AGE": "2", "UAVAPI_SCRIPT_GRACE": "2", "UAVAPI_LINK_TIMEOUT": "2"}
    settings = ApiModuleSettings({"config": file, "script_grace": 3, "link_timeout": 3}, environ)
    settings.set("link_timeout", 4)
    now = settings.snapshot()
    assert (now.port, now.max_age, now.script_grace, now.link_timeout) == (8001, 2, 3, 4)
    told = origins(settings)
    assert (told["host"], told["port"], told["max_age"]) == ("default", file, "environment")
    assert (told["script_grace"], told["link_timeout"]) == ("load", "set")  # `module load`, `uavapi set`


def test_launcher_tells_where_it_had_them_from(ini: Any) -> None:
    given = {"config": ini("[api]\nscript_grace = 1\n"), "port": 8001, "sysid": 3}
    given["origins"] = {"port": "uav.ini", "script_grace": "uav.ini", "max_age": "uav.ini"}
    told = origins(ApiModuleSettings(given, {"UAVAPI_MAX_AGE": "2"}))
    assert (told["port"], told["script_grace"], told["max_age"]) == ("uav.ini", "uav.ini", "environment")


def test_refused_value_leaves_the_origin_as_it_was() -> None:
    settings = ApiModuleSettings()
    with pytest.raises(SettingError, match="anybody on that network"):
        settings.set("host", "0.0.0.0")
    assert origins(settings)["host"] == "default"


def test_each_key_that_is_ignored_is_told_of_in_one_line(ini: Any) -> None:
    keys = {"api": ["uav_connection", "connection_type", "gradys_gs", "vehicle", "udp"]}
    keys["simulated"] = ["simulated", "ardupilot_path", "location", "speedup", "headless", "gs_connection"]
    file = ini("".join(f"[{section}]\n" + "".join(f"{name} = 1\n" for name in keys[section]) for section in keys))
    notes = ApiModuleSettings({"config": file}).notes
    assert [note.removeprefix(f"{file}: ").split()[0] for note in notes] == [*keys["api"], *keys["simulated"]]
    assert notes[0].endswith("uav_connection is ignored here, MAVProxy has the link (--master)")


def test_what_is_listened_on_and_who_may_call_needs_listening_anew() -> None:
    settings = ApiModuleSettings()
    before = settings.snapshot()
    settings.set("script_grace", 3)
    settings.set("log_console", "API")
    assert settings.snapshot().listens_as(before)
    settings.set("token", "secret")
    assert not settings.snapshot().listens_as(before)


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
    with pytest.raises(SettingError, match="allow_scripts_from: 'here' is no network"):
        ApiModuleSettings({"allow_scripts_from": "here"}, environ={})
