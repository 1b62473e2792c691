"""When and where the module listens, what it prints of that, and `uavapi start` and `stop`: a part of `module.py`."""

from __future__ import annotations

import asyncio
import socket
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.module import UavApiModule
from tests.support.mavproxy import MainLoop
from tests.support.module_loader import Loader, listens
from tests.support.ports import free_port


def test_taken_port_is_one_line_and_another_port_helps(
    loader: Loader, main_loop: MainLoop, port: int, capsys: pytest.CaptureFixture[str], output: Callable[[str], str]
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


@pytest.mark.needs("openssl")
def test_key_with_a_password_is_one_line_and_nobody_is_asked_for_it(
    loader: Loader, port: int, tmp_path: Path, output: Callable[[str], str]
) -> None:
    key, cert = str(tmp_path / "key.pem"), str(tmp_path / "cert.pem")
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-passout", "pass:secret", "-subj", "/CN=localhost"]
    subprocess.run([*command, "-keyout", key, "-out", cert], check=True, capture_output=True)
    loader.load(port=port, certfile=cert, keyfile=key)
    line = output("cannot use")
    assert line.startswith(f"uavapi: cannot use {cert} with {key}: the key has a password; `openssl pkey -in KEY ")
    assert not listens(port)


def test_set_port_restarts_there(module: UavApiModule, port: int, output: Callable[[str], str]) -> None:
    other = free_port()
    module.command(["set", "port", str(other)])
    assert output("listening") == f"uavapi: listening on http://127.0.0.1:{other}\n"
    assert listens(other)
    assert not listens(port)


def test_set_to_the_same_value_restarts_nothing(
    module: UavApiModule, port: int, capsys: pytest.CaptureFixture[str]
) -> None:
    before = module.api.filenos()
    module.command(["set", "port", str(port)])
    assert capsys.readouterr().out == ""
    assert module.api.filenos() == before


def test_stop_and_start(module: UavApiModule, port: int, output: Callable[[str], str]) -> None:
    module.command(["stop"])
    assert output("stopped") == "uavapi: stopped\n"
    assert not listens(port)
    module.command(["start"])
    assert output("listening") == f"uavapi: listening on http://127.0.0.1:{port}\n"
    assert listens(port)


def test_starts_and_stops_are_done_in_the_order_in_which_they_were_typed(
    module: UavApiModule, port: int, output: Callable[[str], str]
) -> None:
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


def test_set_does_not_open_what_was_stopped(module: UavApiModule, output: Callable[[str], str]) -> None:
    module.command(["stop"])
    other = free_port()
    module.command(["set", "port", str(other)])
    output("stopped")
    assert not listens(other)
    module.command(["start"])
    output("listening")
    assert listens(other)


def test_commands_of_a_startup_script_come_before_the_main_loop(
    loader: Loader, port: int, output: Callable[[str], str], capsys: pytest.CaptureFixture[str], long_waits: None
) -> None:
    module = loader.load(port=port)
    started = time.monotonic()
    other = free_port()
    for line in ("status", "vehicles", "start", f"set port {other}"):
        module.command(line.split())
    assert time.monotonic() - started < 30
    assert f"not listening; it would be http://127.0.0.1:{port}" in capsys.readouterr().out
    output("listening")
    assert listens(other)


def test_startup_script_may_keep_it_from_listening(
    loader: Loader, main_loop: MainLoop, port: int, output: Callable[[str], str]
) -> None:
    module = loader.load(port=port)
    module.command(["stop"])
    for _ in range(20):
        main_loop.turn(0.01)
    assert not listens(port)
    module.command(["start"])
    output("listening")
    assert listens(port)


def test_long_start_holds_nothing_up_and_says_what_came_of_it(
    loader: Loader,
    main_loop: MainLoop,
    port: int,
    output: Callable[[str], str],
    monkeypatch: pytest.MonkeyPatch,
    long_waits: None,
) -> None:
    begun, released = threading.Event(), threading.Event()

    def slow(*_: Any) -> None:
        begun.set()
        released.wait(120)

    monkeypatch.setattr("mavproxy_uavapi.core.background.SLOW", 0.05)
    module = loader.load(port=port)
    module.logs.open = slow
    started = time.monotonic()
    main_loop.turn()
    assert time.monotonic() - started < 30
    assert begun.wait(60)
    still = f"uavapi: still trying to listen on http://127.0.0.1:{port}; a line follows when it is done\n"
    assert output("still") == still
    released.set()
    assert output("listening") == f"uavapi: listening on http://127.0.0.1:{port}\n"


def test_start_that_fails_for_an_unforeseen_reason_is_reported(
    loader: Loader, port: int, output: Callable[[str], str], monkeypatch: pytest.MonkeyPatch
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
    loader: Loader, main_loop: MainLoop, port: int, monkeypatch: pytest.MonkeyPatch, long_waits: None
) -> None:
    module = loader.load(port=port)
    hanging = threading.Event()

    async def hang() -> None:
        hanging.set()
        await asyncio.Event().wait()

    monkeypatch.setattr("mavproxy_uavapi.http.server.app.ApiServer.start", lambda _: hang())
    started = time.monotonic()
    main_loop.turn()
    assert time.monotonic() - started < 30
    assert hanging.wait(60)
    started = time.monotonic()
    loader.unload(module)
    assert time.monotonic() - started < 30
    assert not listens(port)
