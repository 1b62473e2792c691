"""A flight's log, from the vehicle through MAVProxy to a client."""

from __future__ import annotations

from pathlib import Path

import pytest
from pymavlink import DFReader

from tests.support.processes import embedded

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    directory = tmp_path_factory.mktemp("logs")
    made = embedded(directory, vehicle_logs=str(directory / "downloaded"))
    yield made
    made.stop()


def modes_and_heights(file: Path) -> tuple[list[int], float]:
    """The modes of a log, and the greatest altitude (m above its first place)."""
    log = DFReader.DFReader_binary(str(file))
    modes, heights = [], []
    while (message := log.recv_match(type=["MODE", "GPS"])) is not None:
        if message.get_type() == "MODE":
            modes.append(message.ModeNum)
        else:
            heights.append(message.Alt)
    log.close()
    return modes, max(heights) - heights[0]


def test_log_of_a_flight_is_listed_downloaded_and_read(rig, tmp_path):
    assert rig.ok(rig.get("/logs"))["logs"] == []
    rig.in_the_air(10)
    refused = rig.get("/logs")
    assert (refused.status_code, refused.json()["code"]) == (409, "busy")
    rig.on_the_ground()
    (listed,) = rig.ok(rig.get("/logs"))["logs"]
    assert (listed["id"], listed["downloaded"]) == (1, False)
    assert listed["time"].startswith("20")
    assert rig.get("/logs/1").status_code == 404
    assert rig.ok(rig.post("/logs/1/download"))["result"] == "Log 1 downloaded"
    content = rig.get("/logs/1")
    assert len(content.content) == listed["size"]
    (file,) = (rig.directory / "downloaded").iterdir()
    assert file.read_bytes() == content.content
    modes, height = modes_and_heights(file)
    assert modes == [4, 9], "GUIDED, LAND"
    assert height == pytest.approx(10.0, abs=1.0)
    assert rig.ok(rig.get("/logs"))["logs"] == [{**listed, "downloaded": True}]


def test_log_module_of_mavproxy_still_works(rig):
    mark = rig.mavproxy.mark()
    rig.mavproxy.type("log list")
    rig.mavproxy.says("Log 1  numLogs 1", since=mark)
    rig.mavproxy.type("log download 1")
    rig.mavproxy.says("Finished downloading log1.bin", since=mark)
    (file,) = (rig.directory / "downloaded").iterdir()
    rig.until(lambda: (rig.directory / "log1.bin").read_bytes() == file.read_bytes(), what="the same log")
