"""`uavapi token` at the prompt: it writes the file of tokens."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import BadRequest, SettingError
from mavproxy_uavapi.files.tokens import Tokens, digest_of
from mavproxy_uavapi.prompt import token


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file with the token of one pilot."""
    path = tmp_path / "tokens"
    path.write_text(f"# ours\nanna fly:1,2 sha256:{digest_of(b'0').hex()}  # the pilot\n")
    path.chmod(0o600)
    return path


def test_it_makes_shows_and_removes_tokens(tmp_path: Path) -> None:
    path = tmp_path / "tokens"
    text, changed = token.command(str(path), ["add", "anna", "fly", "1", "2"])
    secret = text.splitlines()[-1]
    assert changed and len(secret) > 40 and "shown this once" in text
    assert stat.S_IMODE(path.stat().st_mode) == 0o600 and secret not in path.read_text()
    tokens = Tokens(print)
    tokens.use(str(path))
    anna = tokens.find(digest_of(secret.encode()))
    assert anna is not None and str(anna).startswith("anna fly:1,2 sha256:")
    path.write_text(path.read_text().rstrip("\n") + "  # keep this\n# and this")
    token.command(str(path), ["add", "bo", "admin"])
    assert token.command(str(path), ["list"]) == (f"tokens of {path}\n  anna fly:1,2\n  bo admin", False)
    token.command(str(path), ["remove", "bo"])
    assert "# keep this" in path.read_text() and "# and this" in path.read_text() and "bo" not in path.read_text()
    assert [entry.name for entry in tmp_path.iterdir()] == ["tokens"]
    token.command(str(path), ["remove", "anna"])
    assert "has no tokens" in token.command(str(path), ["list"])[0]


@pytest.mark.parametrize(
    "words",
    ["add anna fly", "add a@b fly", "add bo king", "add bo watch 1", "add bo fly 0", "add bo fly:", "remove bo"],
)
def test_it_changes_nothing_for_words_of_no_use(file: Path, words: str) -> None:
    before = file.read_text()
    with pytest.raises(SettingError):
        token.command(str(file), words.split())
    assert file.read_text() == before


@pytest.mark.parametrize("words", ["", "add", "add bo", "remove", "remove a b", "list all", "show"])
def test_it_says_what_it_takes(file: Path, words: str) -> None:
    with pytest.raises(BadRequest, match="token takes"):
        token.command(str(file), words.split())


def test_it_wants_the_setting_first_and_leaves_a_broken_file_alone(file: Path) -> None:
    with pytest.raises(BadRequest, match="uavapi set tokens FILE"):
        token.command("", ["list"])
    file.write_text("broken")
    with pytest.raises(SettingError, match="line 1"):
        token.command(str(file), ["add", "bo", "watch"])
    assert file.read_text() == "broken"
