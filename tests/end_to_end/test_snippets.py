"""What README and docs/ tell a reader to type does what they say."""

from __future__ import annotations

import shutil

import pytest

from mavproxy_uavapi.flights.flight_export import write_zip
from mavproxy_uavapi.flights.flight_import import take
from mavproxy_uavapi.flights.flight_store import FlightStore
from tests.support.snippets import PAGES, ROOT, Reader, blocks

pytestmark = [pytest.mark.long, pytest.mark.needs("curl", "curl"), pytest.mark.needs("tmux", "tmux")]

# They have the commands of README.md (tests/rules/test_snippets.py), and a test of their own (test_contributing.py).
ELSEWHERE = ("docs/pt-BR/README.md", "CONTRIBUTING.md")
CORPUS = ROOT / "tests" / "corpus"


@pytest.fixture
def reader(tmp_path):
    """One who has some files of his own."""
    reader = Reader(tmp_path)
    shutil.copy(ROOT / "examples" / "tested" / "field.geojson", tmp_path)
    shutil.copy(CORPUS / "ini" / "uav_api.ini", tmp_path / "uav.ini")
    shutil.copy(CORPUS / "missions" / "qgroundcontrol.plan", tmp_path / "mission.plan")
    shutil.copy(CORPUS / "missions" / "qgroundcontrol.plan", tmp_path / "survey.plan")
    shutil.copy(CORPUS / "missions" / "mission_planner.waypoints", tmp_path / "mission.waypoints")
    (script,) = (block.text for block in blocks("docs/scripts.md") if block.about == "square.py")
    for name in ("square.py", "leader.py", "follower.py"):
        reader.write(name, script)
    store = FlightStore(tmp_path / "state" / "mavproxy-uavapi" / "flights")
    flight = take(store, CORPUS / "flights" / "arducopter-4.7.bin")
    shutil.copy(store.file(flight), tmp_path / "flight.mcap")
    write_zip(flight, store.file(flight), tmp_path / "flight.zip", 5.0)
    yield reader
    reader.close()


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page) and page not in ELSEWHERE])
def test_what_a_page_says_can_be_done(page, reader):
    for block in blocks(page):
        if block.mark != "not run":
            reader.do(block)
    reader.require_nothing_refused()
