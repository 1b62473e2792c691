"""OpenAPI 3.1 from the table of routes, the request models, and the error tree. Pure.

The routes of other modules, which come and go, are described in the same way. A model without an example gets one
that it accepts.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydantic.json_schema import models_json_schema

from mavproxy_uavapi import __version__
from mavproxy_uavapi.core import errors
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.vehicle.registry import CLASSES
from mavproxy_uavapi.http import examples, requests
from mavproxy_uavapi.http.fleet import FleetRequest
from mavproxy_uavapi.http.openapi_jobs import ACCEPTED, PREFER
from mavproxy_uavapi.http.route import Route

ABOUT = """\
Arm, fly, watch and script an ArduPilot vehicle through MAVProxy. Units: metres, m/s, degrees, seconds, unless a \
name says otherwise. NED is north, east, down of the EKF origin; relative altitudes are above home.

**Calls from this page fly the vehicle.** Each call answers when telemetry shows its effect, or says why it failed.

`x-role` is what a token must be for: `watch`, `fly` (the vehicle that is meant), or `admin`."""

TAGS = {
    "command": "Arm, take off, land, modes, speeds, home. GET and POST do the same.",
    "movement": "Guided flight. Needs an armed vehicle that flies in GUIDED.",
    "telemetry": "The newest data from the vehicle, with its age.",
    "jobs": "The running verbs and the last ones that ended.",
    "audit": "What was commanded, by whom, and what happened to the vehicles meanwhile.",
    "mission": "Scripts, each in its own tmux session; and the mission that the autopilot itself flies.",
    "parameters": "The autopilot's parameters; each new value is read back.",
    "logs": "The dataflash logs that a vehicle holds, and their download to this machine.",
    "envelope": "Where vehicles may fly. Nothing that leads out of it is sent, whoever asks for it.",
    "settings": "The settings of our modules. Most of `uavapi` are set here, all of them at the prompt.",
    "message": "Any MAVLink message, for what has no verb. Off unless the setting `allow_raw` is true.",
    "authority": "Which operator holds a vehicle. Taking it and giving it back sends nothing.",
    "vehicles": "All known vehicles. The prefix `/vehicles/{sysid}` of any path means that vehicle; without it the "
    "setting `sysid` decides, or MAVProxy's current vehicle is meant.",
    "fleet": "One verb for several vehicles, with an answer for each.",
    "peripherical": "Servos and cameras.",
    "docs": "This documentation.",
}

# Errors by the subject of a route; each leaf of the error tree is in at least one.
EVERYWHERE = (errors.Unauthorized, errors.Forbidden, errors.Invalid, errors.TooManyRequests)
OF_A_VEHICLE = (errors.LinkLost, errors.NoVehicle)
OF_A_COMMAND = (*OF_A_VEHICLE, errors.NotSupported, errors.Rejected, errors.TimedOut, errors.Busy)
OF_A_FLIGHT = (
    *OF_A_COMMAND,
    errors.Superseded,
    errors.ModeChanged,
    errors.Paused,
    errors.NotArmed,
    errors.Aborted,
    errors.OutsideEnvelope,
    errors.TooNear,
    errors.Expired,
)
OF_A_SCRIPT = (errors.BadRequest, errors.NotFound, errors.ToolFailed)
BY_TAG: Mapping[str, tuple[type[UavApiError], ...]] = {
    "command": OF_A_FLIGHT,
    "movement": OF_A_FLIGHT,
    "telemetry": (*OF_A_VEHICLE, errors.Stale, errors.NotFound),
    "jobs": (errors.NotFound, errors.Busy),
    "audit": (errors.NotFound,),
    "mission": OF_A_SCRIPT,
    "envelope": (errors.NotFound, errors.BadRequest),
    "vehicles": (errors.NotFound,),
    "authority": (errors.NoVehicle, errors.Busy),
    "parameters": (*OF_A_VEHICLE, errors.NotFound, errors.TimedOut, errors.OutsideEnvelope),
    "settings": (errors.NotFound, errors.TimedOut),
    "logs": (*OF_A_COMMAND, errors.NotFound, errors.Stale, errors.Aborted, errors.ToolFailed),
    "fleet": (),
    "docs": (errors.NotFound,),
}
BY_PATH: Mapping[str, tuple[type[UavApiError], ...]] = {
    **dict.fromkeys(
        ("/mission/waypoints", "/mission/fence", "/mission/rally"),
        (*OF_A_COMMAND, errors.BadRequest, errors.Aborted, errors.OutsideEnvelope),
    ),
    "/mission/start": OF_A_FLIGHT,
    "/mission/progress": (errors.NoVehicle, errors.Stale),
    "/peripherical/servo_output": OF_A_COMMAND,
    "/peripherical/take_photo": (errors.BadRequest, errors.ToolFailed, errors.TimedOut),
}

FILE_FORM = {
    "type": "object",
    "required": ["file"],
    "properties": {"file": {"type": "string", "contentMediaType": "application/octet-stream"}},
}
RAW_BODIES: Mapping[str, Mapping[str, Any]] = {
    "/mission/upload-script": {"multipart/form-data": {"schema": FILE_FORM}},
    "/parameters": {
        "text/plain": {"schema": {"type": "string"}, "example": "WPNAV_SPEED 500"},
        "application/json": {"schema": {"type": "object"}, "example": {"parameters": {"WPNAV_SPEED": 500}}},
    },
    "/envelope": {
        "application/geo+json": {"schema": {"type": "object"}, "example": examples.ENVELOPE},
        "application/vnd.google-earth.kml+xml": {"schema": {"type": "string"}},
    },
    "/mission/waypoints": {
        "text/plain": {"schema": {"type": "string"}, "example": examples.WPL},
        "application/json": {"schema": {"type": "object"}, "example": {"items": examples.ITEMS}},
        "multipart/form-data": {"schema": FILE_FORM},
    },
    "/mission/fence": {
        "application/json": {"schema": {"type": "object"}, "example": examples.FENCE},
        "multipart/form-data": {"schema": FILE_FORM},
    },
    "/mission/rally": {
        "application/json": {"schema": {"type": "object"}, "example": {"points": examples.POINTS}},
        "multipart/form-data": {"schema": FILE_FORM},
    },
}
TEXT, EVENTS = {"schema": {"type": "string"}}, "text/event-stream"
KINDS: Mapping[str, Mapping[str, Any]] = {
    "/peripherical/take_photo": {"image/jpeg": {}},
    "/telemetry/stream": {EVENTS: TEXT},
    "/mission/scripts/{name}/log": {"text/plain": TEXT, EVENTS: TEXT},
    "/parameters.param": {"text/plain": TEXT},
    "/logs/{id}": {"application/octet-stream": {}},
    "/vision/frame.jpg": {"image/jpeg": {}},
    "/vision/stream.mjpg": {"multipart/x-mixed-replace": {}},
    "/docs": {"text/html": TEXT},
    "/docs/{file}": {"text/css": TEXT, "text/javascript": TEXT, "image/png": {}},
    "/openapi.json": {"application/json": {"schema": {"type": "object"}}},
}

# pydantic's names for a bound on a union, and JSON Schema's.
BOUNDS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum"}

ENVELOPE = {
    "type": "object",
    "description": "A success: the device, the vehicle's system id as text, and the result; telemetry has its age.",
    "required": ["device", "id", "result"],
    "properties": {
        "device": {"const": "uav"},
        "id": {"type": "string"},
        "result": {"type": "string"},
        "age_s": {"type": "number", "description": "s since the message arrived"},
    },
    "additionalProperties": True,
}
PROBLEM = {
    "type": "object",
    "required": ["loc", "msg", "type"],
    "properties": {"loc": {"type": "array"}, "msg": {"type": "string"}, "type": {"type": "string"}},
}
FAILURE = {
    "type": "object",
    "description": "A failure: a sentence for the pilot, and an error code for programs.",
    "required": ["detail", "code"],
    "properties": {
        "detail": {"anyOf": [{"type": "string"}, {"type": "array", "items": PROBLEM}]},
        "code": {"type": "string"},
        "ack": {"type": "string", "description": "MAV_RESULT or MAV_MISSION_RESULT, if the autopilot refused"},
        "statustext": {"type": "array", "items": {"type": "string"}, "description": "the autopilot's texts since"},
        "change": {"type": "object", "description": "how it came to that: from, to, time, by whom, last_sent"},
        "outside": {"type": "object", "description": "what it would break (`what`), where (`at`), and `by` how much"},
        "stderr": {"type": "string", "description": "the error output of the program that failed"},
    },
}


def document(routes: Sequence[Route]) -> dict[str, Any]:
    """The whole OpenAPI document."""
    paths: dict[str, dict[str, Any]] = {}
    for route in routes:
        for method in route.methods:
            paths.setdefault(route.path, {})[method.lower()] = operation(route, method)
    used = {tag_of(route) for route in routes}
    return {
        "openapi": "3.1.0",
        "info": {"title": "mavproxy-uavapi", "version": __version__, "description": ABOUT},
        "servers": [{"url": "./"}],  # where this document is: below a proxy's path, too
        "security": [{}, {"token": []}],
        "tags": [
            {"name": tag, "description": TAGS.get(tag, f"Of the module {tag}.")} for tag in sorted(used, key=_order)
        ],
        "paths": paths,
        "components": {
            "schemas": {**_models(routes), "Success": ENVELOPE, "Failure": FAILURE},
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


def operation(route: Route, method: str) -> dict[str, Any]:
    """One method of one path."""
    summary, _, details = inspect.cleandoc(route.action.__doc__ or "").partition("\n")
    about = [details.strip(), inspect.cleandoc(route.model.__doc__ or "") if route.model.model_fields else ""]
    description: dict[str, Any] = {
        "tags": [tag_of(route)],
        "operationId": f"{method.lower()}{re.sub(r'[^A-Za-z0-9]+', '_', route.path)}".rstrip("_"),
        "summary": summary.strip(),
        "description": "\n\n".join(part for part in about if part),
        "parameters": _path_parameters(route),
        "x-role": route.needs.word,
        "responses": {"200": _success(route, method), **_failures(errors_of(route))},
    }
    if route.verb:
        types = [kind for kind, vehicle in CLASSES.items() if vehicle.has(route.verb)]
        description["x-vehicle-types"] = types
        description["description"] = f"{description['description']}\n\nOf: {', '.join(types)}.".strip()
    if route.fleet:
        description["responses"]["207"] = {
            **description["responses"]["200"],
            "description": "Not every vehicle has done it.",
        }
    if route.job or route.fleet:
        description["parameters"] += [*_query(route.options), PREFER]
    if route.job:
        description["responses"]["202"] = ACCEPTED
    if route.body_types(method) and (route.raw or route.model.model_fields):
        description["requestBody"] = _body(route)
    elif method == "GET":
        description["parameters"] += _query(route.model)
    return description


def tag_of(route: Route) -> str:
    """The tag of a route: the first word of its path."""
    word = route.path.split("/")[1]
    return {"openapi.json": "docs", "parameters.param": "parameters"}.get(word, word)


def errors_of(route: Route) -> list[type[UavApiError]]:
    """The errors that it may answer, by status and code."""
    specific = BY_PATH.get(route.path, BY_TAG.get(tag_of(route), (*OF_A_FLIGHT, errors.BadRequest, errors.NotFound)))
    body = (errors.BadRequest,) if {"POST", "PUT"} & set(route.methods) else ()
    return sorted({*EVERYWHERE, *specific, *body}, key=lambda error: (error.status, error.code))


def example_of(model: type[requests.Request]) -> dict[str, Any]:
    """Example values that the model accepts."""
    if issubclass(model, FleetRequest):
        return {"vehicles": [1], **example_of(model.verb)}
    example = examples.REQUESTS.get(model)
    if example is not None:
        return dict(example)
    fields = model.model_json_schema().get("properties", {})
    return {name: fields[name].get("default", 1) for name, field in model.model_fields.items() if field.is_required()}


def _path_parameters(route: Route) -> list[dict[str, Any]]:
    parameters = []
    for name in re.findall(r"{(\w+)}", route.path):
        by_path = examples.PATH_PARAMETERS.get(name, {})
        example = next((value for path, value in by_path.items() if route.path.startswith(path)), "x")
        schema = {"type": "string"}
        parameters.append({"name": name, "in": "path", "required": True, "schema": schema, "example": example})
    return parameters


def _query(model: type[requests.Request]) -> list[dict[str, Any]]:
    schema = simplified(model.model_json_schema())
    examples_by_name = example_of(model)
    parameters = []
    for name, field in schema.get("properties", {}).items():
        parameter = {"name": name, "in": "query", "required": name in schema.get("required", []), "schema": field}
        if "description" in field:
            parameter["description"] = field.pop("description")
        parameters.append({**parameter, "example": examples_by_name[name]} if name in examples_by_name else parameter)
    return parameters


def _body(route: Route) -> dict[str, Any]:
    if route.raw:
        content = RAW_BODIES.get(route.path, {"application/octet-stream": {}})
        return {"required": True, "content": dict(content)}
    schema = {"$ref": f"#/components/schemas/{route.model.__name__}"}
    required = any(field.is_required() for field in route.model.model_fields.values())
    return {
        "required": required,
        "content": {"application/json": {"schema": schema, "example": example_of(route.model)}},
    }


def _success(route: Route, method: str) -> dict[str, Any]:
    if route.path in KINDS:
        return {"description": "The requested content.", "content": dict(KINDS[route.path])}
    body = example_answer(route.path, method)
    usual = "device" in body
    schema = {"$ref": "#/components/schemas/Success"} if usual else {"type": "object"}
    return {"description": "It was done.", "content": {"application/json": {"schema": schema, "example": body}}}


def example_answer(path: str, method: str) -> dict[str, Any]:
    """The body of a success."""

    def example(table: Mapping[str, Any], otherwise: Any) -> Any:
        return table.get(f"{method} {path}", table.get(path, otherwise))

    whole_body = example(examples.BODIES, None)
    if whole_body is not None:
        return dict(whole_body)
    return {
        "device": "uav",
        "id": "1",
        "result": example(examples.RESULTS, "Success"),
        **example(examples.MEMBERS, {}),
    }


def _failures(error_types: Iterable[type[UavApiError]]) -> dict[str, Any]:
    """Responses by status, with an example for each code."""
    responses: dict[str, Any] = {}
    for error in error_types:
        sentence = inspect.cleandoc(error.__doc__ or "").partition("\n")[0]
        detail: Any = [{"loc": ["body", "x"], "msg": sentence, "type": "value_error"}]
        body = {"detail": detail if error is errors.Invalid else sentence, "code": error.code}
        status = responses.setdefault(
            str(error.status),
            {
                "description": "",
                "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Failure"}, "examples": {}}},
            },
        )
        status["description"] = f"{status['description']}\n- `{error.code}`: {sentence}".strip()
        status["content"]["application/json"]["examples"][error.code] = {"value": body}
    return responses


def _models(routes: Sequence[Route]) -> dict[str, Any]:
    """The schemas of all bodies, by their models' names."""
    with_body = [route for route in routes if {"POST", "PUT"} & set(route.methods) and not route.raw]
    models = {route.model for route in with_body if route.model.model_fields}
    template = "#/components/schemas/{model}"
    _, schema = models_json_schema(
        [(model, "validation") for model in sorted(models, key=_name)], ref_template=template
    )
    simple: dict[str, Any] = simplified(schema.get("$defs", {}))
    return simple


def simplified(schema: Any) -> Any:
    """A simpler schema for readers: one number type, and no null for optional values."""
    if isinstance(schema, list):
        return [simplified(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    choices = schema.get("anyOf")
    if isinstance(choices, list):
        non_null = [choice for choice in choices if choice.get("type") != "null"]
        if [choice.get("type") for choice in non_null] == ["integer", "number"]:
            non_null = [non_null[1]]
        if len(non_null) == 1:
            other_members = {
                key: value for key, value in schema.items() if key != "anyOf" and (key, value) != ("default", None)
            }
            return simplified({**non_null[0], **other_members})
    return {BOUNDS.get(key, key): simplified(value) for key, value in schema.items()}


def _name(model: type[requests.Request]) -> str:
    return model.__name__


def _order(tag: str) -> tuple[int, str]:
    return (list(TAGS).index(tag) if tag in TAGS else len(TAGS) - 2, tag)
