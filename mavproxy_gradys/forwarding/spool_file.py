"""The spool's file: creates, checks, protects and migrates it; sets a corrupt one aside.

The setting `spool` may name any file by mistake. So only a file that SQLite reads as a database and that has our
application id is ever changed or renamed. Only SQLite opens a file that it can read: closing another descriptor of it
would release the locks that keep a second MAVProxy out (POSIX).
"""

from __future__ import annotations

import contextlib
import glob
import logging
import os
import random
import re
import sqlite3
import stat
from pathlib import Path

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.forwarding.spool_versions import VERSION, make, migrate
from mavproxy_gradys.forwarding.transaction import Transaction

APPLICATION = 0x67726164  # "grad": PRAGMA application_id of our files
FOLDER = "mavproxy-uavapi"  # the name of the default spool's folder
BESIDE = ("-journal", "-wal", "-shm")  # endings of SQLite's files beside the database
CLOCK_IS_SET = 1.7e9  # s since 1970; a clock before that (2023) was never set
SPARED = 1_000_000  # gap between the last readable number of a corrupt file and the first of the next file
LARGEST = 2**53  # a receiver that reads numbers as JavaScript does cannot tell larger ones apart
SMALLEST = 512  # bytes of a database; SQLite treats a smaller file as empty
WAL_KEPT = 1024 * 1024  # bytes
ROW_DAMAGE = re.compile(r"\S+ value in ")  # the check's text for a damaged cell; `spool_rows.py` checks those itself
log = logging.getLogger("gradys.spool")


def opened(path: Path, wall: float) -> tuple[sqlite3.Connection, Path | None]:
    """Open the file, locked and migrated to this version; returns it, and the corrupt file that it replaced.

    Args:
        path: not a symbolic link, because the file itself may be renamed.
        wall: s since 1970.

    Raises:
        NotStored: it is not a spool, of a newer version, or read-only.
        sqlite3.OperationalError, OSError: no space, no permission, or another program uses it.
    """
    if path.exists() and (not path.is_file() or 0 < path.stat().st_size < SMALLEST):
        raise NotStored(f"{path} is not a spool; `gradys set spool FILE` chooses another file")
    make_place(path)
    if not os.access(path, os.W_OK):
        raise NotStored(f"{path} is read-only; `gradys set spool FILE` chooses another file")
    first = first_number(wall) or random.getrandbits(40)
    try:
        return _opened(path, first), None
    except sqlite3.DatabaseError as error:
        if isinstance(error, sqlite3.OperationalError):
            raise  # no space, no permission, locked: the file itself may be good
        first = max(first, newest_number(path) + SPARED)
        aside = move_aside(path)
        return _opened(path, first), aside


def first_number(wall: float) -> int:
    """The lowest number to begin with at `wall` (s since 1970); 0 if the clock was never set."""
    return int(wall * 1000) if wall > CLOCK_IS_SET else 0


def _opened(path: Path, first: int) -> sqlite3.Connection:
    """As `opened`.

    Raises:
        sqlite3.DatabaseError: it is a corrupt spool.
    """
    db = sqlite3.connect(path, timeout=0, isolation_level=None, check_same_thread=False)
    db.text_factory = lambda cell: cell.decode(errors="surrogateescape")  # an invalid byte must not fail the read
    try:
        db.execute("PRAGMA locking_mode=EXCLUSIVE")  # first, as shared locks need a file, and a disk may be full
        ours = is_ours(db, path)
        db.execute("PRAGMA synchronous=FULL")
        if not ours:
            with Transaction(db):  # before there is a WAL, so that the file itself has the application id
                make(db, first)
                db.execute(f"PRAGMA application_id={APPLICATION}")
        db.execute("PRAGMA journal_mode=WAL")
        db.execute(f"PRAGMA journal_size_limit={WAL_KEPT}")
        check(db)
        migrate(db)
        tighten(path)
    except BaseException:
        db.close()
        raise
    return db


