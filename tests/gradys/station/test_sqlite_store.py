"""What only a store in a file has: it is found again, and a file that is no database is reported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.station.sqlite_store import SqliteStore
from tests.support.station_rows import row


def test_an_sqlite_file_is_found_again(tmp_path: Path, run: Any, clock: Any) -> None:
    store = SqliteStore(tmp_path / "s.db", clock)
    run(store.add([row(1, value=1), row(3, value=3), row(2, value=2)]))
    run(store.close())
    again = SqliteStore(tmp_path / "s.db", clock)
    assert [newest.value for newest in run(again.fleet()).newest] == ["3"]
    assert run(again.add([row(1)])) == 0
    assert run(again.counts()) == (3, 1)
    run(again.close())


def test_a_file_that_is_none_is_reported(tmp_path: Path) -> None:
    (tmp_path / "s.db").write_bytes(b"no database, but longer than a hundred bytes" * 9)
    with pytest.raises(NotStored):
        SqliteStore(tmp_path / "s.db")
