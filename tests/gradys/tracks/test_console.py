from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.tracks.console import TrackConsole, argument_parser, read, report_text
from mavproxy_gradys.tracks.service import Tracking
from mavproxy_uavapi.core.background import BackgroundCommands
from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.host import Host
from tests.gradys.conftest import TelemetrySource
from tests.support.virtual_time import FastLoop


@pytest.mark.parametrize(
    "option",
    ["--ground nan", "--ground inf", "--ground 9001", "--ground -501", "--reach nan", "--reach inf", "--reach 0",
     "--reach 100001", "--transit nan", "--transit 501", "--ground x"],
)  # fmt: skip
def test_a_number_that_cannot_be_flown_by_is_refused(option: str) -> None:
    with pytest.raises(BadRequest):
        argument_parser().parse_args(["fly", "a.track", *option.split()])


def test_numbers_within_their_limits_are_taken() -> None:
    arguments = argument_parser().parse_args(
        ["fly", "a.track", "--ground", "-3.5", "--reach", "200", "--transit", "20"]
    )
    assert (arguments.ground, arguments.reach, arguments.transit) == (-3.5, 200.0, 20.0)


def test_all_flights_are_shown() -> None:
    flight: dict[str, Any] = {"state": "running", "error": None, "stage": "flying", "leg": 2, "legs": 5}
    output = report_text({"recording": None, "flights": [{**flight, "vehicle": 1}, {**flight, "vehicle": 2}]})
    assert output.splitlines() == [f"track flight running, vehicle {n}: flying, leg 2 of 5" for n in (1, 2)]
    assert report_text({"recording": None, "flights": []}) == "no track is recorded or flown"


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("fly a.track", "gradys: a.track cannot be read: No such file or directory"),  # vehicle 10 would do
        ("fly a.track --sysid 11", "gradys: no vehicle 11 on the link yet; heard so far: 10"),
        ("fly --sysid 11 a.track --sysid 10", "gradys: a.track cannot be read: No such file or directory"),
    ],
)
def test_track_is_flown_by_the_vehicle_that_is_named(
    loop: FastLoop,
    host: Host,
    telemetry: TelemetrySource,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    line: str,
    answer: str,
) -> None:
    async def at_once(call: Any, *args: Any) -> Any:
        return call(*args)

    monkeypatch.setattr("asyncio.to_thread", at_once)
    monkeypatch.chdir(tmp_path)
    telemetry.send("heartbeat")
    TrackConsole(host, Tracking(host), BackgroundCommands(host, "gradys")).command(line.split())
    loop.pass_time(1.0)
    host.bridge.turn()
    assert capsys.readouterr().out.strip() == answer


def test_track_from_an_editor_is_read_and_other_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "flight.txt"
    line = "(251908000, 357713121, -786743912, 584090, 0, 65535, 0, 0, 3, 10)\r\n"
    file.write_bytes(line.encode("utf-8-sig"))
    assert len(read(file, None)) == 1
    file.write_bytes(line.encode("utf-16"))
    assert len(read(file, None)) == 1
    for name, words in (("none", "none cannot be read: No such file"), ("", "is not a file")):
        with pytest.raises(BadRequest, match=words):
            read(tmp_path / name, None)
