"""/telemetry: the vehicle's newest messages, with their age; old data never counts as new."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from mavproxy_uavapi.core.errors import NotFound, Rejected, Stale, TimedOut
from mavproxy_uavapi.core.link.messages import MESSAGE_IDS
from mavproxy_uavapi.core.telemetry.vehicle_state import Received
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.core.vehicle.readiness import status as status_of
from mavproxy_uavapi.http import telemetry_views as views
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.requests import Read

FIRST_TIMEOUT = 2.0  # s to wait for a message that has not arrived yet and is requested
HOME_AGE = 1.0  # s for which a requested home position serves further readers


async def _newest(call: Call, name: str) -> Received:
    """The newest message of that name, if it is young enough; one that never arrived is requested.

    Raises:
        Stale: it is too old, or did not come.
    """
    vehicle = call.known_vehicle
    max_age = call.params(Read).max_age or call.service.settings.max_age
    received = vehicle.state.newest(name)
    if received is None:
        await _ask_for(call, name)
        received = vehicle.state.newest(name)
        if received is None:  # it was not requested, or it came with the news of a reboot, so it is outdated
            raise Stale(f"vehicle {vehicle.state.system} has not reported {name} since it booted")
    age = vehicle.clock() - received.at
    if age > max_age:
        raise Stale(f"vehicle {vehicle.state.system} last reported {name} {age:.1f} s ago (max_age is {max_age:g} s)")
    return received


async def _ask_for(call: Call, name: str) -> None:
    """Request a message for a caller that may send something to the vehicle; others get what comes anyway."""
    if not _may_ask(call):
        return
    vehicle = call.vehicle
    try:
        await wait_with_timeout(FIRST_TIMEOUT, vehicle.request(name))
    except (Rejected, TimedOut, asyncio.TimeoutError) as error:
        raise Stale(f"vehicle {vehicle.state.system} has not reported {name} yet") from error


def _may_ask(call: Call) -> bool:
    return call.caller.flies(call.known_vehicle.state.system)


def _age(call: Call, received: Received) -> float:
    return round(max(call.service.host.clock() - received.at, 0.0), 3)


async def _info(
    call: Call, view: Callable[[Any], dict[str, Any]], result: str = "Success", member: str = "info"
) -> dict[str, Any]:
    """The newest message of the route; it awaits nothing if that is there (`http.repeat`)."""
    received = await _newest(call, call.message)
    return call.answer(result, **{member: view(received.message)}, age_s=_age(call, received))


async def general(call: Call) -> dict[str, Any]:
    """Speeds (m/s), heading (degrees), throttle (%), altitude (m AMSL)."""
    return await _info(call, views.general)


async def gps(call: Call) -> dict[str, Any]:
    """Fused position (degrees, m AMSL, m above home), velocity (m/s: north, east, down), heading (degrees)."""
    return await _info(call, views.gps)


async def gps_raw(call: Call) -> dict[str, Any]:
    """The GPS receiver's own position (degrees, m AMSL), speed (m/s) and course (degrees)."""
    return await _info(call, views.gps_raw)


async def ned(call: Call) -> dict[str, Any]:
    """Fused position (m) and velocity (m/s): north, east, down of the EKF origin."""
    return await _info(call, views.ned)


async def attitude(call: Call) -> dict[str, Any]:
    """Roll, pitch, yaw (degrees) and their rates (deg/s)."""
    return await _info(call, views.attitude)


async def sys_status(call: Call) -> dict[str, Any]:
    """SYS_STATUS as it is."""
    return await _info(call, views.fields, "success", "status")


async def sensor_status(call: Call) -> dict[str, Any]:
    """Which sensors are present, enabled, healthy."""
    return await _info(call, views.sensors, "success", "status")


async def battery_info(call: Call) -> dict[str, Any]:
    """Voltage (mV), current (cA), charge (%)."""
    return await _info(call, views.battery, "success")


async def error_info(call: Call) -> dict[str, Any]:
    """Communication and autopilot errors."""
    return await _info(call, views.errors, "success")


async def compass(call: Call) -> dict[str, Any]:
    """The result of the last compass calibration since MAVProxy started."""
    messages = call.known_vehicle.state.messages
    newest = messages.get("MAG_CAL_REPORT")
    if newest is None:
        raise NotFound("no compass calibration was reported; MAG_CAL_REPORT comes during a calibration only")
    per_compass = [messages.get(f"MAG_CAL_REPORT[{number}]") for number in range(3)]
    fitness = [None if calibration is None else calibration.message.fitness for calibration in per_compass]
    return call.answer("Success", info=views.compass(newest.message, fitness), age_s=_age(call, newest))


async def home_info(call: Call) -> dict[str, Any]:
    """Request the home position: degrees, m AMSL; x, y, z m north, east, down of the EKF origin."""
    may_ask = _may_ask(call)
    vehicle = call.vehicle if may_ask else call.known_vehicle
    age = vehicle.state.age("HOME_POSITION", vehicle.clock())
    if may_ask and (age is None or age > HOME_AGE):
        await vehicle.home()
    received = vehicle.state.messages.get("HOME_POSITION")
    if received is None:
        raise Stale(f"vehicle {vehicle.state.system} has not reported its home since it booted")
    return call.answer("Success", **views.home(received.message), age_s=_age(call, received))


async def status(call: Call) -> dict[str, Any]:
    """Whether the vehicle is ready to fly, and why not."""
    vehicle, host = call.known_vehicle, call.service.host
    now = host.clock()
    info = status_of(vehicle, host.link_watch.is_alive(vehicle.state), now)
    return call.answer("Success", info=info, age_s=round(max(now - vehicle.state.heartbeat_at, 0.0), 3))


async def message(call: Call) -> dict[str, Any]:
    """Any MAVLink message: its fields as MAVLink has them, how many came, and how often (Hz)."""
    name = call.names["name"].upper()
    if name.partition("[")[0] not in MESSAGE_IDS:
        raise NotFound(f"there is no MAVLink message {name}")
    state = call.known_vehicle.state
    if state.newest(name) is None:
        raise NotFound(f"vehicle {state.system} has not sent {name}")
    received = await _newest(call, name)
    info = {**views.fields(received.message), "count": received.count}
    info["rate"] = round(received.rate(call.service.host.clock()), 2)
    return call.answer("Success", info=info, age_s=_age(call, received))
