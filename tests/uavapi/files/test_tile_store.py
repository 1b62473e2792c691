from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import BadRequest, Forbidden, NotFound, SettingError
from mavproxy_uavapi.files import tile_store
from mavproxy_uavapi.files.tile_store import LARGEST, LARGEST_KEPT, TileStore, origin_of
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


def test_what_is_kept_is_an_mbtiles_file_with_the_sources_licence(tmp_path: Path) -> None:
    file = tmp_path / "made" / "kept.mbtiles"
    store = TileStore(str(file))
    assert not store.exists
    for zoom, y, body in ((2, 1, PNG), (3, 0, JPEG), (2, 1, JPEG)):
        store.keep(zoom, 3, y, body, "(c) who drew it")
    assert (store.zooms(), store.read(2, 3, 1).body, store.read(3, 3, 0).kind) == ((2, 3), JPEG, "image/jpeg")
    with closing(sqlite3.connect(file)) as database:
        facts = dict(database.execute("SELECT name, value FROM metadata").fetchall())
        assert (facts["attribution"], facts["format"], facts["type"]) == ("(c) who drew it", "jpeg", "baselayer")
        assert database.execute("SELECT tile_row FROM tiles WHERE zoom_level = 2").fetchall() == [(2,)]


@pytest.mark.parametrize(
    ("place", "body"),
    [
        ((2, 4, 0), PNG),
        ((25, 0, 0), PNG),
        ((2, 3, 1), b"<svg/>"),
        ((2, 3, 1), PNG + bytes(LARGEST_KEPT)),
        ((0, 0, 0), b""),
    ],
)
def test_what_is_no_tile_is_not_kept(tmp_path: Path, place: tuple[int, int, int], body: bytes) -> None:
    store = TileStore(str(tmp_path / "kept.mbtiles"))
    with pytest.raises(BadRequest):
        store.keep(*place, body, "")
    assert not store.exists


def test_a_kept_map_has_an_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = TileStore(str(tmp_path / "kept.mbtiles"))
    store.keep(0, 0, 0, PNG, "")
    monkeypatch.setattr(tile_store, "MOST_KEPT", 1000)
    with pytest.raises(Forbidden, match=r"remove .*kept\.mbtiles"):
        store.keep(1, 0, 0, PNG, "")


def test_source_is_an_address_of_tiles_and_changes_no_policy_of_the_page() -> None:
    assert origin_of("https://tiles.example.org:8443/a/{z}/{x}/{y}.png?key=1") == "https://tiles.example.org:8443"
    assert origin_of("") == ""
    for text in (
        "https://a.org/{z}/{x}.png",
        "https://a.org/{z}/{x}/{y} 'unsafe-inline'",
        "ftp://a.org/{z}/{x}/{y}",
        "https://a.org/{z}/{x}/{y};script-src *",
        "https://*/{z}/{x}/{y}",
        "https://u:p@a.org/{z}/{x}/{y}",
    ):
        with pytest.raises(SettingError):
            ApiModuleSettings({"tile_source": text}, environ={})
