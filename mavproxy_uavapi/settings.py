"""The module's settings: one table; defaults < INI file < environment < `module load` < `uavapi set`.

MPSettings holds and validates the values at the prompt; inward goes one frozen snapshot.
"""

from __future__ import annotations

import configparser
import difflib
import ipaddress
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from MAVProxy.modules.lib.mp_settings import MPSetting, MPSettings

from mavproxy_uavapi.core.logs import components

Network = ipaddress.IPv4Network | ipaddress.IPv6Network

# Keys that an INI file of the original service, or of the launcher, may have and that are not the module's,
# with the reason; a line tells of each.
LAUNCHERS = "`mavproxy-uavapi --config` starts simulated vehicles"
NOT_OURS: dict[str, dict[str, str]] = {
    "api": {
        "uav_connection": "MAVProxy has the link (--master)",
        "connection_type": "MAVProxy has the link (--master)",
        "gradys_gs": "the module gradys reads it from here (`module load gradys`, with this file as its config)",
        "vehicle": "the vehicle tells its type itself",
        "udp": "there is no HTTP/3",
    },
    "simulated": {
        "simulated": LAUNCHERS,
        "ardupilot_path": LAUNCHERS,
        "location": LAUNCHERS,
        "speedup": LAUNCHERS,
        "headless": LAUNCHERS,
        "gs_connection": "MAVProxy forwards to ground stations (--out)",
    },
    "logs": {},
}
NEIGHBOURS = {"gradys", "vision"}  # sections of the other modules, in a file that serves all
# What an API takes up by listening anew: its address, its vehicle, and who may call.
ACCESS = ("token", "allow_from", "allow_scripts_from", "allow_open", "cors_origins")
LISTENING = ("host", "port", "sysid", "certfile", "keyfile", *ACCESS)
UNSET = {"", "None", "[]"}
PREFIX = "UAVAPI_"  # of the environment variables
DEFAULT = "default"  # where a value came from that nobody set
ON_SCRIPT_EXIT = ("nothing", "hold", "land", "rtl")
SECRET = "token"  # kept out of listings, logs and the process list


class SettingError(ValueError):
    """A setting that does not exist, or a value that it does not take; the text is one clear line."""


@dataclass(frozen=True)
class Settings:
    """A snapshot of the settings.

    Attributes:
        host: address to listen on.
        port: TCP port to listen on.
        sysid: system id of the vehicle that the API flies; 0 is MAVProxy's current one.
        link_timeout: s without a heartbeat after which a vehicle counts as lost.
        max_age: s after which telemetry is no longer served.
        on_disconnect: what the vehicle does when the client of a waiting verb hangs up: continue or hold.
        allow_from: networks that may call without a token.
        allow_scripts_from: networks among these that may run scripts, too.
        allow_open: whether anybody may call without a token, from anywhere.
        cors_origins: origins of the web pages that may call.
        certfile, keyfile: PEM files for TLS; empty for none.
        max_jobs: verbs that may be in flight at once.
        max_connections: connections that may be open at once.
        max_rate: requests per second of one caller, in the long run.
        local_rate: the same on the loopback, where there is no limit (0) unless `max_rate` was set.
        scripts_path: folder of the uploaded scripts.
        script_logs: folder of their logs.
        python_path: what runs .py scripts.
        script_grace: s from Ctrl-C to the kill of a script that is stopped.
        script_size: kB of one script.
        script_quota: MB of all scripts together.
        on_script_exit: what the vehicle does when its script dies in flight: nothing, hold, land or rtl.
        log_console, debug: components (COPTER, API, GRADYS_GS, SCRIPT) that log to the console, in detail.
        log_path: the log file, or its folder; empty for none.
        token: what clients must send as a bearer token; empty for none.
    """

    host: str
    port: int
    sysid: int
    link_timeout: float
    max_age: float
    on_disconnect: str
    allow_from: tuple[Network, ...]
    allow_scripts_from: tuple[Network, ...]
    allow_open: bool
    cors_origins: tuple[str, ...]
    certfile: str
    keyfile: str
    max_jobs: int
    max_connections: int
    max_rate: float
    local_rate: float
    scripts_path: str
    script_logs: str
    python_path: str
    script_grace: float
    script_size: int
    script_quota: int
    on_script_exit: str
    log_console: frozenset[str]
    log_path: str
    debug: frozenset[str]
    token: str

    @property
    def is_local(self) -> bool:
        """Whether only this machine can call."""
        return is_loopback(self.host)

    def listens_as(self, other: Settings) -> bool:
        """Whether an API that runs by the other ones can take these up as it runs."""
        return all(getattr(self, name) == getattr(other, name) for name in LISTENING)

    def check(self) -> None:
        """Refuse combinations that would let anybody fly the vehicle, or that cannot work.

        Raises:
            SettingError: with the reason.
        """
        if not self.is_local and not (self.token or self.allow_from or self.allow_open):
            raise SettingError(
                f"host = {self.host}: anybody on that network could fly the vehicle; set a token, or name the "
                "networks that may call without one (allow_from), or set allow_open on purpose"
            )
        if bool(self.certfile) != bool(self.keyfile):
            raise SettingError("TLS needs both certfile and keyfile")


