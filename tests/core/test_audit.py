"""The audit trail's file and its memory."""

from __future__ import annotations

import asyncio
import json
import threading
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core import audit as audits
from mavproxy_uavapi.core.audit import (
    FILE,
    KEPT,
    MOST_ADDRESSES,
    OTHERS,
    WAITING,
    Audit,
    Entry,
    Refusals,
    utc_at,
    utc_now,
)
from mavproxy_uavapi.core.errors import NotFound
from tests.support.virtual_time import FastLoop


def entry(verb: str = "/command/arm", **changes: Any) -> Entry:
    members: dict[str, Any] = {"client": "127.0.0.1", "request": {}, "detail": "Armed vehicle", **changes}
    return Entry(time=utc_now(), verb=verb, system=1, outcome="ok", seconds=1.0, sent=(), **members)


@pytest.fixture
def audit(tmp_path: Path) -> Iterator[Audit]:
    made = Audit(tmp_path)
    yield made
    made.close()


def lines(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / FILE).read_text(encoding="ascii").splitlines()]


def test_audit_file_rotates_and_keeps_five_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audits, "FILE_BYTES", 2000)
    audit = Audit(tmp_path)
    for number in range(100):
        audit.add(entry(f"/command/{number}"))
    audit.close()
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == [FILE, *(f"{FILE}.{number}" for number in range(1, 5))]
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 5 * 2000 + 1
    assert lines(tmp_path)[-1]["verb"] == "/command/99"


def test_audit_file_is_its_owners_alone(audit: Audit, tmp_path: Path) -> None:
    audit.add(entry())
    audit.close()
    assert (tmp_path / FILE).stat().st_mode & 0o777 == 0o600


def test_file_holds_lines_of_ascii_whatever_a_client_sends(audit: Audit, tmp_path: Path) -> None:
    mode = '\x1b[2J\n{"forged": 1}\u2028\ud800'
    audit.add(entry(request={"mode": mode}, client="::1\n", detail="x" * 100_000))
    audit.close()
    (line,) = lines(tmp_path)
    assert line["request"]["mode"] == mode
    assert (tmp_path / FILE).stat().st_size < 1000


def test_memory_is_bounded(audit: Audit) -> None:
    for number in range(2 * KEPT):
        audit.add(entry(str(number)))
    assert len(audit.entries) == KEPT
    assert audit.entries[-1].verb == str(2 * KEPT - 1)


