"""The settings of our MAVProxy modules: one base for all three, one snapshot handed inward.

Defaults < INI file < environment < keywords of `module load` < `set` at the prompt.
"""

from __future__ import annotations

import fnmatch
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.core.text import escaped, nearest
from mavproxy_uavapi.core.values import converted, is_unset, path_of

CONFIG_VARIABLE = "UAVAPI_CONFIG"  # names the INI file where no keyword `config` does
DEFAULT = "default"  # where a value came from that nobody set
ENVIRONMENT = "environment"
KEYWORD = "module load"

Snapshot = TypeVar("Snapshot")


@dataclass(frozen=True)
class Change:
    """A value for a setting.

    Attributes:
        origin: where it comes from, as the listing tells it.
        place: what an error about it begins with.
    """

    name: str
    value: Any
    origin: str
    place: str = ""


class ModuleSettings(ABC, Generic[Snapshot]):
    """The settings of a loaded module: validated, whichever way they come in.

    MPSettings would hold them, too; but it takes NaN, and prints lines of its own about what it does not take.

    Attributes:
        module: its name, which begins its environment variables; the INI file's section is called so, too.
        secrets: settings of which errors and listings do not show the value.
        parsers: for a setting that is written as text, what makes the snapshot's value of it; raises SettingError.
        notes: what is to be told of the INI file, a line each.
        origins: where the value of each setting came from that somebody set.

    Args:
        given: keywords of `module load`. `config` names an INI file, and `origins` tells by setting where the
            launcher had the others from.
        environ: the environment; None for this process's.

    Raises:
        SettingError: a setting that does not exist, or a value that it does not take, alone or beside the others.
    """

    module: ClassVar[str]
    secrets: ClassVar[Set[str]] = frozenset()
    parsers: ClassVar[Mapping[str, Callable[[str], Any]]] = {}

    def __init__(self, given: Mapping[str, Any] | None = None, environ: Mapping[str, str] | None = None) -> None:
        keywords = dict(given or {})
        environ = os.environ if environ is None else environ
        self._told_origins: Mapping[str, str] = keywords.pop("origins", {})
        config = keywords.pop("config", environ.get(CONFIG_VARIABLE, ""))
        self.notes: list[str] = []
        self.origins: dict[str, str] = {}
        self._rows = {row.name: row for row in self.table()}
        self._values = {name: row.default for name, row in self._rows.items()}
        changes = [] if is_unset(str(config)) else list(self._of_file(IniFile(path_of(str(config), "config"))))
        changes += self._of_environment(environ)
        changes += [Change(n, value, self._told_origins.get(n, KEYWORD)) for n, value in keywords.items()]
        self._take(changes)

    @staticmethod
    @abstractmethod
    def table() -> list[Any]:
        """The settings with their types, defaults, ranges and choices: rows of MPSetting."""

    @abstractmethod
    def make(self, values: Mapping[str, Any], origins: Mapping[str, str]) -> Snapshot:
        """The snapshot of these values, which have been through their parsers."""

    def check(self, settings: Snapshot, changed: Set[str]) -> None:
        """Refuse values that do not go together, or that something outside stands against.

        Raises:
            SettingError: with the reason; its place is the setting.
        """

    def settings_in(self, ini: IniFile) -> Iterator[tuple[str, str]]:
        """What the file sets: names and texts.

        Raises:
            SettingError: it has a key that there is not.
        """
        for key, text in ini.section(self.module).items():
            if key not in self._rows:
                raise ini.no_key(self.module, key, self._rows)
            yield key, text

    @classmethod
    def names(cls) -> list[str]:
        """All settings."""
        return [row.name for row in cls.table()]

    def set(self, name: str, value: Any) -> None:
        """Set one at the prompt; a value that is refused leaves everything as it was.

        Raises:
            SettingError: unknown, of the wrong type, out of range, not to be understood, or against the others.
        """
        self._take([Change(name, value, f"{self.module} set")])

    def snapshot(self) -> Snapshot:
        """The settings as they are now."""
        return self._made(self._values, self.origins)

    def shown(self, name: str) -> str:
        """A setting's value as a console and a log may show it: one line, and no secrets."""
        value = self._values[name]
        if name in self.secrets:
            return "(set)" if value else ""
        return escaped(str(value))

    def listing(self, wanted: str = "") -> list[str]:
        """A line for each setting: its value, and where that came from.

        Args:
            wanted: a name, the beginning of some, or a pattern such as `sim_*`.

        Raises:
            SettingError: there is none such.
        """
        if wanted in self._rows:
            found = [wanted]
        else:
            found = [n for n in self._rows if n.startswith(wanted) or fnmatch.fnmatchcase(n, wanted)]
        if not found:
            raise self._unknown(wanted)
        width = max(map(len, self._rows))
        return [f"{name:{width}} {self.shown(name):24} {self.origins.get(name, DEFAULT)}" for name in found]

    def _of_file(self, ini: IniFile) -> Iterator[Change]:
        for name, text in self.settings_in(ini):
            if not is_unset(text):
                yield Change(name, text, self._told_origins.get(name, str(ini.file)), f"{ini.file}: ")

    def _of_environment(self, environ: Mapping[str, str]) -> Iterator[Change]:
        for name in self._rows:
            variable = f"{self.module}_{name}".upper()
            if not is_unset(environ.get(variable, "")):
                yield Change(name, environ[variable], ENVIRONMENT, f"{variable}: ")

    def _take(self, changes: list[Change]) -> None:
        """Take all or none; of two changes of one setting the later counts, but both must be possible."""
        last = {change.name: change for change in changes}
        values, origins = dict(self._values), dict(self.origins)
        for change in changes:
            try:
                values[change.name] = self._checked(change.name, change.value)
            except SettingError as error:
                raise SettingError(f"{change.place}{error}", change.name) from error
            origins[change.name] = change.origin
        try:
            self.check(self._made(values, origins), last.keys())
        except SettingError as error:
            changed = next((last[name] for name in error.loc if name in last), None)
            raise SettingError(f"{changed.place if changed else ''}{error}", *error.loc) from error
        self._values, self.origins = values, origins

    def _checked(self, name: str, value: Any) -> Any:
        """The value as the setting's type has it, if the setting takes it."""
        row = self._rows.get(name)
        if row is None:
            raise self._unknown(name)
        try:
            typed = converted(row.type, value)
        except ValueError as error:
            raise self._not_taken(row, value) from error
        if (row.range and not row.range[0] <= typed <= row.range[1]) or (row.choice and typed not in row.choice):
            raise self._not_taken(row, value)
        try:
            self._parsed(name, typed)
        except SettingError as error:
            raise SettingError(f"{name}: {error}", name) from error
        return typed

    def _parsed(self, name: str, value: Any) -> Any:
        return self.parsers[name](value) if name in self.parsers else value

    def _made(self, values: Mapping[str, Any], origins: Mapping[str, str]) -> Snapshot:
        return self.make({name: self._parsed(name, value) for name, value in values.items()}, origins)

    def _unknown(self, name: str) -> SettingError:
        return SettingError(f"no setting {name!r}; {nearest(name, self._rows)}", name)

    def _not_taken(self, row: Any, value: Any) -> SettingError:
        limits = f" from {row.range[0]} to {row.range[1]}" if row.range else ""
        wanted = f"is one of {', '.join(row.choice)}" if row.choice else f"takes a {row.type.__name__}{limits}"
        shown = "…" if row.name in self.secrets else repr(value)
        return SettingError(f"{row.name} = {shown}: it {wanted}", row.name)
