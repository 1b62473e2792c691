from __future__ import annotations

import gc
import re
import weakref
from pathlib import Path
from typing import Annotated, Any

import pytest
from pydantic import Field

from mavproxy_uavapi.core import errors
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.http import examples, requests, routes
from mavproxy_uavapi.http.openapi import BY_PATH, KINDS, RAW_BODIES, TAGS, document, example_of, simplified
from mavproxy_uavapi.http.route import FLY, Route
from mavproxy_uavapi.http.routes import ROUTES

DOCUMENT = document(ROUTES)
OPERATIONS = [(route, method) for route in ROUTES for method in route.methods]
API_PAGE = Path(__file__).parents[3] / "docs" / "api.md"


def named(operation: tuple[Route, str]) -> str:
    return f"{operation[1]} {operation[0].path}"


def described(route: Route, method: str) -> Any:
    return DOCUMENT["paths"][route.path][method.lower()]


def leaves(base: type[UavApiError] = UavApiError) -> list[type[UavApiError]]:
    """The errors that are raised: those whose code is a word of the contract."""
    own = [] if base in (UavApiError, errors.Conflict, errors.StateChanged, errors.Unavailable) else [base]
    return own + [error for child in base.__subclasses__() for error in leaves(child)]


OURS = [error for error in leaves() if error.__module__ == "mavproxy_uavapi.core.errors"]


@pytest.mark.parametrize("operation", OPERATIONS, ids=named)
def test_every_route_is_described_with_its_action_and_model(operation: tuple[Route, str]) -> None:
    route, method = operation
    reported = described(route, method)
    assert reported["summary"] == (route.action.__doc__ or "").strip().splitlines()[0].strip()
    assert reported["summary"].endswith(".")
    assert reported["tags"][0] in TAGS
    fields = {parameter["name"] for parameter in reported["parameters"] if parameter["in"] == "query"}
    assert ("202" in reported["responses"]) is route.job
    assert ("207" in reported["responses"]) is (reported["tags"] == ["fleet"])
    assert ("wait" in fields) is (route.job or reported["tags"] == ["fleet"])
    if method == "GET":
        assert fields - {"wait", "on_disconnect", "lease", "client"} == set(route.model.model_fields)
    elif method == "POST" and not route.raw and route.model.model_fields:
        body = reported["requestBody"]["content"]["application/json"]
        assert body["schema"]["$ref"].endswith(f"/{route.model.__name__}")
        properties = DOCUMENT["components"]["schemas"][route.model.__name__]["properties"]
        assert set(properties) == set(route.model.model_fields)
    in_path = {parameter["name"] for parameter in reported["parameters"] if parameter["in"] == "path"}
    assert in_path == set(re.findall(r"{(\w+)}", route.path))


@pytest.mark.parametrize("operation", OPERATIONS, ids=named)
def test_every_route_has_an_example_of_its_answer(operation: tuple[Route, str]) -> None:
    content = described(*operation)["responses"]["200"]["content"]
    assert operation[0].path in KINDS or content["application/json"]["example"]


def test_nothing_is_described_that_is_no_route() -> None:
    assert {(path, method) for path, methods in DOCUMENT["paths"].items() for method in methods} == {
        (route.path, method.lower()) for route, method in OPERATIONS
    }
    paths = {route.path for route in ROUTES}
    shown = {
        key.rpartition(" ")[2] for table in (examples.RESULTS, examples.MEMBERS, examples.BODIES) for key in table
    }
    assert shown <= paths
    assert set(BY_PATH) | set(RAW_BODIES) <= paths
    assert {path for path in KINDS if not path.startswith("/vision/")} <= paths


def test_operations_have_names_of_their_own() -> None:
    names = [described(*operation)["operationId"] for operation in OPERATIONS]
    assert len(names) == len(set(names))


MODELS = sorted({route.model for route in ROUTES if not route.raw}, key=lambda model: model.__name__)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_example_requests_are_what_their_models_take(model: type[requests.Request]) -> None:
    shown = example_of(model)
    model.model_validate(shown)
    verb = getattr(model, "verb", model)
    assert set(shown) <= set(model.model_fields) | set(verb.model_fields)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_every_parameter_says_what_it_is(model: type[requests.Request]) -> None:
    for name, field in simplified(model.model_json_schema()).get("properties", {}).items():
        assert field.get("description"), f"{model.__name__}.{name} has no description with its unit"


@pytest.mark.parametrize("operation", OPERATIONS, ids=named)
def test_documented_errors_are_those_of_the_tree(operation: tuple[Route, str]) -> None:
    known = {(str(error.status), error.code) for error in OURS}
    reported = {
        (status, code)
        for status, response in described(*operation)["responses"].items()
        if int(status) >= 400
        for code in response["content"]["application/json"]["examples"]
    }
    assert reported <= known
    assert {
        ("401", "unauthorized"),
        ("403", "forbidden"),
        ("422", "invalid"),
        ("429", "too_many_requests"),
    } <= reported


@pytest.mark.parametrize("error", OURS, ids=lambda error: error.__name__)
def test_every_error_is_documented_on_some_route_and_on_the_page(error: type[UavApiError]) -> None:
    responses = [described(*operation)["responses"].get(str(error.status), {}) for operation in OPERATIONS]
    shown = [response["content"]["application/json"]["examples"] for response in responses if response]
    assert any(error.code in codes for codes in shown)
    assert re.search(rf"\| {error.status} [^\n]*`{error.code}`", API_PAGE.read_text(encoding="utf-8"))


TELEMETRY = [path for path in examples.MEMBERS if path.startswith("/telemetry/") and "compass" not in path]


@pytest.mark.parametrize("path", TELEMETRY)
def test_example_answers_have_the_members_of_real_ones(flying: Any, api: Any, path: str) -> None:
    real = api.get(path.replace("{name}", "ATTITUDE")).body
    shown = described(next(route for route in ROUTES if route.path == path), "GET")
    example = shown["responses"]["200"]["content"]["application/json"]["example"]
    if "message" in path or "sys_status" in path:  # as many members as the message has fields
        assert set(example) == set(real)
    else:
        assert shape(example) == shape(real)


def shape(value: Any) -> Any:
    return {name: shape(member) for name, member in value.items()} if isinstance(value, dict) else None


def test_numbers_and_optional_values_are_shown_simply() -> None:
    class Model(requests.Request):
        size: Annotated[requests.Number, Field(gt=0, le=9)]
        limit: Annotated[float | None, Field(ge=1)] = None

    properties = simplified(Model.model_json_schema())["properties"]
    assert properties["size"] == {"type": "number", "exclusiveMinimum": 0, "maximum": 9, "title": "Size"}
    assert properties["limit"] == {"type": "number", "minimum": 1, "title": "Limit"}


def test_routes_of_other_modules_are_described_too(api: Any, service: Any) -> None:
    async def action(_call: Any) -> dict[str, Any]:
        """Look around.

        All the way.
        """
        return {}

    service.host.extensions["/extra/look"] = Route("/extra/look", action, requests.Heading, FLY, ("POST",))
    body = api.get("/openapi.json").body
    reported = body["paths"]["/extra/look"]["post"]
    assert (reported["tags"], reported["summary"]) == (["extra"], "Look around.")
    assert reported["description"].startswith("All the way.")
    assert body["openapi"] == "3.1.0"
    assert "extra" in [tag["name"] for tag in body["tags"]]


def test_it_is_made_once_for_all_strangers_until_a_module_comes_or_goes(
    api: Any, loop: Any, service: Any, monkeypatch: pytest.MonkeyPatch
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
    assert RAW_BODIES[route.path].keys() <= set(route.raw)
