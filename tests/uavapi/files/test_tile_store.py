from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import NotFound, SettingError
from mavproxy_uavapi.files.tile_store import LARGEST, TileStore
from mavproxy_uavapi.settings import ApiModuleSettings

PNG, JPEG = b"\x89PNG\r\n\x1a\nnorth", b"\xff\xd8\xff\xe0south"


def folder_of(directory: Path) -> Path:
    for y, suffix, body in ((1, "png", PNG), (2, "jpg", JPEG), (3, "png", b"<svg/>")):
        file = directory / "2" / "3" / f"{y}.{suffix}"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(body)
    (directory / "4").mkdir()
    (directory / "notes").mkdir()
    return directory


def file_of(directory: Path) -> Path:
    file = directory / "field of ours.mbtiles"
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data)")
        # MBTiles counts rows from the south: of 4 rows, the second from the north is number 2.
        rows = [(2, 3, 2, PNG), (2, 3, 1, JPEG), (2, 3, 0, b"<svg/>"), (4, 0, 0, PNG)]
        database.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", rows)
    return file


both = pytest.mark.parametrize("make", [folder_of, file_of])


@both
def test_tiles_are_numbered_from_the_north_west(tmp_path: Path, make: Callable[[Path], Path]) -> None:
    store = TileStore(str(make(tmp_path)))
    assert store.zooms() == (2, 4)
    assert (store.read(2, 3, 1).body, store.read(2, 3, 1).kind) == (PNG, "image/png")
    assert (store.read(2, 3, 2).body, store.read(2, 3, 2).kind) == (JPEG, "image/jpeg")


@both
@pytest.mark.parametrize("place", [(2, 3, 3), (2, 3, 0), (2, 4, 1), (2, 3, 4), (99, 0, 0), (3, 0, 0)])
def test_what_is_no_picture_or_outside_is_missing(
    tmp_path: Path, make: Callable[[Path], Path], place: tuple[int, int, int]
) -> None:
    with pytest.raises(NotFound, match="has no tile"):
        TileStore(str(make(tmp_path))).read(*place)


def test_huge_file_is_no_tile(tmp_path: Path) -> None:
    folder_of(tmp_path)
    (tmp_path / "2" / "3" / "1.png").write_bytes(PNG + bytes(LARGEST))
    with pytest.raises(NotFound):
        TileStore(str(tmp_path)).read(2, 3, 1)


def test_broken_file_is_an_error_that_says_so(tmp_path: Path) -> None:
    file = tmp_path / "broken.mbtiles"
    file.write_bytes(b"no database at all" * 100)
    with pytest.raises(NotFound, match="not a database"):
        TileStore(str(file)).read(0, 0, 0)


def test_without_a_map_there_is_nothing() -> None:
    assert TileStore("").zooms() is None
    with pytest.raises(NotFound):
        TileStore("").read(0, 0, 0)


@pytest.mark.parametrize("name", ["missing.mbtiles", "empty"])
def test_setting_without_tiles_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(SettingError, match="tiles = "):
        ApiModuleSettings({"tiles": str(tmp_path / name)}, environ={})


def test_setting_with_tiles_is_taken(tmp_path: Path) -> None:
    file = file_of(tmp_path)
    assert ApiModuleSettings({"tiles": str(file)}, environ={}).snapshot().tiles == str(file)
