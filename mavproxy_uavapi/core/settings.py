"""The settings of our MAVProxy modules: one base for all three, and a snapshot for the code that uses them.

Defaults < INI file < environment < keywords of `module load` < `set` at the prompt.
"""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Generic, TypeVar, cast

from MAVProxy.modules.lib.mp_settings import MPSetting

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.core.text import escaped, nearest
from mavproxy_uavapi.core.values import converted, is_unset, path_of

CONFIG_VARIABLE = "UAVAPI_CONFIG"  # names the INI file where no keyword `config` does
DEFAULT = "default"  # the origin of a value that was never set
ENVIRONMENT = "environment"
KEYWORD = "module load"
TRUTHS = ["true", "false"]
UNITS = ("s", "m", "kB", "MB", "requests/s")  # the first word of a meaning, where a setting has one
TYPE_NAMES = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}

Snapshot = TypeVar("Snapshot")


def setting(kind: type, default: Any, meaning: str, **more: Any) -> Any:
    """A field of a snapshot that is a setting, too; the arguments of its MPSetting."""
    return field(metadata={"row": (kind, default, meaning), "more": more})


@dataclass(frozen=True)
class Change:
    """A value for a setting.

    Attributes:
        origin: where it comes from, as the listing shows it.
        place: the beginning of an error about it.
        in_file: whether an INI file has it.
    """

    name: str
    value: Any
    origin: str
    place: str = ""
    in_file: bool = False


