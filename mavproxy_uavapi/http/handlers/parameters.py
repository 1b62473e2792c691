"""/parameters: the autopilot's parameters, from MAVProxy's own table; each new value is read back."""

from __future__ import annotations

import asyncio
import fnmatch
import re
from collections.abc import Collection, Mapping
from itertools import islice
from typing import Annotated, cast

from aiohttp import web
from pydantic import Field
from typing_extensions import NotRequired

from mavproxy_uavapi.core.errors import Invalid, NotFound, UavApiError
from mavproxy_uavapi.core.file_text import text_of
from mavproxy_uavapi.core.link import parameter_files
from mavproxy_uavapi.core.strict_json import json_of
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.files import parameter_docs
from mavproxy_uavapi.files.parameter_docs import About
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import Failure, Success, means
from mavproxy_uavapi.http.contract.parsing import parse
from mavproxy_uavapi.http.contract.requests import Number, Request
from mavproxy_uavapi.http.contract.responses import MULTI_STATUS, dumps, reason
from mavproxy_uavapi.http.contract.route import ANY_FILE, JSON, TEXT
from mavproxy_uavapi.http.wire.bodies import in_time

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_]{1,16}$")]
Value = Annotated[
    Number, Field(ge=-3.4e38, le=3.4e38, description="as the autopilot's type can hold it", examples=[500])
]
MOST_LISTED = 8  # names in a sentence
MOST_DESCRIBED = 60
ABOUT = {
    "title": "Waypoint Horizontal Speed Target",
    "text": "the speed in cm/s which the aircraft will attempt to maintain horizontally during a WP mission",
    "unit": "cm/s",
    "range": "10 2000",
    "values": {},
    "bits": False,
    "reboot": False,
}


class ParameterFilter(Request):
    """`match`: names, with * and ?."""

    match: Annotated[str, Field(max_length=64, description="names, with * and ?")] = "*"


class DescribedParameters(ParameterFilter):
    """`words` that are in a name or in ArduPilot's documentation; `about`: tell what that says of the first 60."""

    words: Annotated[str, Field(max_length=100, description="that a name or its documentation has")] = ""
    about: Annotated[bool, Field(description="tell what the documentation says of the first 60")] = False


class NewValue(Request):
    """`value`: the new value of one parameter."""

    value: Value


class NewValues(Request):
    """`parameters`: new values by name."""

    parameters: Annotated[dict[Name, Value], Field(min_length=1, max_length=2000)]


FILE = {
    "text/plain": {**TEXT, "example": "WPNAV_SPEED 500"},
    JSON: {"schema": NewValues.model_json_schema(), "example": {"parameters": {"WPNAV_SPEED": 500}}},
    **ANY_FILE,
}


class Restore(Request):
    """`restore`: the list is this vehicle's own."""

    restore: Annotated[
        bool,
        Field(description="the list is of this very airframe: set its calibration, device ids and counters, too"),
    ] = False


Held = Annotated[dict[str, float], means("the values that the autopilot holds, by name", {"WPNAV_SPEED": 500.0})]


class ParametersView(Success):
    """Parameters of the autopilot."""

    parameters: Held


class ListedParameters(ParametersView):
    """Parameters of the autopilot, and what ArduPilot's documentation says of them."""

    documented: NotRequired[Annotated[bool, means("whether there is a documentation of the vehicle's type", True)]]
    about: NotRequired[Annotated[dict[str, About], means("what it says, by name", {"WPNAV_SPEED": ABOUT})]]


class ParameterView(Success):
    """A parameter of the autopilot."""

    name: Annotated[str, means("as the autopilot has it", "WPNAV_SPEED")]
    value: Annotated[float, means("that it holds now", 500.0)]


class LoadedParameters(ParametersView):
    """What became of each parameter of a list."""

    failed: Annotated[dict[str, Failure], means("why others are not set, by name", {})]
    left_out: Annotated[dict[str, str], means("why a list does not set them, by name", {})]


async def list_parameters(call: Call) -> ListedParameters:
    """The parameters that MAVProxy knows of the vehicle; those that have `words` in order of their fitting."""
    p, known = call.params(DescribedParameters), _known(call)
    answer = cast(ListedParameters, {**call.answer("success"), "parameters": known})
    if not (p.words or p.about):
        return answer
    documented = await asyncio.to_thread(parameter_docs.of, call.known_vehicle.kind)
    if p.words:
        names = await asyncio.to_thread(parameter_docs.found, list(known), p.words, documented)
        answer["parameters"] = {name: known[name] for name in names}
    answer["documented"] = bool(documented)
    if p.about:
        first = islice(answer["parameters"], MOST_DESCRIBED)
        answer["about"] = {name: documented[name] for name in first if name in documented}
    return answer


