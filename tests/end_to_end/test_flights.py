"""Flights are recorded by a real MAVProxy: taken home whole, and nearly whole after a kill."""

from __future__ import annotations

import asyncio
import io
import os
import re
import signal
import subprocess
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import requests
from mcap.reader import make_reader
from pymavlink import mavutil

from mavproxy_uavapi.flights.flight_file import messages_of
from tests.support.chromium import chromium
from tests.support.page_pilot import Pilot
from tests.support.ports import free_port
from tests.support.processes import SCRIPTS, Process, Rig, eventually

pytestmark = pytest.mark.long
ROOT = Path(__file__).parents[2]
END = "[aria-label='end the record survey 3']"
BUSY = 2.0  # s that a busy machine may take


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "flights"


@pytest.fixture
def rig(tmp_path: Path, folder: Path, harness: ModuleType) -> Iterator[Rig]:
    made = harness.embedded(tmp_path, speedup=4, flights=str(folder))
    yield made
    made.stop()


def complete(rig: Rig, count: int) -> list[dict[str, Any]]:
    """The flights, once so many are packed."""

    def packed() -> Any:
        flights = rig.ok(rig.get("/flights"))["flights"]
        return len(flights) == count and all(flight["state"] == "complete" for flight in flights) and flights

    found: list[dict[str, Any]] = eventually(packed, 60, "the flights' being packed")
    return found


def fly(rig: Rig) -> None:
    rig.until(lambda: rig.status()["ready_to_arm"], 90, "its being ready")
    rig.in_the_air(10)
    rig.ok(rig.post("/movement/go_to_ned_wait", x=20, y=0, z=-10))


MISSION = """\
QGC WPL 110
0 1 0 16 0 0 0 0 -35.363261 149.16523 584 1
1 0 3 22 0 0 0 0 0 0 10 1
2 0 3 16 0 0 0 0 -35.3631 149.1653 10 1
""".replace(" ", "\t").replace("QGC\tWPL\t110", "QGC WPL 110")


