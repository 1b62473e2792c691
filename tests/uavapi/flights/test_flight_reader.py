"""What is shown of a complete flight: its overview, its moments, and its way beside another one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mcap.records import Attachment

from mavproxy_uavapi.flights.commands import run
from mavproxy_uavapi.flights.flight_file import messages_of
from mavproxy_uavapi.flights.flight_overview import unpacked, ways_of
from mavproxy_uavapi.flights.flight_reader import events_of, overview_of
from mavproxy_uavapi.flights.flight_store import FlightStore
from mavproxy_uavapi.flights.topics import Topics
from mavproxy_uavapi.http.stream.stream_event import When, of_info
from tests.support.world import World

BEGAN = 1_778_500_800.0  # s since 1970
LAT, LON = -35.3632, 149.1652
METRE = 1 / 111_318.845  # degrees


def line_flown(store: FlightStore, east: float, seconds: int = 20, name: str = "line", mission: str = "") -> str:
    """The id of a complete flight of 1 m/s to the north, so many metres beside LON, at 10 m."""
    flight, file = store.begin([1], BEGAN, name)
    topics = Topics()
    for tick in range(seconds * 5 + 1):
        at = When(BEGAN + tick / 5, 100.0 + tick / 5)
        place = {
            "lat": LAT + tick / 5 * METRE,
            "lon": LON + east * METRE / 0.8155,
            "alt": 594.0,
            "relative_alt": 10.0,
        }
        still = {"vx": 1.0, "vy": 0.0, "vz": 0.0}
        file.write(
            topics.records(of_info("view", "gps", 1, at, {"position": place, "velocity": still, "heading": 0.0}))
        )
        battery = {"voltage": 12000, "current": 100, "battery_remaining": 100 - tick // 10}
        file.write(topics.records(of_info("view", "battery", 1, at, battery)))
    said = {"severity": 6, "text": "ArduCopter V4.7"}
    file.write(topics.records(of_info("event", "statustext", 1, When(BEGAN + 3.0, 103.0), said)))
    if mission:
        file.attach("mission-1-1.waypoints", "text/plain", mission.encode(), round(BEGAN * 1e9))
    file.close(flight.about())
    return store.pack(flight.id).id


@pytest.fixture
def store(folder: Path) -> FlightStore:
    return FlightStore(folder)


def test_overview_has_a_place_a_second_and_what_happened(store: FlightStore) -> None:
    data = overview_of(store.file(store.find(line_flown(store, 0.0))))
    way, told = ways_of(data)[1], json.loads(unpacked(data))
    assert told["began"] == BEGAN and told["seconds"] == 20.0
    assert [place.time - BEGAN for place in way] == [float(second) for second in range(21)]
    assert way[10].lat == pytest.approx(LAT + 10 * METRE, abs=METRE / 100) and way[10].relative_alt == 10.0
    assert way[0].battery_percent is None and way[20].battery_percent == 91
    assert [event["info"]["text"] for event in told["events"]] == ["ArduCopter V4.7"]


def test_overview_leaves_out_where_a_vehicle_does_not_know_its_place(store: FlightStore) -> None:
    flight, file = store.begin([1], BEGAN, "no fix")
    nowhere = {"position": {"lat": 0.0, "lon": 0.0, "alt": 0.0, "relative_alt": 0.0}, "velocity": {}, "heading": None}
    file.write(Topics().records(of_info("view", "gps", 1, When(BEGAN, 1.0), nowhere)))
    file.close(flight.about())
    assert ways_of(overview_of(store.file(store.pack(flight.id)))) == {}


def test_overview_begins_with_what_is_earliest_even_if_it_was_told_later(store: FlightStore) -> None:
    flight, file = store.begin([1], BEGAN, "late")
    for seconds in (5.0, 2.0, 7.0):
        at = When(BEGAN + seconds, seconds)
        file.write(Topics().records(of_info("event", "statustext", 1, at, {"severity": 6, "text": "hello"})))
    file.close(flight.about())
    path = store.file(store.pack(flight.id))
    told = json.loads(unpacked(overview_of(path)))
    assert (told["began"], told["seconds"]) == (BEGAN + 2.0, 5.0)
    assert len(json.loads(events_of(path, 0.0, 1.0))["events"]) == 1


def test_moments_are_those_that_were_asked_for_and_no_foxglove_doubles(store: FlightStore) -> None:
    path = store.file(store.find(line_flown(store, 0.0)))
    events = json.loads(events_of(path, 2.5, 1.0))["events"]
    assert [event["time"] - BEGAN for event in events if event.get("view") == "gps"] == pytest.approx(
        [2.6, 2.8, 3.0, 3.2, 3.4], abs=1e-3
    )
    assert {event.get("view") or event["event"] for event in events} == {"gps", "battery", "statustext"}
    assert json.loads(events_of(path, 1e6, 5.0)) == {"events": []}
    whole = json.loads(events_of(path, 0.0, 30.0))["events"]
    assert len(whole) == sum(message.schema.startswith("uavapi.") for message in messages_of(path))


def test_flights_beside_each_other_are_so_many_metres_apart(
    store: FlightStore, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = line_flown(store, 0.0), line_flown(store, 3.0, 15)
    assert run(["--folder", str(folder), "compare", first, second]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0] == f"{first}: 20 m in 20 s, 9 %" and told[1].startswith(f"{second}: 15 m in 15 s")
    # its last five metres go on beyond the other's end
    assert told[2].startswith("beside: 3.3 m on average, 95 % within 5.0 m, at most 5.8 m after 20 s at -35.363020")
    assert told[3] == "heights: 0.0 m on average, at most 0.0 m"


def test_flight_beside_its_mission_and_its_rehearsal(
    store: FlightStore, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = line_flown(store, 2.0)
    mission = tmp_path / "line.json"
    goal = {
        "command": "NAV_WAYPOINT",
        "frame": 3,
        "lat": LAT + 20 * METRE,
        "long": LON + 2 * METRE / 0.8155,
        "alt": 12,
    }
    mission.write_text(json.dumps({"items": [goal, {"command": "NAV_RETURN_TO_LAUNCH"}]}))
    assert run(["--folder", str(folder), "compare", flight, str(mission)]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[1] == "line.json: 43 m" and "at most 0.0 m" in told[2]
    report = tmp_path / "rehearsal.json"
    columns = ["at", "lat", "lon", "height", "battery"]
    rows = [[5.0 + second, LAT + second * METRE, LON, 10.0, 100.0 - second] for second in range(21)]
    report.write_text(json.dumps({"flights": [{"vehicles": {"1": {"columns": columns, "samples": rows}}}]}))
    assert run(["--folder", str(folder), "compare", flight, str(report)]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[1] == "rehearsal.json: 20 m in 20 s, 20 %" and told[2].startswith("beside: 2.0 m on average")


def test_flight_is_beside_the_mission_that_its_vehicle_held(
    world: World, store: FlightStore, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lat, long = LAT + 20 * METRE, LON + 4 * METRE / 0.8155
    goal = f"1\t0\t3\t16\t0\t0\t0\t0\t{lat:.8f}\t{long:.8f}\t12\t1"
    home, back = "0\t1\t0\t16\t0\t0\t0\t0\t0\t0\t0\t1", "2\t0\t3\t20\t0\t0\t0\t0\t0\t0\t0\t1"
    flight = line_flown(store, 0.0, mission=f"QGC WPL 110\n{home}\n{goal}\n{back}\n")
    (shown,) = json.loads(unpacked(overview_of(store.file(store.find(flight)))))["missions"]
    assert shown["vehicle"] == 1 and shown["relative_alt"] == [0.0, 12.0, None]
    assert shown["lat"] == pytest.approx([LAT, lat, LAT]) and shown["lon"] == pytest.approx([LON, long, LON])
    assert run(["--folder", str(folder), "compare", flight, "mission"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[1] == "mission: 44 m" and "at most 3.9 m after 20 s" in told[2]
    beside = world.ask("GET", f"/flights/{flight}/compare?other=mission").body
    assert beside["second"]["name"] == "mission" and beside["second"]["duration_s"] is None
    none = line_flown(store, 0.0)
    assert world.ask("GET", f"/flights/{none}/compare?other=mission").status == 400
    assert run(["--folder", str(folder), "compare", line_flown(store, 0.0, mission="torn"), "mission"]) == 1


@pytest.mark.parametrize("text", ["", "{}", '{"flights": []}', '{"flights": [{"vehicles": {}}]}', "no mission"])
def test_file_that_is_no_way_is_refused_in_a_line(
    store: FlightStore, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    file = tmp_path / "way.json"
    file.write_text(text)
    assert run(["--folder", str(folder), "compare", line_flown(store, 0.0), str(file)]) == 1
    assert capsys.readouterr().err.startswith("mavproxy-uavapi flights: ")


def test_api_shows_a_flight_and_compares_two(world: World, store: FlightStore) -> None:
    first, second = line_flown(store, 0.0), line_flown(store, 3.0)
    path = f"/flights/{first}"
    told = world.ask("GET", f"{path}/overview").body
    assert told["vehicles"][0]["vehicle"] == 1 and len(told["vehicles"][0]["lat"]) == 21
    assert len(world.ask("GET", f"{path}/events?at=5&seconds=1").body["events"]) == 10
    for wrong in ("at=-1", "at=nan", "seconds=0", "seconds=31", "at=1e9"):
        assert world.ask("GET", f"{path}/events?{wrong}").status == 422
    beside = world.ask("GET", f"{path}/compare?other={second}").body
    assert beside["beside"]["mean_m"] == pytest.approx(3.0, abs=0.05) and beside["first"]["duration_s"] == 20.0
    assert world.ask("GET", f"{path}/compare?other={second}&vehicle=2").status == 400
    assert world.ask("GET", f"{path}/compare?other=x").status == 404


def test_file_that_is_damaged_or_gone_is_404(world: World, store: FlightStore) -> None:
    flight = line_flown(store, 0.0)
    path = store.file(store.find(flight))
    for content in (b"\x89MCAP0\r\n" + b"torn" * 40, None):
        path.unlink() if content is None else path.write_bytes(content)
        for what in ("overview", "events", "compare?other=mission"):
            assert world.ask("GET", f"/flights/{flight}/{what}").status == 404


def test_flight_that_is_not_complete_is_not_shown_yet(world: World) -> None:
    name = world.ask("POST", "/flights", {"name": "now"}).body["id"]
    for what in ("overview", "events", "compare?other=x"):
        assert world.ask("GET", f"/flights/{name}/{what}").status == 409


def test_file_is_not_made_twice_when_it_is_packed_again(store: FlightStore, tmp_path: Path) -> None:
    from mavproxy_uavapi.flights.flight_file import pack, records_of

    path = store.file(store.find(line_flown(store, 0.0)))
    pack(path, tmp_path / "again.mcap", {})
    names = [one.name for one in records_of(tmp_path / "again.mcap") if isinstance(one, Attachment)]
    assert names == ["overview.json.gz"]
    assert overview_of(tmp_path / "again.mcap") == overview_of(path)
