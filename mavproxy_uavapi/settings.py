"""The module's settings: MPSettings at the prompt -> one frozen snapshot handed inward."""

from __future__ import annotations

import configparser
import difflib
import ipaddress
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from MAVProxy.modules.lib.mp_settings import MPSetting, MPSettings

# Keys that an INI file of the original service, or of the launcher, may have and that are not the module's:
# MAVProxy has the link, the launcher starts what is simulated.
NOT_OURS = {
    "api": {"uav_connection", "connection_type", "gradys_gs", "scripts_path", "python_path", "vehicle"},
    "simulated": {"simulated", "ardupilot_path", "location", "gs_connection", "speedup", "headless"},
    "logs": {"log_console", "log_path", "debug", "script_logs"},
}
UNSET = {"", "None", "[]"}


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
    """

    host: str
    port: int
    sysid: int
    link_timeout: float
    max_age: float


def table() -> list[Any]:
    """The settings with their types, defaults and ranges, as MAVProxy knows them."""
    return [
        MPSetting("host", str, "127.0.0.1", "address to listen on (loopback only)", tab="API"),
        MPSetting("port", int, 8000, "TCP port to listen on", range=(1, 65535), increment=1),
        MPSetting("sysid", int, 0, "vehicle to fly; 0 is MAVProxy's current one", range=(0, 255), increment=1),
        MPSetting("link_timeout", float, 5.0, "s without heartbeat until the link is lost", range=(1, 60)),
        MPSetting("max_age", float, 5.0, "s after which telemetry is stale", range=(0.1, 3600)),
    ]


class ModuleSettings:
    """The settings of the loaded module: validated, whichever way they come in."""

    def __init__(self, given: dict[str, Any] | None = None) -> None:
        """Take `given` settings; those of an INI file that it names as `config` yield to the others.

        Raises:
            SettingError: as `set` and `load`.
        """
        self.mp = MPSettings(table())
        given = dict(given or {})
        config = given.pop("config", None)
        if config is not None:
            self.load(Path(config).expanduser())
        for name, value in given.items():
            self.set(name, value)

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
            if section not in NOT_OURS:
                raise SettingError(f"{file}: no section [{section}]; there are {', '.join(NOT_OURS)}")
            for name, value in parser[section].items():
                if name in NOT_OURS[section] or value in UNSET:
                    continue
                if section != "api" or name not in self.mp.list():
                    raise SettingError(f"{file}: no key {name!r} in [{section}]")
                self.set(name, value)

    def set(self, name: str, value: Any) -> None:
        """Set one.

        Raises:
            SettingError: unknown, of the wrong type, or out of range.
        """
        if name not in self.mp.list():
            near = difflib.get_close_matches(name, self.mp.list(), n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(self.mp.list())}"
            raise SettingError(f"no setting {name!r}; {hint}")
        if name == "host":
            check_loopback(str(value))
        if _is_nothing(value) or not self.mp.set(name, value):
            setting = self.mp.get_setting(name)
            limits = f" from {setting.range[0]} to {setting.range[1]}" if setting.range else ""
            raise SettingError(f"{name} = {value!r}: it takes a {setting.type.__name__}{limits}")

    def snapshot(self) -> Settings:
        """The settings as they are now."""
        return Settings(**{name: self.mp.get(name) for name in self.mp.list()})


def _is_nothing(value: Any) -> bool:
    """Whether it is None or NaN, which MPSetting compares with its range as if they were numbers."""
    try:
        return value is None or math.isnan(float(value))
    except (TypeError, ValueError):
        return False


def check_loopback(host: str) -> None:
    """Refuse to listen where others could fly the vehicle.

    Raises:
        SettingError: `host` is not a loopback address.
    """
    if host == "localhost":
        return
    try:
        loopback = ipaddress.ip_address(host).is_loopback
    except ValueError as error:
        raise SettingError(f"host = {host!r} is not an IP address") from error
    if not loopback:
        raise SettingError(f"host = {host!r}: anybody on that network could fly the vehicle; loopback only")
