"""What a real vehicle is, asked of its API, so that a rehearsal begins as a flight would: `run --like URL`."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mavproxy_uavapi.client.http import Http
from mavproxy_uavapi.core.errors import NotFound, Stale, UavApiError
from mavproxy_uavapi.core.settings import DEFAULT
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.launcher.errors import LaunchError

CAPACITY = "BATT_CAPACITY"  # mAh
VTOL = "Q_ENABLE"
SIMULATED = "SIM_"  # of a vehicle that is simulated itself: where, and how fast
ANSWERS_WITHIN = 120.0  # s; the whole list of parameters by a slow radio
COMES_WITHIN = 2.0  # s in which at least one more parameter comes while a list is fetched
BEGINS_WITHIN = 30.0  # s in which MAVProxy begins to fetch it, after it has found the vehicle
MISSIONS = "/mission/waypoints"
OF_A_MACHINE = ("source", "vehicle", "directory", "threads")  # settings of vision


@dataclass(frozen=True)
class Likeness:
    """What a rehearsal takes over.

    Attributes:
        vehicle: its type: copter, plane, quadplane or rover.
        location: its home, with the heading that it has now: lat,lon,alt,heading.
        parameters: a file with all that are known of it.
        envelope: a file with where it may fly; None if nothing is in force.
        battery: mAh that are left; 0 if it does not tell.
        mission: a file with the mission that it holds; None for none.
        wind: m/s, degrees from, as it tells it now; "" if it does not.
        on_script_exit: the setting of that name.
        camera: the settings of the module vision, if it is loaded, that somebody has set.
    """

    vehicle: str
    location: str
    parameters: Path
    envelope: Path | None
    battery: float
    mission: Path | None
    wind: str
    on_script_exit: str
    camera: dict[str, Any]


def likeness_of(url: str, folder: Path) -> Likeness:
    """Ask an API for its vehicle, or for that of `…/vehicles/2`; nothing is commanded.

    Args:
        url: the API's address; its token is in the environment, as for clients (`UAVAPI_TOKEN`).
        folder: where the files go.

    Raises:
        LaunchError: it does not answer, or lacks what is needed.
        OSError: the folder refuses.
    """
    try:
        return asyncio.run(wait_with_timeout(ANSWERS_WITHIN, _asked(url, folder)))
    except asyncio.TimeoutError:
        raise LaunchError(f"--like {url}: it has not told all within {ANSWERS_WITHIN:g} s") from None
    except UavApiError as error:
        raise LaunchError(f"--like {url}: {error}") from error


async def _asked(url: str, folder: Path) -> Likeness:
    async with Http(url, os.environ.get("UAVAPI_TOKEN", "")) as api:
        parameters = await _whole_list(api)
        home = await api.get("/telemetry/home_info")
        heading = (await api.get("/telemetry/gps"))["info"]["heading"] or 0.0
        kind = (await api.get("/telemetry/status"))["info"]["vehicle_type"]
        left = (await api.get("/telemetry/battery_info"))["info"]["battery_remaining"]
        envelopes = (await api.get("/envelope"))["envelopes"]
        items = (await api.get(MISSIONS))["items"]
        wind = await _wind(api)
        told = await api.get("/settings")
        settings = {one["name"]: one["value"] for one in told["settings"]}
    if not parameters:
        raise LaunchError(f"--like {url}: MAVProxy has no parameters of it yet")
    own = {name: value for name, value in parameters.items() if not name.startswith(SIMULATED)}
    text = "".join(f"{name} {value:.9g}\n" for name, value in own.items())
    capacity = parameters.get(CAPACITY, 0.0) * (100 if left is None else left) / 100
    areas = [one["envelope"] for one in envelopes if one["envelope"]]
    if len(areas) > 1:
        raise LaunchError(f"--like {url}: {len(areas)} envelopes are in force there; give one file by --envelope")
    return Likeness(
        "quadplane" if kind == "plane" and parameters.get(VTOL, 0.0) else kind,
        f"{home['lat']:.7f},{home['lon']:.7f},{home['altitude']:.1f},{heading:.0f}",
        _written(folder / "like.param", text),
        _written(folder / "like.geojson", json.dumps(areas[0])) if areas else None,
        capacity,
        _written(folder / "like.json", json.dumps({"items": items})) if items else None,
        wind,
        settings["on_script_exit"],
        _camera(told["modules"].get("vision", ())),
    )


def _camera(settings: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Those of a simulated camera only count where there is one."""
    source = {one["name"]: one["value"] for one in settings}.get("source")
    left_out = OF_A_MACHINE if source == "sim" else (*OF_A_MACHINE, "sim_")
    return {
        one["name"]: one["value"]
        for one in settings
        if one["origin"] != DEFAULT and not one["name"].startswith(left_out)
    }


async def _wind(api: Http) -> str:
    """What its message WIND says; "" if there is none, or an old one: a copter mostly sends none."""
    with suppress(NotFound, Stale):
        told = (await api.get("/telemetry/message/WIND"))["info"]
        return f"{told['speed']:.1f},{told['direction'] % 360:.0f}"
    return ""


async def _whole_list(api: Http) -> dict[str, float]:
    """All parameters: MAVProxy may be fetching them just now."""
    known: dict[str, float] = {}
    looks = 0
    while True:
        before, known = known, (await api.get("/parameters"))["parameters"]
        looks += 1
        if len(known) == len(before) and (known or looks * COMES_WITHIN > BEGINS_WITHIN):
            return known
        await asyncio.sleep(COMES_WITHIN)


def _written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path