def table() -> list[Any]:
    """The settings with their types, defaults and ranges, as MAVProxy knows them."""
    return [
        MPSetting("host", str, "127.0.0.1", "address to listen on", tab="API"),
        MPSetting("port", int, 8000, "TCP port to listen on", range=(1, 65535), increment=1),
        MPSetting("sysid", int, 0, "vehicle to fly; 0 is MAVProxy's current one", range=(0, 255), increment=1),
        MPSetting("link_timeout", float, 5.0, "s without heartbeat until the link is lost", range=(1, 60)),
        MPSetting("max_age", float, 5.0, "s after which telemetry is stale", range=(0.1, 3600)),
        MPSetting("on_disconnect", str, "continue", "when a client hangs up", choice=["continue", "hold"]),
        MPSetting("allow_from", str, "", "networks that may call without a token", tab="Access"),
        MPSetting("allow_scripts_from", str, "", "networks among these that may run scripts, too"),
        MPSetting("allow_open", bool, False, "let anybody call without a token"),
        MPSetting("cors_origins", str, "", "origins of web pages that may call"),
        MPSetting("certfile", str, "", "TLS certificate (PEM)"),
        MPSetting("keyfile", str, "", "TLS key (PEM)"),
        MPSetting("max_jobs", int, 64, "verbs in flight at once", range=(1, 10000), tab="Limits"),
        MPSetting("max_connections", int, 200, "connections open at once", range=(32, 900)),
        MPSetting("max_rate", float, 500.0, "requests/s of one caller", range=(1, 100000)),
        MPSetting("log_console", str, "", "components that log to the console", tab="Logs"),
        MPSetting("log_path", str, "", "log file, or its folder"),
        MPSetting("debug", str, "", "components that log in detail"),
        MPSetting("scripts_path", str, "~/uav_scripts", "folder of the uploaded scripts", tab="Scripts"),
        MPSetting("script_logs", str, "~/uav_scripts/logs", "folder of their logs"),
        MPSetting("python_path", str, sys.executable, "what runs .py scripts"),
        MPSetting("script_grace", float, 10.0, "s from Ctrl-C to the kill", range=(0, 3600)),
        MPSetting("script_size", int, 1024, "kB of one script", range=(1, 100000)),
        MPSetting("script_quota", int, 50, "MB of all scripts", range=(1, 100000)),
        MPSetting("on_script_exit", str, "hold", "when a script dies in flight", choice=list(ON_SCRIPT_EXIT)),
    ]


