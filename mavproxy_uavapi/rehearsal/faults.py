"""What goes wrong in a rehearsal, and when: `NAME[=VALUE][@WHEN][:SECONDS]`. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mavproxy_uavapi.rehearsal.record import Sample

FORM = re.compile(
    r"(?P<name>[a-z_]+)(=(?P<value>[A-Za-z0-9_.-]+))?(@(?P<when>[a-z0-9.]+))?(:(?P<seconds>[0-9.]+)s?)?"
)
WHEN = re.compile(r"(?P<time>[0-9.]+)s|(?P<height>[0-9.]+)m|item(?P<item>[0-9]+)|leg(?P<leg>[0-9]+)")
AIRBORNE = 2.0  # m above home, at which a fault begins that does not say when
LASTS = 10.0  # s
GUST = 15.0  # m/s
LOW = 9.9  # V

# name -> what the vehicle is told: the control line of the embedded vehicle (`sim.control`)
OF_THE_VEHICLE: Mapping[str, Mapping[str, Any]] = {
    "gps_loss": {"name": "ekf_bad"},
    "gps_frozen": {"name": "freeze_gps"},
    "link_loss": {"name": "silence"},
    "radio_loss": {"name": "radio_loss"},
    "low_battery": {"name": "low_battery", "voltage": LOW},
    "pilot_mode": {"name": "pilot_mode"},
    "pilot_disarm": {"name": "pilot_disarm"},
    "reboot": {"name": "reboot"},
    "wind_gust": {"name": "wind"},
}
OF_PROGRAMS = ("script_killed", "companion_killed")  # the script, or with it MAVProxy and the API
LASTING = ("gps_loss", "gps_frozen", "link_loss", "radio_loss", "wind_gust")
ALL = ("gps_loss", "link_loss", "low_battery", "pilot_mode=LOITER", "wind_gust", "script_killed", "companion_killed")


class NoSuchFault(ValueError):
    """A fault that does not exist, or a moment that cannot be read."""


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong once.

    Attributes:
        text: as it was ordered.
        name: of OF_THE_VEHICLE or OF_PROGRAMS.
        value: the pilot's mode, or m/s of the wind; empty for none.
        time: s since the takeoff on the vehicle's clock; None for another moment.
        height: m above home at which it begins.
        item: the number of the mission's item.
        leg: how many movements were asked for, the last of them included.
        seconds: that it lasts.
    """

    text: str
    name: str
    value: str = ""
    time: float | None = None
    height: float | None = None
    item: int | None = None
    leg: int | None = None
    seconds: float = LASTS

    def is_due(self, sample: Sample, since_takeoff: float | None, legs: int) -> bool:
        """Whether it begins now.

        Args:
            sample: the vehicle now.
            since_takeoff: s; None before.
            legs: how many movements were asked for.
        """
        if self.time is not None:
            return since_takeoff is not None and since_takeoff >= self.time
        if self.item is not None:
            return sample.item >= self.item
        if self.leg is not None:
            return legs >= self.leg
        if self.height is None:
            return sample.is_under_way and (sample.landed or sample.height >= AIRBORNE)  # or it drives
        return sample.armed and sample.height >= self.height

    def lines(self) -> list[dict[str, Any]]:
        """What the vehicle is told, one after the other; empty for what happens to programs."""
        if self.name in OF_PROGRAMS:
            return []
        if self.name == "wind_gust":
            return [{"op": "parameter", "name": "SIM_WIND_SPD", "value": float(self.value or GUST)}]
        line = {"op": "fault", **OF_THE_VEHICLE[self.name]}
        if self.name == "pilot_mode":
            line["mode"] = self.value
        if self.name in LASTING:
            line["seconds"] = self.seconds
        return [line]


def fault_of(text: str) -> Fault:
    """The fault that a text names, such as `gps_loss@item2`, `link_loss@20s:10s` or `pilot_mode=LOITER@leg3`.

    Raises:
        NoSuchFault: it names none.
    """
    found = FORM.fullmatch(text.strip())
    if found is None or found["name"] not in (*OF_THE_VEHICLE, *OF_PROGRAMS):
        raise NoSuchFault(f"{text!r} is no fault; there are {', '.join((*OF_THE_VEHICLE, *OF_PROGRAMS))}")
    when = WHEN.fullmatch(found["when"]) if found["when"] else None
    if found["when"] and when is None:
        raise NoSuchFault(f"{text!r}: the moment is such as 20s, 15m, item2 or leg3")
    if found["name"] == "pilot_mode" and not found["value"]:
        raise NoSuchFault(f"{text!r}: say which mode, such as pilot_mode=LOITER")
    at = {} if when is None else when.groupdict()
    return Fault(
        text.strip(),
        found["name"],
        (found["value"] or "").upper() if found["name"] == "pilot_mode" else found["value"] or "",
        time=float(at["time"]) if at.get("time") else None,
        height=float(at["height"]) if at.get("height") else None,
        item=int(at["item"]) if at.get("item") else None,
        leg=int(at["leg"]) if at.get("leg") else None,
        seconds=float(found["seconds"]) if found["seconds"] else LASTS,
    )
