"""The module's settings: MPSettings at the prompt -> one frozen snapshot handed inward."""

from __future__ import annotations

import difflib
import ipaddress
from dataclasses import dataclass
from typing import Any

from MAVProxy.modules.lib.mp_settings import MPSetting, MPSettings


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
        self.mp = MPSettings(table())
        for name, value in (given or {}).items():
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
        if not self.mp.set(name, value):
            setting = self.mp.get_setting(name)
            limits = f" from {setting.range[0]} to {setting.range[1]}" if setting.range else ""
            raise SettingError(f"{name} = {value!r}: it takes a {setting.type.__name__}{limits}")

    def snapshot(self) -> Settings:
        """The settings as they are now."""
        return Settings(**{name: self.mp.get(name) for name in self.mp.list()})


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
