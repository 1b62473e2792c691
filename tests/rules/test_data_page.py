"""The lines of docs/data.md for other programs do what they say; the layout for Foxglove shows what a record has."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.flights.flight_export import TABLE, write_zip
from mavproxy_uavapi.flights.flight_file import messages_of
from mavproxy_uavapi.flights.flight_import import take
from mavproxy_uavapi.flights.flight_store import FlightStore

ROOT = Path(__file__).parents[2]
LOG = ROOT / "tests" / "corpus" / "flights" / "arducopter-4.7.bin"
SNIPPETS = dict(re.findall(r"```(\w+)\n(.*?)```", (ROOT / "docs" / "data.md").read_text(encoding="utf-8"), re.DOTALL))
PYTHON = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "data.md").read_text(encoding="utf-8"), re.DOTALL)
LAYOUT = json.loads((ROOT / "examples" / "foxglove-flight.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `flight.mcap` and `flight.zip`."""
    folder = tmp_path_factory.mktemp("data")
    store = FlightStore(folder / "flights")
    flight = take(store, LOG)
    shutil.copy(store.file(flight), folder / "flight.mcap")
    write_zip(flight, store.file(flight), folder / "flight.zip", 5.0)
    return folder


@pytest.mark.parametrize("needed", ["pandas", "mcap"])
def test_lines_of_python_show_numbers(home: Path, monkeypatch: pytest.MonkeyPatch, needed: str) -> None:
    pytest.importorskip(needed)
    (lines,) = [one for one in PYTHON if needed in one]
    monkeypatch.chdir(home)
    shown: list[str] = []
    exec(lines, {"print": lambda *words: shown.append(" ".join(map(str, words)))})
    assert "relative_alt" in shown[0]


@pytest.mark.parametrize(("language", "command"), [("r", ["Rscript", "-e"]), ("matlab", ["matlab", "-batch"])])
def test_lines_of_another_language_draw_a_picture(home: Path, language: str, command: list[str]) -> None:
    lines = SNIPPETS[language]
    columns = {*re.findall(r"\bt[.$](\w+)", lines), *re.findall(r'"([a-z]+_[a-z]+)"', lines)}
    assert {"seconds", "relative_alt"} <= columns <= set(TABLE)
    if shutil.which(command[0]):
        subprocess.run([*command, lines], cwd=home, check=True, capture_output=True, timeout=120)
        assert (home / "height.png").stat().st_size > 1000


def paths_of(layout: Any) -> list[str]:
    """The topics, and the members of their messages, that a layout shows."""
    panels = layout["configById"].values()
    curves = [curve["value"] for panel in panels for curve in panel.get("paths", ())]
    topics = [
        panel[name] for panel in panels for name in ("topicPath", "topicToRender", "followTopic") if name in panel
    ]
    return [*curves, *topics, *(topic for panel in panels for topic in panel.get("topics", ()))]


def test_the_layout_shows_what_a_record_has(home: Path) -> None:
    """Jobs and pictures, which this log has not, are in tests/uavapi/flights/test_recorder.py."""
    newest = {seen.topic: seen.data for seen in messages_of(home / "flight.mcap")}
    paths = [path for path in paths_of(LAYOUT) if path not in ("/1/job", "/1/general.info.groundspeed")]
    assert len(paths) >= 6
    for path in paths:
        topic, *members = path.split(".")
        value: Any = newest[topic]
        for member in members:
            value = value[member]
        assert not members or isinstance(value, int | float), path
