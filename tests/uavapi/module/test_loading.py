"""`module load uavapi`: what it brings into MAVProxy, and what it refuses: a part of `module.py`."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from MAVProxy.modules.lib import rline

import uavapi
from mavproxy_uavapi.module import UavApiModule
from tests.support.mavproxy import MainLoop
from tests.support.messages import message_of
from tests.support.module_loader import Loader, ask, listens, send_json


def test_module_is_what_mavproxy_looks_for(module: UavApiModule, mpstate: SimpleNamespace) -> None:
    assert module.name == "uavapi"
    assert module.multi_vehicle
    assert set(mpstate.command_map) == {"uavapi"}
    assert mpstate.completions["uavapi"][:7] == [
        "<status|start|stop|vehicles|config|log|why|help>",
        "flight <start|stop>",
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
    module: UavApiModule,
    mpstate: SimpleNamespace,
    typed: list[str],
    expected: set[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rline, "rline_mpstate", mpstate, raising=False)
    assert set(rline.complete_rules(mpstate.completions[module.name], typed)) >= expected


def test_nothing_listens_before_the_first_idle_task(loader: Loader, port: int, mpstate: SimpleNamespace) -> None:
    loader.load(port=port)
    assert not listens(port)
    assert mpstate.select_extra == {}


def test_loaded_module_answers(module: UavApiModule, main_loop: MainLoop, port: int) -> None:
    module.mavlink_packet(message_of("heartbeat", system=3, armed=True, mode="LOITER"))
    main_loop.until(lambda: 3 in module.host.fleet.vehicles)
    status, body = ask(port, "/telemetry/status")
    assert (status, body["id"], body["info"]["mode"], body["info"]["armed"]) == (200, "3", "LOITER", True)


def test_command_goes_out_in_the_main_loop(
    module: UavApiModule, main_loop: MainLoop, mpstate: SimpleNamespace, port: int
) -> None:
    senders: list[int] = []
    answers: list[Any] = []

    def send(message: Any) -> None:
        senders.append(threading.get_ident())
        if message.get_type() == "COMMAND_LONG" and message.command == 183:
            module.mavlink_packet(
                message_of("command_ack", command=183, target_system=255, target_component=230, sequence=1)
            )

    def client() -> None:
        answers.append(send_json(port, "POST", "/peripherical/servo_output", {"channel": 9, "pwm": 1500}))

    mpstate.the_master.mav.send = send
    module.mavlink_packet(message_of("heartbeat"))
    main_loop.until(lambda: 1 in module.host.fleet.vehicles)
    thread = threading.Thread(target=client)
    thread.start()
    main_loop.until(lambda: answers)
    thread.join()
    assert [body["result"] for _, body in answers] == ["Servo 9 set to 1500 PWM"]
    assert set(senders) == {threading.get_ident()}


@pytest.mark.parametrize(
    ("kwargs", "words"),
    [
        ({"prot": 1}, "uavapi: no setting 'prot'; did you mean port?"),
        ({"port": "x"}, "uavapi: port = 'x': it takes a whole number from 1 to 65535"),
        ({"host": "0.0.0.0"}, "everybody on that network"),
        ({"config": "/no/such.ini"}, "/no/such.ini cannot be read: No such file or directory"),
    ],
)
def test_bad_argument_is_an_import_error_of_one_line_and_leaves_nothing(
    mpstate: SimpleNamespace,
    descriptors: Callable[[], int],
    threads: Callable[[], list[str]],
    kwargs: dict[str, Any],
    words: str,
) -> None:
    names, before = threads(), descriptors()
    with pytest.raises(ImportError) as caught:
        uavapi.init(mpstate, **kwargs)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert (mpstate.command_map, mpstate.select_extra) == ({}, {})
    assert not hasattr(mpstate, "uavapi_host")
    assert (threads(), descriptors()) == (names, before)


def test_track_is_flown_by_the_apis_own_vehicle(loader: Loader, capsys: pytest.CaptureFixture[str]) -> None:
    module = loader.load(sysid=7)
    module.command(["fly", "a.track"])
    assert "module load gradys" in capsys.readouterr().out
    flown: list[list[str]] = []
    module.host.commands["fly"] = flown.append
    module.command(["fly", "a.track", "--reach", "50"])
    module.command(["set", "sysid", "0"])
    module.command(["fly", "a.track"])
    assert flown == [["--sysid", "7", "a.track", "--reach", "50"], ["--sysid", "0", "a.track"]]
