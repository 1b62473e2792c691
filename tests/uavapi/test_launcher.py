"""The launcher: options, command lines, and that it ends all of its processes and none of anybody else's."""

from __future__ import annotations

import dataclasses
import json
import os
import pty
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import termios
import textwrap
import time
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.core.vehicle.geodesy import offset
from mavproxy_uavapi.launcher import (
    cli,
    command_lines,
    directories,
    environment,
    instances,
    locations,
    main,
    options,
    processes,
)
from mavproxy_uavapi.launcher.errors import LaunchError, OptionError
from mavproxy_uavapi.launcher.fleet import SimulatedVehicle, fleet, kinds
from mavproxy_uavapi.launcher.options import RunOptions, parse
from mavproxy_vision import opencv_install

ROOT = Path(cli.__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def own_directories(tmp_path, monkeypatch):
    """Nothing of the user's is read or written."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("ARDUPILOT_LOCATIONS", str(tmp_path / "locations.txt"))
    monkeypatch.delenv("UAVAPI_TOKEN", raising=False)


def ini(tmp_path, text):
    file = tmp_path / "uav.ini"
    file.write_text(textwrap.dedent(text), encoding="utf-8")
    return f"--config={file}"


# Options


def test_the_table_and_the_options_name_the_same_things():
    others = {"module", "mavproxy_args", "further", "vision_config", "gradys_config", "origins"}
    assert {row.name for row in options.TABLE} | others == {field.name for field in dataclasses.fields(RunOptions)}


def test_defaults_are_those_of_the_original_service():
    assert parse([]) == RunOptions()
    assert RunOptions().port == 8000
    assert RunOptions().sysid == 10
    assert RunOptions().uav_connection == "127.0.0.1:17171"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], False),
        (["--simulated"], True),
        (["--simulated", "true"], True),
        (["--simulated", "False"], False),
        (["--simulated=0"], False),
        (["--simulated", "--port", "8001"], True),
    ],
)
def test_a_switch_works_bare_and_with_a_word(words, expected):
    assert parse(words).simulated is expected


def test_file_of_the_original_service_loads(tmp_path):
    loaded = parse(
        [
            ini(
                tmp_path,
                """
                [api]
                port=8001
                uav_connection=127.0.0.1:17172
                connection_type=udpin
                sysid=11
                gradys_gs = None
                scripts_path = ~/scripts

                [simulated]
                location=AbraDF
                ardupilot_path=None
                speedup=5
                gs_connection=[192.168.1.5:14550, 192.168.1.6:14550]

                [logs]
                log_console=[VEHICLE, UVICORN, SCRIPT]
                debug=[]
                """,
            )
        ]
    )
    assert loaded == RunOptions(
        port=8001,
        uav_connection="127.0.0.1:17172",
        sysid=11,
        scripts_path=str(Path.home() / "scripts"),
        simulated=True,
        speedup=5.0,
        gs_connection=("192.168.1.5:14550", "192.168.1.6:14550"),
        log_console=("COPTER", "API", "SCRIPT"),
    )


def test_command_line_wins_over_the_file_wherever_it_stands(tmp_path):
    file = ini(tmp_path, "[api]\nport=8001\nsysid=11\ngradys_gs=1.2.3.4:80\n[simulated]\nspeedup=5\n")
    assert parse([file, "--port", "8002"]).port == 8002
    assert parse(["--port", "8000", file]).port == 8000
    assert parse(["--port", "8002", file]).sysid == 11
    assert parse([file, "--simulated", "false"]).simulated is False
    assert parse([file, "--gradys_gs", "None"]).gradys_gs is None


def test_simulated_section_may_say_no(tmp_path):
    assert parse([ini(tmp_path, "[simulated]\n")]).simulated is True
    assert parse([ini(tmp_path, "[simulated]\nsimulated = false\n")]).simulated is False


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[api]\nprot=8001\n", "no key 'prot' in [api]; did you mean port?"),
        ("[apl]\nport=8001\n", "no section [apl]; did you mean api?"),
        ("[api]\nport=80o1\n", "port in [api]: expected a whole number from 1 to 65535, got '80o1'"),
        ("[simulated]\nheadless=maybe\n", "expected true or false"),
        ("port=8001\n", "no section headers"),
        ("[api]\nport=1\nport=2\n", "already exists"),
    ],
)
def test_wrong_file_is_one_line(tmp_path, capsys, text, said):
    assert main([ini(tmp_path, text)]) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--config", "/nonexistent/uav.ini"], "No such file"),
        (["--prot", "1"], "unrecognized arguments: --prot"),
        (["--port", "65536"], "--port: expected"),
        (["--sysid", "0"], "--sysid: expected"),
        (["--speedup", "nan"], "--speedup: expected a number above 0"),
        (["--simulated", "ja"], "--simulated: expected true or false"),
        (["--connection_type", "udp"], "--connection_type: expected udpin, udpout, tcp or usb"),
        (["--uav_connection", "/dev/ttyUSB0"], "--uav_connection: expected HOST:PORT with udpin"),
        (["--connection_type", "usb", "--uav_connection", "/dev/x,fast"], "expected DEVICE or DEVICE,BAUD"),
        (["--log_console", "ENGINE"], "--log_console: expected some of COPTER"),
        (["--gradys_gs", "10.0.2.5"], "--gradys_gs: expected HOST:PORT"),
        (["--module", "x;reboot"], "--module: expected NAME"),
        (["--simulated", "--vehicle", "boat"], "--vehicle: expected copter, plane, quadplane or rover"),
        (["--simulated", "--vehicles", "copter:0"], "--vehicles: expected a whole number from 1 to 255"),
        (["--simulated", "--spacing", "-1"], "--spacing: expected a number of metres"),
        (["--simulated", "--count", "250"], "--count: system ids end at 255, and these begin at 10"),
        (["--simulated", "--ardupilot_path", "/nonexistent"], "there is no /nonexistent/Tools"),
        (["--simulated", "--ardupilot_path", "/nonexistent", "--speedup", "1.5"], "whole numbers only"),
        (["--simulated", "--location", "Nowhere"], "unknown name 'Nowhere'"),
        (["--simulated", "--location", "99,0,0,0"], "expected lat,lon,alt,heading"),
    ],
)
def test_wrong_option_is_one_line_and_status_2(capsys, words, said):
    assert main(["--port", str(free_port()), *words]) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.count("\n") == 1


def test_version_is_the_packages(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"mavproxy-uavapi {metadata.version('mavproxy-uavapi')}\n"


def test_both_spellings_lists_modules_and_the_rest():
    read = parse(
        [
            *("--uav-connection", "10.0.0.1:5", "--log_console", "VEHICLE", "UVICORN", "COPTER"),
            *("--gs_connection", "[1.1.1.1:1,2.2.2.2:2]", "--module", "vision", "--module", "map,graph"),
            *("--", "--map", "--out", "3.3.3.3:3"),
        ]
    )
    assert read.uav_connection == "10.0.0.1:5"
    assert read.log_console == ("COPTER", "API")
    assert read.gs_connection == ("1.1.1.1:1", "2.2.2.2:2")
    assert read.module == ("vision", "map", "graph")
    assert read.mavproxy_args == ("--map", "--out", "3.3.3.3:3")


# Locations


def test_location_may_be_in_the_south():
    assert parse(["--location", "-35.3,-149.1,600,90", "--speedup", "2"]).location == "-35.3,-149.1,600,90"
    assert parse(["--location=-35.3,149.1,600,90"]).location == "-35.3,149.1,600,90"


def test_location_by_name_numbers_and_files(tmp_path):
    assert locations.resolve("CMAC") == (-35.363261, 149.165230, 584, 353)
    assert locations.resolve("1.5,2.5,30,90") == (1.5, 2.5, 30, 90)
    autotest = tmp_path / "ap" / "Tools" / "autotest"
    autotest.mkdir(parents=True)
    (autotest / "locations.txt").write_text("# names\nHill=1,2,3,4 # a hill\nPond=5,6,7,8\nbroken line\n")
    (tmp_path / "locations.txt").write_text("Pond=50,60,70,80\n")
    assert locations.resolve("Hill", str(tmp_path / "ap")) == (1, 2, 3, 4)
    assert locations.resolve("Pond", str(tmp_path / "ap")) == (50, 60, 70, 80)
    with pytest.raises(OptionError):
        locations.resolve("Hill")


# Command lines


def as_mavproxy_reads(load):
    """MAVProxy 1.8.75: `--cmd` at `;`, then shlex with white space only, then JSON behind the first `:{`."""
    [line] = load.split(";")
    lexer = shlex.shlex(line)
    lexer.quotes, lexer.whitespace_split, lexer.commenters = '"', True, ""
    [_, _, argument] = list(lexer)
    name, _, text = argument.partition(":{")
    return name, json.loads("{" + text)


def test_module_settings_survive_mavproxys_splitting():
    settings = {"config": "/home/a b/c;d\te,'f'/\"g\".ini", "port": 8001}
    assert as_mavproxy_reads(command_lines.module_load("uavapi", settings)) == ("uavapi", settings)


def test_mavproxy_command_for_a_real_vehicle():
    given = RunOptions(port=8001, sysid=3, gradys_gs="10.0.2.5:8000", module=("vision",), mavproxy_args=("--map",))
    line = command_lines.mavproxy_command(given, ["mavproxy.py"], Path("/run"), [], None)
    assert line[:4] == [
        *("mavproxy.py", "--master=udpin:127.0.0.1:17171", "--target-system=3", "--logfile=/run/mav.tlog")
    ]
    loads = [word.removeprefix("--cmd=") for word in line if word.startswith("--cmd=")]
    default = {"host": "default", "port": "default", "sysid": "default"}
    expected = {"host": "127.0.0.1", "port": 8001, "sysid": 3, "origins": default}
    assert as_mavproxy_reads(loads[0]) == ("uavapi", expected)
    assert as_mavproxy_reads(loads[1]) == ("gradys", {"gs": "10.0.2.5:8000"})
    assert loads[2] == "module load vision"
    assert line[-1] == "--map"
    assert "--daemon" not in line


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (RunOptions(connection_type="udpout"), "udpout:127.0.0.1:17171"),
        (RunOptions(connection_type="tcp", uav_connection="10.0.0.1:5760"), "tcp:10.0.0.1:5760"),
        (RunOptions(connection_type="usb", uav_connection="/dev/ttyACM0,57600"), "/dev/ttyACM0,57600"),
    ],
)
def test_link_to_the_vehicle(given, expected):
    assert command_lines.masters(given, []) == [expected]


def simulated(*instances, kind="copter", sysid=10):
    home = locations.BUILT_IN["AbraDF"]
    return [SimulatedVehicle(kind, sysid + number, instance, home) for number, instance in enumerate(instances)]


def test_each_simulated_vehicle_has_a_link():
    given = RunOptions(simulated=True, count=2)
    assert command_lines.masters(given, simulated(2, 5)) == ["tcp:127.0.0.1:5780", "tcp:127.0.0.1:5810"]


def test_fleet_has_types_system_ids_and_homes_in_a_row():
    given = RunOptions(simulated=True, sysid=3, vehicles=(("copter", 2), ("rover", 1)), spacing=10.0)
    home = locations.BUILT_IN["CMAC"]
    vehicles = fleet(given, home, [0, 4, 7])
    assert [(one.kind, one.sysid, one.instance) for one in vehicles] == [
        ("copter", 3, 0),
        ("copter", 4, 4),
        ("rover", 5, 7),
    ]
    assert vehicles[0].home == home
    north, east = offset(home.lat, home.lon, vehicles[2].home.lat, vehicles[2].home.lon)
    assert (north, east) == pytest.approx((0.0, 20.0), abs=0.05)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--count", "3", "--vehicle", "rover"], ["rover"] * 3),
        (["--vehicles", "copter:2,plane"], ["copter", "copter", "plane"]),
        ([], ["copter"]),
    ],
)
def test_types_of_the_simulated_vehicles(arguments, expected):
    assert kinds(parse(["--simulated", *arguments], {})) == expected


def test_headless_mavproxy_is_a_daemon_and_forwards():
    given = RunOptions(headless=True, simulated=True, gs_connection=("1.1.1.1:1",))
    line = command_lines.mavproxy_command(given, [], Path("/run"), simulated(0), None)
    assert "--daemon" in line
    assert "--out=1.1.1.1:1" in line
    assert not any(word.startswith("--sitl") for word in line)


def test_vehicle_commands():
    embedded = command_lines.embedded_command(RunOptions(speedup=2.5), *simulated(3))
    assert embedded[1:] == [
        *("-m", "mavproxy_uavapi.sim", "--instance=3", "--sysid=10", "--speedup=2.5"),
        "--home=-15.8400810,-47.9266420,1042,30",
    ]
    given = RunOptions(ardupilot_path="/ap", speedup=5.0)
    plane = simulated(1, kind="plane", sysid=7)[0]
    sitl = command_lines.sim_vehicle_command(given, "python3", plane, Path("/run/vehicle"))
    assert sitl[:2] == ["python3", "/ap/Tools/autotest/sim_vehicle.py"]
    assert {"--vehicle=ArduPlane", "--instance=1", "--sysid=7", "--speedup=5", "--no-mavproxy"} < set(sitl)


def test_settings_without_a_keyword_travel_by_file():
    assert command_lines.settings_file(RunOptions(port=9000)) is None
    text = command_lines.settings_file(RunOptions(scripts_path="/a%b", log_console=("API",), log_path="/l/u.log"))
    assert text is not None
    assert text == "[api]\nscripts_path = /a%b\n\n[logs]\nlog_console = [API]\nlog_path = /l/u.log\n\n"


def test_token_is_on_no_command_line_and_in_no_greeting(monkeypatch):
    monkeypatch.setenv("UAVAPI_TOKEN", "very-secret")
    given = RunOptions(simulated=True, host="0.0.0.0", scripts_path="/s")
    lines = [
        *command_lines.mavproxy_command(given, ["m"], Path("/run"), simulated(0), Path("/run/uavapi.ini")),
        *command_lines.embedded_command(given, *simulated(0)),
        command_lines.greeting(given, with_token=True),
        command_lines.settings_file(given) or "",
    ]
    assert "very-secret" not in " ".join(lines)
    assert environment.for_mavproxy(os.environ)["UAVAPI_TOKEN"] == "very-secret"


def test_greeting_has_three_lines_to_try_for_a_simulated_vehicle():
    lines = command_lines.greeting(RunOptions(simulated=True, port=8001), with_token=False).splitlines()
    assert lines == [
        "API of vehicle 10: http://127.0.0.1:8001",
        "  curl http://127.0.0.1:8001/command/arm",
        "  curl 'http://127.0.0.1:8001/command/takeoff?alt=10'",
        "  curl http://127.0.0.1:8001/telemetry/gps",
    ]
    assert command_lines.greeting(RunOptions(), with_token=False).count("\n") == 0
    rover = command_lines.greeting(RunOptions(simulated=True, vehicle="rover"), with_token=False)
    assert "takeoff" not in rover and rover.count("\n") == 3


def test_sim_vehicle_gets_no_window_and_no_working_pkill(tmp_path):
    env = environment.for_sim_vehicle({"DISPLAY": ":0", "TMUX": "x", "PATH": os.defpath}, tmp_path)
    assert not set(env) & set(command_lines.WINDOW_VARIABLES)
    assert shutil.which("pkill", path=env["PATH"]) == str(tmp_path / "bin" / "pkill")
    assert subprocess.run([tmp_path / "bin" / "pkill", "none"], check=False).returncode == 1


def test_mavproxy_beside_this_python_comes_before_path(tmp_path, monkeypatch):
    (tmp_path / "mavproxy.py").write_text("")
    monkeypatch.setattr(environment.sysconfig, "get_path", lambda name: str(tmp_path))
    assert environment.mavproxy_program() == [sys.executable, str(tmp_path / "mavproxy.py")]
    monkeypatch.setattr(environment.sysconfig, "get_path", lambda name: "/nonexistent")
    monkeypatch.setattr(environment.sys, "executable", "/nonexistent/python")
    monkeypatch.setenv("PATH", "/nonexistent")
    with pytest.raises(LaunchError, match="pip install MAVProxy"):
        environment.mavproxy_program()


# Directories and instances


def test_run_directories_never_collide_and_are_private(tmp_path):
    first = directories.new_run(state_directory(), RunOptions())
    second = directories.new_run(state_directory(), RunOptions())
    assert first != second
    assert first.parent == second.parent == tmp_path / "state" / "mavproxy-uavapi" / "uav10"
    assert first.stat().st_mode & 0o777 == 0o700


def test_log_path_may_be_a_file_or_a_directory(tmp_path):
    assert directories.split_log_path(None, 1) == (state_directory(), None)
    assert directories.split_log_path(f"{tmp_path}/a/uav.log", 1) == (tmp_path / "a", f"{tmp_path}/a/uav.log")
    assert directories.split_log_path(f"{tmp_path}/a", 1) == (tmp_path / "a", f"{tmp_path}/a/uav_1.log")


def test_two_runs_get_two_instances(tmp_path, monkeypatch):
    monkeypatch.setattr(instances, "ports_are_free", lambda instance: instance != 1)
    with instances.reserved(tmp_path, 0) as first, instances.reserved(tmp_path, 0) as second:
        assert (first, second) == (0, 2)
    with instances.reserved(tmp_path, 0) as again:
        assert again == 0


def test_port_in_use_is_not_free_and_the_launcher_says_so(capsys):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert not instances.is_free(port)
        assert main(["--port", str(port)]) == 1
    assert f"127.0.0.1:{port} is taken" in capsys.readouterr().err


# Processes: a MAVProxy and a vehicle of our own, and the real launcher around them

FAKE_MAVPROXY = """
import http.server, json, os, signal, subprocess, sys, threading, time
mode = os.environ.get("FAKE_MODE", "")
print("MAVProxy stand-in", flush=True)
if mode == "crash":
    sys.exit("cannot open the link")
if mode == "no module":
    print("Failed to load module: uavapi: no setting 'x'. Use 'set moddebug 3' for more", flush=True)
stray = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(300)"])
other = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(300)"], start_new_session=True)
with open(os.environ["FAKE_PIDS"], "a") as pids:
    print("mavproxy", os.getpid(), "\\nstray", stray.pid, "\\nother", other.pid, file=pids)
stop = threading.Event()
def on_term(*_):
    if mode != "deaf":
        stop.set()
signal.signal(signal.SIGTERM, on_term)
[load] = [word for word in sys.argv if word.startswith("--cmd=module load uavapi:")]
class Api(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.end_headers()
    def log_message(self, *_):
        pass
server = http.server.HTTPServer(("127.0.0.1", json.loads(load.partition("uavapi:")[2])["port"]), Api)
if mode != "no module":
    threading.Thread(target=server.serve_forever, daemon=True).start()
if "--daemon" in sys.argv:
    stop.wait()
else:
    try:
        input("MAV> ")
    except (EOFError, KeyboardInterrupt):
        pass
print("Unloading module uavapi", flush=True)
os._exit(1)
"""
FAKE_VEHICLE = """
import os, subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(300)"])
with open(os.environ["FAKE_PIDS"], "a") as pids:
    print("vehicle", os.getpid(), "\\nchild", child.pid, file=pids)
if os.environ.get("FAKE_MODE") == "no vehicle":
    sys.exit("sim: the port is taken")
print("sim: vehicle 10 listening on tcp:127.0.0.1:5760", flush=True)
time.sleep(300)
"""
DRIVER = """
import fcntl, os, sys, termios
if os.isatty(0):
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
from mavproxy_uavapi.launcher import environment, instances, supervisor
from mavproxy_uavapi.launcher import cli, command_lines
environment.mavproxy_program = lambda: [sys.executable, {mavproxy!r}]
command_lines.embedded_command = lambda *_: [sys.executable, {vehicle!r}]
instances.ports_are_free = lambda _: True
supervisor.MAVPROXY_GRACE_S = supervisor.PROMPT_GRACE_S = supervisor.MAVPROXY_FORCED_S = 0.3
sys.exit(cli.run())
"""


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def is_alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


def eventually(condition, timeout_s=10.0):
    """Wait for real processes; the time is a limit, not a pause."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


class Launched:
    """The launcher in a process of its own, around the stand-ins."""

    def __init__(self, directory, words, mode="", stdin=subprocess.DEVNULL):
        for name, text in {"mavproxy": FAKE_MAVPROXY, "vehicle": FAKE_VEHICLE}.items():
            (directory / f"{name}.py").write_text(text)
        driver = DRIVER.format(mavproxy=str(directory / "mavproxy.py"), vehicle=str(directory / "vehicle.py"))
        (directory / "driver.py").write_text(driver)
        self.pids_file = directory / "pids"
        self.out_file = directory / "out"
        self.port = free_port()
        interactive = stdin is not subprocess.DEVNULL
        with self.out_file.open("wb") as output:
            self.process = subprocess.Popen(
                [sys.executable, str(directory / "driver.py"), f"--port={self.port}", *words],
                stdin=stdin,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, "PYTHONPATH": str(ROOT), "FAKE_PIDS": str(self.pids_file), "FAKE_MODE": mode},
                cwd=directory,
                start_new_session=interactive,
            )

    @property
    def pids(self):
        lines = self.pids_file.read_text().splitlines() if self.pids_file.exists() else []
        return {name: int(pid) for name, pid in map(str.split, lines)}

    @property
    def out(self):
        return self.out_file.read_text()

    def ours(self):
        return [pid for name, pid in self.pids.items() if name != "other" and is_alive(pid)]

    def wait_up(self):
        up = eventually(lambda: "API of vehicle" in self.out or self.process.poll() is not None)
        assert up and self.process.poll() is None, self.out

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for pid in self.pids.values():
            if is_alive(pid):
                os.kill(pid, signal.SIGKILL)


@pytest.fixture
def launched(tmp_path):
    started = []

    def launch(*words, **more):
        started.append(Launched(tmp_path, words, **more))
        return started[-1]

    yield launch
    for one in started:
        one.close()


@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_signal_ends_all_of_its_processes_and_no_other(launched, tmp_path, signum):
    run = launched("--simulated")
    run.wait_up()
    assert set(run.pids) == {"mavproxy", "stray", "other", "vehicle", "child"}
    assert f"curl http://127.0.0.1:{run.port}/command/arm" in run.out
    run.process.send_signal(signum)
    assert run.process.wait(10) == 0
    assert run.ours() == []
    assert is_alive(run.pids["other"]), "what MAVProxy started in another session is not ours to end"
    [run_dir] = (tmp_path / "state" / "mavproxy-uavapi" / "uav10").iterdir()
    assert "Unloading module uavapi" in (run_dir / "mavproxy.log").read_text()
    assert {entry.name for entry in tmp_path.iterdir()} == {
        *("mavproxy.py", "vehicle.py", "driver.py", "pids", "out", "state")
    }


def test_killed_launcher_takes_everything_with_it(launched):
    run = launched("--simulated")
    run.wait_up()
    run.process.kill()
    assert eventually(lambda: run.ours() == [])
    assert is_alive(run.pids["other"])


def test_mavproxy_that_does_not_listen_is_killed(launched):
    run = launched(mode="deaf")
    run.wait_up()
    run.process.terminate()
    assert run.process.wait(10) == 0
    assert run.ours() == []


def test_clean_end_of_mavproxy_is_status_0(launched):
    run = launched("--simulated")
    run.wait_up()
    os.kill(run.pids["mavproxy"], signal.SIGTERM)
    assert run.process.wait(10) == 0
    assert run.ours() == []


def test_crash_of_mavproxy_is_one_line_with_its_log(launched):
    run = launched("--simulated", mode="crash")
    assert run.process.wait(10) == 1
    assert "MAVProxy ended with status 1: cannot open the link (log: " in run.out
    assert run.ours() == []


def test_api_that_cannot_load_ends_the_wait_in_mavproxys_words(launched):
    run = launched("--simulated", mode="no module")
    assert run.process.wait(10) == 1
    assert "mavproxy-uavapi: Failed to load module: uavapi: no setting 'x'. (log: " in run.out
    assert run.ours() == []


def test_mavproxy_killed_from_outside_is_reported_as_a_shell_would(launched):
    run = launched()
    run.wait_up()
    os.kill(run.pids["mavproxy"], signal.SIGKILL)
    assert run.process.wait(10) == 128 + signal.SIGKILL
    assert run.ours() == []


def test_vehicle_that_does_not_start_is_one_line_with_its_log(launched):
    run = launched("--simulated", mode="no vehicle")
    assert run.process.wait(10) == 1
    assert "the vehicle did not start: sim: the port is taken (log: " in run.out
    assert run.ours() == []


def test_vehicle_that_dies_ends_the_run(launched):
    run = launched("--simulated")
    run.wait_up()
    os.kill(run.pids["vehicle"], signal.SIGKILL)
    assert run.process.wait(10) == 1
    assert "the simulated vehicle ended" in run.out
    assert run.ours() == []


@pytest.mark.parametrize("typed", [b"exit\n", b"\x03", b"\x04"])
def test_at_a_terminal_mavproxy_has_the_prompt_and_ends_the_run(launched, typed):
    keyboard, terminal = pty.openpty()
    try:
        run = launched("--simulated", stdin=terminal)
        run.wait_up()
        assert os.getpgid(run.pids["mavproxy"]) == run.process.pid, "the terminal's foreground group"
        assert os.getsid(run.pids["vehicle"]) != run.process.pid, "out of reach of the terminal's Ctrl-C"
        os.write(keyboard, typed)
        assert run.process.wait(10) == 0
        assert run.ours() == []
    finally:
        os.close(keyboard)
        os.close(terminal)


def test_at_a_terminal_a_signal_to_the_launcher_ends_the_run_too(launched):
    keyboard, terminal = pty.openpty()
    try:
        run = launched("--simulated", stdin=terminal, mode="deaf")
        run.wait_up()
        before = termios.tcgetattr(terminal)
        run.process.terminate()
        assert run.process.wait(10) == 0
        assert run.ours() == []
        assert termios.tcgetattr(terminal) == before
    finally:
        os.close(keyboard)
        os.close(terminal)


def test_a_strangers_process_is_no_member_even_in_our_session():
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as stranger:
        assert not processes.signal_member(stranger.pid, signal.SIGKILL, "tag", {os.getsid(0)})
        assert stranger.poll() is None
        stranger.kill()


def test_the_modules_own_keys_of_the_file_reach_the_module(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\nport = 8005\nmax_age = 2\nallow_from = 10.0.0.0/8\n", encoding="utf-8")
    read = parse(["--config", str(file)], environ={})
    text = command_lines.settings_file(read)
    assert text is not None and "max_age = 2" in text and "allow_from = 10.0.0.0/8" in text


def test_a_wrong_value_of_the_modules_is_an_error_at_once(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\nmax_age = soon\n", encoding="utf-8")
    with pytest.raises(OptionError, match="max_age"):
        parse(["--config", str(file)], environ={})


def test_the_environment_stands_between_file_and_command_line(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\nport = 8005\nsysid = 5\n", encoding="utf-8")
    read = parse(["--config", str(file), "--sysid", "7"], environ={"UAVAPI_PORT": "8006", "UAVAPI_SYSID": "6"})
    assert (read.port, read.sysid) == (8006, 7)


def test_module_is_told_where_each_setting_came_from(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\nport = 8005\nsysid = 5\nscript_grace = 20\n", encoding="utf-8")
    read = parse(["--config", str(file), "--sysid", "7"], environ={"UAVAPI_LOG_PATH": "/l/u.log"})
    name, given = as_mavproxy_reads(command_lines.module_loads(read, Path("/run/uavapi.ini"))[0])
    assert name == "uavapi"
    assert given["origins"] == {
        "host": "default",
        "port": str(file),
        "sysid": "command line",
        "script_grace": str(file),
        "log_path": "environment",
    }


def test_environment_that_was_read_does_not_come_back_over_the_command_line() -> None:
    given = {"UAVAPI_SCRIPTS_PATH": "/e", "UAVAPI_PORT": "1", "UAVAPI_SCRIPT_GRACE": "20", "UAVAPI_TOKEN": "t"}
    given["UAVAPI_CONFIG"] = "/e/uav.ini"
    passed = environment.for_mavproxy(given)
    assert {name for name in passed if name.startswith("UAVAPI_")} == {"UAVAPI_SCRIPT_GRACE", "UAVAPI_TOKEN"}


def test_section_of_the_module_gradys_is_its_own_to_read(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\ngradys_gs = 10.0.2.5:8000\n[gradys]\nperiod = 2\n", encoding="utf-8")
    read = parse(["--config", str(file), "--module", "gradys,vision"], environ={})
    loads = command_lines.module_loads(read, None)
    keywords = {"config": str(file), "gs": "10.0.2.5:8000", "origins": {"gs": str(file)}}
    assert as_mavproxy_reads(loads[1]) == ("gradys", keywords)
    assert loads[2:] == ["module load vision"]


def test_one_file_configures_all_three_modules(tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    file = tmp_path / "uav.ini"
    file.write_text("[api]\nport = 8005\n[vision]\nspeed = 2\n[gradys]\nperiod = 2\n", encoding="utf-8")
    by_argument = parse(["--config", str(file)], environ={})
    assert parse([], environ={"UAVAPI_CONFIG": str(file)}) == by_argument
    loads = [as_mavproxy_reads(load) for load in command_lines.module_loads(by_argument, None)]
    assert [name for name, _ in loads] == ["uavapi", "gradys", "vision"]
    assert loads[1][1] == loads[2][1] == {"config": str(file)}


def test_keywords_of_a_module_go_with_its_section_and_load_it_once(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[gradys]\nperiod = 2\n", encoding="utf-8")
    read = parse(["--config", str(file), "--module", 'gradys:{"period":3}', "--module", 'map:{"a":1}'], environ={})
    loads = command_lines.module_loads(read, None)
    assert as_mavproxy_reads(loads[1]) == ("gradys", {"config": str(file), "period": 3})
    assert loads[2:] == ['module load map:{"a":1}']
    with pytest.raises(OptionError, match="--module"):
        parse(["--module", "gradys:{period}"], environ={})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[vison]\nspeed = 2\n", "no section [vison]; did you mean vision?"),
        ("[vision]\nspede = 2\n", "no key 'spede' in [vision]; did you mean speed?"),
        ("[vision]\nspeed = nan\n", "speed = 'nan': it takes a float from 0.1 to 10"),
        ("[vision]\ntags = 0:0.3.0\n", "tags: '0:0.3.0' is not ID:SIZE"),
        ("[gradys]\nperoid = 2\n", "no key 'peroid' in [gradys]; did you mean period?"),
        ("[gradys]\nsink = mqtt://me:s3cret@b/a?b\n", "sink: mqtt://me:***@b/a?***: a topic holds none of + # ?"),
    ],
)
def test_sections_of_the_modules_are_checked_before_anything_starts(tmp_path, text, said):
    if "[vision]" in text:
        pytest.importorskip("cv2")
    file = tmp_path / "uav.ini"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(OptionError) as caught:
        parse(["--config", str(file)], environ={})
    assert f"{file}: {said}" in str(caught.value)
    assert "s3cret" not in str(caught.value)


def test_environment_of_a_module_is_checked_with_its_section(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[gradys]\nperiod = 2\n", encoding="utf-8")
    with pytest.raises(OptionError, match="^GRADYS_PERIOD: period = 'x': it takes a float"):
        parse(["--config", str(file)], environ={"GRADYS_PERIOD": "x"})


def test_section_vision_without_opencv_is_one_clear_line(tmp_path: Path, monkeypatch: Any) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[vision]\nspeed = 2\n", encoding="utf-8")
    monkeypatch.setattr(opencv_install, "problem", lambda: "vision needs OpenCV 4.10 or newer, but there is none")
    with pytest.raises(OptionError) as caught:
        parse(["--config", str(file)], environ={})
    assert str(caught.value) == f"{file}: [vision]: vision needs OpenCV 4.10 or newer, but there is none"


def test_http3_of_the_original_service_may_be_off_only(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\nudp = false\n", encoding="utf-8")
    parse(["--config", str(file)], environ={})
    file.write_text("[api]\nudp = true\n", encoding="utf-8")
    with pytest.raises(OptionError, match="there is no HTTP/3"):
        parse(["--config", str(file)], environ={})
