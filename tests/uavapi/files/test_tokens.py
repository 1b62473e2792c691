"""The file of tokens: what it may say, who may read it, and what happens when it changes."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.files.tokens import MOST, Token, Tokens, check, digest_of, new_token, parse, read
from mavproxy_uavapi.files.watched_file import LOOK_EVERY
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.virtual_time import FastLoop

HASHES = [f"sha256:{digest_of(str(number).encode()).hex()}" for number in range(MOST + 2)]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file with one token, "0"."""
    path = tmp_path / "tokens"
    put(path, f"# ours\nanna fly:1,2 {HASHES[0]}  # the pilot\n")
    return path


def put(path: Path, text: str, mode: int = 0o600) -> None:
    path.write_text(text)
    path.chmod(mode)


def test_line_has_a_name_a_role_with_vehicles_and_a_hash() -> None:
    tokens = parse(f"\n# a comment\nanna fly:1,2 {HASHES[0]} # she\n\tbo\twatch {HASHES[1]}\r\nc-3 admin {HASHES[2]}")
    assert [(token.name, token.role, token.vehicles) for token in tokens] == [
        ("anna", Role.FLY, {1, 2}),
        ("bo", Role.WATCH, set()),
        ("c-3", Role.ADMIN, set()),
    ]
    assert str(tokens[0]) == f"anna fly:1,2 {HASHES[0]}"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("anna fly", "NAME ROLE"),
        (f"anna bo fly {HASHES[1]}", "NAME ROLE"),
        (f"anna king {HASHES[1]}", "'king' is not one of watch, fly, admin"),
        (f"anna prompt {HASHES[1]}", "'prompt' is not one of"),
        (f"anna watch:1 {HASHES[1]}", "only fly names some"),
        (f"anna admin:1 {HASHES[1]}", "only fly names some"),
        *((f"anna fly:{systems} {HASHES[1]}", "not system ids") for systems in ("", "0", "256", "1,", "a", "²")),
        ("anna fly my-own-secret", "the third word of anna is not a hash"),
        (f"anna fly {HASHES[1].upper()}", "is not a hash"),
        (f"anna fly {HASHES[1]}0", "is not a hash"),
        (f"10.0.0.5 fly {HASHES[1]}", "is not a name"),
        (f"::1 fly {HASHES[1]}", "is not a name"),
        (f"console fly {HASHES[1]}", "console cannot name an operator"),
        (f"a@b fly {HASHES[1]}", "is not a name"),
        (f"a/b fly {HASHES[1]}", "is not a name"),
        (f"a\x1b[31m fly {HASHES[1]}", "is not a name"),
        (f"{'a' * 33} fly {HASHES[1]}", "is not a name"),
        (f"first fly {HASHES[1]}", "first has a token already"),
        (f"anna fly {HASHES[0]}", "anna has the token of somebody else"),
    ],
)
def test_line_that_means_nothing_is_named_and_no_secret_is_shown(line: str, words: str) -> None:
    with pytest.raises(SettingError) as caught:
        parse(f"first watch {HASHES[0]}\n\n{line}\n")
    text = str(caught.value)
    assert text.startswith("line 3: ") and words in text
    assert text.isprintable() and "my-own-secret" not in text and HASHES[1] not in text


def test_there_may_be_only_so_many() -> None:
    lines = [f"n{number} watch {HASHES[number]}" for number in range(MOST + 1)]
    assert len(parse("\n".join(lines[:MOST]))) == MOST
    with pytest.raises(SettingError, match="more than"):
        parse("\n".join(lines))


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o666, 0o601])
def test_file_that_others_can_use_is_refused_in_one_line(file: Path, mode: int) -> None:
    file.chmod(mode)
    with pytest.raises(SettingError, match="others can use .*: `chmod 600") as caught:
        read(file)
    assert "\n" not in str(caught.value)


def test_link_pipe_folder_and_binary_are_refused_and_do_not_block(file: Path, tmp_path: Path) -> None:
    link, pipe, binary = tmp_path / "link", tmp_path / "pipe", tmp_path / "binary"
    link.symlink_to(file)
    os.mkfifo(pipe, 0o600)
    binary.write_bytes(b"\xff\xfe\x00")
    binary.chmod(0o600)
    for path, words in (
        (link, "it is a link"),
        (pipe, "not a file"),
        (tmp_path, "not a file"),
        (binary, "not UTF-16 text"),
    ):
        with pytest.raises(SettingError, match=words):
            read(path)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_an_editors_mark_and_line_ends_change_nothing(file: Path, encoding: str) -> None:
    expected = read(file)
    file.write_bytes(file.read_text().replace("\n", "\r\n").encode(encoding))
    assert read(file) == expected


