"""A log as it grows."""

from __future__ import annotations

from pathlib import Path

import pytest

from mavproxy_uavapi.scripts.follower import PIECE, Follower


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "log"


@pytest.fixture
def follower(log: Path) -> Follower:
    return Follower(log)


def test_follower_waits_for_whole_lines(log: Path, follower: Follower) -> None:
    assert follower.lines(at_end=False) == []
    log.write_bytes(b"a\nb")
    assert follower.lines(at_end=False) == ["a"]
    log.write_bytes(b"a\nbc\r\nd")
    assert follower.lines(at_end=False) == ["bc"]
    assert follower.lines(at_end=True) == ["d"]
    assert follower.lines(at_end=True) == []


def test_no_more_than_a_piece_is_read_at_once(log: Path, follower: Follower) -> None:
    log.write_bytes(b"\n" * (2 * PIECE + 10))
    counts = []
    while not counts or follower.behind:
        counts.append(len(follower.lines(at_end=True)))
    assert counts == [PIECE, PIECE, 10]


def test_line_without_end_comes_in_parts(log: Path, follower: Follower) -> None:
    log.write_bytes(b"x" * (5 * PIECE // 2))
    parts = follower.lines(at_end=False) + follower.lines(at_end=False) + follower.lines(at_end=False)
    assert [len(part) for part in parts] == [PIECE, PIECE]
    assert [len(part) for part in follower.lines(at_end=True)] == [PIECE // 2]


def test_log_that_is_cut_is_read_again(log: Path, follower: Follower) -> None:
    log.write_bytes(b"one\ntwo\nthr")
    assert follower.lines(at_end=False) == ["one", "two"]
    log.write_bytes(b"four\n")
    assert follower.lines(at_end=False) == ["thr", "four"]


def test_log_that_is_replaced_is_read_again(log: Path, follower: Follower) -> None:
    log.write_bytes(b"one\n")
    assert follower.lines(at_end=False) == ["one"]
    log.rename(log.with_name("log.1"))
    assert follower.lines(at_end=False) == []
    log.write_bytes(b"of the new file\n")
    assert follower.lines(at_end=False) == ["of the new file"]
