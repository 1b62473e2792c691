"""The manager with real tmux sessions and real files; the vehicle is not asked for anything here."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from requests.utils import get_environ_proxies

from mavproxy_uavapi.core.errors import BadRequest, NotFound, NoVehicle, ToolFailed
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.scripts import manager, names, runs, tmux
from mavproxy_uavapi.scripts.manager import Scripts
from mavproxy_uavapi.settings import ApiModuleSettings

PRINTS = b"import os, sys\nprint(os.environ['UAVAPI_URL'], os.environ['UAVAPI_TOKEN'], os.environ['UAVAPI_SYSID'])\n"
SLEEPS = b"import time\nprint('up')\ntime.sleep(60)\n"


class NoRegistry:
    def find(self, _system: int) -> Any:
        raise NoVehicle("none")


def settings(folder: Path, **keywords: Any) -> Any:
    defaults = {"scripts_path": str(folder / "scripts"), "script_logs": str(folder / "logs"), "sysid": 9}
    return ApiModuleSettings({**defaults, **keywords}, environ={}).snapshot()


def scripts_in(folder: Path, **keywords: Any) -> Scripts:
    return Scripts(SimpleNamespace(registry=NoRegistry()), settings(folder, **keywords))  # type: ignore[arg-type]


def flown(folder: Path, story: Callable[[Scripts], Awaitable[Any]], **keywords: Any) -> Any:
    async def run() -> Any:
        scripts = scripts_in(folder, **keywords)
        try:
            return await asyncio.wait_for(story(scripts), 30)
        finally:
            await scripts.stop()

    return asyncio.run(run())


async def ended(scripts: Scripts, script: str) -> Any:
    while scripts.running_run(script) is not None:  # noqa: ASYNC110  another process ends it
        await asyncio.sleep(0.02)
    return await scripts.newest(script)


async def up(scripts: Scripts, script: str) -> None:
    run = await scripts.newest(script)
    assert run is not None
    while not run.out_log.read_text():  # noqa: ASYNC110  another process writes it
        await asyncio.sleep(0.02)


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_script_learns_where_the_api_is_and_its_end_is_remembered(tmp_path: Path) -> None:
    async def story(scripts: Scripts) -> Any:
        await scripts.save("a.py", PRINTS)
        await scripts.execute("a", [])
        return await ended(scripts, "a.py")

    run = flown(tmp_path, story, token="secret", port=8123)
    assert run.out_log.read_text() == "http://127.0.0.1:8123 secret 9\n"
    assert (run.exit_status, run.session.startswith("uavapi_9_a_")) == (0, True)
    assert b"secret" not in b"".join(file.read_bytes() for file in run.path.parent.iterdir() if "json" in file.name)


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_bytes_that_were_checked_run_even_if_the_file_was_replaced_since(tmp_path: Path) -> None:
    checked = b"import os, sys\nprint('checked', os.path.basename(sys.argv[0]), sys.argv[1:])\n"

    async def story(scripts: Scripts) -> Any:
        await scripts.save("a.py", b"print('another')\n")
        await scripts.execute("a", ["x"], content=checked)
        run = await ended(scripts, "a.py")
        await scripts.execute("a", [])
        return run, await ended(scripts, "a.py")

    first, second = flown(tmp_path, story)
    assert first.out_log.read_text() == "checked a.py ['x']\n"
    assert second.out_log.read_text() == "another\n"


def test_script_for_one_of_several_vehicles_finds_that_one(tmp_path: Path) -> None:
    environment = scripts_in(tmp_path, port=8123).environment(system=2)
    assert environment["UAVAPI_URL"] == "http://127.0.0.1:8123/vehicles/2"
    assert environment["UAVAPI_SYSID"] == "2"


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_script_that_dies_at_once_is_answered_with_its_fate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(manager, "DIES_AT_ONCE", 30.0)  # a busy machine takes long to die

    async def story(scripts: Scripts) -> Any:
        await scripts.save("a.py", b"import nonesuch")
        return await scripts.execute("a", [])

    run = flown(tmp_path, story)
    assert (run.running, run.exit_status) == (False, 1)
    assert "nonesuch" in run.err_log.read_text()


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "0.0.0.0", "192.168.1.5"])
def test_scripts_calls_go_past_the_networks_proxy_and_others_through_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, host: str
) -> None:
    monkeypatch.setenv("http_proxy", "http://proxy.example:3128")
    monkeypatch.setenv("NO_PROXY", "intranet.example")
    scripts = scripts_in(tmp_path, host=host, token="t")
    for name, value in scripts.environment().items():
        monkeypatch.setenv(name, value)
    for past in (os.environ["UAVAPI_URL"], "http://localhost:8000", "http://intranet.example"):
        assert get_environ_proxies(past) == {}
    assert "http" in get_environ_proxies("http://weather.example")


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_running_script_is_not_started_twice_and_stops(tmp_path: Path) -> None:
    async def story(scripts: Scripts) -> None:
        await scripts.save("a.py", SLEEPS)
        outcomes = await asyncio.gather(*(scripts.execute("a", []) for _ in range(3)), return_exceptions=True)
        assert [type(outcome) for outcome in outcomes].count(BadRequest) == 2
        assert [run.script for run in await scripts.running()] == ["a.py"]
        await up(scripts, "a.py")
        run = await scripts.halt("a.py")
        assert (run.running, run.exit_status, run.killed) == (False, -2, False)
        assert await scripts.running() == []
        with pytest.raises(BadRequest, match="not running"):
            await scripts.halt("a")
        with pytest.raises(NotFound):
            await scripts.halt("b")

    flown(tmp_path, story)


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_next_api_of_the_port_finds_the_last_ones_scripts_for_any_vehicle(tmp_path: Path) -> None:
    async def begin(scripts: Scripts) -> None:
        await scripts.save("a.py", SLEEPS)
        await scripts.execute("a", ["x"])

    async def find(scripts: Scripts) -> list[str]:
        await scripts.start()
        return [run.script for run in await scripts.running()]

    async def find_and_stop(scripts: Scripts) -> Any:
        await scripts.start()
        await scripts.save("a.py", SLEEPS)
        with pytest.raises(BadRequest, match="already running"):
            await scripts.execute("a", [])
        await up(scripts, "a.py")
        return await scripts.halt("a")

    flown(tmp_path, begin)
    assert flown(tmp_path, find) == ["a.py"]
    assert flown(tmp_path, find, sysid=0) == flown(tmp_path, find, sysid=90) == ["a.py"]
    assert flown(tmp_path, find, port=8001) == [], "another MAVProxy's scripts are not ours"
    assert flown(tmp_path / "elsewhere", find_and_stop).exit_status == -2


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_what_cannot_be_started_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    async def story(scripts: Scripts) -> None:
        await scripts.save("a.py", PRINTS)
        with pytest.raises(ToolFailed, match="/no/such/python"):
            await scripts.execute("a", [])
        assert await scripts.running() == []

    flown(tmp_path, story, python_path="/no/such/python")
    assert list((tmp_path / "logs").iterdir()) == []


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_script_that_cannot_start_leaves_the_session_of_its_name_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(names, "session_name", lambda *_: "uavapi_9_a")

    async def story(scripts: Scripts) -> None:
        await scripts.save("a.py", SLEEPS)
        await scripts.save("b.py", SLEEPS)
        await scripts.execute("a", [])
        with pytest.raises(ToolFailed, match="duplicate session"):
            await scripts.execute("b", [])
        await up(scripts, "a.py")
        assert [run.script for run in await scripts.running()] == ["a.py"]

    flown(tmp_path, story)
    assert not list((tmp_path / "logs").glob("b_*"))


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_scripts_with_dots_in_their_names_begin_in_the_same_second(tmp_path: Path) -> None:
    async def story(scripts: Scripts) -> None:
        for name in ("survey.v2.py", "survey_v2.py", "survey_run.json.py"):
            await scripts.save(name, SLEEPS)
            await scripts.execute(name, [])
        assert [run.script for run in await scripts.running()] == [
            "survey.v2.py",
            "survey_v2.py",
            "survey_run.json.py",
        ]

    flown(tmp_path, story)


def test_without_tmux_execute_is_a_clear_error_and_all_else_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def story(scripts: Scripts) -> None:
        await scripts.start()
        await scripts.save("a.py", PRINTS)
        with pytest.raises(ToolFailed, match="tmux is not installed"):
            await scripts.execute("a", [])
        assert scripts.store.listed() == ["a.py"]
        assert await scripts.running() == []

    monkeypatch.setenv("PATH", str(tmp_path))
    flown(tmp_path, story)
    assert list((tmp_path / "logs").iterdir()) == []


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_deaths_are_acted_upon_and_other_ends_are_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    acted: list[tuple[int, str, list[str]]] = []

    async def after_death(_host: Any, sysid: int, run: Any, others: list[str]) -> str:
        acted.append((sysid, run.script, others))
        return "done"

    async def story(scripts: Scripts) -> None:
        for name, text in {"good.py": b"", "bad.py": b"1/0", "stopped.py": SLEEPS}.items():
            await scripts.save(name, text)
        for name in ("good.py", "bad.py"):
            await scripts.execute(name, [])
            await ended(scripts, name)
        await scripts.execute("stopped.py", [])
        await scripts.execute("bad.py", [])  # while another one may fly the vehicle
        await ended(scripts, "bad.py")
        await scripts.halt("stopped.py")
        await asyncio.sleep(0.1)

    monkeypatch.setattr(manager.on_exit, "after_death", after_death)
    flown(tmp_path, story, on_script_exit="rtl")
    assert acted == [(9, "bad.py", []), (9, "bad.py", ["stopped.py"])]


def test_scripts_run_by_the_python_that_we_run_by(tmp_path: Path) -> None:
    assert settings(tmp_path).python_path == sys.executable


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_client_that_hangs_up_and_asks_again_starts_no_second_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = tmux.start

    async def slow(*args: Any) -> None:
        await asyncio.sleep(1.0)
        await start(*args)

    monkeypatch.setattr(tmux, "start", slow)

    async def story(scripts: Scripts) -> None:
        await scripts.save("a.py", SLEEPS)
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(scripts.execute("a", []), 0.5)
        with pytest.raises(BadRequest):
            await scripts.execute("a", [])
        assert [run.script for run in await scripts.running()] == ["a.py"]

    flown(tmp_path, story)


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_script_whose_log_is_removed_lives_until_it_ends(tmp_path: Path) -> None:
    async def story(scripts: Scripts) -> None:
        await scripts.save("a.py", SLEEPS)
        run = await scripts.execute("a", [])
        await up(scripts, "a.py")
        run.out_log.unlink()
        await asyncio.sleep(1.0)
        assert [one.script for one in await scripts.running()] == ["a.py"]
        ended_run = await scripts.halt("a")
        assert not ended_run.running

    flown(tmp_path, story)


def test_what_scripts_of_other_vehicles_printed_is_not_of_this_flight(
    make_run: Callable[..., runs.Run], tmp_path: Path
) -> None:
    for script, sysid in (("a.sh", 1), ("b.sh", 2), ("c.sh", 0)):
        run = make_run(script=script, sysid=sysid)
        run.path.write_text(run.path.read_text()[:-1] + ', "ended_at": 100.0}')
        run.out_log.write_text(f"{script} is here\n")
    printed = {name.split("_")[0]: data for name, _, data in scripts_in(tmp_path).printed([1], 50.0)}
    assert printed == {"script-a": b"a.sh is here\n", "script-c": b"c.sh is here\n"}


def test_rehearsal_of_a_scripts_bytes_goes_with_what_it_printed(
    make_run: Callable[..., runs.Run], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    scripts = scripts_in(tmp_path)
    for name, text in (("a.sh", "fly"), ("b.sh", "fly on")):
        scripts.store.save(name, text.encode())
        run = make_run(script=name, sysid=1)
        run.path.write_text(run.path.read_text()[:-1] + ', "ended_at": 100.0}')
    rehearsals.keep(rehearsals.digest_of(b"fly"), "{}")
    assert scripts.printed([1], 50.0) == [("script-rehearsal-a.sh.json", "application/json", b"{}")]
