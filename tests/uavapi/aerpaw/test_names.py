"""The names that scripts import, and how a script is found and told."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from mavproxy_uavapi.aerpaw import names, options, script
from mavproxy_uavapi.aerpaw.exceptions import StateMachineError
from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.aerpaw.runner import StateMachine

RUNNERS = (
    "BasicRunner StateMachine ZmqStateMachine entrypoint state timed_state background at_init in_background sleep"
)
IMPORTS = {
    "aerpawlib.v1.vehicle": "Vehicle Drone Rover DummyVehicle",
    "aerpawlib.vehicle": "Vehicle Drone Rover DummyVehicle",
    "aerpawlib.v1.runner": f"{RUNNERS} expose_zmq expose_field_zmq",
    "aerpawlib.runner": f"{RUNNERS} expose_zmq expose_field_zmq",
    "aerpawlib.v1.util": "Coordinate VectorNED Waypoint read_from_plan read_from_plan_complete readGeofence inside",
    "aerpawlib.util": "Coordinate VectorNED doIntersect get_location_from_waypoint",
    "aerpawlib.v1.external": "ExternalProcess",
    "aerpawlib.external": "ExternalProcess",
    "aerpawlib.aerpaw": "AERPAW_Platform",
    "aerpawlib.v1.exceptions": "MAVSDKNotInstalledError AerpawlibError NavigationError HeartbeatLostError",
    "aerpawlib.v1.safety": "SafetyCheckerClient SafetyCheckerServer serialize_request deserialize_msg",
    "aerpawlib.v1.safety.server": "SafetyCheckerServer main_cli",
    "aerpawlib.v1.safety.wire_format": "serialize_msg serialize_response",
    "aerpawlib.safetyChecker": "SafetyCheckerClient SafetyCheckerServer",
    "aerpawlib.v1.constants": "EARTH_RADIUS_M ZMQ_PROXY_IN_PORT COPTER_GUIDED_MODE HEARTBEAT_TIMEOUT_S",
    "aerpawlib.v1.helpers": "ThreadSafeValue heading_difference wait_for_condition wait_for_value_change",
    "aerpawlib.structured_log": "StructuredEventLogger",
    "aerpawlib.v1.log": "ColoredFormatter LogComponent LogLevel configure_logging get_logger",
    "aerpawlib.v1.util.geometry": "Coordinate VectorNED",
    "aerpawlib.v1": "BasicRunner Drone VectorNED entrypoint Coordinate StateMachine ExternalProcess",
    "aerpawlib": "BasicRunner Drone VectorNED entrypoint",
    "aerpawlib.v2": "BasicRunner StateMachine ZmqStateMachine Drone Rover Vehicle DummyVehicle MockVehicle VectorNED"
    " Coordinate ExternalProcess AerpawPlatform SafetyCheckerClient VehicleTask read_from_plan read_geofence inside"
    " entrypoint state timed_state background at_init expose_zmq UnexpectedDisarmError Battery run_zmq_proxy",
    "aerpawlib.v2.aerpaw": "AerpawPlatform OeoSeverity",
    "aerpawlib.v2.constants": "PLAN_CMD_TAKEOFF DEFAULT_MIN_BATTERY_PERCENT MOCK_LAT",
    "aerpawlib.v2.exceptions": "AerpawlibError RunnerError PlanError TaskCancelledError UnexpectedDisarmError",
    "aerpawlib.v2.external": "ExternalProcess",
    "aerpawlib.v2.geofence": "polygon_edges read_geofence do_intersect",
    "aerpawlib.v2.log": "LogComponent LogLevel configure_logging get_logger set_level",
    "aerpawlib.v2.plan": "get_location_from_waypoint read_from_plan_complete",
    "aerpawlib.v2.runner": "BasicRunnerConfig StateSpec expose_field_zmq",
    "aerpawlib.v2.safety": "NoOpSafetyChecker PreflightChecks SafetyCheckerClient setup_signal_handlers",
    "aerpawlib.v2.testing": "MockVehicle DummyVehicle",
    "aerpawlib.v2.types": "Coordinate VectorNED Attitude Battery GPSInfo",
    "aerpawlib.v2.vehicle": "Drone Rover Vehicle VehicleTask",
    "aerpawlib.v2.zmqutil": "run_zmq_proxy",
}


@pytest.fixture
def served() -> Iterator[None]:
    """aerpawlib's names, for the test only."""
    before = list(sys.meta_path)
    names.serve()
    yield
    sys.meta_path[:] = before
    for name in [name for name in sys.modules if name.partition(".")[0] == "aerpawlib"]:
        del sys.modules[name]


@pytest.mark.parametrize("module", IMPORTS)
def test_scripts_find_what_they_import(served: None, module: str) -> None:
    there = importlib.import_module(module)
    assert [name for name in IMPORTS[module].split() if not hasattr(there, name)] == []


def test_same_class_by_every_name(served: None) -> None:
    assert importlib.import_module("aerpawlib.util").Coordinate is Coordinate
    assert importlib.import_module("aerpawlib.v1").Coordinate is Coordinate
    assert importlib.import_module("aerpawlib.v2").Coordinate is Coordinate


@pytest.mark.parametrize("name", ["aerpawlib.v3", "aerpawlib.v1.nothing", "aerpawlib.v2.protocols"])
def test_what_is_not_served_is_not_there(served: None, name: str) -> None:
    with pytest.raises(ModuleNotFoundError, match="v1"):
        importlib.import_module(name)


