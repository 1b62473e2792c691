"""Finds the route of a request."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from aiohttp import web

from mavproxy_uavapi.http.contract.route import Route

OF_A_VEHICLE = re.compile(r"/vehicles/(?P<system>[1-9][0-9]{0,2})(?P<path>/.+)")  # before any path
LARGEST_SYSTEM = 255


@dataclass(frozen=True)
class Match:
    """The routes at a path.

    Attributes:
        path: the path without the vehicle's prefix and without a trailing slash.
        system: the system id of the vehicle that the request names; 0 for none.
        route: the route for the request's method; None if there is none.
        allowed: the methods that the path has.
        names: the value of each `{name}` in the route's path.
    """

    path: str
    system: int = 0
    route: Route | None = None
    allowed: frozenset[str] = frozenset()
    names: Mapping[str, str] = field(default_factory=dict)


class Router:
    """Finds the route of a request.

    It replaces aiohttp's router, which answers some requests (an unknown path, an `Expect`) before any check.

    Args:
        routes: the permanent routes.
        extensions: the routes of other modules by path; they come and go.
        system: the system id for paths that name none; 0 for no fixed one.
    """

    def __init__(self, routes: Iterable[Route], extensions: Mapping[str, Route], system: int = 0) -> None:
        self._extensions = extensions
        self._system = system
        self._by_path: dict[str, list[Route]] = {}
        self._by_pattern: dict[re.Pattern[str], list[Route]] = {}
        for route in routes:
            if "{" in route.path:
                self._by_pattern.setdefault(route.pattern, []).append(route)
            else:
                self._by_path.setdefault(route.path, []).append(route)

    def find(self, method: str, path: str) -> Match:
        """The route of a request; a trailing slash of its path makes no difference."""
        path, system = path.rstrip("/"), self._system
        if not path and method == "GET":
            path = "/"  # the page; to any other method there is nothing
        named = OF_A_VEHICLE.fullmatch(path)
        if named is not None and int(named["system"]) <= LARGEST_SYSTEM:
            path, system = named["path"], int(named["system"])
        routes, names = self._at(path)
        route = next((route for route in routes if method in route.methods), None)
        return Match(path, system, route, frozenset(method for route in routes for method in route.methods), names)

    def _at(self, path: str) -> tuple[list[Route], dict[str, str]]:
        """All routes at a path, and the values of its names."""
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
NOWHERE = Match("")
