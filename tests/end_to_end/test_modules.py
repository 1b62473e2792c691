"""Loading, unloading and the console, in a real MAVProxy."""

from __future__ import annotations

import os
import re
import shlex
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import requests

from tests.support.ports import free_port

ROUNDS = 50


@pytest.fixture(scope="module")
def mavproxy(harness, tmp_path_factory) -> Iterator:
    """A MAVProxy on the embedded vehicle, with none of our modules loaded."""
    made = harness.Rig(tmp_path_factory.mktemp("bare"), free_port())
    try:
        instance = harness.start_embedded(made, speedup=2)
        env = {"PYTHONPATH": str(made.directory)}
        made.mavproxy = made.start("mavproxy", harness.mavproxy_command(instance), env)
        made.mavproxy.says("Received", timeout=60)  # the parameters: MAVProxy is up and settled
        yield made
    finally:
        made.stop()


def load_line(rig) -> str:
    return f'module load uavapi:{{"port":{rig.port}}}'


def resources(pid: int) -> dict[str, int]:
    """Threads and file descriptors of a process."""
    return {what: len(os.listdir(f"/proc/{pid}/{what}")) for what in ("task", "fd")}


def no_more_than(before: dict[str, int], pid: int) -> bool:
    """Whether a process has no more of anything than it had."""
    return all(count <= before[what] for what, count in resources(pid).items())


@pytest.mark.long
def test_fifty_rounds_of_load_and_unload_leave_nothing_behind(mavproxy, harness):
    prompt = mavproxy.mavproxy

    def one_round() -> None:
        prompt.ask(load_line(mavproxy), f"listening on {mavproxy.url}")
        prompt.ask("module load vision", "Loaded module vision")
        prompt.ask("module load gradys", "Loaded module gradys")
        assert requests.get(mavproxy.url + "/telemetry/general", timeout=10).status_code in (200, 503)
        for name in ("uavapi", "vision", "gradys"):  # the first one made the host, the last one ends it
            prompt.ask(f"module unload {name}", f"Unloaded module {name}")

    one_round()  # what Python and MAVProxy load once and keep
    before = resources(prompt.pid)
    for _ in range(ROUNDS):
        one_round()
    assert harness.eventually(lambda: no_more_than(before, prompt.pid), what=f"having no more than {before}")
    for name in ("uavapi", "vision", "gradys"):
        prompt.ask(name, f"Unknown command '{name}'")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", mavproxy.port))  # the port is free


def test_reload_takes_the_port_over(mavproxy, harness):
    prompt = mavproxy.mavproxy
    prompt.ask(load_line(mavproxy), f"listening on {mavproxy.url}")
    before = resources(prompt.pid)
    for _ in range(5):
        output = prompt.ask(f"module reload {load_line(mavproxy).removeprefix('module load ')}", "listening on")
        assert "Reloaded module uavapi" not in output or "Failed" not in output
        mavproxy.wait_until_up()
    assert harness.eventually(lambda: no_more_than(before, prompt.pid), what=f"having no more than {before}")
    prompt.ask("module unload uavapi", "Unloaded module uavapi")


def test_the_modules_say_what_they_are(mavproxy):
    prompt = mavproxy.mavproxy
    prompt.ask("module load vision", "Loaded module vision")
    prompt.ask("vision status", "AprilTag")
    prompt.ask('module load gradys:{"gs":"127.0.0.1:9"}', "Loaded module gradys")
    prompt.ask("gradys status", "127.0.0.1:9")
    output = prompt.ask("module list", "wp:")
    assert "vision: " in output and "gradys: " in output
    prompt.ask("module unload vision", "Unloaded module vision")
    prompt.ask("module unload gradys", "Unloaded module gradys")


def test_console_commands(mavproxy):
    prompt = mavproxy.mavproxy
    prompt.ask(load_line(mavproxy), f"listening on {mavproxy.url}")
    mavproxy.wait_until_up()
    assert re.search(r"vehicle 1: copter, \w+, disarmed, link ok", prompt.ask("uavapi status", "in flight"))
    prompt.ask("uavapi vehicles", "vehicle 1: copter")
    prompt.ask("uavapi help", "uavapi set NAME VALUE")
    prompt.ask("uavapi stauts", "did you mean status?")
    prompt.ask("uavapi set", "link_timeout")
    prompt.ask("uavapi set prot 8001", "did you mean port?")
    prompt.ask("uavapi set port many", "it takes a whole number")
    prompt.ask("uavapi set host 0.0.0.0", "everybody on that network")
    prompt.ask("uavapi stop", "uavapi: stopped")
    with pytest.raises(requests.ConnectionError):
        mavproxy.get("/telemetry/status", timeout=5)
    prompt.ask("uavapi start", f"listening on {mavproxy.url}")
    mavproxy.wait_until_up()
    prompt.ask("module unload uavapi", "Unloaded module uavapi")


def test_the_next_line_of_a_script_finds_the_module_at_work(mavproxy):
    """MAVProxy runs a script's lines one after the other, without an idle task between them.

    It reads no link meanwhile, and on a slow machine OpenCV takes longer to load than a link may be silent.
    """
    prompt = mavproxy.mavproxy
    prompt.ask(load_line(mavproxy), f"listening on {mavproxy.url}")
    prompt.type("uavapi set link_timeout 60")
    mavproxy.wait_until_up()
    script = mavproxy.directory / "vision.scr"
    script.write_text("module load vision\nvision set source http\nvision search\n")
    mark = prompt.mark()
    prompt.type(f"script {script}")
    for answer in ("looking for 36h11 through http", "the vehicle is not armed"):  # by two threads, in any order
        output = prompt.says(answer, mark)
    assert "main loop" not in output
    assert mavproxy.ok(mavproxy.get("/vision/status"))["info"]["source"] == "http"
    for name in ("vision", "uavapi"):
        prompt.ask(f"module unload {name}", f"Unloaded module {name}")


