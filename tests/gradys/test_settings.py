from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.settings import GradysModuleSettings
from mavproxy_uavapi.core.errors import SettingError


def test_an_ini_file_of_the_original_service_names_the_station(tmp_path: Path) -> None:
    ini = tmp_path / "uav.ini"
    ini.write_text(
        "[api]\nport = 8000\ngradys_gs = 10.0.0.5:8000\n[logs]\ndebug = []\n"
        "[gradys]\nperiod = 2\nquantities = position@1\n  alt=GLOBAL_POSITION_INT.relative_alt*0.001@1[m]\n"
    )
    settings = GradysModuleSettings({"config": str(ini), "period": 3}).snapshot()
    assert [station.url for station in settings.gs] == ["http://10.0.0.5:8000"]
    assert settings.period == 3.0
    assert [quantity.name for quantity in settings.quantities] == ["position", "alt"]


@pytest.mark.parametrize("text", ["[gradys]\nnope = 1\n", "[gradys]\nperiod = x\n", "no section\n"])
def test_an_ini_file_that_means_nothing_is_refused(tmp_path: Path, text: str) -> None:
    ini = tmp_path / "uav.ini"
    ini.write_text(text)
    with pytest.raises(SettingError):
        GradysModuleSettings({"config": str(ini)})


@pytest.mark.parametrize(
    "name,value",
    [("gs", "x:y"), ("ip", "a b"), ("period", float("nan")), ("period", "inf"), ("timeout", 0), ("token", "a\nb"),
     ("sink", "ftp://x"), ("quantities", "x"), ("ca_file", "/no/such"), ("spool_mb", -1), ("nope", 1),
     ("sink", "mqtt://broker/fleet/+/x"), ("sink", "mqtt://broker/a#b"),
     ("device", ""), ("device", "a/b"), ("device", "a b"), ("device", "é"), ("device", "x" * 61), ("sink", "mqtts://broker/a?b"),
     ("sink", "mqtt://broker/a%23"), ("gs", "a..b:80"),
     ("spool", "a\0b"), ("sink", "http://a/r#ack=200"), ("sink", "mqtt://broker/a#ack=status")],
)  # fmt: skip
def test_what_cannot_work_is_refused(name: str, value: Any) -> None:
    with pytest.raises(SettingError):
        GradysModuleSettings({name: value})


def test_a_sinks_option_is_no_comment_of_an_ini_file(tmp_path: Path) -> None:
    ini = tmp_path / "uav.ini"
    ini.write_text("[gradys]\nsink = http://h/r#ack=status, mqtt://b/t\n")
    settings = GradysModuleSettings({"config": str(ini)})
    assert [sink.status_counts for sink in settings.snapshot().sink] == [True, False]
    assert settings.shown("sink") == "http://h/r#ack=status,mqtt://b/t"


def test_none_unsets() -> None:
    settings = GradysModuleSettings({"gs": "a:1"})
    settings.set("gs", "None")
    assert settings.snapshot().gs == ()


def test_passwords_are_not_shown() -> None:
    settings = GradysModuleSettings({"token": "s3cret", "sink": "mqtt://me:pass@broker/x"})
    assert settings.shown("token") == "(set)"
    assert settings.shown("sink") == "mqtt://me:***@broker/x"


COMMAND = 'soil=file:/run/soil.txt@5[percent], hum=exec:"read-humidity --bus 1"@30[percent]'


def test_only_an_ini_file_has_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ini = tmp_path / "uav.ini"
    ini.write_text(f"[gradys]\nquantities = {COMMAND}\n")
    settings = GradysModuleSettings({"config": str(ini)})
    assert settings.snapshot().quantities[1].command == ("read-humidity", "--bus", "1")
    settings.set("period", 2)  # the file's commands stay
    before = settings.snapshot()
    with pytest.raises(SettingError, match="hum: only an INI file may have exec:"):
        settings.set("quantities", COMMAND)
    assert settings.snapshot() == before
    for values in ({"quantities": COMMAND}, {"quantities": COMMAND, "origins": {"quantities": str(ini)}}):
        with pytest.raises(SettingError, match="INI file"):
            GradysModuleSettings(values)
    monkeypatch.setenv("GRADYS_QUANTITIES", COMMAND)
    with pytest.raises(SettingError, match=r"GRADYS_QUANTITIES: .*INI file"):
        GradysModuleSettings({})


def test_a_file_may_be_set_at_the_prompt() -> None:
    settings = GradysModuleSettings({})
    settings.set("quantities", "soil=file:/run/soil.txt@5[percent]")
    assert settings.snapshot().quantities[0].file == "/run/soil.txt"
    settings.set("quantities", "None")
    assert settings.snapshot().quantities == ()
