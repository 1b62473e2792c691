"""What is recorded of flights, in virtual time on the embedded copter."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.flights.flight_export import table, trail
from mavproxy_uavapi.flights.flight_file import attachments_of, messages_of
from mavproxy_uavapi.flights.flight_store import COMPLETE, ENDED, RECORDING, Flight, FlightStore
from tests.support.world import World


def fly(world: World) -> None:
    """Up, and down again."""
    assert world.ask("GET", "/command/arm").status == 200
    assert world.ask("GET", "/command/takeoff?alt=5").status == 200
    assert world.ask("GET", "/command/land?wait=true").status == 200


def flights(folder: Path) -> list[Flight]:
    return FlightStore(folder).all()


def test_flight_is_recorded_from_arming_to_disarming(world: World, folder: Path) -> None:
    world.loop.pass_time(3.0)
    assert flights(folder) == []
    fly(world)
    world.loop.pass_time(5.0)
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
    (parameters,) = attachments_of(file)
    assert parameters.name == "parameters-at-the-end-1.param" and b"LAND_SPD_MS 1\n" in parameters.data


def test_next_flight_is_another_file(world: World, folder: Path) -> None:
    for _ in range(2):
        fly(world)
        world.loop.pass_time(5.0)
    assert len(flights(folder)) == 2 and len({flight.id for flight in flights(folder)}) == 2


def test_named_one_lasts_until_it_is_ended_whatever_the_vehicle_does(world: World, folder: Path) -> None:
    answer = world.ask("POST", "/flights", {"name": "Survey 3: north", "notes": "wind"})
    assert (answer.status, answer.body["vehicles"], answer.body["state"]) == (200, [1], RECORDING)
    name = answer.body["id"]
    assert name.endswith("-survey-3-north")
    fly(world)
    world.loop.pass_time(5.0)
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
    world: World, folder: Path, loop: Any, monkeypatch: Any
) -> None:
    from mavproxy_uavapi.flights import recorder

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
    world.loop.pass_time(10.0)
    known = flights(folder)
    assert len(known) == 4 and {flight.state for flight in known} == {ENDED}
    for flight in known:
        assert len(list(messages_of(FlightStore(folder).file(flight)))) == flight.messages > 50


def test_disk_that_does_not_answer_is_told_to_who_asks(world: World, monkeypatch: Any) -> None:
    from mavproxy_uavapi.flights import recorder

    name = world.ask("POST", "/flights", {"name": "survey"}).body["id"]

    async def hangs(act: Any, *args: Any) -> Any:
        await asyncio.sleep(3600.0)
        return act(*args)

    monkeypatch.setattr(recorder.asyncio, "to_thread", hangs)
    world.loop.pass_time(1.0)
    for path, body in ((f"/flights/{name}/end", {}), ("/flights", {"name": "another"})):
        began = world.loop.time()
        assert world.ask("POST", path, body).outcome == "500 tool_failed"
        assert world.loop.time() - began < recorder.DISK_ANSWERS + 1.0
    monkeypatch.undo()
    world.loop.pass_time(3700.0)


def slow_begin(monkeypatch: Any, seconds: float) -> None:
    """A disk that takes its time to make a file."""
    from mavproxy_uavapi.flights import recorder

    async def slow_thread(act: Any, *args: Any) -> Any:
        result = act(*args)
        if act.__name__ == "begin":
            await asyncio.sleep(seconds)
        return result

    monkeypatch.setattr(recorder.asyncio, "to_thread", slow_thread)


@pytest.mark.parametrize("moment", [0.1, 0.5, 0.9, 1.1])
def test_flight_that_begins_when_the_api_stops_is_ended_whole(
    world: World, folder: Path, monkeypatch: Any, moment: float
) -> None:
    slow_begin(monkeypatch, 0.8)
    assert world.ask("GET", "/command/arm").status == 200
    world.loop.pass_time(moment)
    world.recording.cancel()
    world.loop.run(asyncio.wait({world.recording}))
    assert [flight.state for flight in flights(folder)] in ([], [ENDED])
    assert len(FlightStore(folder).unpacked()) == len(flights(folder)), "somebody holds a file yet"


@pytest.mark.parametrize("seconds", [3.0, 30.0])
def test_file_that_comes_when_nobody_waits_for_it_is_closed(
    world: World, folder: Path, monkeypatch: Any, seconds: float
) -> None:
    slow_begin(monkeypatch, seconds)
    wire = world.begin("POST", "/flights", {"name": "survey"})
    world.loop.pass_time(1.0)
    if seconds < 10.0:
        wire.hang_up()
    world.loop.pass_time(40.0)
    assert len(FlightStore(folder).unpacked()) == 1


def test_nothing_is_sent_for_it(world: World) -> None:
    before = len(world.sent)
    name = world.ask("POST", "/flights", {"name": "watch"}).body["id"]
    world.loop.pass_time(5.0)
    world.ask("POST", f"/flights/{name}/end", {})
    assert world.orders_of(world.sent[before:]) == []


def test_disk_that_refuses_is_said_once_and_harms_no_flight(world: World, folder: Path) -> None:
    folder.write_text("no folder")
    world.screen()
    fly(world)
    assert world.ask("POST", "/flights", {"name": "survey"}).status == 500
    world.loop.pass_time(5.0)
    assert world.screen().count("is not recorded") == 1


def test_record_that_cannot_go_on_ends_and_the_flight_does_not(world: World, folder: Path, monkeypatch: Any) -> None:
    from mavproxy_uavapi.flights.flight_file import FlightFile

    def full(_self: Any, _records: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(FlightFile, "write", full)
    world.screen()
    fly(world)
    assert "ends here: No space left on device" in world.screen()


def test_record_that_cannot_be_ended_is_said_and_the_next_is_made(
    world: World, folder: Path, monkeypatch: Any
) -> None:
    from mavproxy_uavapi.flights.flight_file import FlightFile

    close = FlightFile.close

    def full(self: Any, about: Any) -> None:
        close(self, about)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(FlightFile, "close", full)
    fly(world)
    world.loop.pass_time(5.0)
    assert "ends here: No space left on device" in world.screen()
    monkeypatch.setattr(FlightFile, "close", close)
    fly(world)
    world.loop.pass_time(5.0)
    assert flights(folder)[0].state == ENDED


def test_vehicle_that_is_not_heard_for_a_minute_has_ended_its_flight(world: World, folder: Path) -> None:
    world.ask("GET", "/command/arm")
    world.ask("GET", "/command/takeoff?alt=5")
    world.cut_until = world.loop.time() + 90.0
    world.loop.pass_time(30.0)
    assert [flight.state for flight in flights(folder)] == [RECORDING]
    world.loop.pass_time(45.0)
    assert [flight.state for flight in flights(folder)] == [ENDED]
    world.loop.pass_time(30.0)
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
