"""The runner as a process, without tmux: what it logs, records, and does when it is told to stop."""

from __future__ import annotations

import json
import os
import re
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from mavproxy_uavapi.scripts import clients, runner, runs
from tests.support.processes import eventually

MakeRun = Callable[..., runs.Run]
LANDS = "trap 'echo landing; exit 0' INT\necho up\nwhile true; do sleep 0.1; done"
STUBBORN = "trap '' INT\necho up\nwhile true; do sleep 0.1; done"

Started = Callable[[runs.Run], subprocess.Popen[bytes]]


@pytest.fixture
def started() -> Iterator[Started]:
    processes: list[subprocess.Popen[bytes]] = []

    def start(run: runs.Run) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-I", runner.__file__, str(run.path)]
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL))
        return processes[-1]

    yield start
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


def test_output_goes_to_both_logs_and_to_the_terminal(make_run: MakeRun, started: Started) -> None:
    run = make_run('echo "out $1 $GIVEN"; echo err >&2; exit 3', args=["a b; c"])
    shown, _ = started(run).communicate(timeout=20)
    run = runs.load(run.path)
    assert run.out_log.read_text() == "out a b; c yes\n"
    assert run.err_log.read_text() == "err\n"
    assert b"out a b; c yes" in shown and b"err" in shown and b"ended with status 3" in shown
    assert (run.exit_status, run.running, run.died, run.killed) == (3, False, True, False)
    assert run.ended_at is not None and run.ended_at >= run.started_at


def test_environment_file_is_for_us_alone_and_gone_at_once(make_run: MakeRun, started: Started) -> None:
    run = make_run(LANDS)
    environment = run.path.with_name(run.path.name.replace("_run", "_env"))
    assert environment.stat().st_mode & 0o777 == 0o600
    process = started(run)
    eventually(lambda: runs.tail(run.out_log))  # the script runs
    assert not environment.exists()
    process.terminate()  # the runner ends its script; killed it could not
    process.communicate(timeout=20)


def test_stop_is_ctrl_c_first_so_that_the_script_can_land(make_run: MakeRun, started: Started) -> None:
    run = make_run(LANDS)
    process = started(run)
    eventually(lambda: runs.tail(run.out_log))
    assert runs.load(run.path).running
    process.terminate()
    process.communicate(timeout=20)
    run = runs.load(run.path)
    assert run.out_log.read_text() == "up\nlanding\n"
    assert (run.exit_status, run.killed, run.died) == (0, False, False)
    assert run.stopping_at is not None


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_script_that_does_not_stop_is_killed_after_the_grace_period(
    make_run: MakeRun, started: Started, number: int
) -> None:
    run = make_run(STUBBORN, grace=0.3)
    process = started(run)
    eventually(lambda: runs.tail(run.out_log))
    process.send_signal(number)
    stopping = eventually(lambda: runs.load(run.path).stopping_at)
    process.communicate(timeout=20)
    run = runs.load(run.path)
    assert (run.exit_status, run.killed, run.died) == (-signal.SIGKILL, True, True)
    assert run.ended_at is not None and run.ended_at - stopping >= 0.3


def test_suspended_script_hears_the_stop(make_run: MakeRun, started: Started) -> None:
    run = make_run(LANDS + "\n# kill -STOP")
    process = started(run)
    eventually(lambda: runs.tail(run.out_log))
    child = psutil.Process(process.pid).children()[0].pid
    os.killpg(child, signal.SIGSTOP)
    process.terminate()
    process.communicate(timeout=20)
    assert runs.load(run.path).out_log.read_text().endswith("landing\n")


def test_program_that_is_not_there_is_recorded_in_words(make_run: MakeRun, started: Started) -> None:
    run = make_run(command=["/no/such/python", "a.py"])
    started(run).communicate(timeout=20)
    run = runs.load(run.path)
    assert run.exit_status == 127
    assert run.error is not None and "/no/such/python" in run.error
    assert "/no/such/python" in run.err_log.read_text()


def test_background_child_that_keeps_the_output_does_not_keep_the_run(make_run: MakeRun, started: Started) -> None:
    run = make_run("sleep 30 &\necho done")
    started(run).communicate(timeout=10)
    assert runs.load(run.path).exit_status == 0


# A child that has left the session, and tells its process.
LEFT = "setsid -f bash -c '{}'\n"
FLIES = (
    'trap "echo child landing; sleep 0.5; echo child down; exit" INT; echo child $$; while true; do sleep 0.1; done'
)
FLIES_ON = 'trap "" INT TERM; echo child $$; while true; do sleep 0.1; done'


def child_of(run: runs.Run) -> int:
    """The process that a child has told."""
    words = eventually(lambda: re.search(r"child (\d+)\n", runs.tail(run.out_log)))
    return int(words[1])


def lives(pid: int) -> bool:
    return Path(f"/proc/{pid}/cmdline").exists() and Path(f"/proc/{pid}/cmdline").read_bytes() != b""