def test_no_other_process_finds_it() -> None:
    code = "import mavproxy_uavapi.aerpaw.host\nimport aerpawlib"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert "No module named 'aerpawlib'" in done.stderr


def test_real_package_is_left_alone_or_lends_its_util(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    package = tmp_path / "aerpawlib" / "v1"
    package.mkdir(parents=True)
    (package.parent / "__init__.py").write_text("")
    (package / "__init__.py").write_text("")
    (package / "util.py").write_text("class Coordinate:\n    real = True\n")
    info = tmp_path / "aerpawlib-1.4.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: aerpawlib\nVersion: 1.4.5\n")
    code = (
        "from mavproxy_uavapi.aerpaw import names\n"
        "try:\n    names.serve()\nexcept names.AlreadyInstalled as error:\n    print(error)\n"
        "names.serve(real=True)\n"
        "from aerpawlib.v1.util import Coordinate\nfrom aerpawlib.v1.vehicle import Drone\n"
        "print(Coordinate.real, Drone.__module__)\n"
    )
    environment = {"PYTHONPATH": f"{tmp_path}:{Path(__file__).parents[3]}", "PATH": "/usr/bin:/bin"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True, env=environment
    )
    output = done.stdout.splitlines()
    assert "--real" in output[0]
    assert output[1] == "True mavproxy_uavapi.aerpaw.drone"


# -- the command line -------------------------------------------------------------------------------------


def test_what_is_not_ours_is_the_scripts_in_its_order() -> None:
    arguments = ["--file", "a.plan", "--script", "s.py", "--lat", "-35.5", "--vehicle", "drone", "-r", "5", "--ping"]
    chosen, rest = options.parse(arguments)
    assert (chosen.script, chosen.vehicle, chosen.on_exit) == ("s.py", "drone", "rtl")
    assert rest == ["--file", "a.plan", "--lat", "-35.5", "-r", "5", "--ping"]


def test_options_of_files_come_before_those_of_the_command_line(tmp_path: Path) -> None:
    one, two = tmp_path / "one.json", tmp_path / "two.json"
    one.write_text(json.dumps({"vehicle": "rover", "skip-init": True, "conn": "http://a", "quiet": False}))
    two.write_text(json.dumps({"conn": "http://b", "file": "x.plan"}))
    chosen, rest = options.parse(["--config", str(one), "--config", str(two), "--script", "s", "--vehicle", "none"])
    assert (chosen.vehicle, chosen.skip_init, chosen.conn, chosen.quiet) == ("none", True, "http://b", False)
    assert rest == ["--file=x.plan"]


def test_options_of_the_original_are_understood() -> None:
    line = "--script s --conn http://a --vehicle generic --mavsdk-port 50052 --no-aerpaw-environment --skip-rtl"
    more = "--api-version v1 --no-status-bar --conn-timeout 5 --heartbeat-timeout 2 --zmq-identifier a"
    chosen, rest = options.parse([*line.split(), *more.split(), "--zmq-proxy-server", "b"])
    assert rest == [] and chosen.heartbeat_timeout == 2.0


@pytest.mark.parametrize("arguments", [["--vehicle", "drone"], ["--script", "a", "--vehicle", "plane"]])
def test_options_that_make_no_sense_end_with_a_sentence(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        options.parse(arguments)
    assert "--script" in capsys.readouterr().err


@pytest.fixture
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of scripts, the current one; what is imported there is forgotten."""
    modules, path = set(sys.modules), list(sys.path)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        del sys.modules[name]


SCRIPT = """
from beside_it import NUMBER
from mavproxy_uavapi.aerpaw.runner import StateMachine

class Base(StateMachine):
    number = NUMBER

class Mission(Base):
    pass
"""


@pytest.mark.parametrize("name", ["a_script.py", "a_script", "./a_script.py"])
def test_script_is_found_with_what_lies_beside_it(in_folder: Path, name: str) -> None:
    (in_folder / "beside_it.py").write_text("NUMBER = 3\n")
    (in_folder / "a_script.py").write_text(SCRIPT)
    kind = script.runner_of(script.load(name))
    assert (kind.__name__, kind.number) == ("Mission", 3)  # type: ignore[attr-defined]
    assert issubclass(kind, StateMachine)


def test_script_may_be_a_dotted_name(in_folder: Path) -> None:
    (in_folder / "folder_of_scripts").mkdir()
    (in_folder / "beside_it.py").write_text("NUMBER = 3\n")
    (in_folder / "folder_of_scripts" / "one.py").write_text(SCRIPT)
    assert script.runner_of(script.load("folder_of_scripts.one")).__name__ == "Mission"


@pytest.mark.parametrize(("text", "says"), [("", "it has none"), (SCRIPT + "class B(Base): pass", "Mission, B")])
def test_script_has_one_runner(in_folder: Path, text: str, says: str) -> None:
    (in_folder / "beside_it.py").write_text("NUMBER = 3\n")
    (in_folder / "odd_script.py").write_text(text)
    with pytest.raises(StateMachineError, match=says):
        script.runner_of(script.load("odd_script.py"))


def test_script_that_is_not_there_is_named(in_folder: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere.py"):
        script.load("nowhere.py")
