"""Holds each answer against what the description says of it, more strictly than a client may: nothing is unsaid."""

from __future__ import annotations

import functools
from typing import Any

import jsonschema_rs

from mavproxy_uavapi.http.contract.route import JSON
from mavproxy_uavapi.http.contract.router import Router
from mavproxy_uavapi.http.openapi import EVERYWHERE, document
from mavproxy_uavapi.http.routes import ROUTES

ANYWHERE = {error.code for error in EVERYWHERE} | {"internal", "not_found"}  # a path that is not there, or a defect


@functools.cache
def _described() -> dict[str, Any]:
    described: dict[str, Any] = _closed(document(ROUTES))
    return described


@functools.cache
def _router() -> Router:
    return Router(ROUTES, {})


@functools.cache
def _validator(name: str) -> Any:
    """The validator of a component, or of the answer of `method path status`."""
    words = name.split()
    if len(words) == 1:
        schema: dict[str, Any] = {"$ref": f"#/components/schemas/{name}"}
    else:
        method, path, status = words
        schema = _described()["paths"][path][method.lower()]["responses"][status]["content"][JSON]["schema"]
    return jsonschema_rs.validator_for({**schema, "components": _described()["components"]})


def _closed(schema: Any) -> Any:
    """The same, with no member besides those that are named."""
    if isinstance(schema, list):
        return [_closed(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    closed = {name: _closed(part) for name, part in schema.items()}
    return {"additionalProperties": False, **closed} if isinstance(schema.get("properties"), dict) else closed


def check(method: str, path: str, status: int, body: Any) -> None:
    """Raise AssertionError unless the answer is one of those that the description has for it."""
    match = _router().find(method, path.partition("?")[0])
    if match.route is None and status < 400:
        return  # of another module
    if status >= 400:
        _require(_validator("Failure"), body, f"{method} {path}: {status}")
        if match.route is not None:
            known = ANYWHERE | {error.code for error in match.route.errors}
            assert body["code"] in known, f"{method} {path} may answer {body['code']}, which is not described"
        return
    assert match.route is not None
    if match.route.content:
        return
    name = "Accepted" if status == 202 else f"{method} {match.route.path} {status}"
    _require(_validator(name), body, name)


def _require(validator: Any, body: Any, what: str) -> None:
    problems = [f"{problem.message} at {list(problem.instance_path)}" for problem in validator.iter_errors(body)]
    assert not problems, f"{what} is not what the description says: {problems}"
