"""Logs by component."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from mavproxy_uavapi.core.logs import Logs, component_of, components, log_file


@pytest.fixture
def output() -> list[str]:
    return []


@pytest.fixture
def logs(output: list[str]) -> Iterator[Logs]:
    made = Logs(output.append)
    yield made
    made.close()


@pytest.mark.parametrize(
    ("logger", "component"),
    [("uavapi.copter", "COPTER"), ("uavapi.http", "API"), ("gradys.push", "GRADYS_GS"), ("uavapi.script", "SCRIPT")],
)
def test_every_logger_speaks_for_a_component(logger: str, component: str) -> None:
    assert component_of(logger) == component


def test_component_names_are_the_originals_with_aliases() -> None:
    assert components("[VEHICLE, api, copter]") == ("COPTER", "API")
    assert components("None") == components("[]") == components("") == ()
    with pytest.raises(ValueError, match="no log component ROTOR"):
        components("ROTOR")


def test_console_shows_what_was_requested_and_every_warning(logs: Logs, output: list[str]) -> None:
    logs.open(frozenset({"COPTER"}), frozenset(), "", 1)
    logging.getLogger("uavapi.copter").info("climbing")
    logging.getLogger("uavapi.http").info("a request")
    logging.getLogger("uavapi.http").warning("too many of them")
    logging.getLogger("uavapi.copter").debug("in detail")
    assert output == ["COPTER: climbing", "API: too many of them"]


def test_debug_shows_a_component_in_detail(logs: Logs, output: list[str]) -> None:
    logs.open(frozenset({"COPTER"}), frozenset({"COPTER"}), "", 1)
    logging.getLogger("uavapi.copter").debug("in detail")
    assert output == ["COPTER: in detail"]


def test_file_has_all_components_with_time_and_level(logs: Logs, tmp_path: Path) -> None:
    logs.open(frozenset(), frozenset(), str(tmp_path / "uav.log"), 1)
    logging.getLogger("uavapi.copter").info("climbing")
    logging.getLogger("gradys").warning("no station")
    logs.close()
    lines = (tmp_path / "uav.log").read_text(encoding="utf-8").splitlines()
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} COPTER INFO climbing", lines[0])
    assert lines[1].endswith("GRADYS_GS WARNING no station")


def test_folder_gets_a_file_named_after_the_vehicle(tmp_path: Path) -> None:
    assert log_file(str(tmp_path / "logs"), 7) == tmp_path / "logs" / "uav_7.log"
    assert log_file(str(tmp_path / "a" / "b.txt"), 7) == tmp_path / "a" / "b.txt"


def test_nothing_is_left_behind(logs: Logs, output: list[str], tmp_path: Path) -> None:
    for _ in range(3):
        logs.open(frozenset({"API"}), frozenset(), str(tmp_path / "uav.log"), 1)
    logging.getLogger("uavapi.http").info("once")
    assert output == ["API: once"]
    logs.close()
    logging.getLogger("uavapi.http").warning("after")
    assert output == ["API: once"]
    assert logging.getLogger("uavapi").handlers == []


def test_file_that_cannot_be_opened_leaves_the_logs_as_they_were(
    logs: Logs, output: list[str], tmp_path: Path
) -> None:
    logs.open(frozenset({"API"}), frozenset(), str(tmp_path / "uav.log"), 1)
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file"):
        logs.open(frozenset(), frozenset(), str(tmp_path / "file" / "uav.log"), 1)
    logging.getLogger("uavapi.http").info("still here")
    logs.close()
    assert output == ["API: still here"]
    assert "still here" in (tmp_path / "uav.log").read_text(encoding="utf-8")


def test_full_disk_is_reported_once_and_breaks_nothing(
    logs: Logs, output: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    logs.open(frozenset(), frozenset(), "/dev/full", 1)
    for _ in range(3):
        logging.getLogger("uavapi.http").info("a request")
    logs.close()
    assert len(output) == 1 and "cannot write /dev/full: [Errno 28]" in output[0]
    assert capsys.readouterr().err == ""


def test_file_is_rotated(logs: Logs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_uavapi.core.logs.FILE_BYTES", 1000)
    logs.open(frozenset(), frozenset(), str(tmp_path / "uav.log"), 1)
    for number in range(200):
        logging.getLogger("uavapi.http").info("request %d", number)
    logs.close()
    files = sorted(file.name for file in tmp_path.iterdir())
    assert files == ["uav.log", "uav.log.1", "uav.log.2", "uav.log.3"]
    assert all(file.stat().st_size <= 1000 for file in tmp_path.iterdir())
    assert "request 199" in (tmp_path / "uav.log").read_text(encoding="utf-8")


def test_what_a_client_wrote_is_one_line_on_the_console_and_in_the_file(
    logs: Logs, output: list[str], tmp_path: Path
) -> None:
    logs.open(frozenset({"API"}), frozenset(), str(tmp_path / "uav.log"), 1)
    logging.getLogger("uavapi.http").info("asked for %s", "\x1b[2J\nAPI ERROR forged\u202e")
    try:
        raise ValueError("\x1b[31m")
    except ValueError:
        logging.getLogger("uavapi.http").exception("a defect")
    logs.close()
    text = (tmp_path / "uav.log").read_text(encoding="utf-8")
    for shown in ("\n".join(output), text):
        assert "asked for \\x1b[2J\\nAPI ERROR forged\\u202e" in shown
        assert "\nValueError: \\x1b[31m" in shown
        assert "\x1b" not in shown
