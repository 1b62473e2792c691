from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.file_text import bytes_of, read_text, text_of, unpacked

WORDS = "[api]\nname = Süd\n"
KML = '<?xml version="1.0" encoding="{}"?>\n<kml>Süd</kml>'


@pytest.mark.parametrize(
    "data",
    [
        WORDS.encode(),
        b"\xef\xbb\xbf" + WORDS.encode(),
        WORDS.encode("utf-16"),
        WORDS.encode("utf-16-le"),
        WORDS.encode("utf-16-be"),
        b"\xfe\xff" + WORDS.encode("utf-16-be"),
        WORDS.encode("utf-32"),
        WORDS.replace("\n", "\r\n").encode(),
        WORDS.replace("\n", "\r").encode(),
    ],
)
def test_every_mark_every_width_and_every_line_end_give_the_same_text(data: bytes) -> None:
    assert text_of(data, "it") == WORDS


@pytest.mark.parametrize(
    ("declared", "real"),
    [
        ("UTF-8", "utf-8"),
        ("utf-16", "utf-8"),  # as Mission Planner writes: SharpKml's text, saved by the program
        ("UTF-16", "utf-16"),
        ("ISO-8859-1", "latin-1"),
        ("windows-1252", "cp1252"),
        ("us-ascii", "ascii"),
        ("gb2312", "gb2312"),
    ],
)
def test_a_declared_encoding_counts_unless_the_bytes_are_of_another_width(declared: str, real: str) -> None:
    text = KML.format(declared).replace("ü", "" if real in ("ascii", "gb2312") else "ü")
    assert text_of(text.encode(real), "it") == text


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"a\nb \xff", "it is not UTF-8 text: line 2, column 3 has byte 0xFF"),
        (b"a\nb\n\x00", "it is not text: line 3, column 1 has a zero byte"),
        (b"\xff\xfea", "it is not UTF-16 text: line 1, column 1 has byte 0x61"),
        (b"PK\x03\x04\x14\x00", "it is packed (a zip): unpack it"),
        (KML.format("klingon").encode(), "it declares the encoding 'klingon', which is not known: save it as UTF-8"),
        (KML.format("rot13").encode(), "'rot13', which is not known"),
        (KML.format("unicode_escape").encode(), "'unicode_escape', which is not known"),
        (KML.format("").encode(), "'', which is not known"),
        (KML.format("a\x01b").encode(), "is not known"),
    ],
)
def test_what_is_not_text_is_refused_with_its_place(data: bytes, words: str) -> None:
    with pytest.raises(BadRequest) as caught:
        text_of(data, "it")
    assert words in str(caught.value)
    assert "codec" not in str(caught.value)


def test_a_file_is_read_by_its_name(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"\xef\xbb\xbfa\r\n")
    assert read_text(file, 10) == "a\n"


def test_what_is_no_file_or_too_large_is_refused_by_name(tmp_path: Path) -> None:
    pipe, large = tmp_path / "pipe", tmp_path / "large"
    os.mkfifo(pipe)
    large.write_bytes(b"x" * 2049)
    for path, words in [
        (pipe, "pipe is not a file"),
        (tmp_path, "is not a file"),
        (Path("/dev/zero"), "/dev/zero is not a file"),
        (tmp_path / "none", "none cannot be read: No such file or directory"),
        (Path("a\0b"), "cannot be the name of a file"),
        (large, "large has more than 2 kB"),
    ]:
        with pytest.raises(BadRequest, match=words):
            bytes_of(path, 2048)


def zipped(*names: str, how: int = zipfile.ZIP_DEFLATED, size: int = 6) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", how) as archive:
        for name in names:
            archive.writestr(zipfile.ZipInfo(name), "<kml/>".ljust(size), how)
    return file.getvalue()


@pytest.mark.parametrize("how", [zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED])
def test_the_one_kml_of_a_kmz_is_read(how: int) -> None:
    assert unpacked(zipped("files/icon.png", "Doc.KML", how=how), "it", 100) == b"<kml/>"
    assert unpacked(b"<kml/>", "it", 100) == b"<kml/>"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (zipped("doc.kml", size=101), "the KML that it holds has more than 0 kB"),
        (zipped("doc.kml", size=10**7), "the KML that it holds has more than 0 kB"),
        (zipped("doc.kml", "b/doc.kml"), "it is packed, and has 2 KML files, not one"),
        (zipped("a.txt"), "it is packed, and has 0 KML files, not one"),
        (zipped("doc.kml")[:40], "it is packed, and damaged or encrypted"),
        (
            zipped("doc.kml").replace(b"\x14\x00\x00\x00", b"\x14\x00\x01\x00"),
            "it is packed, and damaged or encrypted",
        ),
        (zipped("doc.kml").replace(b"\x00\x08\x00", b"\x00\x63\x00"), "it is packed in an unusual way"),
        (zipped("doc.kml", how=zipfile.ZIP_LZMA), "it is packed in an unusual way"),
    ],
    ids=["large", "bomb", "two", "none", "cut", "encrypted", "method", "lzma"],
)
def test_a_kmz_that_is_damaged_large_or_many_is_refused(data: bytes, words: str) -> None:
    with pytest.raises(BadRequest) as caught:
        unpacked(data, "it", 100)
    assert words in str(caught.value)
