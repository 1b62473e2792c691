from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.companion import autopilot, plan, setup
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.launcher.options import parse


def at(root: Path, path: Any) -> Path:
    return root / str(path)[1:]


def given(root: Path, *options: str) -> list[str]:
    return ["--root", str(root), "--device", "/dev/ttyS7,57600", "--sysid", "3", *options]


def test_it_is_set_up_and_removed_and_records_stay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert setup.run(given(tmp_path, "--network", "--yes")) == 0
    said = capsys.readouterr().out
    assert "write /etc/mavproxy-uavapi/uav.ini: vehicle 3 at /dev/ttyS7, the API on every network" in said
    assert "#token=" in said and "█" in said
    api = IniFile(at(tmp_path, plan.CONFIG)).section("api")
    assert (api["uav_connection"], api["host"]) == ("/dev/ttyS7,57600", "0.0.0.0")
    tokens = at(tmp_path, plan.TOKENS)
    assert tokens.stat().st_mode & 0o777 == 0o600 and "owner admin sha256:" in tokens.read_text()
    assert setup.run(["--root", str(tmp_path), "--remove"]) == 0
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == [tokens]
    assert not at(tmp_path, plan.CONFIG).parent.exists()
    assert setup.run(["--root", str(tmp_path), "--remove"]) == 0
    assert "nothing is set up here" in capsys.readouterr().out


def test_what_somebody_else_put_beside_the_settings_stays(tmp_path: Path) -> None:
    setup.run(given(tmp_path, "--yes"))
    environment = at(tmp_path, plan.CONFIG).with_name("environment")
    environment.write_text("UAVAPI_TOKEN=x\n")
    assert setup.run(["--root", str(tmp_path), "--remove"]) == 0
    assert environment.exists()


def test_a_second_time_it_keeps_the_settings_and_the_tokens(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    setup.run(given(tmp_path, "--network", "--yes"))
    config, tokens = at(tmp_path, plan.CONFIG), at(tmp_path, plan.TOKENS)
    config.write_text(config.read_text() + "\n[vision]\nsource = camera:0\n")
    before = config.read_text(), tokens.read_text()
    capsys.readouterr()
    assert setup.run(given(tmp_path, "--network", "--yes")) == 0
    assert (config.read_text(), tokens.read_text()) == before
    said = capsys.readouterr().out
    assert "keep /etc/mavproxy-uavapi/uav.ini" in said and "#token=" not in said


def test_it_asks_what_it_does_not_hear_and_does_nothing_without_a_yes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(autopilot, "ports", lambda: ["/dev/likely", "/dev/other"])
    monkeypatch.setattr(autopilot, "hear", lambda device, bauds: None)
    asked: list[str] = []
    answers = iter(["", "12", "n", "no"])

    def ask(question: str) -> str:
        asked.append(question)
        return next(answers)

    options = setup._arguments().parse_args(["--root", str(tmp_path)])
    assert setup.Setup(tmp_path, ask).install(options) == 1
    assert [question.split(" [")[0] for question in asked] == [
        "the autopilot's serial port",
        "the vehicle's system id",
        "may other machines call it, with a token?",
        "go on?",
    ]
    assert list(tmp_path.iterdir()) == []


def test_every_answer_that_makes_no_sense_is_asked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(autopilot, "ports", list)
    (tmp_path / "a.log").write_text("a log")
    answers = [
        "",
        "/dev/no-such-port",
        str(tmp_path / "a.log"),
        "/dev/tty S0",
        "/dev/ttyS7,fast",
        "udpin:here",
        "udp:0.0.0.0:1",
    ]
    answers += ["udpin:127.0.0.1:0.5", "/dev/ttyS7,57600", "one", "256", "7", "perhaps", "y", "oui", "yes"]
    hear = autopilot.hear
    monkeypatch.setattr(
        autopilot, "hear", lambda device, bauds: None if device == "/dev/ttyS7" else hear(device, bauds)
    )
    options = setup._arguments().parse_args(["--root", str(tmp_path)])
    left = iter(answers)
    assert setup.Setup(tmp_path, lambda question: next(left)).install(options) == 0
    assert next(left, None) is None
    said = capsys.readouterr().out
    for why in (
        "connect the autopilot",
        "no-such-port",
        "no serial port",
        "'fast' is no number",
        "udpin, udpout, tcp",
    ):
        assert why in said
    api = IniFile(at(tmp_path, plan.CONFIG)).section("api")
    assert (api["uav_connection"], api["sysid"], api["host"]) == ("/dev/ttyS7,57600", "7", "0.0.0.0")


def test_it_takes_what_it_hears(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(autopilot, "ports", lambda: ["/dev/likely"])
    heard = autopilot.Autopilot("/dev/likely", 57600, 9, "plane")
    monkeypatch.setattr(autopilot, "hear", lambda device, bauds: heard)
    assert setup.run(["--root", str(tmp_path), "--yes"]) == 0
    options = parse(["--config", str(at(tmp_path, plan.CONFIG))])
    assert (options.uav_connection, options.sysid, options.host) == ("/dev/likely,57600", 9, "127.0.0.1")


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (["--device", "/dev/ttyS7,fast"], "the baud rate: 'fast' is no number"),
        (["--device", "/dev/ttyS7,57600", "--sysid", "256"], "system ids are 1 to 255"),
        (["--device", "udpin:here"], "udpin:here: "),
        (["--device", "udp:0.0.0.0:14550"], "udpin, udpout, tcp"),
        (["--device", "/etc"], "it is no serial port"),
    ],
)
def test_what_makes_no_sense_is_said_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], why: str
) -> None:
    assert setup.run(["--root", str(tmp_path), "--yes", *options]) == 1
    error = capsys.readouterr().err
    assert why in error and error.count("\n") == 1 and list(tmp_path.iterdir()) == []


def test_settings_that_stay_get_no_token_that_they_do_not_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    setup.run(given(tmp_path, "--yes"))
    assert setup.run(given(tmp_path, "--network", "--yes")) == 0
    assert not at(tmp_path, plan.TOKENS).exists() and "#token=" not in capsys.readouterr().out


def test_without_a_port_it_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(autopilot, "ports", list)
    assert setup.run(["--root", str(tmp_path), "--yes"]) == 1
    assert "connect the autopilot" in capsys.readouterr().err


def test_here_it_needs_root(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(setup.os, "geteuid", lambda: 1000)
    assert setup.run(["--yes"]) == 1
    assert "sudo" in capsys.readouterr().err
