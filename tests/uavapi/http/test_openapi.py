from __future__ import annotations

import functools
import gc
import re
import weakref
from pathlib import Path
from typing import Annotated, Any

import pytest
from pydantic import Field

from mavproxy_uavapi import __version__
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.http import routes
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.contract import requests
from mavproxy_uavapi.http.contract.answers import Success
from mavproxy_uavapi.http.contract.route import FLY, Route
from mavproxy_uavapi.http.openapi import EVERYWHERE, TAGS, answers_of, document, example_of, leaves, simplified
from mavproxy_uavapi.http.routes import ROUTES
from tests.support import described as described_answers
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

OPERATIONS = [(route, method) for route in ROUTES for method in route.methods]
API_PAGE = Path(__file__).parents[3] / "docs" / "api.md"


@functools.cache
def whole() -> Any:
    return document(ROUTES)


def named(operation: tuple[Route, str]) -> str:
    return f"{operation[1]} {operation[0].path}"


def described(route: Route, method: str) -> Any:
    return whole()["paths"][route.path][method.lower()]


def parameters(operation: Any) -> list[Any]:
    """Those of an operation, wherever they are written."""
    shared = whole()["components"]["parameters"]
    return [shared[one["$ref"].rpartition("/")[2]] if "$ref" in one else one for one in operation["parameters"]]


OURS = [error for error in leaves() if error is not UavApiError and error.__module__ == "mavproxy_uavapi.core.errors"]


@pytest.mark.parametrize("operation", OPERATIONS, ids=named)
def test_every_route_is_described_by_model_errors_and_a_true_answer(
    operation: tuple[Route, str],
) -> None:
    route, method = operation
    reported = described(route, method)
    assert reported["summary"] == (route.action.__doc__ or "").strip().splitlines()[0].strip()
    assert reported["summary"].endswith(".")
    assert reported["tags"][0] in TAGS
    fields = {parameter["name"] for parameter in parameters(reported) if parameter["in"] == "query"}
    assert ("202" in reported["responses"]) is route.job
    assert ("207" in reported["responses"]) is route.partly
    assert ("wait" in fields) is (route.job or reported["tags"] == ["fleet"])
    if method == "GET":
        assert fields - {"wait", "on_disconnect", "lease", "client"} == set(route.model.model_fields)
    elif method == "POST" and not route.raw and route.model.model_fields:
        body = reported["requestBody"]["content"]["application/json"]
        assert body["schema"]["$ref"].endswith(f"/{route.model.__name__}")
        properties = whole()["components"]["schemas"][route.model.__name__]["properties"]
        assert set(properties) == set(route.model.model_fields)
    in_path = {parameter["name"] for parameter in parameters(reported) if parameter["in"] == "path"}
    assert in_path == set(re.findall(r"{(\w+)}", route.path))
    assert set(reported["x-codes"]) <= {error.code for error in OURS} - {error.code for error in EVERYWHERE}
    content = reported["responses"]["200"]["content"]
    assert route.content or answers_of(route.action)
    if not route.content:
        described_answers.check(method, route.path, 200, content["application/json"]["example"])


def test_paths_are_those_of_the_routes_also_below_a_vehicle() -> None:
    described_ones = {(path, method) for path, methods in whole()["paths"].items() for method in methods}
    plain = {(route.path, method.lower()) for route, method in OPERATIONS}
    of_vehicles = [(route.path, method.lower()) for route, method in OPERATIONS if route.of_vehicle]
    of_one = {(f"/vehicles/{{sysid}}{path}", method) for path, method in of_vehicles}
    assert described_ones == plain | of_one
    assert ("/vehicles/{sysid}/command/arm", "post") in of_one


def test_description_is_no_larger_than_it_has_to_be() -> None:
    """330 operations, each twice by its vehicle; compressed it is 30 kB."""
    assert len(routes._specification(())) < 380_000


def test_operations_have_names_of_their_own() -> None:
    names = [operation["operationId"] for item in whole()["paths"].values() for operation in item.values()]
    assert len(names) == len(set(names))


MODELS = sorted({route.model for route in ROUTES if not route.raw}, key=lambda model: model.__name__)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_requests_take_their_example_and_say_what_each_parameter_is(model: type[requests.Request]) -> None:
    shown = example_of(model)
    model.model_validate(shown)
    verb = getattr(model, "verb", model)
    assert set(shown) <= set(model.model_fields) | set(verb.model_fields)
    for name, field in simplified(model.model_json_schema()).get("properties", {}).items():
        assert field.get("description"), f"{model.__name__}.{name} has no description with its unit"


