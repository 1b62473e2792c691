"""`uavapi set`, `status` and `vehicles` at the prompt, and settings that outlive a reload: a part of `module.py`."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.module import HELP, UavApiModule
from tests.support.mavproxy import MainLoop
from tests.support.messages import message_of
from tests.support.module_loader import Loader, listens, send_json


def test_bad_value_at_the_prompt_changes_nothing(
    module: UavApiModule, port: int, capsys: pytest.CaptureFixture[str]
) -> None:
    module.command(["set", "prot", "1"])
    module.command(["set", "port", "x"])
    out = capsys.readouterr().out
    assert "uavapi: no setting 'prot'; did you mean port?\n" in out
    assert "uavapi: port = 'x': it takes a whole number from 1 to 65535\n" in out
    assert listens(port)


def test_set_shows_the_settings(module: UavApiModule, port: int, capsys: pytest.CaptureFixture[str]) -> None:
    module.command(["set"])
    out = capsys.readouterr().out
    assert re.search(rf"port +{port} +module load", out)
    assert re.search(r"host +127.0.0.1 +default", out)
    module.command(["set", "max_age"])
    assert capsys.readouterr().out.splitlines() == [
        "max_age            5.0                      default",
        "  s after which telemetry is stale: a number from 0.1 to 3600; default 5.0",
    ]


def test_status_and_vehicles_and_help(
    module: UavApiModule, main_loop: MainLoop, port: int, capsys: pytest.CaptureFixture[str]
) -> None:
    module.command([])
    assert capsys.readouterr().out == (
        f"uavapi: listening on http://127.0.0.1:{port}\nno vehicle on the link yet\n0 calls in flight\n"
    )
    module.mavlink_packet(message_of("heartbeat", system=3))
    main_loop.until(lambda: 3 in module.host.fleet.vehicles)
    module.command(["vehicles"])
    assert capsys.readouterr().out.startswith("vehicle 3: copter, STABILIZE, disarmed, link ok")
    module.command(["help"])
    assert capsys.readouterr().out == HELP + "\n"


def test_settings_of_the_load_and_of_the_prompt_outlive_a_reload(
    loader: Loader, port: int, output: Callable[[str], str], capsys: pytest.CaptureFixture[str]
) -> None:
    module = loader.load(port=1, token="secret", sysid=7)
    module.command(["set", "port", str(port)])
    module.command(["set", "allow_from", "127.0.0.0/8"])
    loader.unload(module)
    capsys.readouterr()
    module = loader.load()
    assert output("listening") == (
        f"uavapi: as before: port={port}, token=(set), sysid=7, allow_from=127.0.0.0/8 "
        "(keywords at `module load` replace all that)\n"
        f"uavapi: listening on http://127.0.0.1:{port}\n"
    )
    settings = module.module_settings.snapshot()
    assert (settings.sysid, settings.token) == (7, "secret")
    origins = module.module_settings.origins
    assert (origins["port"], origins["sysid"]) == ("uavapi set", "module load")


def test_settings_that_are_only_good_together_outlive_a_reload(
    loader: Loader, capsys: pytest.CaptureFixture[str]
) -> None:
    module = loader.load(allow_open=True)
    for line in ("set host 0.0.0.0", "set token secret", "set allow_open false"):
        module.command(line.split())
    loader.unload(module)
    settings = loader.load().module_settings.snapshot()
    assert (settings.host, settings.token, settings.allow_open) == ("0.0.0.0", "secret", False)


def test_file_of_the_first_load_is_read_again_and_yields_to_the_prompt(loader: Loader, tmp_path: Path) -> None:
    file = tmp_path / "uavapi.ini"
    file.write_text("[api]\nsysid = 2\nport = 8001\n")
    module = loader.load(config=str(file))
    module.command(["set", "port", "8002"])
    loader.unload(module)
    file.write_text("[api]\nsysid = 3\nport = 8003\n")
    settings = loader.load().module_settings.snapshot()
    assert (settings.sysid, settings.port) == (3, 8002)


def test_setting_by_http_is_as_at_the_prompt_and_outlives_a_reload(
    loader: Loader, module: UavApiModule, main_loop: MainLoop, port: int, output: Callable[[str], str]
) -> None:
    answers: list[Any] = []
    in_force: list[float] = []

    def call() -> None:
        answers.append(send_json(port, "PUT", "/settings/script_grace", {"value": 3}))
        in_force.append(module.api._server.service.settings.script_grace)
        answers.append(send_json(port, "PUT", "/settings/python_path", {"value": "/tmp/mine"}))

    client = threading.Thread(target=call)
    client.start()
    printed = output("uavapi: script_grace is 3.0, set by 127.0.0.1\n")
    main_loop.until(lambda: not client.is_alive())
    assert [status for status, _ in answers] == [200, 422]
    assert in_force == [3.0] and "python_path" not in printed
    loader.unload(module)
    again = loader.load()
    assert again.module_settings.snapshot().script_grace == 3
    assert again.module_settings.origins["script_grace"] == "uavapi set"


def test_setting_without_a_new_listening_leaves_calls_in_flight_alone(
    module: UavApiModule, arming: Callable[[], Any], port: int, tmp_path: Path, output: Callable[[str], str]
) -> None:
    module.command(["set", "debug", "COPTER"])
    module.command(["set", "script_grace", "3"])
    (tmp_path / "file").touch()
    module.command(["set", "log_path", str(tmp_path / "file" / "uav.log")])
    output("the logs stay as they were")
    assert len(module.host.jobs.running()) == 1
    assert module.api._server.service.settings.script_grace == 3
    module.command(["set", "max_rate", "1"])
    assert listens(port)
    module.command(["stop"])
    output("stopped")
    assert arming()[1]["code"] == "aborted"
