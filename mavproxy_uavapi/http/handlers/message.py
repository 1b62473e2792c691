"""/message: any MAVLink message, for what has no verb."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Forbidden
from mavproxy_uavapi.core.mainloop.permit import no_check
from mavproxy_uavapi.core.telemetry.flight_modes import flies_mission, mode_name
from mavproxy_uavapi.core.vehicle import raw_messages
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.requests import Request
from mavproxy_uavapi.http.contract.responses import Done
from mavproxy_uavapi.http.handlers.rehearsals import require_rehearsed_mission


class RawMessage(Request):
    """`name` of a MAVLink message, and a value for each of its `fields`."""

    name: Annotated[str, Field(max_length=64, description="such as COMMAND_LONG", examples=["STATUSTEXT"])]
    fields: Annotated[
        dict[str, Any],
        Field(
            max_length=64,
            description="numbers, names of the field's enum, lists for arrays, text for characters",
            examples=[{"severity": "MAV_SEVERITY_INFO", "text": "hello"}],
        ),
    ] = {}


async def send_message(call: Call) -> Done:
    """Send any MAVLink message; a command is done when the vehicle accepts it. Needs the setting `allow_raw`."""
    if not call.service.settings.allow_raw:
        raise Forbidden("messages of any kind are not allowed here; `uavapi set allow_raw true` at the prompt")
    vehicle, params = call.vehicle, call.params(RawMessage)
    message = raw_messages.message_named(params.name, params.fields, vehicle.address)
    name, mode = message.get_type(), raw_messages.mode_of(vehicle, message)
    begins_mission = mode is not None and flies_mission(mode_name(vehicle.state.vehicle_type, mode))
    require_unchanged = await require_rehearsed_mission(call, vehicle) if begins_mission else no_check

    async def verb(job: Job) -> None:
        require_unchanged()
        await raw_messages.send(vehicle, job, message)

    done = f"{name} accepted" if name in raw_messages.WITH_ACK else f"{name} sent"
    return await call.fly(vehicle, verb, done)