@pytest.mark.parametrize("error", OURS, ids=lambda error: error.__name__)
def test_every_error_is_documented_on_some_route_and_on_the_page(error: type[UavApiError]) -> None:
    shown = [described(*operation)["x-codes"] for operation in OPERATIONS]
    assert error in EVERYWHERE or any(error.code in codes for codes in shown)
    failure = whole()["components"]["responses"]["Failure"]
    assert error.code in failure["content"]["application/json"]["examples"]
    assert error.code in whole()["components"]["schemas"]["Failure"]["properties"]["code"]["enum"]
    assert re.search(rf"\| {error.status} [^\n]*`{error.code}`", API_PAGE.read_text(encoding="utf-8"))


def test_answer_that_is_not_as_described_is_noticed(flying: Drone, api: Api) -> None:
    """Every answer in these tests is held against the description."""
    real = api.get("/telemetry/gps").body
    described_answers.check("GET", "/telemetry/gps", 200, real)
    for wrong in ({**real, "more": 1}, {**real, "age_s": "0.1"}, {"info": real["info"]}):
        with pytest.raises(AssertionError, match="not what the description says"):
            described_answers.check("GET", "/telemetry/gps", 200, wrong)
    with pytest.raises(AssertionError, match="may answer not_armed, which is not described"):
        described_answers.check("GET", "/jobs", 409, {"detail": "it is not", "code": "not_armed"})


def test_version_is_told(api: Api) -> None:
    assert api.get("/version").body == {"name": "mavproxy-uavapi", "version": __version__}


def test_numbers_and_optional_values_are_shown_simply() -> None:
    class Model(requests.Request):
        size: Annotated[requests.Number, Field(gt=0, le=9)]
        limit: Annotated[float | None, Field(ge=1)] = None

    properties = simplified(Model.model_json_schema())["properties"]
    assert properties["size"] == {"type": "number", "exclusiveMinimum": 0, "maximum": 9}
    assert properties["limit"] == {"type": "number", "minimum": 1}


def test_routes_of_other_modules_are_described_too(api: Api, service: Service) -> None:
    async def action(_call: Any) -> Success:
        """Look around.

        All the way.
        """
        return {"device": "uav", "id": "1", "result": "success"}

    service.host.extensions["/extra/look"] = Route("/extra/look", action, requests.Heading, FLY, ("POST",))
    body = api.get("/openapi.json").body
    reported = body["paths"]["/extra/look"]["post"]
    assert (reported["tags"], reported["summary"]) == (["extra"], "Look around.")
    assert reported["description"].startswith("All the way.")
    assert body["openapi"] == "3.1.0"
    assert "extra" in [tag["name"] for tag in body["tags"]]


def test_it_is_made_once_for_all_strangers_until_a_module_comes_or_goes(
    api: Api, loop: FastLoop, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[int] = []

    def counted(all_routes: Any) -> Any:
        made.append(len(all_routes))
        return document(all_routes)

    async def ask(**headers: str) -> Any:
        async with api.client.get("/openapi.json", headers=headers) as response:
            return response, await response.read()

    monkeypatch.setattr(routes, "document", counted)
    routes._specification.cache_clear()
    response, body = loop.run(ask())
    assert (response.content_type, response.charset) == ("application/json", "utf-8")
    assert loop.run(ask())[1] == body
    again, nothing = loop.run(ask(**{"If-None-Match": response.headers["ETag"]}))
    assert (again.status, nothing) == (304, b"")
    service.host.extensions["/extra/look"] = Route("/extra/look", routes.specification, requests.Empty, FLY)
    assert b"/extra/look" in loop.run(ask())[1]
    assert made == [len(ROUTES), len(ROUTES) + 1]
    extension = weakref.ref(service.host.extensions.pop("/extra/look"))
    gc.collect()
    assert extension() is None  # nor what its module has


@pytest.mark.parametrize("route", [route for route in ROUTES if route.raw], ids=lambda route: route.path)
def test_types_of_a_file_are_those_that_the_path_takes(route: Route) -> None:
    described_types = described(route, route.methods[0])["requestBody"]["content"]
    assert list(described_types) == [kind for kind, about in route.raw.items() if about]
