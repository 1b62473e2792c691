"""What a stream can show besides messages: the API's own payloads, each made anew when its source arrives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle import mission_flight
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.contract import telemetry_views as views
from mavproxy_uavapi.http.contract.reports import report_of_vehicle, status_of

# name -> the message that it shows, and how
OF_A_MESSAGE: Mapping[str, tuple[str, Callable[[Any], Mapping[str, object]]]] = {
    "general": ("VFR_HUD", views.general),
    "gps": ("GLOBAL_POSITION_INT", views.gps),
    "gps_raw": ("GPS_RAW_INT", views.gps_raw),
    "ned": ("LOCAL_POSITION_NED", views.ned),
    "attitude": ("ATTITUDE", views.attitude),
    "battery": ("SYS_STATUS", views.battery),
    "home": ("HOME_POSITION", views.home),
    "target": ("POSITION_TARGET_GLOBAL_INT", views.target),
}


def mission(_host: Host, vehicle: Vehicle) -> dict[str, Any] | None:
    """How far the mission has come, as `/mission/progress` has it; None while the vehicle does not tell."""
    return mission_flight.recent_progress(vehicle)


# name -> a summary of several messages, made twice a second and at each change of mode, arming or commander
OF_A_VEHICLE: Mapping[str, Callable[[Host, Vehicle], Mapping[str, object] | None]] = {
    "status": status_of,
    "vehicle": report_of_vehicle,
    "mission": mission,
}
NAMES = (*OF_A_MESSAGE, *OF_A_VEHICLE)
BY_MESSAGE: Mapping[str, list[str]] = {
    message: [name for name, (source, _) in OF_A_MESSAGE.items() if source == message]
    for message, _ in OF_A_MESSAGE.values()
}