class ModuleSettings(Generic[Snapshot]):
    """The settings of a loaded module, validated for every source.

    MPSettings is not used: it accepts NaN, and prints its own lines about values that it refuses.

    Attributes:
        module: its name, also of the INI file's section; in capitals it begins the environment variables.
        snapshot_class: the dataclass of a snapshot; its fields are made by `setting`.
        secrets: settings whose values errors and listings do not show.
        parsers: make the snapshot's value of a setting that is written as text; they raise SettingError.
        notes: remarks about the INI file for the prompt, a line each.
        origins: the source of each setting's value, for settings that were set.

    Args:
        keywords: of `module load`. `config` names an INI file, and `origins` says by setting where the launcher
            has the others from.
        environ: the environment; None for this process's.

    Raises:
        SettingError: an unknown setting, or a value that is refused, alone or together with the others.
    """

    module: ClassVar[str]
    snapshot_class: ClassVar[type]
    secrets: ClassVar[Set[str]] = frozenset()
    parsers: ClassVar[Mapping[str, Callable[[str], Any]]] = {}

    def __init__(self, keywords: Mapping[str, Any] | None = None, environ: Mapping[str, str] | None = None) -> None:
        given_settings = dict(keywords or {})
        environ = os.environ if environ is None else environ
        self._given_origins: Mapping[str, str] = given_settings.pop("origins", {})
        config = given_settings.pop("config", environ.get(CONFIG_VARIABLE, ""))
        self.notes: list[str] = []
        self.origins: dict[str, str] = {}
        self._rows = {row.name: row for row in self.table()}
        self._values = {name: row.default for name, row in self._rows.items()}
        changes = [] if is_unset(str(config)) else list(self._of_file(IniFile(path_of(str(config), "config"))))
        changes += self._of_environment(environ)
        changes += [Change(n, value, self._given_origins.get(n, KEYWORD)) for n, value in given_settings.items()]
        self._take(changes)

    @classmethod
    def table(cls) -> list[Any]:
        """The settings with their types, defaults, ranges and choices: rows of MPSetting."""
        rows = [(one.name, one.metadata) for one in fields(cls.snapshot_class) if one.metadata]
        return [MPSetting(name, *of["row"], **of["more"]) for name, of in rows]

    def make(self, values: Mapping[str, Any], origins: Mapping[str, str]) -> Snapshot:
        """The snapshot of these values, which the parsers have converted."""
        return cast("Snapshot", self.snapshot_class(**values))

    def check(self, settings: Snapshot, changed: Set[str]) -> None:
        """Refuse values that do not fit together, or that this machine cannot use.

        Raises:
            SettingError: with the reason; its place is the setting.
        """

    def check_source(self, name: str, value: Any, in_file: bool) -> None:
        """Refuse a valid value because of where it comes from: an INI file, or another source.

        Raises:
            SettingError: with the reason.
        """

    def settings_in(self, ini: IniFile) -> Iterator[tuple[str, str]]:
        """The names and texts that the file sets.

        Raises:
            SettingError: it has an unknown key.
        """
        for key, text in ini.section(self.module).items():
            if key not in self._rows:
                raise ini.no_key(self.module, key, self._rows)
            yield key, text

    @classmethod
    def names(cls) -> list[str]:
        """All settings."""
        return [row.name for row in cls.table()]

    @classmethod
    def value_completions(cls) -> list[str]:
        """Rules for tab completion of the values that are one of some words."""
        words = {row.name: TRUTHS if row.type is bool else row.choice for row in cls.table()}
        return [f"set {name} <{'|'.join(some)}>" for name, some in words.items() if some]

    def set(self, name: str, value: Any) -> None:
        """Set one at the prompt; a refused value changes nothing.

        Raises:
            SettingError: unknown, of the wrong type, out of range, unreadable, or in conflict with the others.
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

    def listing(self, pattern: str = "") -> list[str]:
        """A line for each setting: its value and the value's origin. A single setting also has its meaning.

        Args:
            pattern: a name, the beginning of names, or a pattern such as `sim_*`.

        Raises:
            SettingError: no setting matches.
        """
        if pattern in self._rows:
            names = [pattern]
        else:
            names = [n for n in self._rows if n.startswith(pattern) or fnmatch.fnmatchcase(n, pattern)]
        if not names:
            raise self._unknown(pattern)
        width = max(map(len, self._rows))
        lines = [f"{name:{width}} {self.shown(name):24} {self.origins.get(name, DEFAULT)}" for name in names]
        return [*lines, f"  {self._meaning(self._rows[pattern])}"] if pattern in self._rows else lines

    def reports(self) -> list[dict[str, Any]]:
        """Each setting as an answer has it: name, value, meaning, unit, what it accepts, default and origin."""
        return [self._report(row) for row in self._rows.values()]

    def _report(self, row: Any) -> dict[str, Any]:
        secret, word = row.name in self.secrets, row.label.partition(" ")[0]
        value, shown = self._values[row.name], self.shown(row.name)
        return {
            "name": row.name,
            "value": value if shown == escaped(str(value)) else shown,
            "meaning": row.label,
            "unit": word if word in UNITS else "",
            "accepts": _accepted(row),
            "choices": TRUTHS if row.type is bool else list(row.choice or ()),
            "default": "" if secret else row.default,
            "origin": self.origins.get(row.name, DEFAULT),
        }

    def _meaning(self, row: Any) -> str:
        """Meaning, unit, accepted values and default of a setting."""
        default = "(set)" if row.name in self.secrets and row.default else row.default
        return f"{row.label}: {_accepted(row)}; default {'empty' if default == '' else default}"

    def _of_file(self, ini: IniFile) -> Iterator[Change]:
        for name, text in self.settings_in(ini):
            if not is_unset(text):
                yield Change(name, text, self._given_origins.get(name, str(ini.file)), f"{ini.file}: ", True)

    def _of_environment(self, environ: Mapping[str, str]) -> Iterator[Change]:
        for name in self._rows:
            variable = f"{self.module}_{name}".upper()
            if not is_unset(environ.get(variable, "")):
                yield Change(name, environ[variable], ENVIRONMENT, f"{variable}: ")

    def _take(self, changes: list[Change]) -> None:
        """Take all or none. Of two changes of one setting the later one counts, but both must be valid."""
        last = {change.name: change for change in changes}
        values, origins = dict(self._values), dict(self.origins)
        for change in changes:
            try:
                values[change.name] = self._checked(change.name, change.value)
                self.check_source(change.name, values[change.name], change.in_file)
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
        """The value in the setting's type, if the setting accepts it."""
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
        shown = "…" if row.name in self.secrets else repr(value)
        verb = "is" if row.choice else "takes"
        return SettingError(f"{row.name} = {shown}: it {verb} {_accepted(row)}", row.name)


def _accepted(row: Any) -> str:
    limits = f" from {row.range[0]} to {row.range[1]}" if row.range else ""
    return f"one of {', '.join(row.choice)}" if row.choice else f"{TYPE_NAMES[row.type]}{limits}"