class ModuleSettings:
    """The settings of the loaded module: validated, whichever way they come in.

    Args:
        given: keywords of `module load`; `config` names an INI file, and `origins` tells by setting where the
            launcher had the others from.
        environ: the environment.

    Raises:
        SettingError: as `set` and `load`.
    """

    def __init__(self, given: Mapping[str, Any] | None = None, environ: Mapping[str, str] | None = None) -> None:
        self.mp = MPSettings(table())
        self.origins: dict[str, str] = {}
        self.notes: list[str] = []
        self._token = ""
        given = dict(given or {})
        config = given.pop("config", None)
        self._told_origins: Mapping[str, str] = given.pop("origins", {})
        if config is not None:
            self.load(Path(str(config)).expanduser())
        for name in self.names():
            value = (os.environ if environ is None else environ).get(PREFIX + name.upper())
            if value is not None:
                self._take(name, value, "environment")
        for name, value in given.items():
            self._take(name, value, self._told_origins.get(name, "module load"))
        self.snapshot().check()

    def names(self) -> list[str]:
        """All settings, the secret one too."""
        return self.all_names()

    @staticmethod
    def all_names() -> list[str]:
        """All settings, the secret one too."""
        return [*(setting.name for setting in table()), SECRET]

    def load(self, file: Path) -> None:
        """Read an INI file: section [api] has the settings, by their names.

        Raises:
            SettingError: it cannot be read, or has a key or a value that means nothing.
        """
        parser = configparser.ConfigParser(interpolation=None)
        try:
            with file.open(encoding="utf-8") as stream:
                parser.read_file(stream)
        except OSError as error:
            raise SettingError(f"{file}: {error.strerror}") from error
        except (configparser.Error, UnicodeDecodeError) as error:
            raise SettingError(f"{file}: {' '.join(str(error).split())}") from error
        for section in parser.sections():
            if section in NEIGHBOURS:
                continue
            if section not in NOT_OURS:
                raise SettingError(f"{file}: no section [{section}]; there are {', '.join(NOT_OURS)}")
            for name, value in parser[section].items():
                self._take_key(file, section, name, value)

    def _take_key(self, file: Path, section: str, name: str, value: str) -> None:
        if value in UNSET:
            return
        why_not = NOT_OURS[section].get(name)
        if why_not is not None:
            self.notes.append(f"{file}: {name} is ignored here, {why_not}")
        else:
            if section == "simulated" or name not in self.names():
                raise SettingError(f"{file}: no key {name!r} in [{section}]{self._hint(name)}")
            self._take(name, value, self._told_origins.get(name, str(file)))

    def set(self, name: str, value: Any) -> None:
        """Set one at the prompt; a value that must not be leaves everything as it was.

        Raises:
            SettingError: unknown, of the wrong type, out of range, or against the others.
        """
        before = self._token if name == SECRET else self.mp.get(name) if name in self.mp.list() else None
        origin = self.origins.get(name, DEFAULT)
        self._take(name, value, "uavapi set")
        try:
            self.snapshot().check()
        except SettingError:
            self._take(name, before, origin)
            raise

    def _take(self, name: str, value: Any, origin: str) -> None:
        if name == SECRET:
            self._token = "" if str(value) in UNSET else str(value)
        elif name not in self.mp.list():
            raise SettingError(f"no setting {name!r}{self._hint(name)}")
        else:
            _parse(name, value)
            # MPSettings would print lines of its own about a value that it does not take.
            if not _is_taken(self.mp.get_setting(name), value) or not self.mp.set(name, value):
                raise SettingError(f"{name} = {value!r}: {self._wanted(name)}")
        self.origins[name] = origin

    def _hint(self, name: str) -> str:
        near = difflib.get_close_matches(name, self.names(), n=1)
        return f"; did you mean {near[0]}?" if near else f"; there are {', '.join(self.names())}"

    def _wanted(self, name: str) -> str:
        setting = self.mp.get_setting(name)
        if setting.choice:
            return f"it is one of {', '.join(setting.choice)}"
        limits = f" from {setting.range[0]} to {setting.range[1]}" if setting.range else ""
        return f"it takes a {setting.type.__name__}{limits}"

    def snapshot(self) -> Settings:
        """The settings as they are now."""
        values = {name: _parse(name, self.mp.get(name)) for name in self.mp.list()}
        is_set = self.origins.get("max_rate", DEFAULT) != DEFAULT
        return Settings(**values, local_rate=values["max_rate"] if is_set else 0.0, token=self._token)

    def listing(self) -> list[str]:
        """A line for each setting: its value and where that came from; the token is not shown."""
        shown = {name: self.mp.get(name) for name in self.mp.list()}
        shown[SECRET] = "(set)" if self._token else ""
        return [f"{name:14} {shown[name]!s:24} {self.origins.get(name, DEFAULT)}" for name in self.names()]


def _parse(name: str, value: Any) -> Any:
    """The value as the snapshot has it.

    Raises:
        SettingError: it is no such thing.
    """
    if name == "host":
        is_loopback(str(value))
    if name in ("allow_from", "allow_scripts_from"):
        return tuple(_network(name, word) for word in _words(value))
    if name in ("log_console", "debug"):
        try:
            return components(str(value))
        except ValueError as error:
            raise SettingError(f"{name}: {error}") from error
    if name == "cors_origins":
        return tuple(_words(value))
    return value


def _is_taken(setting: Any, value: Any) -> bool:
    """Whether an MPSetting takes `value`; NaN and None are in no range, whatever a comparison says."""
    if setting.type is bool:
        return str(value).lower() in ("1", "true", "yes", "0", "false", "no")
    if setting.choice is not None:
        return value in setting.choice
    try:
        number = setting.type(value)
    except (TypeError, ValueError):
        return False
    if setting.range is None:
        return value is not None
    low, high = setting.range
    return bool(low <= number <= high)


def _words(value: Any) -> list[str]:
    return [word for word in str(value).strip("[]").replace(",", " ").split() if word not in UNSET]


def _network(name: str, text: str) -> Network:
    try:
        return ipaddress.ip_network(text, strict=False)
    except ValueError as error:
        raise SettingError(f"{name}: {text!r} is no network such as 192.168.1.0/24") from error


def is_loopback(host: str) -> bool:
    """Whether an address is of this machine alone.

    Raises:
        SettingError: it is no IP address.
    """
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError as error:
        raise SettingError(f"host = {host!r} is not an IP address") from error
