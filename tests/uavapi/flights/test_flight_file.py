from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from mavproxy_uavapi.flights.flight_file import (
    FlightFile,
    FlightMessage,
    attachments_of,
    messages_of,
    metadata_of,
    pack,
)

NOON = 1_778_500_800_000_000_000  # ns since 1970
ABOUT = {"name": "survey 3"}


def view(number: int, size: int = 0) -> FlightMessage:
    data = {"view": "ned", "system": 1, "info": {"number": number, "more": "x" * size}}
    return FlightMessage("/1/ned", "uavapi.View", NOON + number * 10**8, json.dumps(data).encode())


def numbers(path: Path) -> list[int]:
    return [seen.data["info"]["number"] for seen in messages_of(path)]


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    """A file of fifty messages and an attachment, whose writer has not ended."""
    file = FlightFile(tmp_path / "it.journal")
    for number in range(50):
        file.write([view(number)])
    file.attach("parameters-1.param", "text/plain", b"WP_SPD 5\n", 0)
    file.note("versions", {"it": "1"})
    file.note("versions", {"it": "2"})
    yield file.path
    file.close(ABOUT)


def test_whatever_is_cut_off_at_its_end_all_before_it_is_read(journal: Path, tmp_path: Path) -> None:
    whole, known = journal.read_bytes(), numbers(journal)
    assert known == list(range(50))
    for length in range(0, len(whole), 7):
        torn = tmp_path / "torn.journal"
        torn.write_bytes(whole[:length])
        read = numbers(torn)
        assert read == known[: len(read)]
        assert len(read) >= 50 * (length - 1500) / len(whole)  # schemas and the record in which it ends


def test_mcaps_own_reader_seeks_in_a_packed_file(journal: Path, tmp_path: Path) -> None:
    target = tmp_path / "it.mcap"
    assert pack(journal, target, ABOUT) == 50
    with target.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == 50 and summary.chunk_indexes
        assert [schema.name for schema in summary.schemas.values()] == ["uavapi.View"]
        later = list(reader.iter_messages(starting_at=view(40).time))
        assert [json.loads(message.data)["info"]["number"] for _, _, message in later] == list(range(40, 50))
        known = {metadata.name: metadata.metadata for metadata in reader.iter_metadata()}
    digest = hashlib.sha256(b"WP_SPD 5\n").hexdigest()
    assert known == {"flight": ABOUT, "manifest": {"parameters-1.param": digest}, "versions": {"it": "2"}}
    assert metadata_of(target) == known
    assert [(one.name, one.data) for one in attachments_of(target)] == [("parameters-1.param", b"WP_SPD 5\n")]
    assert numbers(target) == list(range(50))


def test_a_torn_journal_is_packed_as_far_as_it_goes(journal: Path, tmp_path: Path) -> None:
    torn, target = tmp_path / "torn.journal", tmp_path / "torn.mcap"
    torn.write_bytes(journal.read_bytes()[:-300])
    count = pack(torn, target, ABOUT)
    assert 40 < count <= 50 and numbers(target) == list(range(count))


def test_no_file_is_written_over(journal: Path) -> None:
    with pytest.raises(FileExistsError):
        FlightFile(journal)


def test_who_else_is_on_the_machine_cannot_read_it(journal: Path) -> None:
    assert journal.stat().st_mode & 0o077 == 0


def test_files_for_foxglove_have_its_schemas(tmp_path: Path) -> None:
    from mavproxy_uavapi.flights.topics import Topics
    from mavproxy_uavapi.http.stream.stream_event import When, of_info

    def records(kind: str, name: str, info: Any) -> list[FlightMessage]:
        return list(topics.records(of_info(kind, name, 1, When(12.5, 3.0), info)))

    topics = Topics()
    place = {"position": {"lat": -35.3, "lon": 149.1, "alt": 590.0, "relative_alt": 6.0}}
    event, fix = records("view", "gps", place)
    assert json.loads(event.data)["info"] == place and (event.topic, event.time) == ("/1/gps", 12_500_000_000)
    assert (fix.topic, fix.schema) == ("/1/location", "foxglove.LocationFix")
    assert json.loads(fix.data)["timestamp"] == {"sec": 12, "nsec": 500_000_000}
    assert json.loads(fix.data)["latitude"] == -35.3

    records("view", "ned", {"position": {"x": 3.0, "y": 4.0, "z": -5.0}})
    for yaw, facing in ((0.0, (0.0, 1.0)), (90.0, (1.0, 0.0)), (180.0, (0.0, -1.0))):
        pose = json.loads(records("view", "attitude", {"roll": 0.0, "pitch": 0.0, "yaw": yaw})[1].data)["pose"]
        assert pose["position"] == {"x": 4.0, "y": 3.0, "z": 5.0}  # east, north, up
        q = pose["orientation"]
        forward = 1 - 2 * (q["y"] ** 2 + q["z"] ** 2), 2 * (q["x"] * q["y"] + q["w"] * q["z"])
        assert forward == pytest.approx(facing, abs=1e-9)
    nose_up = json.loads(records("view", "attitude", {"roll": 0.0, "pitch": 30.0, "yaw": 90.0})[1].data)
    q = nose_up["pose"]["orientation"]
    assert 2 * (q["x"] * q["z"] - q["w"] * q["y"]) == pytest.approx(0.5)  # how far up its nose points

    _, said = records("event", "statustext", {"severity": 2, "text": "Crash"})
    assert json.loads(said.data)["level"] == 4 and json.loads(said.data)["message"] == "Crash"
