"""/settings: the settings of the module `uavapi`; what decides over callers is set at MAVProxy's prompt only."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.http.access import is_owner, require_owner
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.requests import Empty, Request
from mavproxy_uavapi.http.responses import Answer
from mavproxy_uavapi.remote_settings import RemoteSettings
from mavproxy_uavapi.settings import SETTABLE


class NewSetting(Request):
    """`value`: the new value of one setting."""

    value: Annotated[
        Annotated[str, Field(max_length=500)] | bool | int | float,
        Field(description="in the setting's unit; `accepts` of GET /settings says which values it takes"),
    ]


async def show(call: Call) -> Answer:
    """The settings: value, meaning, unit, what each accepts, default, and where its value comes from.

    A secret is shown as `(set)`. `settable` says whether this caller may change it.
    """
    return {"settings": await _reports(call)}


async def put(call: Call) -> Answer:
    """Set one setting, as `uavapi set` does at the prompt; it is in force when this answers.

    Who may call, what callers may do, limits for them, files and programs, and where vehicles may fly are set at the
    prompt only: 422.
    """
    remote, name, value = _remote(call), call.names["name"], call.params(NewSetting).value
    call.remembered = Empty()  # the trail must not hold a secret that somebody tries to set
    require_owner(call, "who may change settings")
    remote.require_settable(name)
    call.remembered = call.params(NewSetting)
    await remote.set(name, value, call.client)
    report = next(one for one in await _reports(call) if one["name"] == name)
    return {"result": f"{name} is {report['value']}", **report}


def _remote(call: Call) -> RemoteSettings:
    remote = call.service.remote_settings
    if remote is None:
        raise NotFound("no module has the settings")
    return remote


async def _reports(call: Call) -> list[dict[str, Any]]:
    may_set = is_owner(call)
    return [{**one, "settable": may_set and one["name"] in SETTABLE} for one in await _remote(call).reports()]
