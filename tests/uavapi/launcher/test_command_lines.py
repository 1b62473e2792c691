"""The command lines of MAVProxy and of the simulated vehicles."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from mavproxy_uavapi.launcher import command_lines, environment
from mavproxy_uavapi.launcher.errors import OptionError
from mavproxy_uavapi.launcher.options import RunOptions, parse
from tests.support.launching import as_mavproxy_reads, simulated


def test_module_settings_survive_mavproxys_splitting():
    settings = {"config": "/home/a b/c;d\te,'f'/\"g\".ini", "port": 8001}
    assert as_mavproxy_reads(command_lines.module_load("uavapi", settings)) == ("uavapi", settings)


def test_mavproxy_command_for_a_real_vehicle():
    options = RunOptions(port=8001, sysid=3, gradys_gs="10.0.2.5:8000", module=("vision",), mavproxy_args=("--map",))
    line = command_lines.mavproxy_command(options, ["mavproxy.py"], Path("/run"), [], None)
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
    ("options", "expected"),
    [
        (RunOptions(connection_type="udpout"), "udpout:127.0.0.1:17171"),
        (RunOptions(connection_type="tcp", uav_connection="10.0.0.1:5760"), "tcp:10.0.0.1:5760"),
        (RunOptions(connection_type="usb", uav_connection="/dev/ttyACM0,57600"), "/dev/ttyACM0,57600"),
    ],
)
def test_link_to_the_vehicle(options, expected):
    assert command_lines.masters(options, []) == [expected]


def test_each_simulated_vehicle_has_a_link():
    options = RunOptions(simulated=True, count=2)
    assert command_lines.masters(options, simulated(2, 5)) == ["tcp:127.0.0.1:5780", "tcp:127.0.0.1:5810"]


def test_headless_mavproxy_is_a_daemon_and_forwards():
    options = RunOptions(headless=True, simulated=True, gs_connection=("1.1.1.1:1",))
    line = command_lines.mavproxy_command(options, [], Path("/run"), simulated(0), None)
    assert "--daemon" in line
    assert "--out=1.1.1.1:1" in line
    assert not any(word.startswith("--sitl") for word in line)


def test_vehicle_commands():
    embedded = command_lines.embedded_command(RunOptions(speedup=2.5), *simulated(3))
    assert embedded[1:] == [
        *("-m", "mavproxy_uavapi.sim", "--instance=3", "--sysid=10", "--speedup=2.5"),
        "--home=-15.8400810,-47.9266420,1042,30",
    ]
    assert "--battery=1500" in command_lines.embedded_command(RunOptions(battery=1500.0), *simulated(3))
    assert "--firmware=4.6" in command_lines.embedded_command(RunOptions(firmware="4.6"), *simulated(3))
    copter, rover = simulated(1)[0], simulated(2, kind="rover")[0]
    alone, both = simulated(1, 3), [copter, rover]
    assert not any("--decks" in word for word in command_lines.embedded_command(RunOptions(), copter, alone))
    assert "--decks=5779" in command_lines.embedded_command(RunOptions(), copter, both)
    assert "--udp=127.0.0.1:5779" in command_lines.embedded_command(RunOptions(), rover, both)
    options = RunOptions(ardupilot_path="/ap", speedup=5.0)
    plane = simulated(1, kind="plane", sysid=7)[0]
    sitl = command_lines.sim_vehicle_command(options, "python3", plane, Path("/run/vehicle"))
    assert sitl[:2] == ["python3", "/ap/Tools/autotest/sim_vehicle.py"]
    assert {"--vehicle=ArduPlane", "--instance=1", "--sysid=7", "--speedup=5", "--no-mavproxy"} < set(sitl)


def test_replay_takes_the_vehicles_place_and_nobody_commands_or_records_it():
    options = RunOptions(simulated=True, replay="/f.mcap", speedup=4.0)
    (vehicle,) = simulated(2)
    assert command_lines.embedded_command(options, vehicle)[1:] == [
        *("-m", "mavproxy_uavapi.flights.replay_feed", "/f.mcap", "--port=5780", "--speedup=4"),
    ]
    line = command_lines.mavproxy_command(options, [], Path("/run"), [vehicle], None)
    assert "--master=tcp:127.0.0.1:5780" in line
    (load,) = [word for word in line if word.startswith("--cmd=module load uavapi")]
    assert "read_only" in load and '"off"' in load.replace("'", '"')
    assert "nothing can be commanded" in command_lines.greeting(options, "http://127.0.0.1:8000", with_token=False)


def test_settings_without_a_keyword_travel_by_file():
    assert command_lines.settings_file(RunOptions(port=9000)) is None
    text = command_lines.settings_file(RunOptions(scripts_path="/a%b", log_console=("API",), log_path="/l/u.log"))
    assert text is not None
    assert text == "[api]\nscripts_path = /a%b\n\n[logs]\nlog_console = [API]\nlog_path = /l/u.log\n\n"


def test_token_is_on_no_command_line_and_in_no_greeting(monkeypatch):
    monkeypatch.setenv("UAVAPI_TOKEN", "very-secret")
    options = RunOptions(simulated=True, host="0.0.0.0", scripts_path="/s")
    lines = [
        *command_lines.mavproxy_command(options, ["m"], Path("/run"), simulated(0), Path("/run/uavapi.ini")),
        *command_lines.embedded_command(options, *simulated(0)),
        command_lines.greeting(options, "http://127.0.0.1:8000", with_token=True),
        command_lines.settings_file(options) or "",
    ]
    assert "very-secret" not in " ".join(lines)
    assert environment.for_mavproxy(os.environ)["UAVAPI_TOKEN"] == "very-secret"


def test_greeting_has_three_lines_to_try_for_a_simulated_vehicle():
    lines = command_lines.greeting(RunOptions(simulated=True), "http://127.0.0.1:8001", with_token=False).splitlines()
    assert lines == [
        "API of vehicle 10: http://127.0.0.1:8001",
        "  the page to fly from: http://127.0.0.1:8001/",
        "  curl http://127.0.0.1:8001/command/arm",
        "  curl 'http://127.0.0.1:8001/command/takeoff?alt=10'",
        "  curl http://127.0.0.1:8001/telemetry/gps",
    ]
    elsewhere = command_lines.greeting(RunOptions(), "http://127.0.0.1:8000", True, ["http://10.0.0.5:8000"])
    assert elsewhere.endswith("\n  the page to fly from: http://127.0.0.1:8000/, http://10.0.0.5:8000/")
    options = RunOptions(simulated=True, vehicle="rover")
    rover = command_lines.greeting(options, "http://127.0.0.1:8000", with_token=False)
    assert "takeoff" not in rover and rover.count("\n") == 4


@pytest.mark.parametrize(
    ("text", "arguments", "environ", "scheme"),
    [
        ("", [], {}, "http"),
        ("certfile = /c.pem\nkeyfile = /k.pem\n", [], {}, "https"),
        ("", [], {"UAVAPI_CERTFILE": "/c.pem", "UAVAPI_KEYFILE": "/k.pem"}, "https"),
        ("", [], {"UAVAPI_CERTFILE": "none"}, "http"),
        ("", ["--certfile", "/c.pem", "--keyfile", "/k.pem"], {}, "https"),
        ("", ["--module", 'uavapi:{"certfile":"/c.pem","keyfile":"/k.pem"}'], {}, "https"),
    ],
)
def test_url_is_that_of_tls_whichever_source_has_the_certificate(
    tmp_path: Path, text: str, arguments: list[str], environ: dict[str, str], scheme: str
) -> None:
    file = tmp_path / "uav.ini"
    file.write_text(f"[api]\nport = 8005\n{text}", encoding="utf-8")
    options = parse(["--config", str(file), *arguments], environ=environ)
    assert command_lines.api_url(options) == f"{scheme}://127.0.0.1:8005"


def test_the_modules_own_keys_of_the_file_reach_the_module(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\nport = 8005\nmax_age = 2\nallow_from = 10.0.0.0/8\n", encoding="utf-8")
    options = parse(["--config", str(file)], environ={})
    text = command_lines.settings_file(options)
    assert text is not None and "max_age = 2" in text and "allow_from = 10.0.0.0/8" in text


def test_module_knows_where_each_setting_came_from(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\nport = 8005\nsysid = 5\nscript_grace = 20\n", encoding="utf-8")
    options = parse(["--config", str(file), "--sysid", "7"], environ={"UAVAPI_LOG_PATH": "/l/u.log"})
    name, keywords = as_mavproxy_reads(command_lines.module_loads(options, Path("/run/uavapi.ini"))[0])
    assert name == "uavapi"
    assert keywords["origins"] == {
        "host": "default",
        "port": str(file),
        "sysid": "command line",
        "script_grace": str(file),
        "log_path": "environment",
    }


def test_section_of_the_module_gradys_is_its_own_to_read(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\ngradys_gs = 10.0.2.5:8000\n[gradys]\nperiod = 2\n", encoding="utf-8")
    options = parse(["--config", str(file), "--module", "gradys,vision"], environ={})
    loads = command_lines.module_loads(options, None)
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
    options = parse(["--config", str(file), "--module", 'gradys:{"period":3}', "--module", 'map:{"a":1}'], environ={})
    loads = command_lines.module_loads(options, None)
    assert as_mavproxy_reads(loads[1]) == ("gradys", {"config": str(file), "period": 3})
    assert loads[2:] == ['module load map:{"a":1}']
    with pytest.raises(OptionError, match="--module"):
        parse(["--module", "gradys:{period}"], environ={})
