"""The files in packaging/ name what the station has: its metrics, its options, and what its broker must keep."""

from __future__ import annotations

import asyncio
import importlib.util
import json
import os
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.station.fleet import AlarmLimits
from mavproxy_gradys.station.fleet_watch import FleetWatch
from mavproxy_gradys.station.health import StationHealth
from mavproxy_gradys.station.inbox import Inbox
from mavproxy_gradys.station.intake import Intake
from mavproxy_gradys.station.metrics import StationCollector, exposition
from mavproxy_gradys.station.options import parser
from mavproxy_gradys.station.sqlite_store import SqliteStore
from mavproxy_gradys.station.statistics import Statistics

PACKAGING = Path(__file__).parents[2] / "packaging"


def program(name: str) -> Any:
    """One of packaging/*.py, as a module."""
    spec = importlib.util.spec_from_file_location(name, PACKAGING / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Broker:
    problem = ""


def test_the_dashboard_asks_for_metrics_that_there_are(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "station.db")
    watch = FleetWatch(store, AlarmLimits(10, 20))
    health = StationHealth(watch, Intake(store, Statistics()), Inbox(1, lambda: 0.0), Broker())
    text = exposition(StationCollector(Statistics(), watch, health)).decode()
    exported = set(re.findall(r"^(station_\w+)", text, re.MULTILINE))
    asyncio.run(store.close())
    panels = json.loads((PACKAGING / "grafana-station.json").read_text(encoding="utf-8"))["panels"]
    requested = {
        name for panel in panels for one in panel["targets"] for name in re.findall(r"station_[a-z_]+", one["expr"])
    }
    assert len(requested) >= 10 and requested <= exported


def test_the_unit_starts_a_worker() -> None:
    unit = (PACKAGING / "mavproxy-gradys-station@.service").read_text(encoding="utf-8")
    (command,) = re.findall(r"^ExecStart=\S+ -m mavproxy_gradys.station (.*)$", unit, re.MULTILINE)
    assert parser().parse_args(command.replace("%i", "8081").split()).port == 8081


def test_the_broker_drops_nothing_and_keeps_what_it_has() -> None:
    lines = (PACKAGING / "mosquitto.conf").read_text(encoding="utf-8").splitlines()
    settings = dict(line.split(maxsplit=1) for line in lines if line and not line.startswith("#"))
    assert settings["max_queued_messages"] == settings["max_inflight_messages"] == "0"
    assert settings["persistence"] == "true" and settings["allow_anonymous"] == "false"


def test_wheel_of_the_bundle_has_its_scripts_and_nothing_unneeded(tmp_path: Path) -> None:
    wheel, to = tmp_path / "mavproxy-1.8-py3-none-any.whl", tmp_path / "slim"
    info, script, globe = (
        "mavproxy-1.8.dist-info",
        "mavproxy-1.8.data/scripts/mavproxy.py",
        "MAVProxy/modules/mavproxy_cesium/a.js",
    )
    kept = {
        "MAVProxy/mavproxy.py": b"1",
        script: b"2",
        f"{info}/METADATA": b"Metadata-Version: 2.4\nName: MAVProxy\nVersion: 1.8\n",
    }
    record = "".join(f"{name},,\n" for name in [*kept, globe, f"{info}/RECORD"])
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, content in {**kept, globe: b"3", f"{info}/RECORD": record.encode()}.items():
            archive.writestr(name, content)
    to.mkdir()
    with zipfile.ZipFile(program("bundle").slim(wheel, to)) as archive:
        named = "MAVProxy-1.8.data/scripts/mavproxy.py"
        assert set(archive.namelist()) == {"MAVProxy/mavproxy.py", named, f"{info}/METADATA", f"{info}/RECORD"}
        assert {row.split(",")[0] for row in archive.read(f"{info}/RECORD").decode().split()} == set(
            archive.namelist()
        )


def test_the_bundle_of_another_machine_takes_its_wheels() -> None:
    platform = json.loads(program("bundle").platform("3.13", "aarch64"))
    fitting = {"cp313-cp313-manylinux_2_17_aarch64", "cp37-abi3-manylinux2014_aarch64", "py3-none-any"}
    assert fitting <= set(platform["compatible_tags"])
    assert platform["marker_environment"]["python_version"] == "3.13"


def test_source_distribution_is_the_same_whoever_packs_it_and_when(tmp_path: Path) -> None:
    packed = []
    for number, (mode, mtime) in enumerate([(0o600, 1e9), (0o664, 1.5e9)]):
        folder = tmp_path / str(number)
        folder.mkdir()
        for name in ("b.py", "a.py")[:: 1 if number else -1]:
            (folder / name).write_text("pass\n")
            (folder / name).chmod(mode)
            os.utime(folder / name, (mtime, mtime))
        archive = folder / "project-1.tar.gz"
        with tarfile.open(archive, "w:gz") as file:
            for name in sorted(["b.py", "a.py"], reverse=bool(number)):
                file.add(folder / name, f"project-1/{name}")
        (tmp_path / f"to{number}").mkdir()
        packed.append(program("distributions").dated(archive, 1_700_000_000, tmp_path / f"to{number}").read_bytes())
    assert packed[0] == packed[1]
    with tarfile.open(tmp_path / "to0" / "project-1.tar.gz") as file:
        assert [one.name for one in file] == ["project-1/a.py", "project-1/b.py"]


@pytest.mark.long
def test_wheels_are_whole_and_the_same_twice(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        command = [sys.executable, PACKAGING / "distributions.py", "--to", tmp_path / folder]
        subprocess.run(command, check=True, capture_output=True)
    one, two = (sorted((tmp_path / folder).iterdir()) for folder in ("one", "two"))
    assert [file.read_bytes() for file in one] == [file.read_bytes() for file in two] and len(one) == 4
    with zipfile.ZipFile(next(file for file in one if file.match("mavproxy_uavapi-*.whl"))) as wheel:
        names = wheel.namelist()
    assert {"uavapi.py", "vision.py", "gradys.py", "mavproxy_uavapi/companion/uav.ini"} <= set(names)
    assert not [name for name in names if "test" in name.split("/")[0]]
    for wheel_file in one:
        if wheel_file.suffix == ".whl":
            assert any(name.endswith("licenses/LICENSE") for name in zipfile.ZipFile(wheel_file).namelist())


def test_bundle_has_ardupilots_words_on_parameters_and_the_manual(tmp_path: Path) -> None:
    tree, wheel = tmp_path / "ardupilot", tmp_path / "mavproxy_uavapi-1-py3-none-any.whl"
    tool = tree / "Tools" / "autotest" / "param_metadata" / "param_parse.py"
    tool.parent.mkdir(parents=True)
    tool.write_text("import sys; open('apm.pdef.xml', 'w').write(' '.join(sys.argv[1:]))", encoding="ascii")
    with zipfile.ZipFile(wheel, "w") as made:
        made.writestr("mavproxy_uavapi/files/parameter_docs.py", "code")
        made.writestr("mavproxy_uavapi-1.dist-info/RECORD", "mavproxy_uavapi/files/parameter_docs.py,,\n")
    bundle = program("bundle")
    bundle.add({**bundle.documented(tree), "mavproxy_uavapi/manual.zip": b"the manual"}, wheel)
    with zipfile.ZipFile(wheel) as made:
        files = {name.rpartition("/")[2]: made.read(name).decode() for name in made.namelist()}
    assert files["Copter.xml"] == "--format xml --vehicle ArduCopter"
    assert files["Plane.xml"] == "--format xml --vehicle ArduPlane"
    assert (files["parameter_docs.py"], files["manual.zip"]) == ("code", "the manual")
    assert "mavproxy_uavapi/files/parameter_docs/Rover.xml,," in files["RECORD"].splitlines()
