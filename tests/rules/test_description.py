"""What /openapi.json promises, asked of the application itself: schemathesis makes the requests."""

from __future__ import annotations

import datetime
from typing import Any

import pytest
import requests
import urllib3
from hypothesis import HealthCheck, given, seed, settings

from mavproxy_uavapi.http.openapi import document
from mavproxy_uavapi.http.routes import ROUTES
from tests.support.make_world import MakeWorld
from tests.support.world import World

pytestmark = pytest.mark.matrix

TRIES = 20  # of max_examples requests, until one is taken: few of what a schema allows make sense
BREATH = 0.2  # s that a verb is given before it is aborted: it is no flight that is tried here
# These wait for disks, programs or for ever, which virtual time does not; they have tests of their own.
# What a fleet's verb takes depends on its vehicles too (`each`), which no schema says.
ELSEWHERE = ("/fleet", "/parameters.param", "/mission", "/telemetry/stream", "/peripherical/take_photo", "/docs")

# What a schema does not say: the names of a vehicle's modes, and rings that are closed and do not cross themselves.
BEYOND_A_SCHEMA = ("GET /command/set_mode", "POST /command/set_mode", "PUT /envelope")

OPERATIONS = {
    f"{method.upper()} {path}": operation
    for path, item in document(ROUTES)["paths"].items()
    for method, operation in item.items()
    if not path.startswith((*ELSEWHERE, "/vehicles/{sysid}/"))
}
quick = settings(
    database=None,
    deadline=None,
    max_examples=3,
    suppress_health_check=list(HealthCheck),
)


def answer(world: World, case: Any) -> requests.Response:
    """The application's answer to a request of schemathesis."""
    requested = requests.Request(**case.as_transport_kwargs("http://localhost")).prepare()
    body = requested.body.encode() if isinstance(requested.body, str) else requested.body
    kind = requested.headers.get("Content-Type", "application/json")
    wire = world.begin(requested.method, requested.path_url, body, kind=kind)
    world.pass_time(BREATH)
    world.end_jobs()
    reply = world.answer(wire, 60.0)
    response = requests.Response()
    response.status_code, response.request = reply.status, requested
    response._content, response.elapsed = reply.raw, datetime.timedelta(0)
    response.headers.update(reply.headers)
    response.raw = urllib3.HTTPResponse(headers=reply.headers, status=reply.status, version=11)
    return response


@pytest.fixture(scope="module")
def schemathesis() -> Any:
    """It takes a second to import, which those who do not run these tests do not pay."""
    import schemathesis

    return schemathesis


@pytest.fixture(scope="module")
def schema(schemathesis: Any) -> Any:
    return schemathesis.openapi.from_dict(document(ROUTES))


CASES = [(name, "positive") for name in OPERATIONS]
CASES += [(name, "negative") for name, operation in OPERATIONS.items() if "requestBody" in operation]


@pytest.mark.parametrize(("name", "mode"), CASES)
def test_answers_are_those_of_the_description(
    make_world: MakeWorld, schemathesis: Any, schema: Any, name: str, mode: str
) -> None:
    from schemathesis.specs.openapi import checks

    world = make_world(max_rate=100_000, max_jobs=1000)
    method, path = name.split(" ", 1)
    promises = [checks.status_code_conformance, checks.content_type_conformance, checks.response_schema_conformance]
    statuses = []

    def ask(case: Any) -> None:
        response = answer(world, case)
        case.validate_response(response, checks=promises)
        statuses.append(response.status_code)

    cases = schema[path][method].as_strategy(generation_mode=schemathesis.GenerationMode(mode))
    for tries in range(3 if name in BEYOND_A_SCHEMA else TRIES):
        seed(tries)(quick(given(case=cases)(ask)))()
        if mode == "negative":
            assert {400, 422} & set(statuses)
            return
        if set(statuses) - {400, 422}:
            return
    assert name in BEYOND_A_SCHEMA
