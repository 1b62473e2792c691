"""Options, the file of `--config` and the environment."""

from __future__ import annotations

import dataclasses
from importlib import metadata
from pathlib import Path

import pytest

from mavproxy_uavapi.commands import COMMANDS
from mavproxy_uavapi.flights.flight_store import FlightStore
from mavproxy_uavapi.launcher import main, options
from mavproxy_uavapi.launcher.errors import OptionError
from mavproxy_uavapi.launcher.options import RunOptions, parse
from mavproxy_uavapi.settings import ApiModuleSettings
from mavproxy_vision import opencv_install
from tests.support.launching import ini
from tests.support.ports import free_port


def test_the_table_and_the_options_name_the_same_things():
    others = {"module", "mavproxy_args", "vehicle_args", "further", "vision_config", "gradys_config", "origins"}
    assert {row.name for row in options.TABLE} | others == {field.name for field in dataclasses.fields(RunOptions)}


def test_defaults_are_those_of_the_original_service():
    assert parse([]) == RunOptions()
    of_the_module = {row.name: row.default for row in ApiModuleSettings.table()}
    assert (RunOptions().host, RunOptions().port) == (of_the_module["host"], of_the_module["port"])
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


def test_file_and_command_line_of_uav_api_0_3_1_are_taken(tmp_path):
    loaded = parse(
        [
            ini(
                tmp_path,
                """
                [mode]
                root_dir = /srv/uav
                vehicle = plane
                [api]
                mavlink_streamrate = 10
                sysid = 11
                [simulated]
                terminal = xterm -e
                headless = yes
                [logs]
                script_logs = /var/log/scripts
                [udp]
                udp = false
                certfile = None
                """,
            )
        ]
    )
    assert loaded == RunOptions(
        root_dir="/srv/uav",
        vehicle="plane",
        mavlink_streamrate=10,
        sysid=11,
        simulated=True,
        terminal="xterm -e",
        headless=True,
        scripts_path="/srv/uav/scripts",
        script_logs="/var/log/scripts",
        log_path="/srv/uav/logs/uav_logs/uav_11.log",
    )
    certificate = ["--certfile", "/c.pem", "--keyfile", "/k.pem"]
    taken = parse(["--mavlink_streamrate", "10", "--root_dir", "/srv/uav", "--terminal", "xterm", *certificate])
    assert (taken.mavlink_streamrate, taken.certfile, taken.keyfile) == (10, "/c.pem", "/k.pem")
    assert taken.log_path == "/srv/uav/logs/uav_logs/uav_10.log"


@pytest.mark.parametrize("rate", ["0", "-1", "2.5", "501"])
def test_stream_rate_is_a_whole_number_of_hertz(rate):
    with pytest.raises(OptionError, match="--mavlink_streamrate: expected a whole number from 1 to 500"):
        parse(["--mavlink_streamrate", rate])


def test_http3_and_half_a_certificate_are_refused_in_a_sentence(capsys):
    assert main(["--udp"]) == 2
    assert "there is no HTTP/3 here, only HTTP/1.1" in capsys.readouterr().err
    assert main(["--certfile", "/c.pem"]) == 2
    assert "TLS needs both certfile and keyfile" in capsys.readouterr().err


def test_commands_of_uav_api_are_known(capsys):
    assert main(["start", "--port", "x"]) == 2
    assert "--port" in capsys.readouterr().err
    assert main(["setup-sitl", "--vehicle", "copter"]) == 0
    assert "--ardupilot_path" in capsys.readouterr().out


def test_the_help_names_all_commands():
    words = options.build_parser().format_help().replace(",", " ").split()
    assert {*COMMANDS, "start", "setup-sitl"} <= set(words)


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
    ("text", "output"),
    [
        ("[api]\nprot=8001\n", "no key 'prot' in [api]; did you mean port?"),
        ("[apl]\nport=8001\n", "no section [apl]; did you mean api?"),
        ("[api]\nport=80o1\n", "port in [api]: expected a whole number from 1 to 65535, got '80o1'"),
        ("[simulated]\nheadless=maybe\n", "expected true or false"),
        ("port=8001\n", "no section headers"),
        ("[api]\nport=1\nport=2\n", "already exists"),
    ],
)
def test_wrong_file_is_one_line(tmp_path, capsys, text, output):
    assert main([ini(tmp_path, text)]) == 2
    message = capsys.readouterr().err
    assert output in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "output"),
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
        (["--connection_type", "usb"], "--uav_connection: usb needs the DEVICE, such as /dev/ttyACM0,115200"),
        (["--connection_type", "usb", "--uav_connection", "10.0.0.1:14550"], "usb needs the DEVICE"),
        (["--log_console", "ENGINE"], "--log_console: expected some of COPTER"),
        (["--gradys_gs", "10.0.2.5"], "--gradys_gs: expected HOST:PORT"),
        (["--module", "x;reboot"], "--module: expected NAME"),
        (["--simulated", "--vehicle", "boat"], "--vehicle: expected copter, plane, quadplane or rover"),
        (["--simulated", "--vehicles", "copter:0"], "--vehicles: expected a whole number from 1 to 255"),
        (["--simulated", "--spacing", "-1"], "--spacing: expected a number of metres"),
        (["--simulated", "--count", "250"], "--count: system ids end at 255, and these begin at 10"),
        (["--simulated", "--ardupilot_path", "/nonexistent"], "there is no /nonexistent/Tools"),
        (["--simulated", "--ardupilot_path", "/nonexistent"], "or this line of the file, the embedded vehicle flies"),
        (["--simulated", "--ardupilot_path", "/nonexistent", "--speedup", "1.5"], "whole numbers only"),
        (["--simulated", "--ardupilot_path", "/nonexistent", "--battery", "1500"], "for the embedded vehicle"),
        (["--simulated", "--ardupilot_path", "/nonexistent", "--firmware", "4.6"], "for the embedded vehicle"),
        (["--simulated", "--firmware", "4.5"], "--firmware"),
        (["--simulated", "--battery", "0"], "--battery: expected a number above 0"),
        (["--simulated", "--location", "Nowhere"], "unknown name 'Nowhere'"),
        (["--simulated", "--location", "99,0,0,0"], "expected lat,lon,alt,heading"),
    ],
)
def test_wrong_option_is_one_line_and_status_2(capsys, words, output):
    assert main(["--port", str(free_port()), *words]) == 2
    message = capsys.readouterr().err
    assert output in message
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


