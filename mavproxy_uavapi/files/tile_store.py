"""Tiles of a map that the user has: an MBTiles file, or a folder z/x/y.png. Blocking: for an executor."""

from __future__ import annotations

import re
import sqlite3
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from mavproxy_uavapi.core.errors import BadRequest, Forbidden, NotFound, SettingError
from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.core.values import is_unset

DEEPEST = 24  # zoom level
LARGEST = 4 * 1024 * 1024  # bytes of one tile
# What a file begins with, and its content type. An MBTiles file of vectors (gzip) is none of these.
KINDS = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp"}
SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")


LARGEST_KEPT, MOST_KEPT = 512 * 1024, 500 * 10**6  # bytes of one tile that is kept from a source, and of all
MBTILES = """
CREATE TABLE IF NOT EXISTS metadata (name TEXT PRIMARY KEY, value TEXT);
CREATE TABLE IF NOT EXISTS tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB,
  PRIMARY KEY (zoom_level, tile_column, tile_row));
"""
# An address with places for the numbers; it goes into the page's policy, which a space, a comma or ; would change.
SOURCE = re.compile(r"(https?://[A-Za-z0-9.-]+(?::\d{1,5})?)/[^\s;,'\"<>]*")


def is_tile(zoom: int, x: int, y: int) -> bool:
    """Whether the earth has such a tile."""
    return 0 <= zoom <= DEEPEST and 0 <= x < 2**zoom and 0 <= y < 2**zoom


def kind_of(body: bytes) -> str | None:
    """The content type of a picture; None if it is none that a map has."""
    return next((kind for start, kind in KINDS.items() if body.startswith(start)), None)


@dataclass(frozen=True)
class Tile:
    """A picture of a part of the map, and its content type."""

    body: bytes
    kind: str


class TileStore:
    """Reads tiles; x counts from the west, y from the north, as web maps number them.

    Args:
        place: the file or the folder; empty for none.
    """

    def __init__(self, place: str) -> None:
        self._place = None if is_unset(place) else Path(place).expanduser().absolute()

    @property
    def exists(self) -> bool:
        """Whether there is a place of tiles, and something at it."""
        return self._place is not None and self._place.exists()

    def keep(self, zoom: int, x: int, y: int, body: bytes, licence: str) -> None:
        """Keep a tile in the MBTiles file, which is made for the first one; `licence` is that of its source.

        Raises:
            BadRequest: it is no PNG, JPEG or WebP, or no tile of the earth.
            Forbidden: the file has MOST_KEPT bytes already, or cannot be written.
        """
        assert self._place is not None
        kind = kind_of(body)
        if kind is None or len(body) > LARGEST_KEPT or not is_tile(zoom, x, y):
            raise BadRequest(f"a tile is a PNG, JPEG or WebP of {LARGEST_KEPT // 1024} kB at most, at its place")
        try:
            self._place.parent.mkdir(parents=True, exist_ok=True)
            if self._place.exists() and self._place.stat().st_size > MOST_KEPT:
                raise Forbidden(f"the kept map has {MOST_KEPT // 10**6} MB already: remove {self._place}")
            with closing(sqlite3.connect(self._place)) as database, database:
                database.executescript(MBTILES)
                facts = {
                    "name": "kept",
                    "type": "baselayer",
                    "attribution": licence,
                    "format": kind.partition("/")[2],
                }
                database.executemany("INSERT OR REPLACE INTO metadata VALUES (?, ?)", facts.items())
                row = (zoom, x, 2**zoom - 1 - y, body)
                database.execute("INSERT OR REPLACE INTO tiles VALUES (?, ?, ?, ?)", row)
        except (OSError, sqlite3.Error) as error:
            raise Forbidden(f"the tile cannot be kept in {self._place}: {error}") from error

    def zooms(self) -> tuple[int, int] | None:
        """The least and the greatest zoom level; None without tiles.

        Raises:
            NotFound: the file or the folder cannot be read.
        """
        if self._place is None:
            return None
        try:
            levels = self._levels_of_file() if self._place.is_file() else self._levels_of_folder()
        except (OSError, sqlite3.Error) as error:
            raise NotFound(f"the map's tiles cannot be read: {error}") from error
        return (min(levels), max(levels)) if levels else None

    def read(self, zoom: int, x: int, y: int) -> Tile:
        """A tile.

        Raises:
            NotFound: there is none, or it is no PNG, JPEG or WebP.
        """
        missing = NotFound(f"the map has no tile {zoom}/{x}/{y}")
        if self._place is None or not is_tile(zoom, x, y):
            raise missing
        try:
            is_file = self._place.is_file()
            body = self._of_file(zoom, x, y) if is_file else self._of_folder(zoom, x, y)
        except (OSError, sqlite3.Error) as error:
            raise NotFound(f"the map's tile {zoom}/{x}/{y} cannot be read: {error}") from error
        kind = kind_of(body or b"")
        if body is None or kind is None or len(body) > LARGEST:
            raise missing
        return Tile(body, kind)

    # -- MBTiles ----------------------------------------------------------------------------------------------

    def _connect(self) -> sqlite3.Connection:
        assert self._place is not None
        return sqlite3.connect(f"{self._place.as_uri()}?mode=ro", uri=True)

    def _levels_of_file(self) -> list[int]:
        with closing(self._connect()) as database:
            rows = database.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles").fetchall()
        return [int(level) for row in rows for level in row if level is not None]

    def _of_file(self, zoom: int, x: int, y: int) -> bytes | None:
        query = "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?"
        with closing(self._connect()) as database:
            row = database.execute(query, (zoom, x, 2**zoom - 1 - y)).fetchone()  # MBTiles counts rows from the south
        return None if row is None else bytes(row[0])

    # -- a folder ---------------------------------------------------------------------------------------------

    def _levels_of_folder(self) -> list[int]:
        assert self._place is not None
        names = [entry.name for entry in self._place.iterdir() if entry.is_dir()]
        return [int(name) for name in names if name.isascii() and name.isdigit() and int(name) <= DEEPEST]

    def _of_folder(self, zoom: int, x: int, y: int) -> bytes | None:
        assert self._place is not None
        for suffix in SUFFIXES:
            file = self._place / str(zoom) / str(x) / f"{y}{suffix}"
            if file.is_file() and file.stat().st_size <= LARGEST:
                return file.read_bytes()
        return None


def check(place: str) -> None:
    """Refuse a place without tiles.

    Raises:
        SettingError: with the reason.
    """
    if is_unset(place):
        return
    try:
        levels = TileStore(place).zooms()
    except NotFound as error:
        raise SettingError(f"tiles = {place}: {error}", "tiles") from error
    if levels is None:
        raise SettingError(f"tiles = {place}: it has no tiles; name an MBTiles file or a folder z/x/y.png", "tiles")


def kept() -> TileStore:
    """What was kept of a source: a file of its own."""
    return TileStore(str(state_directory() / "kept.mbtiles"))


def origin_of(source: str) -> str:
    """The origin of a source of tiles, as the page's policy names it; empty for none.

    Raises:
        SettingError: it is no address of tiles.
    """
    if is_unset(source):
        return ""
    match = SOURCE.fullmatch(source)
    if match is None or not all(name in source for name in ("{z}", "{x}", "{y}")):
        raise SettingError(
            f"tile_source = {source}: not like https://tiles.example.org/{{z}}/{{x}}/{{y}}.png", "tile_source"
        )
    return match[1]
