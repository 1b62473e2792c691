from __future__ import annotations

import os
from pathlib import Path

import pytest

from mavproxy_uavapi.companion import token
from mavproxy_uavapi.files.tokens import digest_of, parse, read_text


@pytest.fixture
def config(tmp_path: Path) -> Path:
    file = tmp_path / "uav.ini"
    file.write_text(f"[api]\nhost = 10.0.0.5\nport = 8002\ntokens = {tmp_path / 'tokens'}\n")
    return file


def test_a_token_is_given_with_the_pages_link_and_its_picture(
    config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert token.run(["--config", str(config), "add", "anna", "fly", "1", "2"]) == 0
    said = capsys.readouterr().out
    link = next(line.strip() for line in said.split("\n") if "#token=" in line)
    assert link.startswith("http://10.0.0.5:8002/#token=")
    (known,) = parse(read_text(config.parent / "tokens"))
    assert (known.name, known.rights) == ("anna", "fly:1,2")
    assert known.digest == digest_of(link.partition("#token=")[2].encode())
    assert token.qr_code(link) in said


def test_tokens_are_listed_and_removed(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["add", "tower", "watch"], ["list"], ["remove", "tower"], ["list"]):
        assert token.run(["--config", str(config), *words]) == 0
    said = capsys.readouterr().out
    assert "  tower watch\n" in said and said.rstrip().endswith("has no tokens")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_file_stays_its_users(config: Path) -> None:
    for folder in (config.parent, *list(config.parent.parents)[:3]):
        folder.chmod(0o755)
    os.chown(config.parent, 12345, 12345)
    for words in (["add", "tower", "watch"], ["add", "anna", "fly"]):
        assert token.run(["--config", str(config), *words]) == 0
    assert (config.parent / "tokens").stat().st_uid == 12345 and os.geteuid() == 0


@pytest.mark.parametrize(
    ("text", "words", "why"),
    [
        ("[api]\nport = x\ntokens = {folder}/tokens\n", ["add", "anna", "fly"], "'x' is no number"),
        ("[api]\nport = 8002\n", ["add", "anna", "fly"], "has no tokens = FILE"),
        (None, ["list"], "No such file"),
        ("[api]\ntokens = {folder}/tokens\n", ["add", "anna", "pilot"], "pilot"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str | None, words: list[str], why: str
) -> None:
    file = tmp_path / "other.ini"
    if text is not None:
        file.write_text(text.format(folder=tmp_path))
    assert token.run(["--config", str(file), *words]) == 1
    error = capsys.readouterr().err
    assert why in error and error.count("\n") == 1


def test_everywhere_means_each_address_of_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_uavapi.core.addresses.own_addresses", lambda: ["10.0.0.5", "192.168.1.2"])
    pages = token.pages({"host": "0.0.0.0", "certfile": "c.pem"})
    assert pages == ["https://10.0.0.5:8000/", "https://192.168.1.2:8000/"]
