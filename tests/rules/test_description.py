"""What /openapi.json promises, asked of the application itself: schemathesis makes the requests."""

from __future__ import annotations

import datetime
from typing import Any

import pytest
import requests
import schemathesis
import urllib3
from hypothesis import HealthCheck, given, settings
from schemathesis import GenerationMode
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from mavproxy_uavapi.http.openapi import document
from mavproxy_uavapi.http.routes import ROUTES

PROMISES = [status_code_conformance, content_type_conformance, response_schema_conformance]
BREATH = 0.2  # s that a verb is given before it is aborted: it is no flight that is tried here
# These wait for disks, programs or for ever, which virtual time does not; they have tests of their own.
# What a fleet's verb takes depends on its vehicles too (`each`), which no schema says.
ELSEWHERE = ("/fleet", "/parameters.param", "/mission", "/telemetry/stream", "/peripherical/take_photo", "/docs")

KNOWN_TO_THE_VEHICLE = ("GET /command/set_mode", "POST /command/set_mode")  # only it knows the names of its modes

SCHEMA = schemathesis.openapi.from_dict(document(ROUTES))
OPERATIONS = {
    f"{operation.method.upper()} {operation.path}": operation
    for operation in (result.ok() for result in SCHEMA.get_all_operations())
    if not operation.path.startswith(ELSEWHERE)
}
quick = settings(
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=8,
    suppress_health_check=list(HealthCheck),
)


def answer(world: Any, case: Any) -> requests.Response:
    """The application's answer to a request of schemathesis."""
    requested = requests.Request(**case.as_transport_kwargs("http://localhost")).prepare()
    body = requested.body.encode() if isinstance(requested.body, str) else requested.body
    kind = requested.headers.get("Content-Type", "application/json")
    wire = world.begin(requested.method, requested.path_url, body, kind=kind)
    world.loop.pass_time(BREATH)
    world.end_jobs()
    reply = world.answer(wire, 60.0)
    response = requests.Response()
    response.status_code, response.request = reply.status, requested
    response._content, response.elapsed = reply.raw, datetime.timedelta(0)
    response.headers.update(reply.headers)
    response.raw = urllib3.HTTPResponse(headers=reply.headers, status=reply.status, version=11)
    return response


CASES = [(name, GenerationMode.POSITIVE) for name in OPERATIONS]
CASES += [(name, GenerationMode.NEGATIVE) for name, operation in OPERATIONS.items() if len(operation.body)]


@pytest.mark.parametrize(("name", "mode"), CASES)
def test_answers_are_those_of_the_description(make_world: Any, name: str, mode: GenerationMode) -> None:
    world = make_world(max_rate=100_000, max_jobs=1000)
    statuses = []

    def ask(case: Any) -> None:
        response = answer(world, case)
        case.validate_response(response, checks=PROMISES)
        statuses.append(response.status_code)

    quick(given(case=OPERATIONS[name].as_strategy(generation_mode=mode))(ask))()
    if mode is GenerationMode.NEGATIVE:
        assert {400, 422} & set(statuses)
    elif name not in KNOWN_TO_THE_VEHICLE:
        assert set(statuses) - {400, 422}
