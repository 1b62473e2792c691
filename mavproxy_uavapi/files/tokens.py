"""The tokens of operators: a file with a name, a role and a hash a line, read again whenever it changes.

    # who    may do what      by which token
    anna     fly:1,2          sha256:…
    tower    watch            sha256:…

A token is 256 random bits, which nobody guesses however fast the hash is; so one round of SHA-256 is enough, and
each request can afford it.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import logging
import os
import re
import secrets
import stat
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mavproxy_uavapi.core.errors import BadRequest, SettingError
from mavproxy_uavapi.core.file_text import text_of
from mavproxy_uavapi.core.roles import Operator, Role
from mavproxy_uavapi.core.values import is_unset
from mavproxy_uavapi.files.watched_file import WatchedFile

log = logging.getLogger("uavapi.http.door")

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,31}")  # never an address, which begins with a digit or has a colon
RESERVED = {"console", "unknown"}  # what the trail calls the prompt, and who has no address
ROLES = {role.word: role for role in (Role.WATCH, Role.FLY, Role.ADMIN)}
HASH = re.compile(r"sha256:([0-9a-f]{64})")
LARGEST = 64 * 1024  # bytes
MOST = 100  # tokens; each request is compared with all of them
SCRIPT = "/"  # between an operator and the script that flies for the operator


@dataclass(frozen=True)
class Token:
    """What its owner may do.

    Attributes:
        name: of the owner; for a script `OWNER/SCRIPT`.
        role: of the owner.
        vehicles: the system ids that the owner may command; empty for all.
        digest: the token's SHA-256.
    """

    name: str
    role: Role
    vehicles: frozenset[int]
    digest: bytes

    @property
    def operator(self) -> Operator:
        """Who holds a vehicle by it."""
        return Operator(self.name.partition(SCRIPT)[0], self.role)

    @property
    def rights(self) -> str:
        """Role and vehicles, as the file spells them."""
        return ":".join(filter(None, (self.role.word, ",".join(map(str, sorted(self.vehicles))))))

    def __str__(self) -> str:
        return f"{self.name} {self.rights} sha256:{self.digest.hex()}"


def digest_of(token: bytes) -> bytes:
    """A token's hash."""
    return hashlib.sha256(token).digest()


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(32)


def name_of(word: str) -> str:
    """The word, if it can be an owner's name.

    Raises:
        SettingError: it cannot.
    """
    if word in RESERVED:
        raise SettingError(f"{word} cannot name an operator: the trail uses it", "tokens")
    if not NAME.fullmatch(word):
        raise SettingError(f"{word!r:.40} is not a name of up to 32 letters, digits, `_`, `.` and `-`", "tokens")
    return word


def rights_of(word: str) -> tuple[Role, frozenset[int]]:
    """`watch`, `admin`, `fly`, or `fly:1,2` with the vehicles.

    Raises:
        SettingError: it is something else.
    """
    role, colon, systems = word.partition(":")
    if role not in ROLES:
        raise SettingError(f"{role!r:.40} is not one of {', '.join(ROLES)}", "tokens")
    if not colon:
        return ROLES[role], frozenset()
    if ROLES[role] is not Role.FLY:
        raise SettingError(f"{role} is for every vehicle; only fly names some", "tokens")
    numbers = systems.split(",")
    if not all(re.fullmatch(r"[1-9][0-9]{0,2}", number) and int(number) < 256 for number in numbers):
        raise SettingError(f"{systems!r:.40} are not system ids such as 1,2", "tokens")
    return Role.FLY, frozenset(map(int, numbers))


