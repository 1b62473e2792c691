"""Which route a request is for."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from aiohttp import web

from mavproxy_uavapi.http.route import Route


@dataclass(frozen=True)
class Match:
    """What there is at a path.

    Attributes:
        route: the one for the request's method; None where there is none.
        allowed: the methods that the path has.
        names: what stands in the place of each `{name}` of the route's path.
    """

    route: Route | None = None
    allowed: frozenset[str] = frozenset()
    names: Mapping[str, str] = field(default_factory=dict)


class Router:
    """Finds the route of a request.

    It is ours, since aiohttp's own answers some requests (a path that is not there, an `Expect`) before any check.

    Args:
        routes: those that are always there.
        extensions: by path, those of other modules, which come and go.
    """

    def __init__(self, routes: Iterable[Route], extensions: Mapping[str, Route]) -> None:
        self._extensions = extensions
        self._by_path: dict[str, list[Route]] = {}
        self._by_pattern: dict[re.Pattern[str], list[Route]] = {}
        for route in routes:
            if "{" in route.path:
                self._by_pattern.setdefault(route.pattern, []).append(route)
            else:
                self._by_path.setdefault(route.path, []).append(route)

    def find(self, method: str, path: str) -> Match:
        """The route of a request; a slash at the end of its path makes no difference."""
        path = path.rstrip("/")
        routes, names = self._at(path)
        allowed = frozenset(method for route in routes for method in route.methods)
        return Match(next((route for route in routes if method in route.methods), None), allowed, names)

    def _at(self, path: str) -> tuple[list[Route], dict[str, str]]:
        """All that is at a path, and its names."""
        routes = self._by_path.get(path)
        if routes is not None:
            return routes, {}
        for pattern, routes in self._by_pattern.items():
            match = pattern.fullmatch(path)
            if match is not None:
                return routes, match.groupdict()
        extension = self._extensions.get(path)
        return ([] if extension is None else [extension]), {}


MATCH = web.RequestKey("match", Match)
