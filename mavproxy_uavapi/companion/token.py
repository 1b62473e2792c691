"""`mavproxy-uavapi token`: operators' tokens without a prompt, each with a link and a QR code for a phone."""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import segno

from mavproxy_uavapi.companion import plan
from mavproxy_uavapi.core.addresses import urls_of
from mavproxy_uavapi.core.errors import SettingError, UavApiError
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.core.terminal import say
from mavproxy_uavapi.core.text import reason_of
from mavproxy_uavapi.prompt import token as token_file


def run(argv: Sequence[str]) -> int:
    """Add, list or remove tokens; the exit status: 0, 1 for an error, which stderr names."""
    parser = argparse.ArgumentParser(
        "mavproxy-uavapi token", description="the tokens of operators (docs/security.md)"
    )
    parser.add_argument("--config", type=Path, default=Path(plan.CONFIG), help="the service's INI file (%(default)s)")
    parser.add_argument("words", nargs="+", metavar="add NAME watch|fly|admin [SYSID …] | list | remove NAME")
    options = parser.parse_args(argv)
    try:
        api = IniFile(options.config).section("api")
        if not api.get("tokens"):
            raise SettingError(
                f"{options.config}: [api] has no tokens = FILE; `mavproxy-uavapi setup --network` writes it"
            )
        file = Path(api["tokens"])
        with as_owner(file):
            if options.words[0] == "add" and len(options.words) >= 3:
                name, role, *systems = options.words[1:]
                say(*add(file, name, role, systems, options.config))
            else:
                say(*token_file.command(str(file), options.words)[0].split("\n"))
    except (UavApiError, OSError) as error:
        say(f"mavproxy-uavapi token: {reason_of(error)}", file=sys.stderr)
        return 1
    return 0


@contextlib.contextmanager
def as_owner(file: Path) -> Iterator[None]:
    """Be the user whose file it is, or whose folder, if we are root: it stays that user's, and links gain nothing."""
    user, group = os.geteuid(), os.getegid()
    if user != 0:
        yield
        return
    owner = (file if file.exists() else file.parent).stat()
    os.setegid(owner.st_gid)
    os.seteuid(owner.st_uid)
    try:
        yield
    finally:
        os.seteuid(user)
        os.setegid(group)


def add(file: Path, name: str, role: str, systems: Sequence[str], config: Path) -> list[str]:
    """Add a token, and say it: the token, and the page's address with it, as a link and as a QR code.

    Args:
        file: of the tokens.
        name, role, systems: as `uavapi token add` takes them.
        config: the INI file that says where the API listens.

    Raises:
        BadRequest, SettingError: as `prompt.token.command`.
    """
    at = pages(IniFile(config).section("api"))
    said, _ = token_file.command(str(file), ["add", name, role, *systems])
    secret = said.split("\n")[-1]
    links = [f"{page}#token={secret}" for page in at]
    lines = [*said.split("\n"), "the page with it:", *(f"  {link}" for link in links)]
    return lines + qr_code(links[0]).split("\n")


def pages(api: dict[str, str]) -> list[str]:
    """The addresses of the page, as other machines reach it where they may.

    Args:
        api: the texts of the INI file's [api].

    Raises:
        SettingError: its port is no number.
    """
    host, port, tls = api.get("host", "127.0.0.1"), api.get("port", "8000"), bool(api.get("certfile"))
    if not port.isdecimal():
        raise SettingError(f"port: {port!r:.20} is no number", "port")
    return [f"{url}/" for url in urls_of(host, int(port), tls=tls)]


def qr_code(text: str) -> str:
    """A QR code for a terminal."""
    drawn = io.StringIO()
    segno.make(text, error="m").terminal(drawn, compact=True)
    return drawn.getvalue().rstrip("\n")
