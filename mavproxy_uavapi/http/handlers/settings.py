"""/settings: the settings of our modules. Only those of `uavapi` can be set, except those that control callers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, cast

from pydantic import Field
from typing_extensions import TypedDict

from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import means
from mavproxy_uavapi.http.contract.requests import Empty, Request
from mavproxy_uavapi.http.door.access import is_owner, require_owner
from mavproxy_uavapi.remote_settings import RemoteSettings
from mavproxy_uavapi.settings import SETTABLE, ApiModuleSettings


class SettingReport(TypedDict):
    """A setting of a module."""

    name: Annotated[str, means("as `uavapi set` knows it", "max_age")]
    value: Annotated[Any, means("in its unit; `(set)` in place of a secret", 3.0)]
    meaning: Annotated[str, means("a sentence", "s after which telemetry is stale")]
    unit: Annotated[str, means("empty for none", "s")]
    accepts: Annotated[str, means("which values it takes", "a number from 0.1 to 3600")]
    choices: Annotated[list[Any], means("all that it takes, if those are few words", [])]
    default: Annotated[Any, means("in its unit", 5.0)]
    origin: Annotated[str, means("where its value comes from", "uavapi set")]
    settable: Annotated[bool, means("whether this caller may change it", True)]


class Settings(TypedDict):
    """The settings of `uavapi`, and those of other modules by name."""

    settings: list[SettingReport]
    modules: dict[str, list[SettingReport]]


class SettingSet(SettingReport):
    """A setting that was changed."""

    result: Annotated[str, means("a sentence", "max_age is 3.0")]


Reports = list[SettingReport]


class NewSetting(Request):
    """`value`: the new value of one setting."""

    value: Annotated[
        Annotated[str, Field(max_length=500)] | bool | int | float,
        Field(
            description="in the setting's unit; `accepts` of GET /settings says which values it takes", examples=[3]
        ),
    ]


async def show(call: Call) -> Settings:
    """The settings: value, meaning, unit, what each accepts, default, and where its value comes from.

    `modules` has those of the other modules. A secret is shown as `(set)`. `settable` says whether this caller may
    change it.
    """
    own, others = await _reports(call)
    return {"settings": own, "modules": others}


async def put(call: Call) -> SettingSet:
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
    own = [_report(one, may_set and one["name"] in SETTABLE) for one in reports.pop(ApiModuleSettings.module)]
    return own, {name: [_report(one, False) for one in rows] for name, rows in reports.items()}


def _report(setting: Mapping[str, Any], settable: bool) -> SettingReport:
    return cast(SettingReport, {**setting, "settable": settable})
