"""What is recorded of flights, in virtual time on the embedded copter."""

from __future__ import annotations

import asyncio
import csv
import hashlib
import io
import json
import shutil
import zipfile
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.mission.mission_files import parts_of
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.flights import flight_record, recorder
from mavproxy_uavapi.flights.flight_export import table, trail, write_zip
from mavproxy_uavapi.flights.flight_file import attachments_of, messages_of
from mavproxy_uavapi.flights.flight_store import COMPLETE, ENDED, RECORDING, Flight, FlightStore
from mavproxy_uavapi.programs import cameras
from mavproxy_uavapi.scripts import runs
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop
from tests.support.world import World
from tests.uavapi.flights.conftest import NOON

mavlink = mavutil.mavlink
JPEG = b"\xff\xd8\xff\xdb\x00\x04\x00\x00 picture"
READING = {"device": "uav-1", "quantity": "soil", "representation": "percent", "value": 23.5, "time": NOON}


def fly(world: World) -> None:
    """Up, and down again."""
    assert world.ask("GET", "/command/arm").status == 200
    assert world.ask("GET", "/command/takeoff?alt=5").status == 200
    assert world.ask("GET", "/command/land?wait=true").status == 200


def flights(folder: Path) -> list[Flight]:
    return FlightStore(folder).all()


def test_flight_is_recorded_from_arming_to_disarming(world: World, folder: Path) -> None:
    world.pass_time(3.0)
    assert flights(folder) == []
    fly(world)
    world.pass_time(5.0)
    (flight,) = flights(folder)
    assert (flight.name, flight.vehicles, flight.state, flight.lost) == ("", (1,), ENDED, 0)
    file = FlightStore(folder).file(flight)
    rows = list(table(file, 1, 2.0))
    assert max(row["relative_alt"] for row in rows) > 4.5 and rows[-1]["relative_alt"] < 0.5
    assert {row["mode"] for row in rows} == {"GUIDED", "LAND"} and rows[-1]["armed"] is False
    assert all(row["lat"] is not None for row in rows[2:])
    topics = {seen.topic for seen in messages_of(file)}
    assert {
        "/1/gps",
        "/1/location",
        "/1/pose",
        "/1/battery",
        "/1/status",
        "/log",
        "/1/statustext",
        "/1/job",
    } <= topics
    sentences = "\n".join(entry["sentence"] for entry in trail(file))
    assert all(word in sentences for word in ("arm", "takeoff", "land")), sentences
    parameters = {one.name: one.data for one in attachments_of(file)}["parameters-at-the-end-1.param"]
    assert b"LAND_SPD_MS 1\n" in parameters


ITEMS = [
    {"command": "NAV_TAKEOFF", "alt": 10, "lat": 0, "long": 0},
    {"command": "NAV_WAYPOINT", "alt": 10, "lat": -35.3631, "long": 149.1653},
]


