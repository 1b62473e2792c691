"""The spool's file: made, found to be ours, kept from other eyes, migrated, or set aside when it is corrupt.

Only what SQLite reads as a database and what carries our application id is ever changed or renamed: the setting
`spool` may point anywhere by mistake. No file is opened but by SQLite: to close another descriptor of it would
undo the locks that keep a second MAVProxy out (POSIX).
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
FOLDER = "mavproxy-uavapi"  # what the folder of the default spool is called
BESIDE = ("-journal", "-wal", "-shm")  # what SQLite has beside its file
CLOCK_IS_SET = 1.7e9  # s since 1970: a clock behind this (2023) was never set
SPARED = 1_000_000  # numbers between what is read of a corrupt file and the first of the next
SMALLEST = 512  # bytes of a database; SQLite takes what is smaller for empty
WAL_KEPT = 1024 * 1024  # bytes
ROW_DAMAGE = re.compile(r"\S+ value in ")  # what the check says of a cell; `rows.py` looks at these
log = logging.getLogger("gradys.spool")


def opened(path: Path, wall: float) -> tuple[sqlite3.Connection, Path | None]:
    """The file, ours alone and of this version; and the corrupt one that it replaced.

    Args:
        path: no symbolic link: what is renamed is the file itself.
        wall: s since 1970; numbers of a new file begin there (ms).

    Raises:
        NotStored: it is not ours, or of a newer version.
        sqlite3.OperationalError, OSError: no room, no permission, another one has it.
    """
    if path.exists() and (not path.is_file() or 0 < path.stat().st_size < SMALLEST):
        raise NotStored(f"{path} is no spool; `gradys set spool FILE` takes another")
    make_place(path)
    first = int(wall * 1000) if wall > CLOCK_IS_SET else random.getrandbits(40)
    try:
        return _opened(path, first), None
    except sqlite3.DatabaseError as error:
        if isinstance(error, sqlite3.OperationalError):
            raise  # no room, no permission, locked: the file itself may be good
        first = max(first, newest_number(path) + SPARED)
        aside = move_aside(path)
        return _opened(path, first), aside


def _opened(path: Path, first: int) -> sqlite3.Connection:
    """As `opened`.

    Raises:
        sqlite3.DatabaseError: it is ours, and corrupt.
    """
    db = sqlite3.connect(path, timeout=0, isolation_level=None, check_same_thread=False)
    db.text_factory = lambda cell: cell.decode(errors="surrogateescape")  # one bad letter is no reason to stop
    try:
        ours = is_ours(db, path)
        db.execute("PRAGMA locking_mode=EXCLUSIVE")
        db.execute("PRAGMA synchronous=FULL")
        if not ours:
            with Transaction(db):  # before there is a log: the file itself always says whose it is
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
        NotStored: it is something else, or of a newer version.
        sqlite3.OperationalError: it cannot be read just now.
    """
    try:
        (application,) = db.execute("PRAGMA application_id").fetchone()
        (version,) = db.execute("PRAGMA user_version").fetchone()
        (tables,) = db.execute("SELECT count(*) FROM sqlite_master").fetchone() if application == 0 else (0,)
    except sqlite3.OperationalError:
        raise
    except sqlite3.DatabaseError as error:
        raise NotStored(f"{path} is no spool: {error}; `gradys set spool FILE` takes another") from error
    if application != APPLICATION:
        if application or tables:
            raise NotStored(f"{path} is a database of another program; `gradys set spool FILE` takes another")
        return False
    if not 1 <= version <= VERSION:
        raise NotStored(
            f"{path} is a spool of version {version}, which a newer gradys wrote: this one knows 1 to {VERSION};"
            " `gradys set spool FILE` takes another"
        )
    return True


def check(db: sqlite3.Connection) -> None:
    """Look whether the file is sound; damage within single cells is no reason to give all of it up.

    Raises:
        sqlite3.DatabaseError: it is not.
    """
    for (problem,) in db.execute("PRAGMA quick_check(1000)"):
        if problem != "ok" and not ROW_DAMAGE.match(problem):
            raise sqlite3.DatabaseError(problem)


def newest_number(path: Path) -> int:
    """The highest number that a corrupt file is known to have given, as far as it can be read; 0 if it cannot."""
    numbers = [0]
    with contextlib.closing(sqlite3.connect(path, timeout=0)) as db:
        for table in ("sqlite_sequence", "readings"):
            with contextlib.suppress(sqlite3.Error):  # it is corrupt, we know
                numbers += [seq for (seq,) in db.execute(f"SELECT max(seq) FROM {table}") if isinstance(seq, int)]
    return max(numbers)


def make_place(path: Path) -> None:
    """Make the file and its folders, if need be, readable by nobody else.

    Raises:
        OSError: that is not possible.
    """
    make_folder(path.parent)
    with contextlib.suppress(FileExistsError):
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o600))


def make_folder(folder: Path) -> None:
    """Make it and those above it, and tighten the one that is ours; folders of others are left as they are."""
    if not folder.exists():
        make_folder(folder.parent)
        folder.mkdir(0o700, exist_ok=True)
    if folder.name == FOLDER:
        chmod(folder, 0o700)


def tighten(path: Path) -> None:
    """Keep others from reading the file, what is beside it, and corrupt ones of before: they may hold passwords."""
    files = [path, *(path.with_name(path.name + suffix) for suffix in BESIDE)]
    for file in (*files, *path.parent.glob(f"{glob.escape(path.name)}.corrupt-*")):
        if file.is_file() and not file.is_symlink():  # a link leads to what is somebody else's
            chmod(file, 0o600)


def chmod(file: Path, mode: int) -> None:
    """Take rights away; where that cannot be done (FAT, a file of somebody else) say so and go on."""
    if stat.S_IMODE(file.stat().st_mode) & ~mode == 0:
        return
    try:
        file.chmod(mode)
    except OSError as error:
        log.warning("others may read %s: %s", file, error.strerror)


def move_aside(path: Path) -> Path:
    """Rename a corrupt file, so that nobody's data is lost by our not understanding it; the new name."""
    number = 1
    while (aside := path.with_name(f"{path.name}.corrupt-{number}")).exists():
        number += 1
    for suffix in (*BESIDE, ""):
        part = path.with_name(path.name + suffix)
        if part.exists():
            part.rename(aside.with_name(aside.name + suffix))
    make_place(path)
    return aside