def test_location_may_be_in_the_south():
    assert parse(["--location", "-35.3,-149.1,600,90", "--speedup", "2"]).location == "-35.3,-149.1,600,90"
    assert parse(["--location=-35.3,149.1,600,90"]).location == "-35.3,149.1,600,90"


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


@pytest.mark.parametrize(
    ("text", "output"),
    [
        ("[vison]\nspeed = 2\n", "no section [vison]; did you mean vision?"),
        ("[vision]\nspede = 2\n", "no key 'spede' in [vision]; did you mean speed?"),
        ("[vision]\nspeed = nan\n", "speed = 'nan': it takes a number from 0.1 to 10"),
        ("[vision]\ntags = 0:0.3.0\n", "tags: '0:0.3.0' is not ID:SIZE"),
        ("[gradys]\nperoid = 2\n", "no key 'peroid' in [gradys]; did you mean period?"),
        ("[gradys]\nsink = mqtt://me:s3cret@b/a?b\n", "sink: 'a?b': a topic has none of + # ?"),
    ],
)
def test_sections_of_the_modules_are_checked_before_anything_starts(tmp_path, text, output):
    if "[vision]" in text:
        pytest.importorskip("cv2")
    file = tmp_path / "uav.ini"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(OptionError) as caught:
        parse(["--config", str(file)], environ={})
    assert f"{file}: {output}" in str(caught.value)
    assert "s3cret" not in str(caught.value)


def test_environment_of_a_module_is_checked_with_its_section(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[gradys]\nperiod = 2\n", encoding="utf-8")
    with pytest.raises(OptionError, match="^GRADYS_PERIOD: period = 'x': it takes a number"):
        parse(["--config", str(file)], environ={"GRADYS_PERIOD": "x"})


def test_section_vision_without_opencv_is_one_clear_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[vision]\nspeed = 2\n", encoding="utf-8")
    monkeypatch.setattr(opencv_install, "problem", lambda: "vision needs OpenCV 4.10 or newer, but there is none")
    with pytest.raises(OptionError) as caught:
        parse(["--config", str(file)], environ={})
    assert str(caught.value) == f"{file}: [vision]: vision needs OpenCV 4.10 or newer, but there is none"


def test_replay_has_the_vehicles_of_its_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flight, file = FlightStore(tmp_path).begin([4, 7], 1_778_500_800.0, "survey")
    file.close(flight.about())
    FlightStore(tmp_path).save(flight)
    FlightStore(tmp_path).pack(flight.id)
    record = str(tmp_path / f"{flight.id}.mcap")
    chosen = parse(["--replay", record])
    assert (chosen.simulated, chosen.count, chosen.sysid, chosen.replay) == (True, 1, 4, record)
    assert parse(["--replay", record, "--sysid", "7"]).sysid == 7
    assert parse(["--replay", record, "--sysid", "8"]).sysid == 4
    for words in (["--replay", str(tmp_path / "none")], ["--replay", record, "--vehicles", "copter:2"]):
        assert main(words) == 2
        assert capsys.readouterr().err.startswith("mavproxy-uavapi: --replay")


def test_http3_of_the_original_service_may_be_off_only(tmp_path: Path) -> None:
    file = tmp_path / "uav.ini"
    file.write_text("[api]\nudp = false\n", encoding="utf-8")
    parse(["--config", str(file)], environ={})
    file.write_text("[api]\nudp = true\n", encoding="utf-8")
    with pytest.raises(OptionError, match="there is no HTTP/3"):
        parse(["--config", str(file)], environ={})
