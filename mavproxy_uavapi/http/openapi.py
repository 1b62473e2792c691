"""OpenAPI 3.1 from the table of routes: their models, the types that their actions return, and the error tree. Pure.

The routes of other modules, which come and go, are described in the same way.
"""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args, get_type_hints

from pydantic import TypeAdapter
from typing_extensions import is_typeddict

from mavproxy_uavapi import __version__
from mavproxy_uavapi.core import errors
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.vehicle.registry import CLASSES
from mavproxy_uavapi.http.contract.answers import Accepted, Failure
from mavproxy_uavapi.http.contract.requests import JobOptions, Request
from mavproxy_uavapi.http.contract.route import JSON, WITH_BODY, Action, Route
from mavproxy_uavapi.http.handlers.fleet import FleetRequest

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
    "flights": "What was recorded of each flight: a file each, to take home.",
    "mission": "Scripts, each in its own tmux session; and the mission that the autopilot itself flies.",
    "rehearsals": "A script or the mission on an embedded vehicle first, which is as the real one is.",
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
    "one vehicle": "The same for the vehicle with that system id, whichever MAVProxy means.",
    "docs": "This documentation.",
}

EVERYWHERE = (errors.Unauthorized, errors.Forbidden, errors.Invalid, errors.TooManyRequests, errors.BadRequest)
# pydantic's names for a bound on a union, and JSON Schema's.
BOUNDS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum"}
SCHEMA = "#/components/schemas/{model}"
PARAMETER = "#/components/parameters/{name}"
OF_A_VEHICLE = "/vehicles/{sysid}"
ONE_VEHICLE = "one vehicle"
SYSTEM = {"name": "sysid", "in": "path", "required": True, "schema": {"type": "integer"}, "example": 1}
PREFER = {
    "name": "Prefer",
    "in": "header",
    "schema": {"type": "string", "enum": ["respond-async"]},
    "description": "respond-async: same as wait=false",
}
LOCATION = {"Location": {"description": "where the job is", "schema": {"type": "string"}}}


def document(routes: Sequence[Route]) -> dict[str, Any]:
    """The whole OpenAPI document."""
    schemas = Schemas.of(routes)
    paths: dict[str, dict[str, Any]] = {}
    for route in routes:
        for method in route.methods:
            paths.setdefault(route.path, {})[method.lower()] = operation(route, method, schemas)
            if route.of_vehicle:
                path = f"{OF_A_VEHICLE}{route.path}"
                described = paths[route.path][method.lower()]
                paths.setdefault(path, {})[method.lower()] = of_one_vehicle(route, method, described)
    used = {tag for item in paths.values() for operation in item.values() for tag in operation["tags"]}
    content = {JSON: {"schema": schemas.by_type[Accepted]}}
    accepted = {"description": "It goes on as a job.", "headers": LOCATION, "content": content}
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
            "schemas": schemas.all,
            "parameters": {**_options(), "sysid": SYSTEM},
            "responses": {"Failure": _failure(), "Accepted": accepted},
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
    }


@dataclass
class Schemas:
    """The schemas of bodies and answers.

    Attributes:
        all: by the names of their types.
        by_type: the schema of each body's model and each answer's type, most of them a reference into `all`.
    """

    all: dict[str, Any] = field(default_factory=dict)
    by_type: dict[Any, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, routes: Sequence[Route]) -> Schemas:
        """Those of all routes."""
        answers = {answer for route in routes for answer in answers_of(route.action)} | {Accepted, Failure}
        bodies = {route.model for route in routes if _has_parameters(route) and {*WITH_BODY} & {*route.methods}}
        types = sorted(answers | bodies, key=str)
        adapters = [(one, "serialization" if one in answers else "validation", TypeAdapter(one)) for one in types]
        by_key, definitions = TypeAdapter.json_schemas(adapters, ref_template=SCHEMA)  # type: ignore[arg-type]
        schemas = {name: simplified(schema) for name, schema in definitions.get("$defs", {}).items()}
        schemas["Failure"]["properties"]["code"]["enum"] = sorted(error.code for error in leaves())
        return cls(schemas, {one: by_key[one, mode] for one, mode, _ in adapters})  # type: ignore[index]

    def example_of(self, schema: Mapping[str, Any]) -> Any:  # noqa: PLR0911  one for each kind of schema
        """A value that the schema describes, from the examples of its parts."""
        if "$ref" in schema:
            return self.example_of(self.all[schema["$ref"].rpartition("/")[2]])
        if "anyOf" in schema and "examples" not in schema:
            return self.example_of(schema["anyOf"][0])
        shown = (
            schema.get("examples") or schema.get("enum") or [schema[word] for word in ("const",) if word in schema]
        )
        if shown:
            return shown[0]
        if schema.get("type") == "object":
            return {name: self.example_of(part) for name, part in schema.get("properties", {}).items()}
        if schema.get("type") == "array":
            return [self.example_of(schema["items"])]
        return {"boolean": True, "string": "", "null": None}.get(schema.get("type", "null"), 0)


