"""/telemetry: the vehicle's newest messages, with their age; old data never counts as new."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from mavproxy_uavapi.core.errors import NotFound, Rejected, Stale, TimedOut
from mavproxy_uavapi.core.link.messages import MESSAGE_IDS
from mavproxy_uavapi.core.telemetry.vehicle_state import Received
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract import telemetry_views as views
from mavproxy_uavapi.http.contract.answers import Aged, Info, StatusView, Success
from mavproxy_uavapi.http.contract.reports import status_of
from mavproxy_uavapi.http.contract.requests import Read

T = TypeVar("T")

FIRST_TIMEOUT = 2.0  # s to wait for a message that has not arrived yet and is requested
HOME_AGE = 1.0  # s for which a requested home position serves further readers


class MessagesAnswer(Success):
    """Which messages come, by name; those of several devices also as `NAME[device]`."""

    messages: dict[str, views.MessageKind]


class StatusOf(Aged, Generic[T]):
    """What the vehicle has reported."""

    status: T


class HomeAnswer(Aged, views.HomeView):
    """Where home is."""


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


async def _info(call: Call, view: Callable[[Any], T]) -> Info[T]:
    """The newest message of the route; it awaits nothing if that is there (`http.server.repeat`)."""
    received = await _newest(call, call.message)
    return {**call.answer("success"), "info": view(received.message), "age_s": _age(call, received)}


async def general(call: Call) -> Info[views.GeneralView]:
    """Speeds, heading, throttle, altitude."""
    return await _info(call, views.general)


async def gps(call: Call) -> Info[views.GpsView]:
    """Fused position, velocity and heading."""
    return await _info(call, views.gps)


async def gps_raw(call: Call) -> Info[views.GpsRawView]:
    """The GPS receiver's own position, speed and course."""
    return await _info(call, views.gps_raw)


async def ned(call: Call) -> Info[views.NedView]:
    """Fused position and velocity: north, east, down of the EKF origin."""
    return await _info(call, views.ned)


async def attitude(call: Call) -> Info[views.AttitudeView]:
    """Roll, pitch, yaw and their rates."""
    return await _info(call, views.attitude)


async def sys_status(call: Call) -> StatusOf[views.FieldsView]:
    """SYS_STATUS as it is."""
    return _as_status(await _info(call, views.fields))


async def sensor_status(call: Call) -> StatusOf[dict[str, views.SensorView]]:
    """Which sensors are present, enabled, healthy."""
    return _as_status(await _info(call, views.sensors))


def _as_status(answer: Info[T]) -> StatusOf[T]:
    """The same under the name that the original service has here."""
    head: Success = {"device": answer["device"], "id": answer["id"], "result": answer["result"]}
    return {**head, "status": answer["info"], "age_s": answer["age_s"]}


async def battery_info(call: Call) -> Info[views.BatteryView]:
    """Voltage, current, charge."""
    return await _info(call, views.battery)


async def error_info(call: Call) -> Info[views.ErrorsView]:
    """Communication and autopilot errors."""
    return await _info(call, views.errors)


async def compass(call: Call) -> Info[views.CompassView]:
    """The result of the last compass calibration since MAVProxy started."""
    messages = call.known_vehicle.state.messages
    newest = messages.get("MAG_CAL_REPORT")
    if newest is None:
        raise NotFound("no compass calibration was reported; MAG_CAL_REPORT comes during a calibration only")
    per_compass = [messages.get(f"MAG_CAL_REPORT[{number}]") for number in range(3)]
    fitness = [None if calibration is None else calibration.message.fitness for calibration in per_compass]
    info = views.compass(newest.message, fitness)
    return {**call.answer("success"), "info": info, "age_s": _age(call, newest)}


async def home_info(call: Call) -> HomeAnswer:
    """Request the home position."""
    may_ask = _may_ask(call)
    vehicle = call.vehicle if may_ask else call.known_vehicle
    age = vehicle.state.age("HOME_POSITION", vehicle.clock())
    if may_ask and (age is None or age > HOME_AGE):
        await vehicle.home()
    received = vehicle.state.messages.get("HOME_POSITION")
    if received is None:
        raise Stale(f"vehicle {vehicle.state.system} has not reported its home since it booted")
    return {**call.answer("success"), **views.home(received.message), "age_s": _age(call, received)}


async def status(call: Call) -> Info[StatusView]:
    """Whether the vehicle is ready to fly, and why not."""
    vehicle, host = call.known_vehicle, call.service.host
    age = round(max(host.clock() - vehicle.state.heartbeat_at, 0.0), 3)
    return {**call.answer("success"), "info": status_of(host, vehicle), "age_s": age}


async def message(call: Call) -> Info[views.MessageReport]:
    """Any MAVLink message: its fields as MAVLink has them, how many came, and how often (Hz)."""
    name = call.names["name"].upper()
    if name.partition("[")[0] not in MESSAGE_IDS:
        raise NotFound(f"there is no MAVLink message {name}")
    state = call.known_vehicle.state
    if state.newest(name) is None:
        raise NotFound(f"vehicle {state.system} has not sent {name}")
    received = await _newest(call, name)
    rate = round(received.rate(call.service.host.clock()), 2)
    info: views.MessageReport = {**views.fields(received.message), "count": received.count, "rate": rate}
    return {**call.answer("success"), "info": info, "age_s": _age(call, received)}


async def messages(call: Call) -> MessagesAnswer:
    """Which messages the vehicle's autopilot sends, how often (Hz), and the unit of each number in them."""
    state, now = call.known_vehicle.state, call.service.host.clock()
    kinds: dict[str, views.MessageKind] = {
        name: {
            "rate": round(received.rate(now), 2),
            "units": views.units(received.message),
            "component": state.component,
            "instance": getattr(received.message, "_instance_field", None) if name.endswith("]") else None,
        }
        for name, received in sorted(state.messages.items())
    }
    return {**call.answer("success"), "messages": kinds}
