"""One request on its way through: who is asked, for what, and how a verb is awaited."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

from aiohttp import web

from mavproxy_uavapi.errors import BadRequest, NotSupported
from mavproxy_uavapi.host.host import Host
from mavproxy_uavapi.http.requests import Request, parse
from mavproxy_uavapi.http.responses import envelope
from mavproxy_uavapi.settings import Settings
from mavproxy_uavapi.vehicle.copter import Copter
from mavproxy_uavapi.vehicle.jobs import Job
from mavproxy_uavapi.vehicle.vehicle import Vehicle

R = TypeVar("R", bound=Request)


@dataclass
class Service:
    """What the handlers work with.

    Attributes:
        host: the vehicles, and the verbs in flight.
        settings: the snapshot in force.
    """

    host: Host
    settings: Settings


class Call:
    """One request: its service, and its parameters, validated by the route's model."""

    def __init__(self, service: Service, request: web.Request, params: Request) -> None:
        self.service = service
        self.request = request
        self._params = params

    def params(self, model: type[R]) -> R:
        """The parameters, which the route has validated by `model`."""
        assert isinstance(self._params, model)
        return self._params

    @property
    def seen(self) -> Vehicle:
        """The vehicle, whether its link is alive or not."""
        return self.service.host.hangar.find(self.service.settings.sysid)

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle, with a link that is alive: it can be commanded."""
        return self.service.host.hangar.commandable(self.service.settings.sysid)

    @property
    def copter(self) -> Copter:
        """The vehicle, which must be a copter.

        Raises:
            NotSupported: it is another type.
        """
        vehicle = self.vehicle
        if not isinstance(vehicle, Copter):
            raise NotSupported(f"a {vehicle.kind} does not have {self.request.path.rstrip('/')}")
        return vehicle

    def answer(self, result: str, **members: Any) -> dict[str, Any]:
        """A success body."""
        return envelope(self.seen.state.system, result, **members)

    async def fly(
        self,
        vehicle: Vehicle,
        verb: Callable[[Job], Awaitable[None]],
        result: str | Callable[[], str],
        outlives_client: bool = False,
    ) -> dict[str, Any]:
        """Run a flight verb as a job and await it.

        Args:
            vehicle: whose seat the job takes.
            verb: what to do.
            result: the text of its success, or what makes it afterwards.
            outlives_client: whether it goes on when the client hangs up.
        """

        async def body(job: Job) -> str:
            await verb(job)
            return result if isinstance(result, str) else result()

        path = self.request.path.rstrip("/")
        request = self._params.model_dump()
        client = self.request.remote or "unknown"
        job = self.service.host.jobs.begin(
            vehicle.seat, path, request, body, client=client, outlives_client=outlives_client
        )
        return self.answer(await job.outcome())


Action = Callable[[Call], Awaitable[dict[str, Any] | web.StreamResponse]]
SERVICE = web.AppKey("service", Service)


async def parameters(request: web.Request, model: type[Request], body: bool) -> Request:
    """The request's parameters: the query's, and where the route takes a body, the body's over them.

    Raises:
        BadRequest: the body is not a JSON object.
        Invalid: a value is of the wrong type or out of range.
    """
    values: dict[str, Any] = dict(request.query)
    if not body or not request.can_read_body:
        return parse(model, "query", values)
    form = request.content_type == "application/x-www-form-urlencoded"
    try:
        given = dict(await request.post()) if form else await request.json()
    except (ValueError, LookupError, RecursionError) as error:  # no such charset; nested without end
        raise BadRequest(f"the body is not {'a form' if form else 'JSON'}: {error}") from error
    if not isinstance(given, dict):
        raise BadRequest("the body is not a JSON object")
    return parse(model, "body", {**values, **cast(dict[str, Any], given)})
