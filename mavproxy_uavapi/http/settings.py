"""/settings: the settings of our modules. Only those of `uavapi` can be set, except those that control callers."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.http.access import is_owner, require_owner
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.requests import Empty, Request
from mavproxy_uavapi.http.responses import Answer
from mavproxy_uavapi.remote_settings import RemoteSettings
from mavproxy_uavapi.settings import SETTABLE, ApiModuleSettings

Reports = list[dict[str, Any]]


class NewSetting(Request):
    """`value`: the new value of one setting."""

    value: Annotated[
        Annotated[str, Field(max_length=500)] | bool | int | float,
        Field(description="in the setting's unit; `accepts` of GET /settings says which values it takes"),
    ]


async def show(call: Call) -> Answer:
    """The settings: value, meaning, unit, what each accepts, default, and where its value comes from.

    `modules` has those of the other modules. A secret is shown as `(set)`. `settable` says whether this caller may
    change it.
    """
    own, others = await _reports(call)
    return {"settings": own, "modules": others}


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
    own, _ = await _reports(call)
    report = next(one for one in own if one["name"] == name)
    return {"result": f"{name} is {report['value']}", **report}


def _remote(call: Call) -> RemoteSettings:
    remote = call.service.remote_settings
    if remote is None:
        raise NotFound("no module has the settings")
    return remote


async def _reports(call: Call) -> tuple[Reports, dict[str, Reports]]:
    """Those of `uavapi`, and those of the other modules by name."""
    reports = await _remote(call).reports()
    may_set = is_owner(call)
    own = [{**one, "settable": may_set and one["name"] in SETTABLE} for one in reports.pop(ApiModuleSettings.module)]
    return own, {name: [{**one, "settable": False} for one in rows] for name, rows in reports.items()}
