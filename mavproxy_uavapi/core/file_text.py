"""The one reader of foreign bytes: a file or a body, by its byte order mark, its declared or its real encoding.

The text has no byte order mark, and its lines end with `\\n`. An XML text keeps its declaration, true or not.
"""

from __future__ import annotations

import codecs
import io
import os
import re
import stat
import zipfile
from pathlib import Path

from mavproxy_uavapi.core.errors import BadRequest

# UTF-32 comes first: its little-endian mark begins with that of UTF-16.
MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
ZIP = b"PK\x03\x04"
DECLARATION = re.compile(rb"\s*<\?xml\b[^>]{0,200}?\bencoding\s*=\s*[\"']([^\"'>]{0,40})[\"']")
WIDE = re.compile(r"utf[-_]?(?:16|32)|ucs|iso-10646", re.IGNORECASE)  # no text in it can hold a declaration in ASCII
# Encodings in which ASCII is ASCII, by Python's names of them.
NARROW = re.compile(
    r"utf-8|ascii|iso8859-\d+|cp125\d|cp(?:437|85\d|866|874|932|949|950)|koi8-[ru]|gb\w+|big5|shift_jis|euc_\w+"
)


def text_of(data: bytes, what: str) -> str:
    """The text of a file or a body; `what` begins the errors: "the mission", or a path.

    UTF-8, UTF-16 with a byte order mark or without, and what XML declares. A declaration that the bytes contradict
    does not count: some programs declare utf-16 and write UTF-8.

    Raises:
        BadRequest: it is not text, or of an encoding that is not known; it names the line and the column.
    """
    if data.startswith(ZIP):
        raise BadRequest(f"{what} is packed (a zip): unpack it, and send the file that is in it")
    encoding, data = _encoding(data, what)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        before = data[: error.start].decode(encoding, "replace")
        byte = f"byte 0x{data[error.start]:02X}"
        raise BadRequest(f"{what} is not {_spoken(encoding)} text: {place(before)} has {byte}") from error
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if "\0" in text:
        raise BadRequest(f"{what} is not text: {place(text[: text.index(chr(0))])} has a zero byte")
    return text


def unpacked(data: bytes, what: str, largest: int) -> bytes:
    """The KML in a KMZ, as Google Earth writes it by default; other bytes as they are.

    Raises:
        BadRequest: it is damaged or encrypted, holds not one KML, or one of more than `largest` bytes.
    """
    if not data.startswith(ZIP):
        return data
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            files = [info for info in archive.infolist() if info.filename.lower().endswith(".kml")]
            # Others than Google Earth's two name the room that their unpacking takes: it may be gigabytes.
            is_usual = all(info.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for info in files)
            inner = archive.open(files[0]).read(largest + 1) if len(files) == 1 and is_usual else b""
    except Exception as error:  # foreign bytes, and a parser that lists no errors
        raise BadRequest(f"{what} is packed, and damaged or encrypted: unpack it") from error
    if len(files) != 1:
        raise BadRequest(f"{what} is packed, and has {len(files)} KML files, not one")
    if not is_usual:
        raise BadRequest(f"{what} is packed in an unusual way: unpack it")
    if len(inner) > largest:
        raise BadRequest(f"the KML that {what} holds has more than {largest // 1024} kB")
    return inner


def place(before: str) -> str:
    """Where a text goes on after `before`: `line 3, column 7`."""
    lines = before.replace("\r\n", "\n").split("\n")
    return f"line {len(lines)}, column {len(lines[-1]) + 1}"


def bytes_of(path: Path, largest: int) -> bytes:
    """What a file holds. A pipe or a device, which may never end, is no file.

    Raises:
        BadRequest: it cannot be read, or has more than `largest` bytes; it names the file.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(descriptor, "rb") as file:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise BadRequest(f"{path} is not a file")
            data = file.read(largest + 1)
    except IsADirectoryError as error:
        raise BadRequest(f"{path} is not a file") from error
    except OSError as error:
        raise BadRequest(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise BadRequest(f"{str(path)!r} cannot be the name of a file") from error
    if len(data) > largest:
        raise BadRequest(f"{path} has more than {largest // 1024} kB")
    return data


def read_text(path: Path, largest: int) -> str:
    """The text of a file.

    Raises:
        BadRequest: as `bytes_of` and `text_of`.
    """
    return text_of(bytes_of(path, largest), str(path))


def _encoding(data: bytes, what: str) -> tuple[str, bytes]:
    """Python's name of the encoding, and the bytes without the mark."""
    for mark, encoding in MARKS:
        if data.startswith(mark):
            return encoding, data[len(mark) :]
    if len(data) >= 2 and not data[0] and data[1]:  # the first character is ASCII
        return "utf-16-be", data
    if len(data) >= 2 and data[0] and not data[1]:
        return "utf-16-le", data
    declared = DECLARATION.match(data)
    return "utf-8" if declared is None else _narrow(declared[1].decode("ascii", "replace"), what), data


def _narrow(declared: str, what: str) -> str:
    """The encoding of a text whose declaration can be read as ASCII."""
    if WIDE.match(declared):
        return "utf-8"
    try:
        encoding = codecs.lookup(declared).name
    except (LookupError, ValueError):
        encoding = ""
    if not NARROW.fullmatch(encoding):
        raise BadRequest(f"{what} declares the encoding {declared!r}, which is not known: save it as UTF-8")
    return encoding


def _spoken(encoding: str) -> str:
    return encoding.upper().removesuffix("-LE").removesuffix("-BE")