def test_all_that_belongs_to_it_is_in_one_file_and_in_the_zip(
    world: World, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mission that changes, pictures, readings, a tag, what a script printed, answers of commands, versions."""

    async def take(_tool: str, _shot: Any) -> bytes:
        return JPEG

    monkeypatch.setattr(cameras, "take", take)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    planned = parts_of(json.dumps({"items": ITEMS})).items
    rehearsals.keep(rehearsals.digest_of_mission(planned), '{"status": 0}')
    monkeypatch.setattr(world.service.scripts, "logs", tmp_path / "logs")
    script = {"command": ["true"], "cwd": tmp_path, "port": 8000, "grace": 5.0, "environment": {}}
    run = runs.create(tmp_path / "logs", "square.py", [], 1, **script)
    run.out_log.write_text("corner 1 of 4\n")
    run.path.write_text(run.path.read_text()[:-1] + f', "ended_at": {NOON + 1e6}}}')
    name = world.ask("POST", "/flights", {"name": "survey"}).body["id"]
    assert world.ask("POST", "/mission/waypoints", {"items": ITEMS}).status == 200
    world.pass_time(1.0)
    assert world.ask("DELETE", "/mission/waypoints").status == 200
    assert world.ask("GET", "/command/takeoff?alt=5").status == 409
    world.host.tell("tag", 1, {"family": "tag36h11", "id": 7, "seen": True, "distance": 3.0, "ned": [1.0, 2.0, 0.0]})
    world.host.tell("readings", 1, {"readings": [READING, {**READING, "device": "=1+1", "value": [1.0, 2.0]}]})
    world.host.tell("readings", 9, {"readings": [{**READING, "device": "another's"}]})
    assert world.ask("GET", "/peripherical/take_photo?command=fswebcam").status == 200
    world.pass_time(1.0)
    world.host.geotagged(9, JPEG, world.now)
    world.host._receive(message_of("statustext", text="ArduCopter V4.6.3 (3fc7011a)"))
    assert world.ask("POST", f"/flights/{name}/end", {}).status == 200

    flight = FlightStore(folder).pack(name)
    assert set(flight.files) == {
        *("mission-1-1.waypoints", "rehearsal-mission-1-1.waypoints.json", "mission-1-2.waypoints"),
        f"script-{run.out_log.name}",
    }
    assert flight.versions["MAVProxy"] and flight.versions["vehicle-1"] == "ArduCopter V4.6.3 (3fc7011a)"
    assert world.ask("GET", f"/flights/{name}").body["files"] == flight.files
    topics = {seen.topic for seen in messages_of(FlightStore(folder).file(flight))}
    assert {"/1/tag", "/1/picture", "/1/image", "/readings/uav-1/soil"} <= topics
    assert "/readings/another's/soil" not in topics and "/9/image" not in topics
    check_zip(flight, FlightStore(folder).file(flight), tmp_path / "it.zip", f"script-{run.out_log.name}")


def check_zip(flight: Flight, file: Path, target: Path, printed: str) -> None:
    write_zip(flight, file, target, 2.0)
    with zipfile.ZipFile(target) as archive:
        sums = [line.split("  ") for line in archive.read("SHA256SUMS").decode().splitlines()]
        assert {member for _, member in sums} == {one for one in archive.namelist() if "s/" in one}
        assert {f"files/{one}" for one in flight.files} < set(archive.namelist())
        for digest, member in sums:
            assert hashlib.sha256(archive.read(member)).hexdigest() == digest
        told = json.loads(archive.read("flight.json"))
        assert told["files"] == flight.files and told["versions"] == flight.versions
        (picture,) = rows_of(archive, "pictures.csv")
        data = archive.read(f"pictures/{picture['name']}")
        assert data != JPEG and float(picture["lat"]) == pytest.approx(-35.363, abs=1e-3)
        assert hashlib.sha256(data).hexdigest() == picture["sha256"]
        (first, second) = rows_of(archive, "readings.csv")
        assert (first["device"], first["value"], second["value"]) == ("uav-1", "23.5", "[1.0, 2.0]")
        assert second["device"] == "'=1+1", "a spreadsheet evaluates nothing"
        assert b"corner 1 of 4" in archive.read(f"files/{printed}")
        assert b"149.1653" in archive.read("files/mission-1-1.waypoints")
        answered = {row["verb"]: row["outcome"] for row in rows_of(archive, "trail.csv")}
        assert answered["/command/takeoff"] == "not_armed" and answered["/mission/waypoints"] == "ok"
    write_zip(flight, file, target, 2.0, without="script-")
    with zipfile.ZipFile(target) as archive:
        assert not [member for member in archive.namelist() if "script" in member]


def rows_of(archive: zipfile.ZipFile, name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(archive.read(name).decode())))


def test_mavproxy_that_was_never_installed_has_no_version(monkeypatch: pytest.MonkeyPatch) -> None:
    assert recorder.mavproxy_version.__wrapped__() != "unknown"

    def none(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(recorder, "version", none)
    assert recorder.mavproxy_version.__wrapped__() == "unknown"


def test_pictures_that_are_too_large_or_too_many_are_counted_and_not_kept(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flight_record, "MOST_PICTURE", 3000)
    monkeypatch.setattr(flight_record, "MOST_PENDING", 4000)
    name = world.ask("POST", "/flights", {"name": "survey"}).body["id"]
    for size in (3000, 10, 10, 2000, 2000):
        world.host.geotagged(1, JPEG + bytes(size), world.now)
    assert world.ask("POST", f"/flights/{name}/end", {}).body["lost"] == 2


def test_telemetry_that_comes_fast_is_recorded_at_ten_hertz(world: World, folder: Path) -> None:
    name = world.ask("POST", "/flights", {"name": "survey"}).body["id"]
    for number in range(200):  # 4 s at 50 Hz
        world.host._receive(message_of("attitude", time_boot_ms=10_000_000 + number * 20, roll=number / 1000))
        world.pass_time(0.02)
    world.ask("POST", f"/flights/{name}/end", {})
    seen = [one for one in messages_of(FlightStore(folder).file(flights(folder)[0])) if one.topic == "/1/attitude"]
    assert 30 <= len(seen) <= 50


def test_folder_removed_in_flight_is_told_and_the_rest_is_recorded(world: World, folder: Path) -> None:
    assert world.ask("GET", "/command/arm").status == 200
    world.pass_time(1.0)
    world.screen()
    shutil.rmtree(folder)
    world.pass_time(1.5)
    assert "ends here: it was removed" in world.screen()
    assert world.ask("GET", "/command/takeoff?alt=5").status == 200
    assert [flight.state for flight in flights(folder)] == [RECORDING]


def test_folder_that_becomes_read_only_is_told_and_harms_no_flight(
    world: World, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(_self: Any, _flight: Any) -> None:  # root, who may run this, writes anywhere
        raise PermissionError(13, "Permission denied")

    name = world.ask("POST", "/flights", {"name": "survey"}).body["id"]
    world.pass_time(1.0)
    with monkeypatch.context() as patch:
        patch.setattr(FlightStore, "save", read_only)
        assert world.ask("GET", "/command/arm").status == 200
        world.ask("POST", f"/flights/{name}/end", {})
        world.pass_time(1.0)
        said = world.screen()
        assert said.count("ends here: Permission denied") == 1 and said.count("is not recorded") == 1
    assert FlightStore(folder).pack(name).messages > 10, "what was written is whole"
    world.pass_time(1.5)
    assert flights(folder)[0].state == RECORDING, "the flight of the vehicle is recorded as soon as that is possible"


def test_next_flight_is_another_file(world: World, folder: Path) -> None:
    for _ in range(2):
        fly(world)
        world.pass_time(5.0)
    assert len(flights(folder)) == 2 and len({flight.id for flight in flights(folder)}) == 2


def test_named_one_lasts_until_it_is_ended_whatever_the_vehicle_does(world: World, folder: Path) -> None:
    answer = world.ask("POST", "/flights", {"name": "Survey 3: north", "notes": "wind"})
    assert (answer.status, answer.body["vehicles"], answer.body["state"]) == (200, [1], RECORDING)
    name = answer.body["id"]
    assert name.endswith("-survey-3-north")
    fly(world)
    world.pass_time(5.0)
    known = {flight["id"]: flight for flight in world.ask("GET", "/flights").body["flights"]}
    assert len(known) == 2 and known[name]["state"] == RECORDING and known[name]["messages"] > 100
    assert world.ask("DELETE", f"/flights/{name}").status == 409
    assert world.ask("POST", f"/flights/{name}/end", {}).body["state"] == ENDED
    assert world.ask("POST", f"/flights/{name}/end", {}).status == 404
    assert world.ask("GET", f"/flights/{name}.zip").status == 409, "it is not packed yet"
    FlightStore(folder).pack(name)
    shown = world.ask("GET", f"/flights/{name}").body
    assert shown["state"] == COMPLETE and shown["bytes"] == (folder / f"{name}.mcap").stat().st_size
    assert world.ask("DELETE", f"/flights/{name}").status == 200
    assert [flight.name for flight in flights(folder)] == [""]


def test_several_are_ended_while_one_is_written_and_each_file_is_whole(
    world: World, folder: Path, loop: FastLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    writing: list[str] = []

    async def slow_thread(act: Any, *args: Any) -> Any:
        """A disk that takes its time; two that write a file at once would be found out."""
        key = str(getattr(act, "__self__", ""))
        assert key not in writing
        writing.append(key)
        await asyncio.sleep(0.3)
        try:
            return act(*args)
        finally:
            writing.remove(key)

    monkeypatch.setattr(recorder.asyncio, "to_thread", slow_thread)
    names = [world.ask("POST", "/flights", {"name": f"survey {number}"}).body["id"] for number in range(3)]
    fly(world)
    wires = [world.begin("POST", f"/flights/{name}/end", {}) for name in names]
    assert {world.answer(wire).status for wire in wires} == {200}
    world.pass_time(10.0)
    known = flights(folder)
    assert len(known) == 4 and {flight.state for flight in known} == {ENDED}
    for flight in known:
        assert len(list(messages_of(FlightStore(folder).file(flight)))) == flight.messages > 50


def test_disk_that_does_not_answer_is_told_to_who_asks(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    name = world.ask("POST", "/flights", {"name": "survey"}).body["id"]

    async def hangs(act: Any, *args: Any) -> Any:
        await asyncio.sleep(40.0)
        return act(*args)

    monkeypatch.setattr(recorder.asyncio, "to_thread", hangs)
    world.pass_time(1.0)
    for path, body in ((f"/flights/{name}/end", {}), ("/flights", {"name": "another"})):
        began = world.now
        assert world.ask("POST", path, body).outcome == "500 tool_failed"
        assert world.now - began < recorder.DISK_ANSWERS + 1.0
    monkeypatch.undo()
    world.pass_time(60.0)


def slow_begin(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    """A disk that takes its time to make a file."""

    async def slow_thread(act: Any, *args: Any) -> Any:
        result = act(*args)
        if act.__name__ == "begin":
            await asyncio.sleep(seconds)
        return result

    monkeypatch.setattr(recorder.asyncio, "to_thread", slow_thread)


@pytest.mark.parametrize("moment", [0.1, 0.5, 0.9, 1.1])
def test_flight_that_begins_when_the_api_stops_is_ended_whole(
    world: World, folder: Path, monkeypatch: pytest.MonkeyPatch, moment: float
) -> None:
    slow_begin(monkeypatch, 0.8)
    assert world.ask("GET", "/command/arm").status == 200
    world.pass_time(moment)
    world.recording.cancel()
    world.run(asyncio.wait({world.recording}))
    assert [flight.state for flight in flights(folder)] in ([], [ENDED])
    assert len(FlightStore(folder).unpacked()) == len(flights(folder)), "somebody holds a file yet"


def test_record_begun_after_the_recorders_end_is_refused_and_closed(world: World, folder: Path) -> None:
    world.pass_time(1.0)
    world.recording.cancel()
    world.run(asyncio.wait({world.recording}))
    answer = world.ask("POST", "/flights", {"name": "survey"})
    assert answer.outcome == "500 tool_failed" and len(FlightStore(folder).unpacked()) == 1


@pytest.mark.parametrize("seconds", [3.0, 30.0])
def test_file_that_comes_when_nobody_waits_for_it_is_closed(
    world: World, folder: Path, monkeypatch: pytest.MonkeyPatch, seconds: float
) -> None:
    slow_begin(monkeypatch, seconds)
    wire = world.begin("POST", "/flights", {"name": "survey"})
    world.pass_time(1.0)
    if seconds < 10.0:
        wire.hang_up()
    world.pass_time(40.0)
    assert len(FlightStore(folder).unpacked()) == 1


def test_nothing_is_sent_for_it_but_one_question_for_the_version(world: World, folder: Path) -> None:
    before = len(world.sent)
    for _ in range(2):
        name = world.ask("POST", "/flights", {"name": "watch"}).body["id"]
        world.pass_time(5.0)
        world.ask("POST", f"/flights/{name}/end", {})
    (question,) = world.orders_of(world.sent[before:])
    assert (question.command, question.param1) == (mavlink.MAV_CMD_REQUEST_MESSAGE, 148)  # AUTOPILOT_VERSION
    assert {flight.versions["vehicle-1"] for flight in flights(folder)} == {"copter 4.7.3 (embedded)"}


def test_disk_that_refuses_is_said_once_and_harms_no_flight(world: World, folder: Path) -> None:
    folder.write_text("no folder")
    world.screen()
    fly(world)
    assert world.ask("POST", "/flights", {"name": "survey"}).status == 500
    world.pass_time(5.0)
    assert world.screen().count("is not recorded") == 1


def test_record_that_cannot_go_on_ends_and_the_flight_does_not(
    world: World, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mavproxy_uavapi.flights.flight_file import FlightFile

    def full(_self: Any, _records: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(FlightFile, "write", full)
    world.screen()
    fly(world)
    assert "ends here: No space left on device" in world.screen()


def test_record_that_cannot_be_ended_is_said_and_the_next_is_made(
    world: World, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mavproxy_uavapi.flights.flight_file import FlightFile

    close = FlightFile.close

    def full(self: Any, about: Any) -> None:
        close(self, about)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(FlightFile, "close", full)
    fly(world)
    world.pass_time(5.0)
    assert "ends here: No space left on device" in world.screen()
    monkeypatch.setattr(FlightFile, "close", close)
    fly(world)
    world.pass_time(5.0)
    assert flights(folder)[0].state == ENDED


def test_vehicle_that_is_not_heard_for_a_minute_has_ended_its_flight(world: World, folder: Path) -> None:
    world.ask("GET", "/command/arm")
    world.ask("GET", "/command/takeoff?alt=5")
    world.cut(world.now + 90.0)
    world.pass_time(30.0)
    assert [flight.state for flight in flights(folder)] == [RECORDING]
    world.pass_time(45.0)
    assert [flight.state for flight in flights(folder)] == [ENDED]
    world.pass_time(30.0)
    assert [flight.state for flight in flights(folder)] == [RECORDING, ENDED], "it is heard again, and flies"


def test_what_does_not_name_a_flight_is_404(world: World) -> None:
    for name in ("x", "..", "%2e%2e%2fetc", "20260101-000000-none", "20260101-000000-none.json"):
        assert world.ask("GET", f"/flights/{name}").status == 404
        assert world.ask("GET", f"/flights/{name}.mcap").status == 404
        assert world.ask("DELETE", f"/flights/{name}").status == 404


def test_without_a_folder_nothing_is_recorded(world: World, folder: Path) -> None:
    world.service.flights._folder = str
    fly(world)
    assert world.ask("GET", "/flights").status == 404 and not folder.exists()