def test_file_of_somebody_else_is_refused(file: Path) -> None:
    os.chown(file, 12345, 12345)
    with pytest.raises(SettingError, match="belongs to somebody else"):
        read(file)


def test_setting_takes_a_file_of_tokens_or_one_that_is_still_to_be_made(file: Path, tmp_path: Path) -> None:
    settings = ApiModuleSettings({"host": "0.0.0.0", "tokens": str(file)}, environ={})
    assert settings.snapshot().tokens == str(file)
    settings.set("tokens", str(tmp_path / "later"))
    put(tmp_path / "bad", "anna king x")
    for bad in (str(tmp_path / "bad"), str(tmp_path / "no" / "folder"), str(tmp_path)):
        with pytest.raises(SettingError):
            settings.set("tokens", bad)
    with pytest.raises(SettingError, match="everybody on that network"):
        settings.set("tokens", "None")
    check("")


# -- in force -----------------------------------------------------------------------------------------------


def test_change_is_taken_up_and_a_broken_file_changes_nothing(loop: FastLoop, file: Path) -> None:
    loop.set_default_executor(AtOnce())
    said = list[str]()
    tokens = Tokens(said.append)
    tokens.use(str(file))
    watch = loop.create_task(tokens.watch())

    def names() -> list[str]:
        loop.pass_time(2 * LOOK_EVERY)
        return [name for name in ("anna", "bo") if tokens.named(name)]

    assert names() == ["anna"]
    put(file, f"bo watch {HASHES[1]}")
    assert names() == ["bo"] and said == []
    put(file, "bo")
    assert names() == ["bo"] and "line 1" in said[-1] and "the 1 from before stay in force" in said[-1]
    put(file, f"anna watch {HASHES[0]}", 0o644)
    assert names() == ["bo"] and "chmod 600" in said[-1]
    file.chmod(0o600)
    assert names() == ["anna"]
    file.unlink()
    file.symlink_to("/dev/null")
    assert names() == ["anna"] and "it is a link" in said[-1]
    file.unlink()
    assert names() == ["anna"] and "cannot be read" in said[-1]
    put(file, "# nobody")
    assert names() == []
    watch.cancel()
    tokens.use("")
    assert not tokens.wanted


def test_file_that_is_gone_at_the_start_lets_nobody_in(loop: FastLoop, tmp_path: Path) -> None:
    said = list[str]()
    tokens = Tokens(said.append)
    tokens.use(str(tmp_path / "none"))
    assert tokens.wanted and tokens.find(digest_of(b"0")) is None and "cannot be read" in said[0]


def test_token_is_found_by_its_hash_among_the_most_there_may_be(file: Path) -> None:
    put(file, "\n".join(f"n{number} watch {HASHES[number]}" for number in range(MOST)))
    tokens = Tokens(print)
    tokens.use(str(file))
    token = tokens.find(digest_of(b"7"))
    assert token is not None and token.name == "n7"
    assert tokens.find(digest_of(b"x")) is None


def test_what_is_served_ends_when_its_token_goes_or_changes(file: Path) -> None:
    tokens, ended = Tokens(print), list[str]()
    put(file, f"anna fly {HASHES[0]}\nbo watch {HASHES[1]}\nc watch {HASHES[2]}\n")
    tokens.use(str(file))
    anna, bo, c = (tokens.find(digest_of(str(number).encode())) for number in range(3))
    assert anna and bo and c
    with (
        tokens.in_use(anna, lambda: ended.append("anna")),
        tokens.in_use(bo, lambda: ended.append("bo")),
        tokens.in_use(c, lambda: ended.append("c")),
    ):
        put(file, f"anna watch {HASHES[0]}\nbo watch {HASHES[1]}\n")
        tokens.take()
        assert ended == ["anna", "c"]
    tokens.use("")
    assert ended == ["anna", "c"]


@pytest.mark.parametrize(
    ("starter", "counts"), [("anna", True), ("bo", False), ("gone", False), ("10.0.0.5", True), ("::1", True)]
)
def test_token_of_a_script_counts_as_long_as_its_starter_may_start_scripts(
    file: Path, starter: str, counts: bool
) -> None:
    put(file, f"anna admin {HASHES[0]}\nbo fly {HASHES[1]}\n")
    tokens = Tokens(print)
    tokens.use(str(file))
    assert tokens.counts(Token(f"{starter}/square", Role.ADMIN, frozenset(), b"")) is counts


def test_tokens_are_long_and_never_the_same() -> None:
    made = {new_token() for _ in range(100)}
    assert len(made) == 100 and all(len(token) == 43 for token in made)
