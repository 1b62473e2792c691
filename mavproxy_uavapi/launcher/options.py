"""Command line and INI file -> one frozen `RunOptions`; one table serves both, so they cannot disagree.

The names are those of the original service, and so are the sections of the file. Unlike there the command
line wins over the file, and a missing file or a misspelt key is an error.
"""

from __future__ import annotations

import argparse
import configparser
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

from mavproxy_uavapi.launcher import values
from mavproxy_uavapi.launcher.errors import OptionError
from mavproxy_uavapi.settings import ModuleSettings, SettingError


@dataclass(frozen=True)
class RunOptions:
    """What to start. `None` and empty tuples mean "not given".

    Attributes:
        further: settings of the `uavapi` module that the file has and the command line does not know.
        gradys_config: the file, where it has a section for the module `gradys`, which reads it itself.
        origins: where each option came from: the file's name, "environment" or "command line"; none for a default.

    The others are the rows of TABLE.
    """

    port: int = 8000
    host: str = "127.0.0.1"
    sysid: int = 10
    uav_connection: str = "127.0.0.1:17171"
    connection_type: str = "udpin"
    gradys_gs: str | None = None
    scripts_path: str | None = None
    python_path: str | None = None
    vehicle: str = "copter"
    simulated: bool = False
    ardupilot_path: str | None = None
    location: str = "AbraDF"
    gs_connection: tuple[str, ...] = ()
    speedup: float = 1.0
    headless: bool = False
    log_console: tuple[str, ...] = ()
    log_path: str | None = None
    debug: tuple[str, ...] = ()
    script_logs: str | None = None
    module: tuple[str, ...] = ()
    further: tuple[tuple[str, str], ...] = ()
    gradys_config: str | None = None
    origins: Mapping[str, str] = field(default_factory=dict, compare=False)
    mavproxy_args: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """One option: its name, the section of the file it is written in, its converter and its help."""

    name: str
    section: str
    convert: Callable[[str], Any]
    help: str

    @property
    def is_switch(self) -> bool:
        """Whether the bare flag means true."""
        return self.convert is values.boolean

    @property
    def is_list(self) -> bool:
        """Whether several words may follow the flag."""
        return self.convert in (values.words, values.components)

    def read(self, text: str, where: str) -> Any:
        """The value of the text; OptionError, naming the place, where it is wrong."""
        try:
            return self.convert(text)
        except ValueError as error:
            raise OptionError(f"{where}: {error}, got {text!r}") from error


def path(text: str) -> str:
    """A path with `~` expanded; it need not exist yet."""
    return os.path.expanduser(text.strip())


_NAMES = ", ".join(name for name in values.LOG_COMPONENTS)
TABLE = (
    Row("port", "api", values.port, "TCP port of the HTTP API (8000)"),
    Row("host", "api", str.strip, "address it listens on (127.0.0.1); beyond this machine with a token only"),
    Row("sysid", "api", values.system_id, "system id of the vehicle (10); a simulated vehicle gets it"),
    Row("uav_connection", "api", str.strip, "HOST:PORT, or DEVICE[,BAUD] with usb (127.0.0.1:17171)"),
    Row("connection_type", "api", values.one_of("udpin", "udpout", "tcp", "usb"), "kind of the link (udpin)"),
    Row("gradys_gs", "api", values.host_port, "HOST:PORT of a Gradys ground station to report to"),
    Row("scripts_path", "api", path, "directory of uploaded scripts"),
    Row("python_path", "api", path, "Python that runs uploaded scripts"),
    Row("vehicle", "api", values.one_of("copter", "plane", "rover"), "what ArduPilot simulates (copter)"),
    Row("simulated", "simulated", values.boolean, "start a simulated vehicle too"),
    Row("ardupilot_path", "simulated", path, "ArduPilot to simulate with; else the embedded vehicle"),
    Row("location", "simulated", str.strip, "home: a name or lat,lon,alt,heading in deg, m AMSL (AbraDF)"),
    Row("gs_connection", "simulated", values.words, "addresses to forward MAVLink to (MAVProxy's --out)"),
    Row("speedup", "simulated", values.factor, "how many times faster than the clock to simulate (1)"),
    Row("headless", "simulated", values.boolean, "no MAVProxy prompt; so too where stdin is not a terminal"),
    Row("log_console", "logs", values.components, f"components that log to the console: {_NAMES}"),
    Row("log_path", "logs", path, "log file, beside which telemetry logs go, or the directory for both"),
    Row("debug", "logs", values.components, "components that log in detail"),
    Row("script_logs", "logs", path, "directory for the output of uploaded scripts"),
)
PREFIX = "UAVAPI_"  # of the environment variables
VARIABLES = {PREFIX + row.name.upper(): row for row in TABLE}
SECTIONS = frozenset(row.section for row in TABLE)
GRADYS = "gradys"  # a module that has a section of its own


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise OptionError(message)