def operation(route: Route, method: str, schemas: Schemas) -> dict[str, Any]:
    """One method of one path."""
    summary, _, details = inspect.cleandoc(route.action.__doc__ or "").partition("\n")
    about = [details.strip(), inspect.cleandoc(route.model.__doc__ or "") if route.model.model_fields else ""]
    types = [kind for kind, vehicle in CLASSES.items() if vehicle.has(route.verb)] if route.verb else []
    if types:
        about.append(f"Of: {', '.join(types)}.")
    description: dict[str, Any] = {
        "tags": [tag_of(route)],
        "operationId": _operation_id(method, route.path),
        "summary": summary.strip(),
        "description": "\n\n".join(part for part in about if part),
        "parameters": [*_path_parameters(route), *_query(route, method)],
        "x-role": route.needs.word,
        "x-codes": [error.code for error in errors_of(route)],
        "responses": {
            **_successes(route, schemas),
            "default": _response("Failure"),
        },
    }
    if types:
        description["x-vehicle-types"] = types
    if route.body_types(method) and (route.raw or route.model.model_fields):
        description["requestBody"] = _body(route, schemas)
    return description


def of_one_vehicle(route: Route, method: str, described: Mapping[str, Any]) -> dict[str, Any]:
    """The same for the vehicle that the path names; what else there is to say is said once."""
    same = _bare({name: part for name, part in described.items() if name not in ("description", "x-codes")})
    return {
        **same,
        "tags": [ONE_VEHICLE],
        "operationId": _operation_id(method, f"{OF_A_VEHICLE}{route.path}"),
        "summary": f"As {method} {route.path}, of one vehicle.",
        "parameters": [{"$ref": PARAMETER.format(name="sysid")}, *same["parameters"]],
    }


def _bare(described: Any) -> Any:
    """A description without its examples."""
    if isinstance(described, list):
        return [_bare(part) for part in described]
    if not isinstance(described, dict):
        return described
    return {name: _bare(part) for name, part in described.items() if name != "example"}


def tag_of(route: Route) -> str:
    """The tag of a route: the first word of its path."""
    word = route.path.split("/")[1]
    return {"openapi.json": "docs", "version": "docs", "parameters.param": "parameters"}.get(word, word)


def answers_of(action: Action) -> list[Any]:
    """The types of the bodies that an action returns, by its annotation; none if it makes the whole response."""
    returned = get_type_hints(action, include_extras=True)["return"]
    return [one for one in (get_args(returned) if not is_answer(returned) else (returned,)) if is_answer(one)]


def is_answer(kind: Any) -> bool:
    """Whether it is the type of a body."""
    return is_typeddict(getattr(kind, "__origin__", kind))


def errors_of(route: Route) -> list[type[UavApiError]]:
    """The errors that it may answer besides those that any route may, by status and code."""
    rehearsed = {errors.NotRehearsed} if route.conditions is not None else set()
    return sorted({*route.errors, *rehearsed} - {*EVERYWHERE}, key=lambda error: (error.status, error.code))


def leaves(base: type[UavApiError] = UavApiError) -> Iterator[type[UavApiError]]:
    """The errors that are raised, those of other modules, too: each has a code of its own."""
    seen: set[str] = set()
    below = [base]
    while below:
        error = below.pop(0)
        below += error.__subclasses__()
        if error.code not in seen and error not in (errors.Conflict, errors.StateChanged, errors.Unavailable):
            seen.add(error.code)
            yield error


def example_of(model: type[Request]) -> dict[str, Any]:
    """Example values that the model accepts."""
    if issubclass(model, FleetRequest):
        return {"vehicles": [1], **example_of(model.verb)}
    fields = model.model_json_schema().get("properties", {})
    shown = {name: fields[name] for name, one in model.model_fields.items() if one.is_required() or one.examples}
    return {name: shown[name].get("examples", [shown[name].get("default", 1)])[0] for name in shown}


def _has_parameters(route: Route) -> bool:
    return bool(route.model.model_fields) and not route.raw


def _operation_id(method: str, path: str) -> str:
    return f"{method.lower()}{re.sub(r'[^A-Za-z0-9]+', '_', path)}".rstrip("_")


