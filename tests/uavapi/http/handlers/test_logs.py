"""/logs: listed, downloaded as a job, and served, in virtual time."""

from __future__ import annotations

import os
import stat
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.support.drone import Drone
from tests.support.fake_link import FakeLink
from tests.support.log_vehicle import LogVehicle
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

LISTED = {"id": 1, "size": 1024, "time": None, "downloaded": False}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "logs"


@pytest.fixture
def vehicle(loop: FastLoop, drone: Drone, link: FakeLink, api: Api, folder: Path) -> LogVehicle:
    loop.set_default_executor(AtOnce())
    api.service.settings = replace(api.service.settings, vehicle_logs=str(folder))
    return LogVehicle(loop, drone, link)


def read(api: Api, path: str) -> tuple[int, bytes, Any]:
    async def ask() -> tuple[int, bytes, Any]:
        async with api.client.get(path) as response:
            return response.status, await response.read(), response.headers

    return api.loop.run(ask())


def test_logs_of_the_vehicle_are_listed(api: Api, vehicle: LogVehicle) -> None:
    body = api.get("/logs").body
    later = {"id": 2, "size": 250_001, "time": "2026-09-21T14:13:20Z", "downloaded": False}
    assert body["logs"] == [LISTED, later]
    assert body["age_s"] == 0.0
    assert api.get("/vehicles/1/logs").body["logs"] == body["logs"]


def test_log_is_downloaded_and_served(api: Api, vehicle: LogVehicle, folder: Path) -> None:
    vehicle.loss = 0.02
    assert read(api, "/logs/2")[0] == 404
    answer = api.post("/logs/2/download")
    assert (answer.status, answer.body["result"]) == (200, "Log 2 downloaded")
    status, data, headers = read(api, "/vehicles/1/logs/2")
    assert (status, data) == (200, vehicle.logs[2])
    assert headers["Content-Length"] == "250001"
    assert "vehicle1-log2-20260921T141320Z-250001.bin" in headers["Content-Disposition"]
    (file,) = folder.iterdir()
    assert (stat.S_IMODE(file.stat().st_mode), stat.S_IMODE(folder.stat().st_mode)) == (0o600, 0o700)
    assert [log["downloaded"] for log in api.get("/logs").body["logs"]] == [False, True]


def test_job_reports_its_progress_and_its_abort_leaves_nothing(api: Api, vehicle: LogVehicle, folder: Path) -> None:
    job = api.post("/logs/2/download?wait=false").body["job"]
    api.until(lambda: api.get(f"/jobs/{job}").body["progress"].get("bytes", 0) > 0)
    progress = api.get(f"/jobs/{job}").body["progress"]
    assert 0 < progress["bytes"] < progress["of"] == 250_001
    waiting = api.get("/logs/2")
    assert (waiting.status, waiting.body["code"]) == (409, "busy")
    assert api.post("/logs/1/download").body["code"] == "busy"
    assert api.get("/logs").body["code"] == "busy"
    assert api.loop.run(api.ask("DELETE", f"/jobs/{job}")).body["then"] == "nothing is sent"
    api.loop.pass_time(0.5)
    assert vehicle.names()[-1] == "LOG_REQUEST_END"
    assert list(folder.iterdir()) == []
    assert read(api, "/logs/2")[0] == 404


def test_equal_requests_are_one_job_and_others_are_not(api: Api, vehicle: LogVehicle) -> None:
    first = api.post("/logs/2/download?wait=false").body["job"]
    assert api.post("/logs/2/download?wait=false").body["job"] == first
    assert api.post("/logs/1/download?wait=false").body["job"] != first
    assert api.get(f"/jobs/{first}").body["request"] == {"log": 2, "while_armed": False}


def test_client_that_hangs_up_ends_its_download(api: Api, vehicle: LogVehicle, folder: Path) -> None:
    request = api.begin("POST", "/logs/2/download")
    api.until(lambda: "LOG_REQUEST_DATA" in vehicle.names())
    request.cancel()
    api.until(lambda: vehicle.names()[-1] == "LOG_REQUEST_END")
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("number", ["9", "0", "x", "-1", "65536", "99999999", "%2e%2e"])
def test_log_that_is_not_there_is_404(api: Api, vehicle: LogVehicle, number: str, folder: Path) -> None:
    assert api.post(f"/logs/{number}/download").body["code"] == "not_found"
    assert read(api, f"/logs/{number}")[0] == 404
    assert not folder.exists()


def test_armed_vehicle_is_asked_on_purpose_only(api: Api, vehicle: LogVehicle, drone: Drone) -> None:
    drone.fly()
    for answer in (api.get("/logs"), api.post("/logs/1/download")):
        assert (answer.status, answer.body["code"]) == (409, "busy")
    assert vehicle.received == []
    assert api.get("/logs?while_armed=true").status == 504
    assert api.post("/logs/1/download?while_armed=true").status == 504
    assert api.post("/logs/1/download", {"while_armed": "maybe"}).status == 422


def test_of_two_logs_with_one_id_the_last_download_is_served(api: Api, vehicle: LogVehicle, folder: Path) -> None:
    assert api.post("/logs/1/download").status == 200
    (first,) = folder.iterdir()
    vehicle.logs[1], vehicle.began[1] = b"another", 1_780_000_000
    assert api.get("/logs").body["logs"][0]["downloaded"] is False
    assert api.post("/logs/1/download").status == 200
    (second,) = set(folder.iterdir()) - {first}
    os.utime(first, (1, 1))  # both may be of the same tick of the disk's clock
    assert read(api, "/logs/1")[1] == b"another"
    assert first.read_bytes() == bytes(range(256)) * 4


def test_folder_that_cannot_be_written_is_an_error_of_ours(api: Api, vehicle: LogVehicle, folder: Path) -> None:
    folder.write_text("no folder")
    answer = api.post("/logs/1/download")
    assert (answer.status, answer.body["code"]) == (500, "tool_failed")
    assert str(folder) in answer.body["detail"]