def build_parser() -> argparse.ArgumentParser:
    """The command line as argparse sees it: plain texts, converted later by the table."""
    parser = _Parser(
        prog="mavproxy-uavapi",
        description="MAVProxy with an HTTP API for the vehicle and, on request, a simulated vehicle.",
        epilog="Everything after -- goes to MAVProxy as it is. The command line wins over the file.",
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument("--config", metavar="FILE", help="INI file with sections [api], [simulated], [logs]")
    parser.add_argument("--module", action="append", metavar="NAME", help="a further module; repeatable")
    for row in TABLE:
        flags = dict.fromkeys((f"--{row.name}", f"--{row.name.replace('_', '-')}"))
        shape: dict[str, Any] = {"metavar": row.name.upper()}
        if row.is_switch:
            shape = {"nargs": "?", "const": "true", "metavar": "true|false"}
        elif row.is_list:
            shape["nargs"] = "*"
        parser.add_argument(*flags, dest=row.name, help=row.help, **shape)
    return parser


def parse(argv: Sequence[str], environ: Mapping[str, str] | None = None) -> RunOptions:
    """Read the arguments, the environment (`UAVAPI_PORT` …) and the file; the former win over the latter.

    Raises:
        OptionError: a wrong option, value, file or combination; its text is one line.
    """
    arguments = list(argv)
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    given = vars(build_parser().parse_args(_southern(arguments[:cut])))
    config = given.pop("config", None)
    merged = read_ini(Path(config).expanduser()) if config is not None else {}
    origins = dict.fromkeys([*merged, *dict(merged.get("further", ()))], str(config))
    from_environment = read_environment(os.environ if environ is None else environ)
    merged.update(from_environment)
    origins.update(dict.fromkeys(from_environment, "environment"))
    merged["module"] = tuple(name for text in given.pop("module", ()) for name in _read_module(text))
    for row in TABLE:
        if row.name in given:
            raw = given[row.name]
            text = " ".join(raw) if isinstance(raw, list) else raw
            if values.is_unset(text):
                merged.pop(row.name, None)
            else:
                merged[row.name] = row.read(text, f"--{row.name}")
                origins[row.name] = "command line"
    options = RunOptions(**merged, mavproxy_args=tuple(arguments[cut + 1 :]), origins=origins)
    check(options)
    return options


def _southern(words: Sequence[str]) -> list[str]:
    """The words with `--location -35.3,149.1` as one word: argparse takes a minus for the beginning of an option."""
    joined: list[str] = []
    for word in words:
        if joined[-1:] == ["--location"] and re.match(r"-[\d.]", word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _read_module(text: str) -> tuple[str, ...]:
    try:
        return values.modules(text)
    except ValueError as error:
        raise OptionError(f"--module: {error}, got {text!r}") from error


def read_environment(environ: Mapping[str, str]) -> dict[str, Any]:
    """The values of the environment variables `UAVAPI_<NAME>`, by option name.

    Raises:
        OptionError: a value is wrong.
    """
    return {
        row.name: row.read(environ[variable], variable)
        for variable, row in VARIABLES.items()
        if not values.is_unset(environ.get(variable, ""))
    }


def read_ini(file: Path) -> dict[str, Any]:
    """The values of an INI file, by option name. A key may stand in any of the sections, as it always could.

    A section [simulated] means a simulated vehicle unless it says `simulated = false`.

    Raises:
        OptionError: the file is missing or unreadable, a section or key is unknown, a value is wrong.
    """
    # No interpolation: a `%` in a path is a `%`.
    parser = configparser.ConfigParser(interpolation=None)
    try:
        with file.open(encoding="utf-8") as stream:
            parser.read_file(stream)
    except OSError as error:
        raise OptionError(f"--config {file}: {error.strerror}") from error
    except (configparser.Error, UnicodeDecodeError) as error:
        raise OptionError(f"--config {file}: {' '.join(str(error).split())}") from error
    found: dict[str, Any] = {}
    if parser.has_section("simulated"):
        found["simulated"] = True
    if parser.has_section(GRADYS):
        found["gradys_config"] = str(file.absolute())
        parser.remove_section(GRADYS)
    for section in parser.sections():
        if section not in SECTIONS:
            raise OptionError(f"--config {file}: unknown section [{section}]")
        found.update(_read_section(file, section, parser[section]))
    further = _modules_own(file, parser)
    return {**found, "further": further} if further else found


def _read_section(file: Path, section: str, texts: Mapping[str, str]) -> dict[str, Any]:
    rows = {row.name: row for row in TABLE}
    found = {}
    for key, text in texts.items():
        if key in ModuleSettings.all_names() and key not in rows and section != "simulated":
            continue
        if key == "udp" and (values.is_unset(text) or not _read_udp(file, text)):
            continue
        if key not in rows:
            raise OptionError(f"--config {file}: unknown key {key!r} in [{section}]")
        if not values.is_unset(text):
            found[key] = rows[key].read(text, f"--config {file}: {key} in [{section}]")
    return found


def _read_udp(file: Path, text: str) -> bool:
    """The original service's switch for HTTP/3; always False.

    Raises:
        OptionError: it is on, or no switch.
    """
    if Row("udp", "api", values.boolean, "").read(text, f"--config {file}: udp"):
        raise OptionError(f"--config {file}: udp: there is no HTTP/3 here; certfile and keyfile switch to TLS")
    return False


def _modules_own(file: Path, parser: configparser.ConfigParser) -> tuple[tuple[str, str], ...]:
    """The keys that are the `uavapi` module's alone, as they are written; it checks them here already.

    Raises:
        OptionError: a value is wrong.
    """
    rows = {row.name for row in TABLE}
    own = [
        (key, text)
        for section in parser.sections()
        for key, text in parser[section].items()
        if key not in rows and key in ModuleSettings.all_names() and not values.is_unset(text)
    ]
    try:
        ModuleSettings(dict(own), environ={"UAVAPI_ALLOW_OPEN": "true"})
    except SettingError as error:
        raise OptionError(f"--config {file}: {error}") from error
    return tuple(own)


def check(options: RunOptions) -> None:
    """Refuse combinations that cannot work, before anything starts."""
    if not options.simulated:
        _check_connection(options.connection_type, options.uav_connection)
    elif options.ardupilot_path is None and options.vehicle != "copter":
        raise OptionError(f"--vehicle {options.vehicle} needs --ardupilot_path: the embedded one is a copter")
    elif options.ardupilot_path is not None and options.speedup != int(options.speedup):
        raise OptionError(f"--speedup: ArduPilot takes whole numbers only, got {options.speedup:g}")


def _check_connection(kind: str, connection: str) -> None:
    if kind != "usb":
        try:
            values.host_port(connection)
        except ValueError as error:
            raise OptionError(f"--uav_connection: {error} with {kind}, got {connection!r}") from error
    elif not re.fullmatch(r"[^,\s]+(,\d+)?", connection):
        raise OptionError(f"--uav_connection: expected DEVICE or DEVICE,BAUD with usb, got {connection!r}")
