from __future__ import annotations

import asyncio
import json
import re
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from MAVProxy.modules.lib import rline

import uavapi
from mavproxy_uavapi.module import HELP


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Loader:
    """Loads and unloads the module as MAVProxy does."""

    def __init__(self, mpstate: Any, main_loop: Any) -> None:
        self.mpstate, self.main_loop = mpstate, main_loop

    def load(self, **kwargs: Any) -> Any:
        module = uavapi.init(self.mpstate, **kwargs)
        self.main_loop.modules.append(module)
        return module

    def unload(self, module: Any) -> None:
        """In another thread, while the main loop waits."""
        thread = threading.Thread(target=module.unload)
        thread.start()
        thread.join(5.0)
        assert not thread.is_alive()
        self.main_loop.modules.remove(module)


@pytest.fixture
def loader(mpstate: Any, main_loop: Any) -> Iterator[Loader]:
    loader = Loader(mpstate, main_loop)
    yield loader
    for module in list(main_loop.modules):
        loader.unload(module)


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def module(loader: Loader, port: int, output: Any) -> Any:
    """The module, listening."""
    module = loader.load(port=port)
    assert output("listening") == f"uavapi: listening on http://127.0.0.1:{port}\n"
    return module


def ask(port: int, path: str) -> tuple[int, Any]:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=5) as response:
            return response.status, json.load(response)
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.load(error)


@pytest.fixture
def output(main_loop: Any, capsys: Any) -> Callable[[str], str]:
    """Turn the main loop until those words were printed; everything that was printed since the last time."""

    def output(words: str) -> str:
        printed: list[str] = []

        def found() -> bool:
            printed.append(capsys.readouterr().out)
            return words in "".join(printed)

        main_loop.until(found)
        return "".join(printed)

    return output


def listens(port: int) -> bool:
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


def test_module_is_what_mavproxy_looks_for(module: Any, mpstate: Any) -> None:
    assert module.name == "uavapi"
    assert module.multi_vehicle
    assert set(mpstate.command_map) == {"uavapi"}
    assert mpstate.completions["uavapi"][:6] == [
        "<status|start|stop|vehicles|config|log|help>",
        "fleet <arm|brake|disarm|guided|land|rtl|stop>",
        "token <add|list|remove>",
        "authority <take|release>",
        "fly (FILENAME)",
        "set (UAVAPISETTING) (UAVAPIVALUE)",
    ]
    assert "set on_lease_end <hold|land|rtl>" in mpstate.completions["uavapi"]
    assert "set allow_raw <true|false>" in mpstate.completions["uavapi"]
    assert "port" in mpstate.completion_functions["(UAVAPISETTING)"]("")


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        (["set", "on_conflict", "w"], {"refuse", "wait"}),
        (["set", "port", "8"], set()),
        (["fleet", "r"], {"rtl", "arm"}),
    ],
)
def test_mavproxy_completes_values(
    module: Any, mpstate: Any, typed: list[str], expected: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rline, "rline_mpstate", mpstate, raising=False)
    assert set(rline.complete_rules(mpstate.completions[module.name], typed)) >= expected


def test_nothing_listens_before_the_first_idle_task(loader: Loader, port: int, mpstate: Any) -> None:
    loader.load(port=port)
    assert not listens(port)
    assert mpstate.select_extra == {}


def test_loaded_module_answers(module: Any, main_loop: Any, port: int, msg: Callable[..., Any]) -> None:
    module.mavlink_packet(msg("heartbeat", system=3, armed=True, mode="LOITER"))
    main_loop.until(lambda: 3 in module.host.fleet.vehicles)
    status, body = ask(port, "/telemetry/status")
    assert (status, body["id"], body["info"]["mode"], body["info"]["armed"]) == (200, "3", "LOITER", True)


def test_command_goes_out_in_the_main_loop(
    module: Any, main_loop: Any, mpstate: Any, port: int, msg: Callable[..., Any]
) -> None:
    senders: list[int] = []
    answers: list[Any] = []

    def send(message: Any) -> None:
        senders.append(threading.get_ident())
        if message.get_type() == "COMMAND_LONG" and message.command == 183:
            module.mavlink_packet(
                msg("command_ack", command=183, target_system=255, target_component=230, sequence=1)
            )

    def client() -> None:
        request = urllib.request.Request(
            f"http://127.0.0.1:{port}/peripherical/servo_output",
            json.dumps({"channel": 9, "pwm": 1500}).encode(),
            {"Content-Type": "application/json"},
        )
        with urllib.request.urlopen(request, timeout=5) as response:
            answers.append(json.load(response)["result"])

    mpstate.the_master.mav.send = send
    module.mavlink_packet(msg("heartbeat"))
    main_loop.until(lambda: 1 in module.host.fleet.vehicles)
    thread = threading.Thread(target=client)
    thread.start()
    main_loop.until(lambda: answers)
    thread.join()
    assert answers == ["Servo 9 set to 1500 PWM"]
    assert set(senders) == {threading.get_ident()}


