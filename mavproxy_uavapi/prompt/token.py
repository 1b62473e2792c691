"""`uavapi token add|list|remove` at the prompt: the file of the setting `tokens`. Blocking: for a thread."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Sequence
from pathlib import Path

from mavproxy_uavapi.core.errors import BadRequest, SettingError
from mavproxy_uavapi.core.text import joined
from mavproxy_uavapi.files.tokens import MOST, Token, digest_of, name_of, new_token, parse, read_text, rights_of

USAGE = "token takes `add NAME watch|fly|admin [SYSID …]`, `list`, or `remove NAME`"
HEAD = "# NAME ROLE[:VEHICLES] HASH; `uavapi token add NAME ROLE` adds a line\n"


def command(file: str, args: Sequence[str]) -> tuple[str, bool]:
    """Run the command; the line to print, and whether the file has changed.

    Raises:
        BadRequest: no such command, or there is no file.
        SettingError: the file or a word is of no use; nothing has changed.
    """
    if not file:
        raise BadRequest("`uavapi set tokens FILE` comes first")
    path = Path(file).expanduser()
    if args[:1] == ["list"] and len(args) == 1:
        return _list(path), False
    if args[:1] == ["add"] and len(args) >= 3:
        return _add(path, args[1], args[2], args[3:]), True
    if args[:1] == ["remove"] and len(args) == 2:
        return _remove(path, args[1]), True
    raise BadRequest(USAGE)


def _text(path: Path) -> str:
    return read_text(path) if path.exists() or path.is_symlink() else HEAD


def _list(path: Path) -> str:
    lines = [f"  {token.name} {token.rights}" for token in parse(_text(path))]
    return joined([f"tokens of {path}", *lines]) if lines else f"{path} has no tokens"


def _add(path: Path, name: str, role: str, systems: Sequence[str]) -> str:
    rights = rights_of(":".join([role, ",".join(systems)]) if systems else role)
    text = _text(path)
    tokens = parse(text)
    if any(token.name == name for token in tokens):
        raise SettingError(f"{name} has a token already; `uavapi token remove {name}` takes it away", "tokens")
    if len(tokens) >= MOST:
        raise SettingError(f"there are {MOST} tokens already", "tokens")
    secret = new_token()
    token = Token(name_of(name), *rights, digest_of(secret.encode()))
    write(path, text + ("" if text.endswith("\n") or not text else "\n") + f"{token}\n")
    return joined([f"the token of {name} ({token.rights}) is shown this once:", secret])


def _remove(path: Path, name: str) -> str:
    lines = _text(path).split("\n")
    kept = [line for line in lines if line.partition("#")[0].split()[:1] != [name]]
    if len(kept) == len(lines):
        raise SettingError(f"{name!r:.40} has no token", "tokens")
    write(path, "\n".join(kept))
    return f"the token of {name} is no longer valid; its open connections are closed"


def write(path: Path, text: str) -> None:
    """Put a text in the place of the file at once, for its owner's eyes only.

    Raises:
        SettingError: the folder cannot be written to.
    """
    other = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        with open(os.open(other, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(other, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            other.unlink()
        raise SettingError(f"{path} cannot be written: {error.strerror}", "tokens") from error
