"""Reads what a request gives into its model, and says in sentences what is wrong with it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.strict_json import shown
from mavproxy_uavapi.core.text import escaped
from mavproxy_uavapi.http.contract.requests import Request

LONGEST_NAME = 64  # characters of an unknown name in an answer
NEAR = 0.5  # how similar an unknown name is to the one that was meant; `altitude` and `alt` are it by 0.55

R = TypeVar("R", bound=Request)


def parse(
    model: type[R], source: str, values: dict[str, Any], *, query: Collection[str] = (), options: Collection[str] = ()
) -> R:
    """Validate `values`.

    Args:
        model: the model of the values.
        source: the part of the request that they come from, query or body.
        values: by name.
        query: the names of those that come from the query, if the others do not.
        options: the names that the query may have besides the model's.

    Raises:
        Invalid: with one entry per problem.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        problems = []
        for problem in error.errors(include_url=False, include_context=False):
            loc = problem["loc"]
            place = "query" if any(step in query for step in loc) else source
            unknown = problem["type"] == "extra_forbidden"
            says = _no_such_name(model, place, loc, options) if unknown else _sentence(problem)
            problems.append({"loc": [place, *loc], "msg": says, "type": problem["type"]})
        raise Invalid(problems) from error


def _sentence(problem: Mapping[str, Any]) -> str:
    """pydantic's message without the name of Python's error, and with what was given."""
    says: str = problem["msg"].removeprefix("Value error, ")
    is_short = isinstance(problem["input"], str | int | float | None) and problem["type"] != "missing"
    return f"{says}, not {shown(problem['input'])}" if is_short else says


def _no_such_name(model: type[Request], place: str, loc: Sequence[int | str], options: Collection[str]) -> str:
    """What to say of an unknown name: the nearest that there is, and all of them."""
    name, own = str(loc[-1]), list(_model_at(model, loc[:-1]).model_fields)
    if place == "body" and len(loc) == 1 and name in options:
        return f"`{name}` belongs into the query"
    known = [*own, *options] if place == "query" else own
    near = get_close_matches(name.lower(), known, n=1, cutoff=NEAR)
    meant = f"; did you mean `{near[0]}`?" if near else ""
    listed = f"the names are {', '.join(known)}" if known else "there are no names"
    return f"there is no `{escaped(name)[:LONGEST_NAME]}`{meant or ';'} {listed}"


def _model_at(model: type[Request], loc: Sequence[int | str]) -> type[Request]:
    """The model of the value at `loc` of a model; steps that are none of its names (an index) change nothing."""
    for step in loc:
        if isinstance(step, str) and step in model.model_fields:
            model = next(_models_in(model.model_fields[step].annotation), model)
    return model


def _models_in(annotation: Any) -> Iterator[type[Request]]:
    if isinstance(annotation, type) and issubclass(annotation, Request):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)