def test_a_port_in_use_is_one_clear_line_and_mavproxy_lives_on(mavproxy, harness):
    prompt = mavproxy.mavproxy
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", mavproxy.port))
        taken.listen()
        output = prompt.ask(load_line(mavproxy), "takes another port")
        assert "Address already in use" in output
        assert "Traceback" not in output
    other = free_port()
    prompt.ask(f"uavapi set port {other}", f"listening on http://127.0.0.1:{other}")
    prompt.ask("module unload uavapi", "Unloaded module uavapi")


@pytest.mark.parametrize(
    "line,answer",
    [
        ('module load uavapi:{"prot":8001}', "did you mean port?"),
        ('module load uavapi:{"port":"x"}', "it takes a whole number"),
        ('module load uavapi:{"port":70000}', "it takes a whole number from 1 to 65535"),
        ('module load uavapi:{"config":"/no/such/file.ini"}', "No such file or directory"),
    ],
)
def test_a_bad_setting_is_one_clear_line_and_mavproxy_lives_on(mavproxy, line, answer):
    output = mavproxy.mavproxy.ask(line, answer)
    assert "Traceback" not in output
    mavproxy.mavproxy.ask("uavapi status", "Unknown command")


def test_a_missing_dependency_is_one_clear_line_and_mavproxy_lives_on(harness, tmp_path):
    missing = "raise ModuleNotFoundError(\"No module named 'aiohttp'\", name='aiohttp')\n"
    (tmp_path / "aiohttp.py").write_text(missing, encoding="utf-8")
    rig = harness.Rig(tmp_path, free_port())
    try:
        instance = harness.start_embedded(rig, speedup=2)
        rig.mavproxy = rig.start("mavproxy", harness.mavproxy_command(instance), {"PYTHONPATH": str(tmp_path)})
        rig.mavproxy.says("Detected vehicle")
        output = rig.mavproxy.ask("module load uavapi", "Failed to load module")
        assert "aiohttp" in output and "pip install" in output and "Traceback" not in output
        rig.mavproxy.ask("module list", "wp:")
    finally:
        rig.stop()


def test_loaded_from_the_command_line_before_there_is_a_link(harness, tmp_path):
    rig = harness.Rig(tmp_path, free_port())
    ini = tmp_path / "uavapi.ini"
    ini.write_text(f"[api]\nport = {rig.port}\nuav_connection = 127.0.0.1:17171\n", encoding="utf-8")
    try:
        instance = harness.start_embedded(rig, speedup=2)
        option = f'--load-module=uavapi:{{"config":"{ini}"}},vision,gradys'
        rig.mavproxy = rig.start("mavproxy", harness.mavproxy_command(instance, option))
        rig.wait_until_up()
        output = rig.mavproxy.ask("module list", "wp:")
        assert all(f"{name}: " in output for name in ("uavapi", "vision", "gradys"))
    finally:
        rig.stop()


def test_a_forked_child_does_not_keep_the_port(mavproxy):
    """MAVProxy forks for its map and console; what it forks must not hold our port after an unload."""
    prompt = mavproxy.mavproxy
    prompt.ask(load_line(mavproxy), f"listening on {mavproxy.url}")
    script = mavproxy.directory / "forker.py"
    script.write_text(
        "import os, time\n"
        "from MAVProxy.modules.lib import mp_module\n"
        "def init(mpstate):\n"
        "    if os.fork() == 0:\n"
        "        time.sleep(120)\n"
        "        os._exit(0)\n"
        "    return mp_module.MPModule(mpstate, 'forker')\n",
        encoding="utf-8",
    )
    prompt.ask("module load forker", "Loaded module forker")
    prompt.ask("module unload uavapi", "Unloaded module uavapi")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", mavproxy.port))


def test_root_files_hold_one_import_each():
    root = Path(__file__).parents[2]
    for name in ("uavapi", "vision", "gradys"):
        lines = (root / f"{name}.py").read_text(encoding="utf-8").splitlines()
        assert lines == [f"from mavproxy_{name}.module import init as init"]


@pytest.mark.needs("tmux")
def test_tab_completes_the_commands_and_settings(mavproxy, harness, tmp_path):
    """In a terminal of its own: tmux types, and shows the screen."""
    tmux = ["tmux", "-L", f"uavapi-test-{os.getpid()}"]
    command = shlex.join(mavproxy.mavproxy.popen.args)
    subprocess.run([*tmux, "new-session", "-d", "-x", "150", "-y", "50", "-c", str(tmp_path), command], check=True)

    def screen() -> str:
        return subprocess.run([*tmux, "capture-pane", "-p"], check=True, capture_output=True, text=True).stdout

    def type_and_see(text: str, *keys: str) -> None:
        subprocess.run([*tmux, "send-keys", *keys], check=True)
        harness.eventually(lambda: text in screen(), 120, f"{text!r} on the screen")

    try:
        harness.eventually(lambda: "Received" in screen(), 120, "the parameters' arrival")
        type_and_see("listening on", f'module load uavapi:{{"port":{free_port()}}}', "Enter")
        type_and_see("start   status", "uavapi st", "Tab", "Tab")
        type_and_see("calls in flight", "atus", "Enter")
        type_and_see("uavapi set link_timeout", "uavapi set link", "Tab")
    finally:
        subprocess.run([*tmux, "kill-server"], check=False)