def parse(text: str) -> list[Token]:
    """The tokens of a file.

    Raises:
        SettingError: it names the line; it never shows what may be a token.
    """
    tokens: list[Token] = []
    for number, line in enumerate(text.split("\n"), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            token = _token(words)
            if any(other.name == token.name for other in tokens):
                raise SettingError(f"{token.name} has a token already", "tokens")
            if any(other.digest == token.digest for other in tokens):
                raise SettingError(f"{token.name} has the token of somebody else", "tokens")
        except SettingError as error:
            raise SettingError(f"line {number}: {error}", "tokens") from error
        tokens.append(token)
    if len(tokens) > MOST:
        raise SettingError(f"there are more than {MOST} tokens", "tokens")
    return tokens


def _token(words: Sequence[str]) -> Token:
    if len(words) != 3:
        raise SettingError("a line is NAME ROLE[:VEHICLES] HASH", "tokens")
    name, (role, vehicles) = name_of(words[0]), rights_of(words[1])
    digits = HASH.fullmatch(words[2])
    if digits is None:
        raise SettingError(f"the third word of {name} is not a hash: sha256: and 64 digits 0-9a-f", "tokens")
    return Token(name, role, vehicles, bytes.fromhex(digits[1]))


def read_text(path: Path) -> str:
    """The text of a file that only its owner can read.

    Raises:
        SettingError: others can read or change it, it is a link or no file, or it cannot be read.
    """
    try:
        # What stands there may have been put in its place: a link, or a pipe, which would block.
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            _require_private(path, os.fstat(descriptor))
            with open(descriptor, "rb", closefd=False) as file:
                return text_of(file.read(LARGEST), str(path))
        finally:
            os.close(descriptor)
    except OSError as error:
        reason = "it is a link" if path.is_symlink() else error.strerror
        raise SettingError(f"{path} cannot be read: {reason}", "tokens") from error
    except BadRequest as error:
        raise SettingError(str(error), "tokens") from error


def _require_private(path: Path, status: os.stat_result) -> None:
    """Raise SettingError unless it is a file of a sensible size that only we, or root, can use."""
    if not stat.S_ISREG(status.st_mode):
        raise SettingError(f"{path} is not a file", "tokens")
    if stat.S_IMODE(status.st_mode) & 0o077:
        raise SettingError(f"others can use {path}: `chmod 600 {path}`", "tokens")
    if status.st_uid not in (0, os.geteuid()):
        raise SettingError(f"{path} belongs to somebody else", "tokens")
    if status.st_size > LARGEST:
        raise SettingError(f"{path} has more than {LARGEST // 1024} kB", "tokens")


def read(path: Path) -> list[Token]:
    """The tokens of the file.

    Raises:
        SettingError: as `read_text` and `parse`, in one line that names the file.
    """
    text = read_text(path)
    try:
        return parse(text)
    except SettingError as error:
        raise SettingError(f"{path}, {error}", "tokens") from error


def check(name: str) -> None:
    """Raise SettingError unless the setting may be `name`; a file that is not there yet has no tokens."""
    if is_unset(name):
        return
    path = Path(name).expanduser()
    if path.is_symlink() or path.exists():
        read(path)
    elif not path.parent.is_dir():
        raise SettingError(f"there is no folder {path.parent}", "tokens")


class Tokens:
    """The tokens in force, as the file says. Asyncio thread only.

    Args:
        warn: told in a sentence what went wrong.
    """

    def __init__(self, warn: Callable[[str], None]) -> None:
        self._warn = warn
        self._file = WatchedFile(warn)
        self._tokens: list[Token] = []
        self._uses: dict[object, tuple[Token, Callable[[], None]]] = {}

    @property
    def wanted(self) -> bool:
        """Whether there is a file, so that a caller needs a token."""
        return self._file.path is not None

    def use(self, name: str) -> None:
        """Take up the setting: a file, or nothing."""
        self._file.use("" if is_unset(name) else name)
        self._put([])
        if self.wanted:
            self.take()

    async def watch(self) -> None:
        """Take up each change of the file, until cancelled."""
        await self._file.watch(self.take)

    def take(self) -> None:
        """Read the file, and put it in force at once; one that cannot be read changes nothing."""
        path = self._file.path
        if path is None:
            return
        self._file.look()
        try:
            tokens = read(path)
        except SettingError as error:
            count = len(self._tokens)
            self._warn(f"tokens: {error}; the {count} from before stay in force" if count else f"tokens: {error}")
            return
        self._put(tokens)
        log.info("tokens: %d of %s are in force", len(tokens), path)

    def find(self, digest: bytes) -> Token | None:
        """The token with that hash. It takes as long whether there is one or not."""
        match = None
        for token in self._tokens:
            if hmac.compare_digest(token.digest, digest):
                match = token
        return match

    def named(self, name: str) -> Token | None:
        """The token of that owner."""
        return next((token for token in self._tokens if token.name == name), None)

    @contextlib.contextmanager
    def in_use(self, token: Token, end: Callable[[], None]) -> Iterator[None]:
        """Within the context a request is served for that token; `end` is called if it is in force no more."""
        key = object()
        self._uses[key] = token, end
        try:
            yield
        finally:
            del self._uses[key]

    def _put(self, tokens: list[Token]) -> None:
        self._tokens = tokens
        for token, end in list(self._uses.values()):
            if not self.counts(token):
                end()

    def counts(self, token: Token) -> bool:
        """Whether it is in force; a script's is, as long as whoever started the script may start scripts."""
        if SCRIPT not in token.name:
            return token in self._tokens
        starter = token.operator.name
        owner = self.named(starter)
        is_address = not NAME.fullmatch(starter)
        return is_address or (owner is not None and owner.role is Role.ADMIN)
