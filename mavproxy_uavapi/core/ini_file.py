"""The INI file: one for all three modules and the launcher. Each reads its own sections."""

from __future__ import annotations

import configparser
from collections.abc import Iterable
from pathlib import Path

from mavproxy_uavapi.core.errors import BadRequest, SettingError
from mavproxy_uavapi.core.file_text import bytes_of, text_of
from mavproxy_uavapi.core.strict_json import shown
from mavproxy_uavapi.core.text import nearest

# All but [vision] and [gradys] are the original service's.
SECTIONS = ("api", "mode", "udp", "simulated", "logs", "vision", "gradys")


LARGEST = 1024 * 1024  # bytes


class IniFile:
    """A file that was read: texts by section and key.

    Args:
        file: its path; errors begin with it.

    Raises:
        SettingError: it is missing, cannot be read, or has an unknown section.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        # A `%` in a path is a `%`, and [DEFAULT] a section like others.
        parser = configparser.ConfigParser(interpolation=None, default_section="")
        try:
            text = text_of(bytes_of(file, LARGEST), f"{file}: it")
            parser.read_string(text)
        except BadRequest as error:
            raise SettingError(str(error)) from error
        except configparser.Error as error:
            sentence = _sentence(error, text)
            raise SettingError(f"{file}: {sentence}") from error
        self.sections = {name: dict(parser[name]) for name in parser.sections()}
        for name in self.sections:
            if name not in SECTIONS:
                hint = nearest(name, SECTIONS)
                raise SettingError(f"{file}: no section [{name}]; {hint}")

    def section(self, name: str) -> dict[str, str]:
        """The texts of a section by key; none where the file does not have it."""
        return self.sections.get(name, {})

    def no_key(self, section: str, key: str, known: Iterable[str]) -> SettingError:
        """The error for a key that the section does not have; it names the nearest known one."""
        return SettingError(f"{self.file}: no key {key!r} in [{section}]; {nearest(key, known)}", key)


def _sentence(error: configparser.Error, text: str) -> str:
    """What is wrong in the file, and in which line."""
    if isinstance(error, configparser.MissingSectionHeaderError):
        return f"line {error.lineno}: there are no section headers, such as [api], before {shown(error.line.strip())}"
    if isinstance(error, configparser.DuplicateSectionError):
        return f"line {error.lineno}: section [{error.section}] already exists"
    if isinstance(error, configparser.DuplicateOptionError):
        return f"line {error.lineno}: {error.option} already exists in [{error.section}]"
    if isinstance(error, configparser.ParsingError) and error.errors:
        number, _ = error.errors[0]
        line = text.split("\n")[number - 1].strip()
        return f"line {number} is neither [section] nor `key = value`: {shown(line)}"
    return "it is no INI file"
