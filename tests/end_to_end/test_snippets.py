"""What README and docs/ tell a reader to type does what they say."""

from __future__ import annotations

import re
import shutil

import pytest

from mavproxy_uavapi.flights.flight_export import write_zip
from mavproxy_uavapi.flights.flight_import import take
from mavproxy_uavapi.flights.flight_store import FlightStore
from tests.support.snippets import PAGES, ROOT, Reader, blocks

pytestmark = [
    pytest.mark.long,
    pytest.mark.apart,
    pytest.mark.needs("curl", "curl"),
    pytest.mark.needs("tmux", "tmux"),
]

# They have the commands of README.md (tests/rules/test_snippets.py), and a test of their own (test_contributing.py).
ELSEWHERE = ("docs/pt-BR/README.md", "CONTRIBUTING.md")
CORPUS = ROOT / "tests" / "corpus"


@pytest.fixture
def reader(tmp_path):
    """One who has some files of his own."""
    reader = Reader(tmp_path)
    field = (ROOT / "examples" / "tested" / "field.geojson").read_text(encoding="utf-8")
    (tmp_path / "field.geojson").write_text(field.replace('"radius": 80', '"radius": 300'), encoding="utf-8")
    shutil.copy(CORPUS / "ini" / "uav_api.ini", tmp_path / "uav.ini")
    shutil.copy(CORPUS / "missions" / "qgroundcontrol.plan", tmp_path / "mission.plan")
    shutil.copy(CORPUS / "missions" / "qgroundcontrol.plan", tmp_path / "survey.plan")
    shutil.copy(CORPUS / "missions" / "mission_planner.waypoints", tmp_path / "mission.waypoints")
    (script,) = (block.text for block in blocks("docs/scripts.md") if block.about == "square.py")
    up_and_down = re.sub(r"for leg in \(.*\):", "for leg in ():", script)
    for name, text in {"square.py": script, "leader.py": up_and_down, "follower.py": up_and_down}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
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