async def parameter_file(call: Call) -> web.StreamResponse:
    """The same as the text of a .param file."""
    text = "".join(f"{name:<16} {value:.9g}\n" for name, value in _known(call).items())
    return web.Response(text=text, content_type="text/plain", charset="utf-8")


def _known(call: Call) -> dict[str, float]:
    known, pattern = call.known_vehicle.state.parameters, call.params(ParameterFilter).match.upper()
    return {name: known[name] for name in sorted(known) if fnmatch.fnmatchcase(name, pattern)}


async def show_parameter(call: Call) -> ParameterView:
    """One parameter, read from the vehicle now."""
    name = _name(call)
    value = await call.vehicle.parameters.read_now(name)
    return {**call.answer("success"), "name": name, "value": value}


async def set_parameter(call: Call) -> ParameterView:
    """Set one parameter; answers with the value that the autopilot holds now: it may have rounded it."""
    name, vehicle = _name(call), call.vehicle
    value = await vehicle.parameters.set(name, float(call.params(NewValue).value))
    return {**call.answer(f"{name} is {value:g}"), "name": name, "value": value}


async def load_parameters(call: Call) -> LoadedParameters | web.Response:
    """Set many parameters, by JSON or the text of a .param file; `left_out` says which are not set by a list.

    200 when all others are set, else 207 with the `failed` ones.
    """
    vehicle = call.vehicle
    values, left_out = await _values(call)
    call.remembered = values
    done, failures = await _set_all(
        call, vehicle, {name.upper(): float(value) for name, value in values.parameters.items()}
    )
    missing = f", but not {_listed(failures)}" if failures else ""
    without = f"; left out: {_listed(left_out)}" if left_out else ""
    result = f"{len(done)} of {len(done) + len(failures)} parameters are set{missing}{without}"
    body: LoadedParameters = {
        **call.answer(result),
        "parameters": done,
        "failed": failures,
        "left_out": left_out,
    }
    return web.json_response(body, status=MULTI_STATUS, dumps=dumps) if failures else body


def _listed(names: Collection[str]) -> str:
    more = len(names) - MOST_LISTED
    return ", ".join(islice(names, MOST_LISTED)) + (f" and {more} more" if more > 0 else "")


async def _set_all(
    call: Call, vehicle: Vehicle, values: Mapping[str, float]
) -> tuple[dict[str, float], dict[str, Failure]]:
    """The values that the autopilot holds now, and what became of the others."""
    done: dict[str, float] = {}
    failures: dict[str, Failure] = {}
    for name, value in values.items():
        try:
            call.require_permission(vehicle)  # again: a long list takes minutes, and somebody may take the vehicle
            done[name] = await vehicle.parameters.set(name, value)
        except UavApiError as error:
            failures[name] = reason(error)
    return done, failures


async def _values(call: Call) -> tuple[NewValues, dict[str, str]]:
    """The values by name, as the body has them, and why others are left out.

    Raises:
        BadRequest: it is neither JSON nor a .param file.
        Invalid: a name or a value makes no sense, or nothing is left.
    """
    text = text_of(await in_time(call.request.read()), "the body")
    restore = call.params(Restore).restore
    if not text.lstrip().startswith("{"):
        given, left_out = await asyncio.to_thread(parameter_files.read, text, restore)
    else:
        body = parse(NewValues, "body", await asyncio.to_thread(json_of, text, "the body"))
        if len({name.upper() for name in body.parameters}) < len(body.parameters):
            raise Invalid("a name is there twice", "body", "parameters")
        reasons = {name: parameter_files.why_left_out(name.upper(), restore) for name in body.parameters}
        left_out = {name.upper(): reason for name, reason in reasons.items() if reason}
        given = {name: value for name, value in body.parameters.items() if not reasons[name]}
    if left_out and not given:
        raise Invalid(f"nothing is left to set without {_listed(left_out)}: {next(iter(left_out.values()))}", "body")
    return parse(NewValues, "body", {"parameters": given}), left_out


def _name(call: Call) -> str:
    name = call.names["name"].upper()
    if not re.fullmatch(r"[A-Z0-9_]{1,16}", name):
        raise NotFound(f"there is no parameter {name[:32]!r}")
    return name