def test_flight_is_taken_home_as_the_pages_say(rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = rig.mavproxy.ask("uavapi flight start survey3", "is recorded until")
    assert "survey3" in said
    (tmp_path / "square.txt").write_text(MISSION)
    rig.mavproxy.ask(f"wp load {tmp_path / 'square.txt'}", "TYPE_MISSION: ACCEPTED")
    fly(rig)
    rig.ok(rig.get("/command/land", wait="true"))
    rig.mavproxy.ask("uavapi flight stop", "survey3")
    flights = complete(rig, 2)
    assert [flight["name"] for flight in flights] == ["", "survey3"]
    assert {"mission-1-1.waypoints", "parameters-at-the-end-1.param"} <= set(flights[1]["files"])
    assert flights[1]["versions"]["vehicle-1"] and flights[1]["versions"]["MAVProxy"]
    monkeypatch.chdir(tmp_path)
    for flight in flights:
        data = rig.get(f"/flights/{flight['id']}.mcap").content
        assert len(data) == flight["bytes"]
        assert make_reader(io.BytesIO(data)).get_summary().statistics.message_count == flight["messages"]
        Path("flight.mcap").write_bytes(data)
        Path("flight.zip").write_bytes(rig.get(f"/flights/{flight['id']}.zip", rate="2").content)
        with zipfile.ZipFile("flight.zip") as archive:
            names = set(archive.namelist())
            assert {"vehicle1.csv", "vehicle1.parquet", "path.gpx", "path.kml", "trail.csv", "flight.json"} <= names
            assert {f"files/{name}" for name in flight["files"]} | {"SHA256SUMS"} <= names
            rows = archive.read("vehicle1.csv").decode().splitlines()
            assert "takeoff" in archive.read("trail.csv").decode()
        assert len(rows) > 10 and max(float(row.split(",")[6] or 0) for row in rows[1:]) > 9.0
    snippets = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "data.md").read_text(encoding="utf-8"), re.DOTALL)
    (reading,) = [one for one in snippets if "mcap" in one]  # tests/rules/test_data_page.py runs the others
    shown: list[str] = []
    exec(reading, {"print": lambda *words: shown.append(str(words))})
    assert len(shown) > 10 and "relative_alt" in shown[0]
    listed = subprocess.run(
        [SCRIPTS / "mavproxy-uavapi", "flights", "--folder", tmp_path / "flights", "list"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "'survey3': vehicle 1," in listed.stdout


def test_kill_in_flight_loses_a_second_and_the_next_start_makes_a_whole_file_of_the_rest(
    rig: Rig, folder: Path
) -> None:
    fly(rig)
    rig.ok(rig.post("/movement/go_to_ned", x=400, y=0, z=-10))
    time.sleep(3.0)
    os.killpg(rig.mavproxy.pid, signal.SIGKILL)
    killed_at = time.time()
    (journal,) = folder.glob("*.journal")
    last = max(message.time for message in messages_of(journal))
    assert killed_at - last < 1.0 + BUSY
    rig.mavproxy = rig.start("again", list(rig.mavproxy.popen.args))
    eventually(lambda: any(folder.glob("*.mcap")), 60, "the file's being whole")
    (whole,) = folder.glob("*.mcap")
    with whole.open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_end_time >= last * 1e9 - 1000


async def look(rig: Rig, directory: Path) -> list[str]:
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await page.visit(rig.url + "/")
        await pilot.sees_live()
        await pilot.click("Flights")
        await page.evaluate("document.querySelector('flight-list input').value = 'survey 3'")
        await pilot.click("Record all vehicles")
        await pilot.sees("flight-list", "survey 3")
        await asyncio.to_thread(fly, rig)
        await pilot.sees("flight-list", "Vehicle 1")
        await page.evaluate(f"document.querySelector({END!r}).click()")
        await page.until(f"!document.querySelector({END!r})")
        (directory / "flights.png").write_bytes(await page.picture())
        await pilot.finds_it_accessible()
        return page.complaints


def test_replay_is_heard_by_a_ground_station_and_refuses_every_command(
    rig: Rig, folder: Path, tmp_path: Path
) -> None:
    fly(rig)
    rig.ok(rig.get("/command/land", wait="true"))
    (flight,) = complete(rig, 1)
    rig.stop()
    port, out = free_port(), free_port()
    with mavutil.mavlink_connection(f"udpin:127.0.0.1:{out}") as station:
        command = [SCRIPTS / "mavproxy-uavapi", "--replay", folder / f"{flight['id']}.mcap", "--headless"]
        command += [f"--port={port}", f"--log_path={tmp_path}/replay", "--gs_connection", f"127.0.0.1:{out}"]
        player = Process([str(word) for word in command], tmp_path / "player.log", tmp_path)
        try:
            player.says("nothing can be commanded", timeout=90)
            url = f"http://127.0.0.1:{port}"
            assert requests.get(f"{url}/telemetry/gps", timeout=30).status_code == 200
            refused = requests.get(f"{url}/command/arm", timeout=30)
            assert refused.status_code == 403 and "read only" in refused.json()["detail"]
            told = [message.to_dict() for message in iter(station.recv_msg, None)]
            assert any(one["mavpackettype"] == "GLOBAL_POSITION_INT" for one in told)
            assert any("REPLAY" in str(one.get("text")) for one in told)
        finally:
            player.stop()


SHOWN = "document.querySelector('replay-bar').context"


async def replay(rig: Rig, directory: Path, flight: str, other: str) -> list[str]:
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await page.visit(f"{rig.url}/#replay={flight}")
        await page.until("document.querySelector('replay-bar')?.context?.replay.overview.seconds > 1")
        strip = await page.evaluate("document.getElementById('trouble').textContent")
        assert strip.startswith(f"REPLAY of {flight}: nothing here is live")
        commanding = "hold-all, go-to, flight-actions, fleet-actions, mission-plan, script-list"
        assert await page.evaluate(f"document.querySelectorAll({commanding!r}).length") == 0
        await page.until(f"{SHOWN}.fleet.of(1).get('gps')")
        refused = f"{SHOWN}.api.command('/vehicles/1/command/arm').then(() => '', error => error.message)"
        assert "nothing can be commanded" in await page.evaluate(refused)
        await page.evaluate("document.querySelector('replay-bar select').value = '5'")
        await page.evaluate("document.querySelector('replay-bar select').dispatchEvent(new Event('change'))")
        await pilot.click("Play")
        await page.until(f"{SHOWN}.replay.time > 3 && !{SHOWN}.replay.isPlaying")  # at the end it stands
        await page.until(f"{SHOWN}.fleet.of(1).get('gps').position.relative_alt < 1")
        middle = f"{SHOWN}.replay.overview.vehicles[0].relative_alt.findIndex(alt => alt > 9)"
        await page.evaluate(f"{SHOWN}.replay.jump({SHOWN}.replay.overview.vehicles[0].seconds[{middle}])")
        await page.until(f"{SHOWN}.fleet.of(1).get('gps')?.position.relative_alt > 8")
        chosen = f"document.querySelector('replay-bar [aria-label=\"beside another flight\"]').value = {other!r}"
        await page.evaluate(chosen)
        await page.evaluate("document.querySelectorAll('replay-bar select')[1].dispatchEvent(new Event('change'))")
        await pilot.sees("replay-bar", "on average, at most")
        await pilot.click("History")
        await pilot.sees("history-list", "takeoff")
        (directory / "replay.png").write_bytes(await page.picture())
        await pilot.finds_it_accessible()
        return page.complaints


@pytest.mark.needs("chromium")
def test_page_replays_a_flight_and_can_command_nothing_meanwhile(rig: Rig, tmp_path: Path) -> None:
    for number in (1, 2):
        fly(rig)
        rig.ok(rig.get("/command/land", wait="true"))
        flights = complete(rig, number)
    jobs = len(rig.ok(rig.get("/jobs"))["jobs"])
    assert asyncio.run(replay(rig, tmp_path, flights[0]["id"], flights[1]["id"])) == []
    assert len(rig.ok(rig.get("/jobs"))["jobs"]) == jobs and not rig.status()["armed"]


@pytest.mark.needs("chromium")
def test_page_begins_and_ends_a_record_and_shows_the_flight(rig: Rig, tmp_path: Path) -> None:
    assert asyncio.run(look(rig, tmp_path)) == []
    assert any(flight["name"] == "survey 3" and flight["ended"] for flight in rig.ok(rig.get("/flights"))["flights"])
