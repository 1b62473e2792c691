from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import ToolFailed
from mavproxy_uavapi.scripts import runner, runs, tmux
from tests.support.processes import eventually


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_session_remembers_its_record_and_ends_with_the_script(make_run: Callable[..., runs.Run]) -> None:
    run = make_run("trap 'exit 0' INT; echo shown; sleep 30 & wait")
    asyncio.run(tmux.start(run.session, [sys.executable, "-I", runner.__file__, str(run.path)], run.path))
    assert asyncio.run(tmux.sessions("uavapi_1_")) == {run.session: run.path}
    assert asyncio.run(tmux.sessions("uavapi_2_")) == {}
    pane = ["tmux", "capture-pane", "-p", "-t", f"={run.session}:"]
    eventually(lambda: b"shown" in subprocess.run(pane, capture_output=True, check=False).stdout)
    subprocess.run(["tmux", "send-keys", "-t", f"={run.session}:", "C-c"], check=True)  # as a person would
    eventually(lambda: runs.load(run.path).ended_at)
    eventually(lambda: asyncio.run(tmux.sessions("uavapi_")) == {})
    assert runs.load(run.path).exit_status == 0


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_end_of_the_session_stops_the_script(make_run: Callable[..., runs.Run]) -> None:
    run = make_run("trap 'echo landing; exit 0' INT; echo up; while true; do sleep 0.1; done")
    asyncio.run(tmux.start(run.session, [sys.executable, "-I", runner.__file__, str(run.path)], run.path))
    eventually(lambda: runs.tail(run.out_log))
    asyncio.run(tmux.kill(run.session, Path("/another")))
    assert asyncio.run(tmux.sessions("uavapi_")) == {run.session: run.path}
    asyncio.run(tmux.kill(run.session, run.path))
    eventually(lambda: runs.load(run.path).ended_at)
    assert run.out_log.read_text() == "up\nlanding\n"


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_session_that_exists_is_a_failure_and_not_a_running_script() -> None:
    asyncio.run(tmux.start("uavapi_1_x", ["sleep", "30"], Path("/x")))
    with pytest.raises(ToolFailed, match="duplicate session"):
        asyncio.run(tmux.start("uavapi_1_x", ["sleep", "30"], Path("/x")))


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_no_server_is_no_session() -> None:
    assert asyncio.run(tmux.sessions("uavapi_")) == {}


@pytest.mark.needs("tmux")
@pytest.mark.usefixtures("own_tmux")
def test_run_that_is_over_at_once_is_no_failure() -> None:
    asyncio.run(tmux.start("uavapi_1_x", ["true", "x"], Path("/x")))


def test_machine_without_tmux_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolFailed, match="tmux is not installed"):
        asyncio.run(tmux.sessions("uavapi_"))
