"""A record as MAVLink: what a ground station hears is what was recorded."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.telemetry.flight_modes import kind_of, mode_name
from mavproxy_uavapi.flights.flight_file import messages_of
from mavproxy_uavapi.flights.flight_reader import events_of
from mavproxy_uavapi.flights.flight_store import FlightStore
from mavproxy_uavapi.flights.replay_feed import Feed, main, serve, vehicles_in
from mavproxy_uavapi.flights.topics import Topics
from mavproxy_uavapi.http.stream.stream_event import When, of_info
from mavproxy_uavapi.http.stream.stream_views import OF_A_MESSAGE
from tests.support.ports import free_port
from tests.support.world import World

CLOSE = 0.02  # m, m/s, degrees: what MAVLink's integers round


@pytest.fixture
def record(world: World, folder: Path) -> Path:
    """The file of a flight of the embedded copter."""
    world.ask("GET", "/command/arm")
    world.ask("GET", "/command/takeoff?alt=5")
    world.ask("GET", "/command/land?wait=true")
    world.pass_time(5.0)
    store = FlightStore(folder)
    return store.file(store.pack(store.all()[0].id))


def heard(frames: Any) -> list[tuple[float, Any]]:
    parser = mavlink.MAVLink(None)
    return [(seconds, message) for seconds, frame in frames for message in parser.parse_buffer(frame) or ()]


def differs(told: Any, recorded: Any) -> bool:
    if isinstance(recorded, dict):
        return any(differs(told[name], recorded[name]) for name in recorded)
    if isinstance(recorded, float) and told is not None:
        return abs(told - recorded) > CLOSE
    return bool(told != recorded)


def test_station_hears_the_views_as_they_were_recorded(record: Path) -> None:
    assert vehicles_in(record) == [1]
    told: dict[str, list[Any]] = {}
    for _, message in heard(Feed(record).frames()):
        assert (message.get_srcSystem(), message.get_srcComponent()) == (1, mavlink.MAV_COMP_ID_AUTOPILOT1)
        told.setdefault(message.get_type(), []).append(message)
    for name in ("gps", "gps_raw", "ned", "attitude", "general", "battery"):
        source, view = OF_A_MESSAGE[name]
        recorded = [one.data["info"] for one in messages_of(record) if one.topic == f"/1/{name}"]
        assert len(told[source]) == len(recorded) > 5, name
        for message, info in zip(told[source], recorded, strict=True):
            assert not differs(view(message), info), (view(message), info)
    beats = [(mode_name(one.type, one.custom_mode), bool(one.base_mode & 128)) for one in told["HEARTBEAT"]]
    status = [one.data["info"] for one in messages_of(record) if one.topic == "/1/status"]
    assert beats == [(info["mode"], info["armed"]) for info in status]
    assert kind_of(told["HEARTBEAT"][0].type) == "copter"
    texts = [one.text for one in told["STATUSTEXT"]]
    assert texts[0] == "REPLAY: nothing here is live" and "Arming motors" in texts


def test_what_mavlink_cannot_say_is_left_out(folder: Path) -> None:
    store, topics = FlightStore(folder), Topics()
    flight, file = store.begin([1], 1_778_500_800.0, "a large one")
    for second, current in enumerate((10_000, 40_000, 20_000)):  # cA
        told = {"voltage": 50_000, "current": current, "battery_remaining": 90}
        at = When(1_778_500_800.0 + second, float(second))
        file.write(topics.records(of_info("view", "battery", 1, at, told)))
    file.close(flight.about())
    frames = heard(Feed(store.file(store.pack(flight.id))).frames())
    assert [one.current_battery for _, one in frames if one.get_type() == "SYS_STATUS"] == [10_000, 20_000]


def test_times_go_on_as_they_were(record: Path) -> None:
    times = [seconds for seconds, _ in Feed(record).frames()]
    assert times[0] == 0.0 and times[-1] > 10.0 and all(0.0 <= seconds <= times[-1] + 3.0 for seconds in times)


def test_whoever_connects_hears_it_and_is_not_listened_to(record: Path) -> None:
    port = free_port()

    async def listen() -> list[Any]:
        serving = asyncio.create_task(serve(record, port, 1000.0))
        await asyncio.sleep(0)
        while True:
            try:
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                break
            except OSError:
                await asyncio.sleep(0.02)
        arm = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0)
        writer.write(arm.pack(mavlink.MAVLink(None, 255, 190)))
        parser, messages, expected = mavlink.MAVLink(None), [], len(list(Feed(record).frames()))
        while len(messages) < expected:
            messages += parser.parse_buffer(await reader.read(4096)) or ()
        writer.close()
        serving.cancel()
        await asyncio.wait({serving})
        return messages

    messages = asyncio.run(asyncio.wait_for(listen(), 30.0))
    assert "COMMAND_ACK" not in {message.get_type() for message in messages}


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"no record at all, but a text that is long enough"])
def test_what_is_no_record_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes
) -> None:
    file = tmp_path / "flight.mcap"
    file.write_bytes(content)
    with pytest.raises(BadRequest, match="not the file of a flight"):
        vehicles_in(file)
    assert main([str(file), "--port", str(free_port())]) == 1
    assert capsys.readouterr().err.startswith("replay: flight.mcap is not")
    assert main([str(tmp_path / "none.mcap")]) == 1


def test_readings_named_like_a_view_are_no_view_of_the_stream(folder: Path) -> None:
    store, topics = FlightStore(folder), Topics()
    flight, file = store.begin([1], 1_778_500_800.0, "readings")
    reading = {"device": "uav-1", "quantity": "gps", "representation": "percent", "value": 2.0, "time": 1.0}
    file.write(topics.records(of_info("event", "readings", 1, When(1_778_500_801.0, 1.0), {"readings": [reading]})))
    file.close(flight.about())
    path = store.file(store.pack(flight.id))
    assert list(Feed(path).frames()) == [] and events_of(path, 0.0, 5.0) == b'{"events":[]}'
