"""Python imports this before a rehearsed script: its time is its simulated vehicle's, and its vehicle is that one."""

from __future__ import annotations

import os


def _numbers(name: str) -> set[int]:
    return {int(number) for number in os.environ.get(name, "").split()}


# The script's Python may be one without our package: these lie beside this file.
if os.environ.get("UAVAPI_CLOCK"):
    import uavapi_clock  # type: ignore[import-not-found]
    import uavapi_leads  # type: ignore[import-not-found]

    uavapi_clock.go_by_it()
    if mavlink := os.environ.get("UAVAPI_MAVLINK"):
        line = os.environ.get("UAVAPI_MAVLINK_LINE", "")
        uavapi_leads.lead_mavlink(mavlink, line, _numbers("UAVAPI_MAVLINK_PORTS"))
        uavapi_leads.refuse_serial_lines()
    if url := os.environ.get("UAVAPI_URL"):
        uavapi_leads.lead_api(int(url.split("/")[2].rpartition(":")[2]), _numbers("UAVAPI_PORTS"))