def _path_parameters(route: Route) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "in": "path",
            "required": True,
            "schema": {"type": "string"},
            "example": route.names.get(name, "x"),
        }
        for name in re.findall(r"{(\w+)}", route.path)
    ]


def _query(route: Route, method: str) -> list[dict[str, Any]]:
    """What the query may say, and the header of a job."""
    own = _parameters(route.model) if method not in WITH_BODY or route.raw else []
    return [*own, *({"$ref": PARAMETER.format(name=name)} for name in _options() if route.job or route.fleet)]


def _parameters(model: type[Request]) -> list[dict[str, Any]]:
    schema, examples = simplified(model.model_json_schema()), example_of(model)
    parameters = []
    for name, one in schema.get("properties", {}).items():
        parameter = {"name": name, "in": "query", "required": name in schema.get("required", []), "schema": one}
        if "description" in one:
            parameter["description"] = one.pop("description")
        one.pop("examples", None)
        parameters.append({**parameter, "example": examples[name]} if name in examples else parameter)
    return parameters


@functools.cache
def _options() -> dict[str, Any]:
    """What each job takes besides its parameters, by name."""
    return {**{one["name"]: one for one in _parameters(JobOptions)}, "Prefer": PREFER}


def _response(name: str) -> dict[str, str]:
    return {"$ref": f"#/components/responses/{name}"}


def _body(route: Route, schemas: Schemas) -> dict[str, Any]:
    if route.raw:
        return {
            "required": True,
            "content": {kind: simplified(described) for kind, described in route.raw.items() if described},
        }
    required = any(one.is_required() for one in route.model.model_fields.values())
    content = {"schema": schemas.by_type[route.model], "example": example_of(route.model)}
    return {"required": required, "content": {JSON: content}}


def _successes(route: Route, schemas: Schemas) -> dict[str, Any]:
    """The answers that are no failure, by status."""
    types = answers_of(route.action)
    if route.content or not types:
        return {"200": {"description": "The requested content.", "content": dict(route.content)}}
    kinds = [schemas.by_type[answer] for answer in types]
    schema = kinds[0] if len(kinds) == 1 else {"anyOf": kinds}
    example = schemas.example_of(schema)
    if "result" in example and not route.fleet:
        example["result"] = route.done
    done = {"description": "It was done.", "content": {JSON: {"schema": schema, "example": example}}}
    answers = {"200": done}
    if route.partly:
        answers["207"] = {**done, "description": "It was done in part."}
    return {**answers, "202": _response("Accepted")} if route.job else answers


def _failure() -> dict[str, Any]:
    """Any failure, with a sentence and an example for each code."""
    lines, examples = [], {}
    for error in sorted(leaves(), key=lambda error: (error.status, error.code)):
        sentence = inspect.cleandoc(error.__doc__ or "").partition("\n")[0]
        detail: Any = [{"loc": ["body", "x"], "msg": sentence, "type": "value_error"}]
        body = {"detail": detail if error is errors.Invalid else sentence, "code": error.code}
        lines.append(f"- {error.status} `{error.code}`: {sentence}")
        examples[error.code] = {"value": body}
    about = "A failure. `x-codes` of an operation says which it may answer besides those that any may."
    return {
        "description": "\n".join([about, "", *lines]),
        "content": {JSON: {"schema": {"$ref": SCHEMA.format(model="Failure")}, "examples": examples}},
    }


def simplified(schema: Any) -> Any:
    """A simpler schema for readers: one number type, no titles of members, and no null for optional parameters."""
    if isinstance(schema, list):
        return [simplified(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    choices = schema.get("anyOf")
    if isinstance(choices, list):
        is_optional = ("default", None) in schema.items()
        kept = [choice for choice in choices if not is_optional or choice.get("type") != "null"]
        types = [choice.get("type") for choice in kept]
        if types[:2] == ["integer", "number"]:
            kept = kept[1:]
        others = {key: value for key, value in schema.items() if key != "anyOf" and (key, value) != ("default", None)}
        return _each({**kept[0], **others} if len(kept) == 1 else {**others, "anyOf": kept})
    return _each(schema)


def _each(schema: Mapping[str, Any]) -> dict[str, Any]:
    return {
        BOUNDS.get(key, key): value
        if key in ("example", "examples")
        else {name: simplified(part) for name, part in value.items()}
        if key in ("properties", "$defs")
        else simplified(value)
        for key, value in schema.items()
        if key != "title" or not isinstance(value, str)
    }


def _order(tag: str) -> tuple[int, str]:
    return (list(TAGS).index(tag) if tag in TAGS else len(TAGS) - 2, tag)