# -- loading ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kwargs", "words"),
    [
        ({"prot": 1}, "uavapi: no setting 'prot'; did you mean port?"),
        ({"port": "x"}, "uavapi: port = 'x': it takes a whole number from 1 to 65535"),
        ({"host": "0.0.0.0"}, "everybody on that network"),
        ({"config": "/no/such.ini"}, "/no/such.ini: No such file or directory"),
    ],
)
def test_bad_argument_is_an_import_error_of_one_line_and_leaves_nothing(
    mpstate: Any, descriptors: Any, kwargs: dict[str, Any], words: str
) -> None:
    threads, before = threading.active_count(), descriptors()
    with pytest.raises(ImportError) as caught:
        uavapi.init(mpstate, **kwargs)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert (mpstate.command_map, mpstate.select_extra) == ({}, {})
    assert not hasattr(mpstate, "uavapi_host")
    assert (threading.active_count(), descriptors()) == (threads, before)


def test_taken_port_is_one_line_and_another_port_helps(
    loader: Loader, main_loop: Any, port: int, capsys: Any, output: Any
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", port))
        taken.listen()
        module = loader.load(port=port)
        assert output("\n") == (
            f"uavapi: cannot listen on http://127.0.0.1:{port}: Address already in use; "
            "`uavapi set port N` takes another port\n"
        )
        main_loop.turn()
        assert capsys.readouterr().out == ""
        other = free_port()
        module.command(["set", "port", str(other)])
        output("listening")
        assert listens(other)


# -- the prompt -------------------------------------------------------------------------------------------


def test_set_port_restarts_there(module: Any, port: int, output: Any) -> None:
    other = free_port()
    module.command(["set", "port", str(other)])
    assert output("listening") == f"uavapi: listening on http://127.0.0.1:{other}\n"
    assert listens(other)
    assert not listens(port)


def test_set_to_the_same_value_restarts_nothing(module: Any, port: int, capsys: Any) -> None:
    before = module.api.filenos()
    module.command(["set", "port", str(port)])
    assert capsys.readouterr().out == ""
    assert module.api.filenos() == before


def test_bad_value_at_the_prompt_changes_nothing(module: Any, port: int, capsys: Any) -> None:
    module.command(["set", "prot", "1"])
    module.command(["set", "port", "x"])
    out = capsys.readouterr().out
    assert "uavapi: no setting 'prot'; did you mean port?\n" in out
    assert "uavapi: port = 'x': it takes a whole number from 1 to 65535\n" in out
    assert listens(port)


def test_set_shows_the_settings(module: Any, port: int, capsys: Any) -> None:
    module.command(["set"])
    out = capsys.readouterr().out
    assert re.search(rf"port +{port} +module load", out)
    assert re.search(r"host +127.0.0.1 +default", out)
    module.command(["set", "max_age"])
    assert capsys.readouterr().out.splitlines() == [
        "max_age            5.0                      default",
        "  s after which telemetry is stale: a number from 0.1 to 3600; default 5.0",
    ]


def test_stop_and_start(module: Any, port: int, output: Any) -> None:
    module.command(["stop"])
    assert output("stopped") == "uavapi: stopped\n"
    assert not listens(port)
    module.command(["start"])
    assert output("listening") == f"uavapi: listening on http://127.0.0.1:{port}\n"
    assert listens(port)


def test_starts_and_stops_are_done_in_the_order_in_which_they_were_typed(module: Any, port: int, output: Any) -> None:
    other = free_port()
    for line in ("stop", "start", f"set port {other}", "stop", f"set port {port}", "start"):
        module.command(line.split())
    addresses = [f"uavapi: listening on http://127.0.0.1:{number}\n" for number in (port, other, port)]
    stopped = "uavapi: stopped\n"
    assert (
        output(addresses[1] + stopped + addresses[2])
        == stopped + addresses[0] + addresses[1] + stopped + addresses[2]
    )
    assert listens(port)
    assert not listens(other)


def test_set_does_not_open_what_was_stopped(module: Any, output: Any) -> None:
    module.command(["stop"])
    other = free_port()
    module.command(["set", "port", str(other)])
    output("stopped")
    assert not listens(other)
    module.command(["start"])
    output("listening")
    assert listens(other)


def test_status_and_vehicles_and_help(module: Any, main_loop: Any, port: int, msg: Any, capsys: Any) -> None:
    module.command([])
    assert capsys.readouterr().out == (
        f"uavapi: listening on http://127.0.0.1:{port}\nno vehicle on the link yet\n0 calls in flight\n"
    )
    module.mavlink_packet(msg("heartbeat", system=3))
    main_loop.until(lambda: 3 in module.host.fleet.vehicles)
    module.command(["vehicles"])
    assert capsys.readouterr().out.startswith("vehicle 3: copter, STABILIZE, disarmed, link ok")
    module.command(["help"])
    assert capsys.readouterr().out == HELP + "\n"


def test_commands_of_a_startup_script_come_before_the_main_loop(
    loader: Loader, port: int, output: Any, capsys: Any
) -> None:
    module = loader.load(port=port)
    started = time.monotonic()
    other = free_port()
    for line in ("status", "vehicles", "start", f"set port {other}"):
        module.command(line.split())
    assert time.monotonic() - started < 1.0
    assert f"not listening; it would be http://127.0.0.1:{port}" in capsys.readouterr().out
    output("listening")
    assert listens(other)


def test_startup_script_may_keep_it_from_listening(loader: Loader, main_loop: Any, port: int, output: Any) -> None:
    module = loader.load(port=port)
    module.command(["stop"])
    for _ in range(20):
        main_loop.turn(0.01)
    assert not listens(port)
    module.command(["start"])
    output("listening")
    assert listens(port)


# -- a start that takes long, or fails --------------------------------------------------------------------


def test_start_that_takes_long_holds_nothing_up_and_says_so_and_what_came_of_it(
    loader: Loader, main_loop: Any, port: int, output: Any, monkeypatch: Any
) -> None:
    begun, released = threading.Event(), threading.Event()

    def slow(*_: Any) -> None:
        begun.set()
        released.wait(10)

    monkeypatch.setattr("mavproxy_uavapi.core.background.SLOW", 0.05)
    module = loader.load(port=port)
    module.logs.open = slow
    started = time.monotonic()
    main_loop.turn()
    assert time.monotonic() - started < 0.5
    assert begun.wait(5)
    still = f"uavapi: still trying to listen on http://127.0.0.1:{port}; a line follows when it is done\n"
    assert output("still") == still
    released.set()
    assert output("listening") == f"uavapi: listening on http://127.0.0.1:{port}\n"


def test_start_that_fails_for_an_unforeseen_reason_is_reported(
    loader: Loader, port: int, output: Any, monkeypatch: Any
) -> None:
    module = loader.load(port=port)
    defects: list[Any] = []
    module.host.bridge.loop.set_exception_handler(lambda _, context: defects.append(context["exception"]))
    module.api.start = lambda _: 1 / 0
    assert output("\n") == "uavapi: a defect ended this: ZeroDivisionError('division by zero')\n"
    assert [type(defect) for defect in defects] == [ZeroDivisionError]
    del module.api.start
    module.command(["start"])
    output("listening")
    assert listens(port)


def test_start_that_hangs_does_not_hold_up_the_unload(
    loader: Loader, main_loop: Any, port: int, monkeypatch: Any
) -> None:
    module = loader.load(port=port)
    hanging = threading.Event()

    async def hang() -> None:
        hanging.set()
        await asyncio.Event().wait()

    monkeypatch.setattr("mavproxy_uavapi.http.app.ApiServer.start", lambda _: hang())
    started = time.monotonic()
    main_loop.turn()
    assert time.monotonic() - started < 0.5
    assert hanging.wait(5)
    started = time.monotonic()
    loader.unload(module)
    assert time.monotonic() - started < 2.0
    assert not listens(port)


def test_track_is_flown_by_the_apis_own_vehicle(loader: Loader, capsys: Any) -> None:
    module = loader.load(sysid=7)
    module.command(["fly", "a.track"])
    assert "module load gradys" in capsys.readouterr().out
    flown: list[list[str]] = []
    module.host.commands["fly"] = flown.append
    module.command(["fly", "a.track", "--reach", "50"])
    module.command(["set", "sysid", "0"])
    module.command(["fly", "a.track"])
    assert flown == [["--sysid", "7", "a.track", "--reach", "50"], ["--sysid", "0", "a.track"]]


# -- reloading --------------------------------------------------------------------------------------------


def test_settings_of_the_load_and_of_the_prompt_outlive_a_reload(
    loader: Loader, port: int, output: Any, capsys: Any
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


def test_settings_that_are_only_good_together_outlive_a_reload(loader: Loader, capsys: Any) -> None:
    module = loader.load(allow_open=True)
    for line in ("set host 0.0.0.0", "set token secret", "set allow_open false"):
        module.command(line.split())
    loader.unload(module)
    settings = loader.load().module_settings.snapshot()
    assert (settings.host, settings.token, settings.allow_open) == ("0.0.0.0", "secret", False)


def test_file_of_the_first_load_is_read_again_and_yields_to_the_prompt(loader: Loader, tmp_path: Any) -> None:
    file = tmp_path / "uavapi.ini"
    file.write_text("[api]\nsysid = 2\nport = 8001\n")
    module = loader.load(config=str(file))
    module.command(["set", "port", "8002"])
    loader.unload(module)
    file.write_text("[api]\nsysid = 3\nport = 8003\n")
    settings = loader.load().module_settings.snapshot()
    assert (settings.sysid, settings.port) == (3, 8002)


# -- unloading --------------------------------------------------------------------------------------------


def test_unload_leaves_nothing_behind_twenty_times(
    loader: Loader, main_loop: Any, mpstate: Any, port: int, descriptors: Any, msg: Any
) -> None:
    threads, before = threading.active_count(), descriptors()
    for number in range(20):
        module = loader.load(port=port)
        if number % 5:  # and sometimes it is unloaded before it began
            main_loop.until(lambda module=module: module.api.listening)
            module.mavlink_packet(msg("heartbeat"))
            main_loop.until(lambda module=module: module.host.fleet.vehicles)
            assert ask(port, "/telemetry/status")[0] == 200
        loader.unload(module)
        assert (mpstate.command_map, mpstate.completions, mpstate.select_extra) == ({}, {}, {})
        assert list(mpstate.completion_functions) == ["(OTHER)"]
        assert not hasattr(mpstate, "uavapi_host")
    assert not listens(port)
    assert threading.active_count() == threads
    assert descriptors() == before


def test_unload_ends_a_call_in_flight_and_answers_it(
    loader: Loader, module: Any, main_loop: Any, port: int, msg: Any
) -> None:
    answers: list[Any] = []
    module.mavlink_packet(msg("heartbeat"))
    main_loop.until(lambda: 1 in module.host.fleet.vehicles)
    client = threading.Thread(target=lambda: answers.append(ask(port, "/command/arm")))
    client.start()
    main_loop.until(module.host.jobs.running)
    loader.unload(module)
    client.join(5.0)
    assert answers[0][0] == 409
    assert answers[0][1]["code"] == "aborted"


def test_unload_takes_its_descriptors_back_from_a_host_that_goes_on(
    loader: Loader, main_loop: Any, mpstate: Any, port: int
) -> None:
    import vision

    other = vision.init(mpstate)
    main_loop.modules.append(other)
    before = len(other.host.bridge._open_sockets)
    for _ in range(3):
        module = loader.load(port=port)
        main_loop.until(lambda: listens(port))
        loader.unload(module)
        assert not listens(port)
    assert len(other.host.bridge._open_sockets) == before
    assert other.host.bridge.running


def put(port: int, name: str, value: Any) -> tuple[int, Any]:
    url, body = f"http://127.0.0.1:{port}/settings/{name}", json.dumps({"value": value}).encode()
    request = urllib.request.Request(url, body, {"Content-Type": "application/json"}, method="PUT")
    try:
        with urllib.request.urlopen(request, timeout=5) as response:
            return response.status, json.load(response)
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.load(error)


def test_setting_that_comes_by_http_is_set_as_at_the_prompt_and_outlives_a_reload(
    loader: Loader, module: Any, main_loop: Any, port: int, output: Any
) -> None:
    answers: list[Any] = []
    in_force: list[float] = []

    def call() -> None:
        answers.append(put(port, "script_grace", 3))
        in_force.append(module.api._server.service.settings.script_grace)
        answers.append(put(port, "python_path", "/tmp/mine"))

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


def test_setting_that_needs_no_other_listening_leaves_calls_in_flight_alone(
    module: Any, main_loop: Any, port: int, msg: Any, tmp_path: Any, output: Any
) -> None:
    answers: list[Any] = []
    module.mavlink_packet(msg("heartbeat"))
    main_loop.until(lambda: 1 in module.host.fleet.vehicles)
    client = threading.Thread(target=lambda: answers.append(ask(port, "/command/arm")))
    client.start()
    main_loop.until(module.host.jobs.running)
    module.command(["set", "debug", "COPTER"])
    module.command(["set", "script_grace", "3"])
    (tmp_path / "file").touch()
    module.command(["set", "log_path", str(tmp_path / "file" / "uav.log")])
    output("the logs stay as they were")
    assert len(module.host.jobs.running()) == 1 and answers == []
    assert module.api._server.service.settings.script_grace == 3
    module.command(["set", "max_rate", "1"])
    assert listens(port)
    module.command(["stop"])
    output("stopped")
    client.join(5.0)
    assert answers[0][1]["code"] == "aborted"
