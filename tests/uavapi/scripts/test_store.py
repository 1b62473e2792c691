from __future__ import annotations

import os
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import BadRequest, NotFound
from mavproxy_uavapi.scripts.store import ScriptStore


@pytest.fixture
def store(tmp_path: Path) -> ScriptStore:
    return ScriptStore(tmp_path / "scripts", size_limit=2048, quota=4096)


def test_saved_script_is_there_whole_and_can_be_run(store: ScriptStore) -> None:
    path = store.save("a.sh", b"echo hi\n")
    assert path == store.folder / "a.sh"
    assert path.read_bytes() == b"echo hi\n"
    assert os.access(path, os.X_OK)


def test_a_second_upload_takes_the_place_of_the_first(store: ScriptStore) -> None:
    store.save("a.py", b"1")
    store.save("a.py", b"2")
    assert (store.folder / "a.py").read_bytes() == b"2"


def test_a_symbolic_link_is_replaced_and_not_followed(store: ScriptStore, tmp_path: Path) -> None:
    target = tmp_path / "precious"
    target.write_text("keep")
    store.folder.mkdir()
    (store.folder / "a.py").symlink_to(target)
    store.save("a.py", b"new")
    assert target.read_text() == "keep"


def test_too_large_a_script_is_refused_and_nothing_is_left(store: ScriptStore) -> None:
    with pytest.raises(BadRequest, match="larger than 2 kB"):
        store.save("a.py", b"x" * 2049)
    assert not store.folder.exists() or list(store.folder.iterdir()) == []


def test_quota_counts_all_scripts_but_the_one_that_is_replaced(store: ScriptStore) -> None:
    store.save("a.py", b"x" * 2048)
    store.save("b.py", b"x" * 2048)
    store.save("b.py", b"y" * 2048)
    with pytest.raises(BadRequest, match="no room"):
        store.save("c.py", b"x")
    assert store.listed() == ["a.py", "b.py"]


def test_failure_half_way_leaves_the_old_script_and_no_temporary_file(
    store: ScriptStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.save("a.py", b"old")

    def full(_fd: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        store.save("a.py", b"new")
    assert [(file.name, file.read_bytes()) for file in store.folder.iterdir()] == [("a.py", b"old")]


def test_only_scripts_are_listed_found_and_cleared(store: ScriptStore) -> None:
    assert store.listed() == store.clear() == []
    store.save("b.py", b"")
    store.save("a.sh", b"")
    (store.folder / "notes.txt").write_text("keep")
    (store.folder / "dir.py").mkdir()
    assert store.listed((".py",)) == ["b.py"]
    assert store.find("b").name == "b.py"
    with pytest.raises(NotFound):
        store.find("dir")
    with pytest.raises(NotFound):
        store.find("c")
    assert store.clear() == ["a.sh", "b.py"]
    assert sorted(file.name for file in store.folder.iterdir()) == ["dir.py", "notes.txt"]
