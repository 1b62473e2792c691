"""The INI file: one for all three modules and the launcher. Each reads its own sections."""

from __future__ import annotations

import configparser
from collections.abc import Iterable
from pathlib import Path

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.text import nearest

# All but [vision] and [gradys] are the original service's.
SECTIONS = ("api", "mode", "udp", "simulated", "logs", "vision", "gradys")


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
            with file.open(encoding="utf-8") as stream:
                parser.read_file(stream)
        except OSError as error:
            raise SettingError(f"{file}: {error.strerror}") from error
        except (configparser.Error, UnicodeDecodeError) as error:
            raise SettingError(f"{file}: {' '.join(str(error).split())}") from error
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
