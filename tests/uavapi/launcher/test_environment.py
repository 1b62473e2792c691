from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from mavproxy_uavapi.launcher import command_lines, environment
from mavproxy_uavapi.launcher.errors import LaunchError


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


def test_environment_that_was_read_does_not_override_the_command_line() -> None:
    environ = {"UAVAPI_SCRIPTS_PATH": "/e", "UAVAPI_PORT": "1", "UAVAPI_SCRIPT_GRACE": "20", "UAVAPI_TOKEN": "t"}
    environ["UAVAPI_CONFIG"] = "/e/uav.ini"
    passed = environment.for_mavproxy(environ)
    assert {name for name in passed if name.startswith("UAVAPI_")} == {"UAVAPI_SCRIPT_GRACE", "UAVAPI_TOKEN"}
