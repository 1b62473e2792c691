from __future__ import annotations

import errno
import fcntl
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mavproxy_uavapi.scripts import runs

MakeRun = Callable[..., runs.Run]


def test_logs_are_named_by_script_and_time(make_run: MakeRun) -> None:
    run = make_run(script="square.sh")
    assert run.out_log.name[:-8].rsplit("_", 2)[0] == "square"
    assert len(run.out_log.name) == len("square_YYYYmmdd_HHMMSS_out.log")
    assert run.err_log.name == run.out_log.name.replace("_out", "_err")
    assert run.session == "uavapi_1_" + run.out_log.name.removesuffix("_out.log")


def test_second_run_in_the_same_second_waits_for_the_next(make_run: MakeRun) -> None:
    assert make_run().path != make_run().path


def test_script_that_is_named_like_a_record_has_its_own_logs(make_run: MakeRun) -> None:
    run = make_run(script="a_run.json.sh")
    assert run.out_log.exists() and run.out_log.name == run.path.name.removesuffix("_run.json") + "_out.log"


def test_discarded_run_leaves_nothing(make_run: MakeRun) -> None:
    run = make_run()
    runs.discard(run.path)
    assert list(run.path.parent.iterdir()) == []


@pytest.mark.parametrize("where", [(Path, "write_text"), (runs.json, "dump")], ids=["record", "environment"])
def test_full_disk_leaves_neither_logs_nor_the_secret(
    make_run: MakeRun, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, where: tuple[object, str]
) -> None:
    def full(*args: object, **_: object) -> None:
        if args[0] != tmp_path / "a.sh":
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(*where, full)
    with pytest.raises(OSError, match="No space"):
        make_run()
    assert list((tmp_path / "logs").iterdir()) == []


def test_newest_run_comes_first_and_other_scripts_are_left_out(make_run: MakeRun) -> None:
    first = make_run(script="a.sh")
    make_run(script="a.py")
    second = make_run(script="a.sh")
    make_run(script="a_b.sh")
    (first.path.parent / "a_x_run.json").write_text("[]")
    (first.path.parent / "a_y_run.json").write_text("{")
    assert [run.path for run in runs.of_script(first.path.parent, "a.sh")] == [second.path, first.path]


def test_tail_is_the_end_of_a_log(tmp_path: Path) -> None:
    log = tmp_path / "log"
    assert runs.tail(log) == ""
    log.write_bytes(b"a" * 10 + b"\xff" + b"bcd")
    assert runs.tail(log, 4) == "\ufffdbcd"


@pytest.mark.parametrize(
    ("reported", "died"),
    [
        ({"exit_status": 0, "ended_at": 2.0}, False),
        ({"exit_status": 1, "ended_at": 2.0}, True),
        ({"exit_status": -11, "ended_at": 2.0}, True),
        ({"exit_status": -2, "ended_at": 2.0}, True),
        ({"exit_status": -2, "ended_at": 2.0, "stopping_at": 1.0}, False),
        ({"exit_status": 1, "ended_at": 2.0, "stopping_at": 1.0}, False),
        ({"exit_status": -9, "ended_at": 2.0, "stopping_at": 1.0, "killed": True}, True),
        ({}, True),
        ({"alive": True}, False),
    ],
)
def test_a_run_died_unless_it_ended_well_or_by_ctrl_c_on_our_asking(
    make_run: MakeRun, reported: dict[str, object], died: bool
) -> None:
    assert replace(make_run(), **reported).died is died  # type: ignore[arg-type]


def test_report_of_a_run_that_is_being_stopped_says_how_long_it_has(make_run: MakeRun) -> None:
    run = replace(make_run(grace=10.0), alive=True, started_at=100.0, stopping_at=105.0)
    reported = run.report(now=108.0)
    assert (reported["running"], reported["running_for_s"], reported["stopping"], reported["kill_in_s"]) == (
        True,
        8.0,
        True,
        7.0,
    )


def test_record_that_was_removed_leaves_what_was_known(make_run: MakeRun) -> None:
    run = make_run()
    run.path.unlink()
    assert runs.refreshed(run).script == "a.sh"


def test_record_of_something_else_is_a_value_error(tmp_path: Path) -> None:
    path = tmp_path / "x_run.json"
    path.write_text(json.dumps({"script": "a.py"}))
    with pytest.raises(ValueError, match="not the record"):
        runs.load(path)


def test_runs_since_a_time_are_those_that_had_not_ended_then(make_run: MakeRun) -> None:
    ended, running = make_run(script="a.sh"), make_run(script="b.sh")
    ended.path.write_text(json.dumps({**json.loads(ended.path.read_text()), "ended_at": 100.0}))
    (ended.path.parent / "torn_run.json").write_text("{")
    with running.out_log.open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # its runner lives
        assert [run.script for run in runs.since(ended.path.parent, 99.0)] == ["a.sh", "b.sh"]
        assert [run.script for run in runs.since(ended.path.parent, 101.0)] == ["b.sh"]
