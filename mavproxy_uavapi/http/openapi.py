"""OpenAPI 3.1 from the table of routes, the request models, and the tree of errors. Pure.

The routes of other modules, which come and go, are described just as ours; what nobody gave an example for
gets one that its model takes.
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
from mavproxy_uavapi.http.route import Route

ABOUT = """\
Arm, fly, watch and script an ArduPilot vehicle through MAVProxy. Units: metres, m/s, degrees, seconds, unless a \
name says otherwise. NED is north, east, down of the EKF origin; relative altitudes are above home.

**What is tried here is flown.** Each call answers when telemetry shows that it was done, or says why it was not."""

TAGS = {
    "command": "Arm, take off, land, modes, speeds, home. GET and POST do the same.",
    "movement": "Guided flight. Needs an armed vehicle that flies in GUIDED.",
    "telemetry": "What the vehicle last told, with its age.",
    "jobs": "The verbs in flight, and the last ones that ended.",
    "mission": "Scripts, each in a tmux session of its own; and the mission that the autopilot itself flies.",
    "parameters": "The autopilot's parameters; each new value is read back.",
    "vehicles": "Which vehicles there are. `/vehicles/{sysid}` before any path means that vehicle; without it the "
    "setting `sysid` says which, or MAVProxy's current one is meant.",
    "fleet": "One verb for several vehicles, with an answer of each.",
    "peripherical": "Servos and cameras.",
    "docs": "This documentation.",
}

# Errors by what a route is about; each of the tree's leaves is in some of them.
EVERYWHERE = (errors.Unauthorized, errors.Forbidden, errors.Invalid, errors.TooManyRequests)
OF_A_VEHICLE = (errors.LinkLost, errors.NoVehicle)
OF_A_COMMAND = (*OF_A_VEHICLE, errors.NotSupported, errors.Rejected, errors.TimedOut, errors.Busy)
OF_A_FLIGHT = (*OF_A_COMMAND, errors.Superseded, errors.ModeChanged, errors.Paused, errors.NotArmed, errors.Aborted)
OF_A_SCRIPT = (errors.BadRequest, errors.NotFound, errors.ToolFailed)
BY_TAG: Mapping[str, tuple[type[UavApiError], ...]] = {
    "command": OF_A_FLIGHT,
    "movement": OF_A_FLIGHT,
    "telemetry": (*OF_A_VEHICLE, errors.Stale, errors.NotFound),
    "jobs": (errors.NotFound, errors.Busy),
    "mission": OF_A_SCRIPT,
    "vehicles": (errors.NotFound,),
    "parameters": (*OF_A_VEHICLE, errors.NotFound, errors.TimedOut),
    "fleet": (),
    "docs": (errors.NotFound,),
}
BY_PATH: Mapping[str, tuple[type[UavApiError], ...]] = {
    "/mission/waypoints": (*OF_A_COMMAND, errors.BadRequest, errors.Aborted),
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
    "/mission/waypoints": {
        "text/plain": {"schema": {"type": "string"}, "example": examples.WPL},
        "application/json": {"schema": {"type": "object"}, "example": {"items": examples.ITEMS}},
        "multipart/form-data": {"schema": FILE_FORM},
    },
}
TEXT, EVENTS = {"schema": {"type": "string"}}, "text/event-stream"
KINDS: Mapping[str, Mapping[str, Any]] = {
    "/peripherical/take_photo": {"image/jpeg": {}},
    "/telemetry/stream": {EVENTS: TEXT},
    "/mission/scripts/{name}/log": {"text/plain": TEXT, EVENTS: TEXT},
    "/parameters.param": {"text/plain": TEXT},
    "/vision/frame.jpg": {"image/jpeg": {}},
    "/vision/stream.mjpg": {"multipart/x-mixed-replace": {}},
    "/docs": {"text/html": TEXT},
    "/docs/{file}": {"text/css": TEXT, "text/javascript": TEXT, "image/png": {}},
    "/openapi.json": {"application/json": {"schema": {"type": "object"}}},
}

# How pydantic spells a bound that it found on a union, and how JSON Schema does.
BOUNDS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum"}

ENVELOPE = {
    "type": "object",
    "description": "A success: the device, the vehicle's system id as text, and the result; telemetry says its age.",
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
    "description": "A failure: a sentence that a pilot understands, and a word that a program does.",
    "required": ["detail", "code"],
    "properties": {
        "detail": {"anyOf": [{"type": "string"}, {"type": "array", "items": PROBLEM}]},
        "code": {"type": "string"},
        "ack": {"type": "string", "description": "MAV_RESULT or MAV_MISSION_RESULT, where the autopilot refused"},
        "statustext": {"type": "array", "items": {"type": "string"}, "description": "what the autopilot said since"},
        "stderr": {"type": "string", "description": "what the program said that failed"},
    },
}


HURRY = [
    {
        "name": "wait",
        "in": "query",
        "required": False,
        "schema": {"type": "boolean", "default": True},
        "description": "false: answer 202 at once, with the number of the job that goes on",
    },
    {
        "name": "on_disconnect",
        "in": "query",
        "required": False,
        "schema": {"type": "string", "enum": ["continue", "hold"]},
        "description": "what the vehicle does when the client hangs up, over the setting of that name",
    },
    {
        "name": "Prefer",
        "in": "header",
        "required": False,
        "schema": {"type": "string", "enum": ["respond-async"]},
        "description": "respond-async: as wait=false",
    },
]
ACCEPTED = {
    "description": "It goes on as a job.",
    "headers": {"Location": {"description": "where the job is", "schema": {"type": "string"}}},
    "content": {
        "application/json": {
            "schema": {"$ref": "#/components/schemas/Success"},
            "example": {"device": "uav", "id": "1", "result": "Job 12 accepted", "job": "12"},
        }
    },
}


def document(routes: Sequence[Route]) -> dict[str, Any]:
    """The whole description."""
    paths: dict[str, dict[str, Any]] = {}
    for route in routes:
        for method in route.methods:
            paths.setdefault(route.path, {})[method.lower()] = operation(route, method)
    used = {tag_of(route) for route in routes}
    return {
        "openapi": "3.1.0",
        "info": {"title": "mavproxy-uavapi", "version": __version__, "description": ABOUT},
        "servers": [{"url": "/"}],
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
    summary, _, more = inspect.cleandoc(route.action.__doc__ or "").partition("\n")
    about = [more.strip(), inspect.cleandoc(route.model.__doc__ or "") if route.model.model_fields else ""]
    told: dict[str, Any] = {
        "tags": [tag_of(route)],
        "operationId": f"{method.lower()}{re.sub(r'[^A-Za-z0-9]+', '_', route.path)}".rstrip("_"),
        "summary": summary.strip(),
        "description": "\n\n".join(part for part in about if part),
        "parameters": _path_parameters(route),
        "responses": {"200": _success(route, method), **_failures(errors_of(route))},
    }
    if route.verb:
        types = [kind for kind, vehicle in CLASSES.items() if vehicle.has(route.verb)]
        told["x-vehicle-types"] = types
        told["description"] = f"{told['description']}\n\nOf: {', '.join(types)}.".strip()
    if tag_of(route) == "fleet":
        told["parameters"] += HURRY
        told["responses"]["207"] = {**told["responses"]["200"], "description": "Not every vehicle has done it."}
    if route.job:
        told["parameters"] += HURRY
        told["responses"]["202"] = ACCEPTED
    if method in ("POST", "PUT") and (route.raw or route.model.model_fields):
        told["requestBody"] = _body(route)
    elif method == "GET":
        told["parameters"] += _query(route.model)
    return told


def tag_of(route: Route) -> str:
    """What it is listed under: the first word of its path."""
    word = route.path.split("/")[1]
    return {"openapi.json": "docs", "parameters.param": "parameters"}.get(word, word)


def errors_of(route: Route) -> list[type[UavApiError]]:
    """What it may answer besides success, by status and code."""
    own = BY_PATH.get(route.path, BY_TAG.get(tag_of(route), (*OF_A_FLIGHT, errors.BadRequest, errors.NotFound)))
    body = (errors.BadRequest,) if {"POST", "PUT"} & set(route.methods) else ()
    return sorted({*EVERYWHERE, *own, *body}, key=lambda error: (error.status, error.code))


def example_of(model: type[requests.Request]) -> dict[str, Any]:
    """Values that the model takes."""
    given = examples.REQUESTS.get(model)
    if given is not None:
        return dict(given)
    fields = model.model_json_schema().get("properties", {})
    return {name: fields[name].get("default", 1) for name, field in model.model_fields.items() if field.is_required()}


def _path_parameters(route: Route) -> list[dict[str, Any]]:
    found = []
    for name in re.findall(r"{(\w+)}", route.path):
        shown = examples.PATH_PARAMETERS.get(name, {})
        example = next((value for path, value in shown.items() if route.path.startswith(path)), "x")
        schema = {"type": "string"}
        found.append({"name": name, "in": "path", "required": True, "schema": schema, "example": example})
    return found


def _query(model: type[requests.Request]) -> list[dict[str, Any]]:
    schema = simplified(model.model_json_schema())
    shown = example_of(model)
    found = []
    for name, field in schema.get("properties", {}).items():
        told = {"name": name, "in": "query", "required": name in schema.get("required", []), "schema": field}
        if "description" in field:
            told["description"] = field.pop("description")
        found.append({**told, "example": shown[name]} if name in shown else told)
    return found


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
        return {"description": "What was asked for.", "content": dict(KINDS[route.path])}
    body = example_answer(route.path, method)
    usual = "device" in body
    schema = {"$ref": "#/components/schemas/Success"} if usual else {"type": "object"}
    return {"description": "It was done.", "content": {"application/json": {"schema": schema, "example": body}}}


def example_answer(path: str, method: str) -> dict[str, Any]:
    """The body of a success."""

    def given(table: Mapping[str, Any], otherwise: Any) -> Any:
        return table.get(f"{method} {path}", table.get(path, otherwise))

    whole = given(examples.BODIES, None)
    if whole is not None:
        return dict(whole)
    return {"device": "uav", "id": "1", "result": given(examples.RESULTS, "Success"), **given(examples.MEMBERS, {})}


def _failures(found: Iterable[type[UavApiError]]) -> dict[str, Any]:
    """Responses by status, with an example for each code."""
    told: dict[str, Any] = {}
    for error in found:
        sentence = inspect.cleandoc(error.__doc__ or "").partition("\n")[0]
        detail: Any = [{"loc": ["body", "x"], "msg": sentence, "type": "value_error"}]
        body = {"detail": detail if error is errors.Invalid else sentence, "code": error.code}
        status = told.setdefault(
            str(error.status),
            {
                "description": "",
                "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Failure"}, "examples": {}}},
            },
        )
        status["description"] = f"{status['description']}\n- `{error.code}`: {sentence}".strip()
        status["content"]["application/json"]["examples"][error.code] = {"value": body}
    return told


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
    """A schema as people read it: one kind of number, and what may be left out without its null."""
    if isinstance(schema, list):
        return [simplified(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    choices = schema.get("anyOf")
    if isinstance(choices, list):
        left = [choice for choice in choices if choice.get("type") != "null"]
        if [choice.get("type") for choice in left] == ["integer", "number"]:
            left = [left[1]]
        if len(left) == 1:
            rest = {
                key: value for key, value in schema.items() if key != "anyOf" and (key, value) != ("default", None)
            }
            return simplified({**left[0], **rest})
    return {BOUNDS.get(key, key): simplified(value) for key, value in schema.items()}


def _name(model: type[requests.Request]) -> str:
    return model.__name__


def _order(tag: str) -> tuple[int, str]:
    return (list(TAGS).index(tag) if tag in TAGS else len(TAGS) - 2, tag)