def test_stalled_disk_holds_nobody_up_and_what_it_lost_is_reported(
    audit: Audit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    goes_on = threading.Event()
    lines_file = audit._lines
    assert lines_file is not None
    emit = lines_file.emit

    def stalled(record: Any) -> None:
        goes_on.wait()
        emit(record)

    monkeypatch.setattr(lines_file, "emit", stalled)
    for number in range(WAITING + 20):
        audit.add(entry(str(number)))
    goes_on.set()
    audit._writer.submit(lambda: None).result()
    audit.add(entry("last"))
    audit.close()
    written = lines(tmp_path)
    assert [line.get("verb") for line in written[-2:]] == [None, "last"]
    assert written[-2]["lost"] == 20
    assert len(written) == WAITING + 2


def test_audit_in_no_folder_keeps_its_memory_and_says_so_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    audit = Audit(tmp_path / "not" / "there")
    for number in range(3):
        audit.add(entry(str(number)))
    audit.close()
    assert len(audit.entries) == 3
    assert sum("cannot write" in record.getMessage() for record in caplog.records) == 1


def test_refusals_are_reported_at_the_end_too(loop: FastLoop, tmp_path: Path) -> None:
    audit = Audit(tmp_path)

    async def refuse() -> None:
        audit.refused("10.0.0.9", "unauthorized")
        audit.refused("10.0.0.9", "unauthorized")

    loop.run(refuse())
    audit.close()
    assert [line["request"] for line in lines(tmp_path)] == [{"unauthorized": 2}]


def test_addresses_beyond_the_most_are_counted_together() -> None:
    refusals = Refusals()
    for number in range(10_000):
        refusals.add(f"2001:db8::{number:x}", "unauthorized")
    counts = refusals.take()
    assert len(counts) == MOST_ADDRESSES + 1
    assert counts[OTHERS] == {"unauthorized": 10_000 - MOST_ADDRESSES}
    assert refusals.take() == {}


# -- the trail is read again ------------------------------------------------------------------------------


def pages(audit: Audit, limit: int = 7, **limits: Any) -> list[str]:
    """The verbs of all pages, the newest first."""

    async def read() -> list[str]:
        verbs, before = [], ""
        while True:
            entries = await audit.page(lambda _: True, limit, before=before, **limits)
            verbs += [entry.verb for entry in entries]
            if len(entries) < limit:
                return verbs
            before = entries[-1].id

    return asyncio.run(read())


def numbers(audit: Audit, limit: int = 7, **limits: Any) -> list[int]:
    return [int(verb) for verb in pages(audit, limit, **limits)]


def test_pages_go_on_in_the_files_without_a_gap_and_without_a_double(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audits, "KEPT", 10)
    monkeypatch.setattr(audits, "FILE_BYTES", 8000)
    earlier = Audit(tmp_path)
    for number in range(30):
        earlier.add(entry(str(number)))
    earlier.close()
    audit = Audit(tmp_path)
    audit.newest = deque(maxlen=10)
    for number in range(30, 60):
        audit.add(entry(str(number)))
    audit._writer.submit(lambda: None).result()
    assert (tmp_path / f"{FILE}.1").exists()
    assert numbers(audit) == list(range(59, -1, -1))
    audit.close()


def test_time_limits_count_in_memory_and_in_the_files(tmp_path: Path) -> None:
    earlier = Audit(tmp_path)
    for number in range(10):
        earlier.add(replace(entry(str(number)), time=utc_at(1000 + number)))
    earlier.close()
    audit = Audit(tmp_path)
    for number in range(10, 20):
        audit.add(replace(entry(str(number)), time=utc_at(1000 + number)))
    assert numbers(audit, since=utc_at(1005), until=utc_at(1015), limit=3) == list(range(14, 4, -1))
    audit.close()


def test_hint_leaves_out_the_unwanted_but_not_where_a_page_goes_on(tmp_path: Path) -> None:
    earlier = Audit(tmp_path)
    for number in range(10):
        earlier.add(entry(str(number), kind="mode" if number % 2 else "text"))
    earlier.close()
    audit = Audit(tmp_path)
    assert numbers(audit, limit=2, hint=lambda line: '"kind": "mode"' in line) == [9, 7, 5, 3, 1]
    audit.close()


def test_lines_of_others_and_torn_ones_are_passed_over(tmp_path: Path) -> None:
    stamp = utc_now()
    older = {"time": stamp, "client": "a", "verb": "1", "request": {}, "system": 1, "outcome": "ok", "detail": ""}
    lines_of_others = [json.dumps(older), json.dumps({"time": stamp, "lost": 3}), "[]", '{"time": "', ""]
    (tmp_path / FILE).write_text("\n".join(lines_of_others))
    audit = Audit(tmp_path)
    assert pages(audit) == ["1"]
    audit.close()


def test_trail_without_a_file_has_what_is_in_memory() -> None:
    audit = Audit(None)
    for number in range(10):
        audit.add(entry(str(number)))
    assert numbers(audit) == list(range(9, -1, -1))
    with pytest.raises(NotFound):
        asyncio.run(audit.page(lambda _: True, 1, before="1-1"))
    audit.close()


@pytest.mark.parametrize(
    ("members", "says"),
    [
        (
            {"verb": "/command/takeoff", "request": {"alt": 10.0, "vtol": None}},
            "takeoff (alt 10) of anna is done after 12 s",
        ),
        ({"system": 2, "script": "a"}, "vehicle 2: arm of anna, script a is done after 12 s"),
        ({"verb": "/jobs/7", "seconds": 0.0}, "jobs/7 of anna is done at once"),
        ({"outcome": "mode_changed", "detail": "no"}, "arm of anna fails after 12 s: no"),
        (
            {"verb": "/command/arm", "outcome": "aborted", "detail": "no", "seconds": 3.14},
            "arm of anna ends after 3.1 s: no",
        ),
        ({"verb": "hold after /x", "outcome": "ok"}, "hold after /x of anna is done after 12 s"),
        (
            {"verb": "refused", "detail": "3 requests were refused", "request": {"forbidden": 3}},
            "3 requests were refused, of anna (forbidden 3)",
        ),
        ({"kind": "mode", "detail": "it changes"}, "it changes"),
    ],
)
def test_entry_is_a_sentence(members: dict[str, Any], says: str) -> None:
    whole = {"client": "anna", "verb": "/command/arm", "outcome": "ok", "seconds": 12.3, **members}
    assert Entry(utc_now(), **whole).sentence == says