def test_child_that_has_left_the_session_lands_with_its_script(make_run: MakeRun, started: Started) -> None:
    """It gets one Ctrl-C: a second one would end its landing."""
    run = make_run(LEFT.format(FLIES) + LANDS)
    process = started(run)
    child = child_of(run)
    eventually(lambda: "up" in runs.tail(run.out_log))
    assert child in [one["pid"] for one in clients.processes(runs.load(run.path))]
    process.terminate()
    process.communicate(timeout=20)
    run = runs.load(run.path)
    log = run.out_log.read_text()
    assert [log.count(line) for line in ("\nlanding\n", "child landing\n", "child down\n")] == [1, 1, 1]
    assert (run.exit_status, run.killed, run.died, lives(child)) == (0, False, False, False)


def test_last_words_of_a_child_that_ends_meanwhile_are_in_the_log(
    make_run: MakeRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = make_run("")
    process = runner.ScriptProcess(run.path)
    writer: list[int] = []

    def family_ends(_: object) -> list[int]:
        if writer:
            os.write(writer[0], b"child down\n")
            os.close(writer.pop())
        return []

    monkeypatch.setattr(runner, "_family", family_ends)
    process._child = subprocess.Popen("true")
    process._child.wait()
    process._kill_at = time.monotonic() + runner.UNKILLABLE
    with selectors.DefaultSelector() as selector:
        reader, end = os.pipe()
        writer.append(end)
        selector.register(reader, selectors.EVENT_READ, process._out)
        process._end_family(selector)
    for file in (process._out.file, process._err.file):
        file.close()
    assert run.out_log.read_text() == "child down\n"


def test_child_that_has_left_the_session_is_killed_after_the_grace_period(
    make_run: MakeRun, started: Started
) -> None:
    run = make_run(LEFT.format(FLIES_ON) + LANDS, grace=0.5)
    process = started(run)
    child = child_of(run)
    eventually(lambda: "up" in runs.tail(run.out_log))
    process.terminate()
    stopping = eventually(lambda: runs.load(run.path).stopping_at)
    process.communicate(timeout=20)
    run = runs.load(run.path)
    assert (run.exit_status, run.killed, lives(child)) == (0, True, False)
    assert run.ended_at is not None and run.ended_at - stopping >= 0.5


@pytest.mark.parametrize("text", [FLIES, FLIES_ON], ids=["it lands", "it is killed"])
def test_script_that_ends_by_itself_leaves_no_child_behind(make_run: MakeRun, started: Started, text: str) -> None:
    run = make_run(LEFT.format(text) + "sleep 0.5; exit 3", grace=0.5 if text is FLIES_ON else 15.0)
    started(run).communicate(timeout=20)
    run = runs.load(run.path)
    child = child_of(run)
    assert (run.exit_status, run.killed, lives(child)) == (3, text is FLIES_ON, False)
    assert clients.processes(run) == []


def test_daemons_that_end_while_the_script_runs_leave_no_zombies(make_run: MakeRun, started: Started) -> None:
    run = make_run("for i in 1 2 3; do setsid -f true; done\n" + LANDS)
    process = started(run)
    eventually(lambda: "up" in runs.tail(run.out_log))
    runner_process = psutil.Process(process.pid)
    eventually(lambda: all(one.status() != psutil.STATUS_ZOMBIE for one in runner_process.children(recursive=True)))
    process.terminate()
    process.communicate(timeout=20)


def test_script_that_closes_its_outputs_goes_on(make_run: MakeRun, started: Started) -> None:
    run = make_run("echo up; exec >&- 2>&-; sleep 0.5; exit 4")
    process = started(run)
    process.communicate(timeout=20)
    assert runs.load(run.path).exit_status == 4


def test_runner_that_was_killed_leaves_a_run_that_nobody_takes_for_running(
    make_run: MakeRun, started: Started
) -> None:
    run = make_run(LANDS)
    process = started(run)
    eventually(lambda: runs.load(run.path).pid)
    child = psutil.Process(process.pid).children()[0].pid
    process.kill()
    process.wait(10)
    os.killpg(child, signal.SIGKILL)
    run = runs.load(run.path)
    assert (run.running, run.exit_status, run.died) == (False, None, True)


def test_full_log_ends_with_a_note_and_the_script_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "LOG_LIMIT", 10)
    log = runner.RunLog(str(tmp_path / "log"), runner.Terminal())
    for _ in range(5):
        log.write(b"123456")
    log.file.close()
    assert (tmp_path / "log").read_bytes() == b"123456123456\n[the log is full]\n"


def test_full_disk_does_not_end_the_script(tmp_path: Path) -> None:
    log = runner.RunLog("/dev/full", runner.Terminal())
    log.write(b"x")
    log.write(b"x")
    log.file.close()


def test_record_is_json_for_anybody(make_run: MakeRun, started: Started) -> None:
    run = make_run("exit 0")
    started(run).communicate(timeout=20)
    assert json.loads(run.path.read_text())["exit_status"] == 0