def is_ours(db: sqlite3.Connection, path: Path) -> bool:
    """Whether it is a spool that we can use; False for an empty database, which becomes one.

    Raises:
        NotStored: it is not a spool, or of a newer version.
        sqlite3.OperationalError: it cannot be read now.
    """
    try:
        (application,) = db.execute("PRAGMA application_id").fetchone()
        (version,) = db.execute("PRAGMA user_version").fetchone()
        (tables,) = db.execute("SELECT count(*) FROM sqlite_master").fetchone() if application == 0 else (0,)
    except sqlite3.OperationalError:
        raise
    except sqlite3.DatabaseError as error:
        if begins_as_ours(path):
            raise  # it was cut short, for example
        raise NotStored(f"{path} is not a spool: {error}; `gradys set spool FILE` chooses another file") from error
    if application != APPLICATION:
        if application or tables:
            raise NotStored(f"{path} is another program's database; `gradys set spool FILE` chooses another file")
        return False
    if not 1 <= version <= VERSION:
        raise NotStored(
            f"{path} is a spool of version {version}, which a newer gradys wrote: this one knows 1 to {VERSION};"
            " `gradys set spool FILE` chooses another file"
        )
    return True


def begins_as_ours(path: Path) -> bool:
    """Whether the header is that of a spool of a version that we know, of a file that SQLite cannot read."""
    with path.open("rb") as file:  # https://www.sqlite.org/fileformat.html#the_database_header
        header = file.read(72)
    version, application = (int.from_bytes(header[first : first + 4], "big") for first in (60, 68))
    return header.startswith(b"SQLite format 3\0") and application == APPLICATION and 1 <= version <= VERSION


def check(db: sqlite3.Connection) -> None:
    """Check the file's structure; damage within single cells is allowed, because it affects single rows only.

    Raises:
        sqlite3.DatabaseError: it is corrupt.
    """
    for (problem,) in db.execute("PRAGMA quick_check(1000)"):
        if problem != "ok" and not ROW_DAMAGE.match(problem):
            raise sqlite3.DatabaseError(problem)
    if any(number >= LARGEST for number in newest_numbers(db)):
        raise sqlite3.DatabaseError("it has no more numbers to give")


def newest_number(path: Path) -> int:
    """The highest possible number that can be read from a corrupt file; 0 if none can."""
    with contextlib.closing(sqlite3.connect(path, timeout=0)) as db:
        return max([0, *(number for number in newest_numbers(db) if number < LARGEST)])


def newest_numbers(db: sqlite3.Connection) -> list[int]:
    """The highest number of each table that can be read."""
    numbers = []
    for table in ("sqlite_sequence", "readings"):
        with contextlib.suppress(sqlite3.Error):  # it is corrupt
            numbers += [seq for (seq,) in db.execute(f"SELECT max(seq) FROM {table}") if isinstance(seq, int)]
    return numbers


def make_place(path: Path) -> None:
    """Create the file and its folders if necessary, readable for their owner only.

    Raises:
        OSError: they cannot be created.
    """
    make_folder(path.parent)
    with contextlib.suppress(FileExistsError):
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o600))


def make_folder(folder: Path) -> None:
    """Create the folder and its parents; restrict access to our own folder only."""
    if not folder.exists():
        make_folder(folder.parent)
        folder.mkdir(0o700, exist_ok=True)
    if folder.name == FOLDER:
        chmod(folder, 0o700)


def tighten(path: Path) -> None:
    """Restrict access to the file, SQLite's files beside it and older corrupt ones: they may have passwords."""
    files = [path, *(path.with_name(path.name + suffix) for suffix in BESIDE)]
    for file in (*files, *path.parent.glob(f"{glob.escape(path.name)}.corrupt-*")):
        if file.is_file() and not file.is_symlink():  # the target of a link may belong to another program
            chmod(file, 0o600)


def chmod(file: Path, mode: int) -> None:
    """Restrict a file's mode; if that fails (FAT, another owner), log it and go on."""
    if stat.S_IMODE(file.stat().st_mode) & ~mode == 0:
        return
    try:
        file.chmod(mode)
    except OSError as error:
        log.warning("others may read %s: %s", file, error.strerror)


def move_aside(path: Path) -> Path:
    """Rename a corrupt file, so that its data is not lost; returns the new name."""
    number = 1
    while (aside := path.with_name(f"{path.name}.corrupt-{number}")).exists():
        number += 1
    for suffix in (*BESIDE, ""):
        part = path.with_name(path.name + suffix)
        if part.exists():
            part.rename(aside.with_name(aside.name + suffix))
    make_place(path)
    return aside
