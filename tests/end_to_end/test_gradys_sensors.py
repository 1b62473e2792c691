"""Sensors of the companion computer in a real MAVProxy: files, and commands that must not outlive it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import requests

from tests.support.ports import free_port

pytestmark = pytest.mark.long

INI = """\
[gradys]
sink = {url}/readings
spool = {folder}/spool.db
quantities = soil=file:{folder}/soil.txt@1[percent]
  gps=file:{folder}/gps_data@1[raw]
  hum=exec:"sh -c 'echo 61.5'"@1[percent]
  hangs=exec:"sh -c 'sleep 600 & echo $! $$ > {folder}/pids; wait'"@1
"""


@pytest.fixture(scope="module")
def rig(harness, tmp_path_factory) -> Iterator:
    made = harness.embedded(tmp_path_factory.mktemp("sensors"), "--sysid=10", speedup=1)
    yield made
    made.stop()


@pytest.fixture(scope="module")
def station(rig, harness) -> str:
    """A receiver's URL."""
    port = free_port()
    database = rig.directory / "station.db"
    command = [sys.executable, "-m", "mavproxy_gradys.station", f"--port={port}", f"--database={database}"]
    rig.start("station", command).says("listening on")
    return f"http://127.0.0.1:{port}"


def newest(station: str, quantity: str) -> Any:
    readings = requests.get(f"{station}/readings", params={"quantity": quantity}, timeout=10).json()["readings"]
    return readings[-1] if readings else None


def runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_sensors_of_an_ini_file(rig, station, harness, tmp_path):
    (tmp_path / "uav.ini").write_text(INI.format(url=station, folder=tmp_path))
    (tmp_path / "soil.txt").write_text("23.5\n")
    rig.mavproxy.ask(f'module load gradys:{{"config":"{tmp_path}/uav.ini"}}', "Loaded module gradys")
    try:
        soil = harness.eventually(lambda: newest(station, "soil"), what="the file's reading")
        assert (soil["device"], soil["value"], soil["representation"]) == ("uav-10", 23.5, "percent")
        assert harness.eventually(lambda: newest(station, "hum"), what="the command's reading")["value"] == 61.5
        rig.mavproxy.says("GRADYS_GS: no reading of gps:")
        rig.mavproxy.ask("gradys status", "gps every 1 s: 0 taken")
        # The latest reading of a recording is a sensor, as CentMesh's sensing daemon has it.
        rig.mavproxy.ask(
            f"gradys track record {tmp_path}/flight.track 5 --latest {tmp_path}/gps_data", "recording vehicle"
        )
        reading = harness.eventually(lambda: newest(station, "gps"), what="the text's reading")
        assert reading["value"].startswith("GPS_RAW_INT {time_usec : ")
        rig.mavproxy.says("GRADYS_GS: gps is read again")
        rig.mavproxy.ask('gradys set quantities a=exec:"touch x"@1', "only an INI file may have exec:")
        pids = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
        assert len(pids) == 2
    finally:
        rig.mavproxy.ask("module unload gradys", "Unloaded module gradys")
    for pid in [int(pid) for pid in (tmp_path / "pids").read_text().split()]:
        harness.eventually(lambda pid=pid: not runs(pid), what="its end")
    harness.eventually(lambda: rig.get("/telemetry/gps").ok, what="the API without the module, and a position")
