from __future__ import annotations

from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.ini_file import IniFile


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "uav.ini"


def test_sections_have_texts_by_key(file: Path) -> None:
    file.write_text("[api]\nPort = 1\nsink = a#b, c;d\n[logs]\nlog_path = /tmp/%Y\n[gradys]\nquantities = a\n  b\n")
    ini = IniFile(file)
    assert ini.section("api") == {"port": "1", "sink": "a#b, c;d"}
    assert ini.section("logs") == {"log_path": "/tmp/%Y"}
    assert ini.section("gradys") == {"quantities": "a\nb"}
    assert ini.section("vision") == {}


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_an_editors_mark_and_line_ends_change_nothing(file: Path, encoding: str) -> None:
    file.write_bytes("[api]\r\nport = 1\r\n".encode(encoding))
    assert IniFile(file).section("api") == {"port": "1"}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[vison]\n", "no section [vison]; did you mean vision?"),
        ("[GRADYS]\n", "no section [GRADYS]; did you mean gradys?"),
        ("[DEFAULT]\nport = 1\n", "no section [DEFAULT]; there are api, mode, udp, simulated, logs, vision, gradys"),
        ("port = 1\n", "no section headers"),
        ("[api]\nport = 1\nport = 2\n", "already exists"),
        ("[api]\n[api]\n", "already exists"),
        ("[api]\nport = \udcff\n", "it is not UTF-8 text: line 2, column 8 has byte 0xFF"),
        ("[api]\nport = 1\n???\n", "line 3 is neither [section] nor `key = value`: '???'"),
        ("[api]\n port\n", "line 2 is neither"),
    ],
)
def test_what_means_nothing_is_one_line_that_begins_with_the_file(file: Path, content: str, words: str) -> None:
    file.write_bytes(content.encode("utf-8", "surrogateescape"))
    with pytest.raises(SettingError) as caught:
        IniFile(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "source" not in str(caught.value) and "option '" not in str(caught.value)


def test_what_cannot_be_read_is_reported(file: Path) -> None:
    with pytest.raises(SettingError, match=r"uav\.ini cannot be read: No such file or directory$"):
        IniFile(file)
    with pytest.raises(SettingError, match="is not a file$"):
        IniFile(file.parent)
