"""Command line and INI file -> one frozen `RunOptions`; one table serves both, so that they agree.

Names and sections of the file are those of the original service. Unlike there, the command line wins over the file,
and a missing file or a misspelt key is an error.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NoReturn

from mavproxy_uavapi import __version__
from mavproxy_uavapi.core import logs
from mavproxy_uavapi.core.errors import SettingError, UavApiError
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.core.settings import CONFIG_VARIABLE, ENVIRONMENT
from mavproxy_uavapi.core.values import boolean, is_unset, words
from mavproxy_uavapi.launcher import values
from mavproxy_uavapi.launcher.errors import OptionError
from mavproxy_uavapi.settings import SECTIONS, ApiModuleSettings
from mavproxy_vision import opencv_install

HIGHEST_SYSTEM = 255


@dataclass(frozen=True)
class Row:
    """One option: its name, its converter and its help."""

    name: str
    convert: Callable[[str], Any]
    help: str

    @property
    def is_switch(self) -> bool:
        """Whether the bare flag means true."""
        return self.convert is boolean

    @property
    def is_list(self) -> bool:
        """Whether several words may follow the flag."""
        return self.convert in (words, values.components)

    def read(self, text: str, place: str) -> Any:
        """The value of the text; raises OptionError, which names the place, if it is wrong."""
        try:
            return self.convert(text)
        except ValueError as error:
            raise OptionError(f"{place}: {error}, got {text!r}") from error


def path(text: str) -> str:
    """A path with `~` expanded; it need not exist yet."""
    return os.path.expanduser(text.strip())


def option(default: Any, convert: Callable[[str], Any], help: str) -> Any:
    """A field of `RunOptions` that is a row of TABLE."""
    return field(default=default, metadata={"row": (convert, help)})


# Some are settings of the module `uavapi`, too. Their help and errors are the command line's own, and so is the
# default of `sysid`, the original service's: simulated vehicles need one, and the module takes the current vehicle.
@dataclass(frozen=True)
class RunOptions:
    """What to start. `None` and empty tuples mean "not given".

    Attributes:
        further: settings of the `uavapi` module in the file that are not options of the command line.
        vision_config, gradys_config: the file, if it has a section for that module; the module reads it itself.
        vehicle_args: further arguments of the embedded vehicle.
        origins: the source of each option: the file's name, "environment" or "command line"; absent for a default.

    The others are options, each with its row of TABLE.
    """

    port: int = option(8000, values.port, "TCP port of the HTTP API (8000)")
    host: str = option(
        "127.0.0.1", str.strip, "address it listens on (127.0.0.1); beyond this machine with a token only"
    )
    sysid: int = option(10, values.system_id, "system id of the vehicle (10); a simulated vehicle gets it")
    uav_connection: str = option(
        "127.0.0.1:17171", str.strip, "HOST:PORT, or DEVICE[,BAUD] with usb (127.0.0.1:17171)"
    )
    connection_type: str = option("udpin", values.one_of("udpin", "udpout", "tcp", "usb"), "kind of the link (udpin)")
    gradys_gs: str | None = option(None, values.host_port, "HOST:PORT of a Gradys ground station to report to")
    scripts_path: str | None = option(None, path, "directory of uploaded scripts")
    python_path: str | None = option(None, path, "Python that runs uploaded scripts")
    vehicle: str = option("copter", values.one_of(*values.VEHICLES), "type of the simulated vehicle (copter)")
    simulated: bool = option(False, boolean, "also start a simulated vehicle")
    count: int = option(1, values.count, "how many vehicles to simulate (1), with system ids from sysid on")
    vehicles: tuple[tuple[str, int], ...] = option(
        (), values.vehicles, "their types and numbers, instead of vehicle and count: copter:8,rover:2"
    )
    spacing: float = option(5.0, values.distance, "m from one to the next, in a row to the east (5)")
    ardupilot_path: str | None = option(None, path, "ArduPilot to simulate with; else the embedded vehicle")
    location: str = option("AbraDF", str.strip, "home: a name or lat,lon,alt,heading in deg, m AMSL (AbraDF)")
    gs_connection: tuple[str, ...] = option((), words, "addresses to forward MAVLink to (MAVProxy's --out)")
    speedup: float = option(1.0, values.factor, "how many times faster than real time to simulate (1)")
    battery: float = option(0.0, values.factor, "mAh of the embedded vehicle's battery; else it never becomes empty")
    firmware: str = option("", values.one_of("4.6", "4.7"), "whose parameters the embedded vehicle has (4.7)")
    replay: str | None = option(
        None, path, "play the file of a flight (.mcap) instead; nothing can be commanded then"
    )
    headless: bool = option(False, boolean, "no MAVProxy prompt; so too where stdin is not a terminal")
    log_console: tuple[str, ...] = option(
        (), values.components, f"components that log to the console: {', '.join(logs.NAMES)}"
    )
    log_path: str | None = option(None, path, "log file, beside which telemetry logs go, or the directory for both")
    debug: tuple[str, ...] = option((), values.components, "components that log in detail")
    script_logs: str | None = option(None, path, "directory for the output of uploaded scripts")
    root_dir: str | None = option(
        None, path, "directory in which scripts/ and logs/ are, unless other options say where"
    )
    mavlink_streamrate: int | None = option(
        None, values.stream_rate, "Hz of telemetry, asked of the autopilot (MAVProxy's 4)"
    )
    certfile: str | None = option(None, path, "TLS certificate (PEM): the API is https")
    keyfile: str | None = option(None, path, "TLS key (PEM)")
    udp: bool = option(False, boolean, "HTTP/3, which is not there; false is taken")
    terminal: str = option("", str.strip, "taken, and not used: nothing opens a window")
    module: tuple[str, ...] = ()
    further: tuple[tuple[str, str], ...] = ()
    vision_config: str | None = None
    gradys_config: str | None = None
    origins: Mapping[str, str] = field(default_factory=dict, compare=False)
    mavproxy_args: tuple[str, ...] = ()
    vehicle_args: tuple[str, ...] = ()


TABLE = tuple(Row(one.name, *one.metadata["row"]) for one in fields(RunOptions) if one.metadata)
VARIABLES = {f"UAVAPI_{row.name.upper()}": row for row in TABLE}


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise OptionError(message)


def build_parser() -> argparse.ArgumentParser:
    """The command line for argparse: plain texts, which the table converts later."""
    parser = _Parser(
        prog="mavproxy-uavapi",
        description="MAVProxy with an HTTP API for the vehicle and, on request, a simulated vehicle.",
        epilog="Everything after -- goes to MAVProxy unchanged. The command line wins over the file. As the first "
        "word run, flights, setup, token are commands with a --help each; uav_api's start changes nothing, and its "
        "setup-sitl says how to fly a built ArduPilot.",
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    parser.add_argument(
        "--config", metavar="FILE", help="INI file with sections [api], [simulated], [logs], [vision], [gradys]"
    )
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
    """Read the arguments, the environment (`UAVAPI_PORT` …) and the file, in this order of precedence.

    `UAVAPI_CONFIG` names the file if no argument does.

    Raises:
        OptionError: a wrong option, value, file or combination; its text is one line.
    """
    arguments = list(argv)
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    arguments_by_name = vars(build_parser().parse_args(_southern(arguments[:cut])))
    environ = os.environ if environ is None else environ
    config = arguments_by_name.pop("config", None) or environ.get(CONFIG_VARIABLE, "")
    merged = {} if is_unset(config) else read_ini(Path(path(config)), environ)
    origins = dict.fromkeys([*merged, *dict(merged.get("further", ()))], config)
    from_environment = read_environment(environ)
    merged.update(from_environment)
    origins.update(dict.fromkeys(from_environment, ENVIRONMENT))
    merged["module"] = tuple(name for text in arguments_by_name.pop("module", ()) for name in _read_module(text))
    for row in TABLE:
        if row.name in arguments_by_name:
            raw = arguments_by_name[row.name]
            text = " ".join(raw) if isinstance(raw, list) else raw
            if is_unset(text):
                merged.pop(row.name, None)
            else:
                merged[row.name] = row.read(text, f"--{row.name}")
                origins[row.name] = "command line"
    merged = {**_below_root(merged), **merged}
    if "replay" in merged:
        merged = {**merged, **_of_replay(merged)}
    options = RunOptions(**merged, mavproxy_args=tuple(arguments[cut + 1 :]), origins=origins)
    check(options)
    return options


def _below_root(given: Mapping[str, Any]) -> dict[str, str]:
    """The files and directories below `root_dir`, if it is given, as the original service lays them out."""
    if "root_dir" not in given:
        return {}
    logs_dir = os.path.join(given["root_dir"], "logs")
    return {
        "scripts_path": os.path.join(given["root_dir"], "scripts"),
        "script_logs": os.path.join(logs_dir, "script_logs"),
        "log_path": os.path.join(logs_dir, "uav_logs", f"uav_{given.get('sysid', RunOptions.sysid)}.log"),
    }


def _of_replay(given: Mapping[str, Any]) -> dict[str, Any]:
    """What the file of a flight decides: it is one link, with the vehicles that it has.

    Raises:
        OptionError: it is no such file.
    """
    from mavproxy_uavapi.flights.replay_feed import vehicles_in  # noqa: PLC0415  it imports MAVLink's dialect

    if given.get("ardupilot_path") or given.get("vehicles"):
        raise OptionError("--replay plays a record: without ardupilot_path and vehicles")
    try:
        systems = vehicles_in(Path(given["replay"]))
    except (OSError, UavApiError) as error:
        raise OptionError(f"--replay: {error}") from error
    return {"simulated": True, "count": 1, "sysid": given["sysid"] if given.get("sysid") in systems else systems[0]}


def _southern(words: Sequence[str]) -> list[str]:
    """The words with `--location -35.3,149.1` as one word, because argparse takes a minus for an option."""
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
        if not is_unset(environ.get(variable, ""))
    }


def read_ini(file: Path, environ: Mapping[str, str]) -> dict[str, Any]:
    """The values of an INI file, by option name. A key may stand in any of our sections, as in the original service.

    A section [simulated] means a simulated vehicle unless it says `simulated = false`. The modules' sections are
    already checked here, together with `environ`.

    Raises:
        OptionError: the file is missing or unreadable, a section or key is unknown, a value is wrong, or the module
        of a section cannot be imported.
    """
    try:
        ini = IniFile(file)
        values_by_name: dict[str, Any] = {"simulated": True} if "simulated" in ini.sections else {}
        for section in SECTIONS:
            values_by_name.update(_read_section(ini, section))
        further = _modules_own(ini)
    except SettingError as error:
        raise OptionError(f"--config {error}") from error
    if further:
        values_by_name["further"] = further
    return {**values_by_name, **_modules_configs(ini, environ)}


def _modules_configs(ini: IniFile, environ: Mapping[str, str]) -> dict[str, str]:
    """The file by option name, for each module that has a section in it."""
    configs = {}
    for name, check_module in MODULES.items():
        if name in ini.sections:
            try:
                check_module({"config": str(ini.file)}, environ)
            except SettingError as error:
                raise OptionError(str(error)) from error
            configs[f"{name}_config"] = str(ini.file.absolute())
    return configs


def _read_section(ini: IniFile, section: str) -> dict[str, Any]:
    rows = {row.name: row for row in TABLE}
    further = [name for name in ApiModuleSettings.names() if name not in rows]
    section_values = {}
    for key, text in ini.section(section).items():
        if key in further:
            continue
        if key not in rows:
            raise ini.no_key(section, key, [*rows, *further])
        if not is_unset(text):
            section_values[key] = rows[key].read(text, f"--config {ini.file}: {key} in [{section}]")
    return section_values


def _modules_own(ini: IniFile) -> tuple[tuple[str, str], ...]:
    """The keys that only the `uavapi` module has, unchanged; they are already checked here.

    Raises:
        SettingError: a value is wrong.
    """
    rows = {row.name for row in TABLE}
    keys = [
        (key, text)
        for section in SECTIONS
        for key, text in ini.section(section).items()
        if key not in rows and key in ApiModuleSettings.names() and not is_unset(text)
    ]
    try:
        ApiModuleSettings(dict(keys), environ={"UAVAPI_ALLOW_OPEN": "true"})
    except SettingError as error:
        raise SettingError(f"{ini.file}: {error}") from error
    return tuple(keys)


def _check_vision(option_values: Mapping[str, Any], environ: Mapping[str, str]) -> None:
    problem = opencv_install.problem()
    if problem is not None:
        raise SettingError(f"{option_values['config']}: [vision]: {problem}")
    from mavproxy_vision.settings import VisionModuleSettings  # noqa: PLC0415  it imports OpenCV

    VisionModuleSettings(option_values, environ)


def _check_gradys(option_values: Mapping[str, Any], environ: Mapping[str, str]) -> None:
    from mavproxy_gradys.settings import GradysModuleSettings  # noqa: PLC0415  a slow import, only if needed

    GradysModuleSettings(option_values, environ)


# The modules that read their own section of the file.
MODULES: Mapping[str, Callable[[Mapping[str, Any], Mapping[str, str]], None]] = {
    "vision": _check_vision,
    "gradys": _check_gradys,
}


def check(options: RunOptions) -> None:
    """Refuse what cannot work, before anything starts."""
    if options.udp:
        raise OptionError("--udp: there is no HTTP/3 here, only HTTP/1.1; certfile and keyfile switch to TLS")
    if bool(options.certfile) != bool(options.keyfile):
        raise OptionError("TLS needs both certfile and keyfile")
    if not options.simulated:
        _check_connection(options.connection_type, options.uav_connection)
    elif options.sysid + _number_of_vehicles(options) - 1 > HIGHEST_SYSTEM:
        raise OptionError(f"--count: system ids end at {HIGHEST_SYSTEM}, and these begin at {options.sysid}")
    elif options.ardupilot_path is not None and options.speedup != int(options.speedup):
        raise OptionError(f"--speedup: ArduPilot takes whole numbers only, got {options.speedup:g}")
    elif options.ardupilot_path is not None and options.battery:
        raise OptionError("--battery is for the embedded vehicle; ArduPilot has the parameter SIM_BATT_CAP_AH")
    elif options.ardupilot_path is not None and options.firmware:
        raise OptionError("--firmware is for the embedded vehicle; ArduPilot's is that of --ardupilot_path")


def _number_of_vehicles(options: RunOptions) -> int:
    return sum(number for _, number in options.vehicles) or options.count


def _check_connection(kind: str, connection: str) -> None:
    if kind != "usb":
        try:
            values.host_port(connection)
        except ValueError as error:
            raise OptionError(f"--uav_connection: {error} with {kind}, got {connection!r}") from error
    elif connection == RunOptions().uav_connection or re.fullmatch(r"[^/]*:\d+", connection):
        raise OptionError(f"--uav_connection: usb needs the DEVICE, such as /dev/ttyACM0,115200; got {connection!r}")
    elif not re.fullmatch(r"[^,\s]+(,\d+)?", connection):
        raise OptionError(f"--uav_connection: expected DEVICE or DEVICE,BAUD with usb, got {connection!r}")
