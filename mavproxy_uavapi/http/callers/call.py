"""One request: its vehicle, its parameters, and how its verb is awaited."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from aiohttp import web

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.control.start_gate import begun_before
from mavproxy_uavapi.core.errors import Forbidden, Invalid, NotSupported, TooManyRequests
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.streaming import MOST_OPEN, SharedSlots
from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.files.tokens import Token, Tokens
from mavproxy_uavapi.flights.recorder import FlightRecorder
from mavproxy_uavapi.http.callers.browser import browsers_header
from mavproxy_uavapi.http.callers.bucket import Bucket
from mavproxy_uavapi.http.callers.caller import CALLER, Caller, client_of
from mavproxy_uavapi.http.callers.log_throttle import LogThrottle
from mavproxy_uavapi.http.contract.answers import Accepted, Success
from mavproxy_uavapi.http.contract.requests import CallOptions, JobOptions, Request
from mavproxy_uavapi.http.contract.responses import Done, envelope
from mavproxy_uavapi.http.contract.router import NOWHERE, Match
from mavproxy_uavapi.http.stream.broadcast import TelemetryBroadcast
from mavproxy_uavapi.remote_settings import RemoteSettings
from mavproxy_uavapi.scripts.manager import Scripts
from mavproxy_uavapi.scripts.rehearser import File, Rehearser
from mavproxy_uavapi.settings import ApiSettings

log = logging.getLogger("uavapi.http.server")
R = TypeVar("R", bound=Request)

ON_DISCONNECT = {None: None, "continue": "nothing", "hold": "hold"}  # the query's `on_disconnect`: the policy's value


@dataclass
class Service:
    """The objects that the handlers work with.

    Attributes:
        host: the vehicles and their jobs.
        settings: the present settings.
        remote_settings: the settings for callers; None where no module has them.
        scripts: the mission scripts.
        tokens: those of operators.
        broadcast: the telemetry for subscribers.
        flights: their records.
        streams: the slots of streaming answers, of all kinds.
        callers: the request rates of callers that passed the door check.
        strangers: the request rates of callers that did not.
        throttle: for log lines that a stranger can cause.
        is_rehearsal: whether its vehicles are those of a rehearsal, which its scripts may command.
    """

    host: Host
    settings: ApiSettings
    remote_settings: RemoteSettings | None = None
    scripts: Scripts = field(init=False)
    rehearser: Rehearser = field(init=False)
    tokens: Tokens = field(init=False)
    broadcast: TelemetryBroadcast = field(init=False)
    flights: FlightRecorder = field(init=False)
    streams: SharedSlots = field(default_factory=lambda: SharedSlots(MOST_OPEN, "streams are open"))
    callers: Bucket = field(default_factory=Bucket)
    strangers: Bucket = field(default_factory=Bucket)
    throttle: LogThrottle = field(init=False)
    is_rehearsal: bool = False

    def __post_init__(self) -> None:
        self.scripts = Scripts(self.host, self.settings)
        self.rehearser = Rehearser(self.host, self.scripts)
        self.broadcast = TelemetryBroadcast(self.host)
        self.flights = FlightRecorder(
            self.host,
            self.broadcast,
            lambda: self.settings.flights,
            lambda: self.settings.flights_quota,
            self.scripts.printed,
        )
        self.throttle = LogThrottle(self.host.clock, log.warning)
        self.tokens = Tokens(self.host.warn)
        self.tokens.use(self.settings.tokens)

    def token_of(self, digest: bytes) -> Token | None:
        """The token in force that has that hash: an operator's, or that of a script or a rehearsal that runs."""
        token = self.tokens.find(digest) or self.scripts.token_of(digest) or self.rehearser.token_of(digest)
        return token if token is not None and self.tokens.counts(token) else None

    def heard_from(self, caller: Caller | None, holder: str) -> None:
        """Renew what a caller has for a time: the leases of `holder`, and the vehicles that it holds."""
        self.host.leases.renew(holder, None if caller is None else caller.operator)


class Call:
    """One request: its service, and its parameters, validated by the route's model.

    Attributes:
        path: the route's path, without the prefix of a vehicle.
        named_system: the system id that the path, or the port, names; 0 for none.
        names: the value of each `{name}` in the route's path.
        options: what the query says besides the parameters.
        job: the job that the call has begun or joined.
        remembered: what the job and the audit trail store instead of the parameters, if those are long.
    """

    def __init__(
        self,
        service: Service,
        request: web.BaseRequest,
        params: Request,
        match: Match = NOWHERE,
        options: CallOptions | None = None,
    ) -> None:
        self.service = service
        self.request = request
        self.path = match.path
        self.named_system = match.system
        self.names = match.names
        self.options = JobOptions() if options is None else options
        self._route = match.route
        self._params = self.remembered = params
        self.job: Job | None = None

    def one_more_stream(self) -> AbstractContextManager[None]:
        """Take a place for a stream. Browsers count apart, so no script of their machine can take the page's."""
        browser = " browser" if browsers_header(self.request.headers) else ""
        return self.service.streams.one_more_of(self.caller.counted_as + browser)

    def params(self, model: type[R]) -> R:
        """The parameters, already validated by the route as `model`."""
        assert isinstance(self._params, model)
        return self._params

    @property
    def system(self) -> int:
        """The system id that the request means; 0 for MAVProxy's current vehicle."""
        return self.named_system or self.service.settings.sysid

    @property
    def message(self) -> str:
        """The MAVLink message that the route shows; empty for none."""
        return "" if self._route is None else self._route.message

    def prefer(self, system: int) -> None:
        """Mean the vehicle with that system id if neither the path nor the port names one; 0 changes nothing."""
        self.named_system = self.named_system or system

    @property
    def known_vehicle(self) -> Vehicle:
        """The vehicle, whether its link is alive or not."""
        return self.service.host.registry.find(self.system)

    @property
    def caller(self) -> Caller:
        """Who passed the door."""
        return self.request[CALLER]

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle, whose link must be alive so that it can be commanded.

        Raises:
            NotSupported: its type does not have the route's verb.
            Forbidden, Busy: as `require_permission`.
        """
        vehicle = self.service.host.registry.commandable(self.system)
        self.require_permission(vehicle)
        if self._route is not None and self._route.verb and not vehicle.has(self._route.verb):
            raise NotSupported(f"a {vehicle.kind} does not have {self.path}")
        return vehicle

    def require_permission(self, vehicle: Vehicle) -> None:
        """Raise unless the caller may cause a message to the vehicle, and may command it if the route does.

        Raises:
            Forbidden: the caller's token is not for that vehicle.
            Busy: somebody else holds it, and the route does not stop it.
        """
        self.require_right(vehicle.state.system)
        if self._route is not None and self._route.obeys_holder:
            self.require_unheld(vehicle)

    def require_unheld(self, vehicle: Vehicle) -> None:
        """Raise Busy if somebody else of the same or a higher role holds the vehicle."""
        self._permit(vehicle)()

    def _permit(self, vehicle: Vehicle) -> Callable[[], None]:
        return partial(self.service.host.leases.require, vehicle, self.caller.operator)

    def require_right(self, system: int) -> None:
        """Raise Forbidden unless the caller's token is for that vehicle, whoever holds it."""
        if not self.caller.flies(system):
            raise Forbidden(f"the token of {self.caller.name} is not for commands to vehicle {system}")

    @property
    def copter(self) -> Copter:
        """The vehicle, which must be a copter.

        Raises:
            NotSupported: it is another type.
        """
        vehicle = self.vehicle
        if not isinstance(vehicle, Copter):
            raise NotSupported(f"a {vehicle.kind} does not have {self.path}")
        return vehicle

    def answer(self, result: str) -> Success:
        """What a success begins with."""
        return envelope(self.known_vehicle.state.system, result)

    async def fly(
        self,
        vehicle: Vehicle,
        verb: Callable[[Job], Awaitable[None]],
        result: str | Callable[[], str],
        *,
        outlives_client: bool = False,
        urgent: bool = False,
        identity: Request | None = None,
    ) -> Done:
        """Run a flight verb as a job and await it; answer 202 at once if the client wants that.

        Args:
            vehicle: the vehicle that the job commands.
            verb: the verb.
            result: the result text of a success, or a function that makes it afterwards.
            outlives_client: whether it goes on when the client hangs up.
            urgent: whether it ends a flight or a movement; no limit on jobs refuses it then.
            identity: what identifies the request, if the parameters do not.
        """
        await self._require_rehearsed(vehicle)
        self.require_permission(vehicle)  # again: somebody may have taken it while a body arrived
        self.remembered = identity or self.remembered
        is_async = self.is_async

        async def body(job: Job) -> str:
            with self.naming_source():
                await self.service.host.registry.traffic.in_turn(job, verb)
            return result if isinstance(result, str) else result()

        in_flight = sum(job.vehicle is vehicle for job in self.service.host.jobs.running())
        if in_flight >= self.service.settings.max_jobs and not urgent:
            raise TooManyRequests(f"{in_flight} verbs of the vehicle are in flight already (max_jobs)")
        job = self._begin(vehicle, body, outlives_client)
        script = None
        if is_async or (outlives_client and not urgent):  # other jobs end with their client, or stop the vehicle
            self.job = job
            script = await job.go_on_for(self.service.scripts.session_of(self.peer))
        if is_async:
            return self.accepted(job)
        return self.answer(await self.outcome(job, script))

    async def _require_rehearsed(self, vehicle: Vehicle) -> None:
        """Raise NotRehearsed, or warn, unless the request was rehearsed well, where `rehearse` wants that."""
        if self._route is None or self._route.conditions is None or self.service.settings.rehearse == "off":
            return
        file = File.of_request(self.path, self._params.model_dump(), self._route.conditions())
        await asyncio.to_thread(self.service.rehearser.require, vehicle, f"this {self.path}", file.digest)

    def _begin(self, vehicle: Vehicle, body: Callable[[Job], Awaitable[str]], outlives_client: bool) -> Job:
        """Begin a job, or join the one that does the same already, with what this client wishes for it."""
        host, params, holder = self.service.host, self.remembered, self.holder
        on_disconnect, lease = ON_DISCONNECT[self.job_options.on_disconnect], self.job_options.lease
        joined = host.jobs.running_for(vehicle, self.path, params.model_dump())
        job = host.jobs.begin(
            vehicle,
            self.path,
            params.model_dump(),
            body,
            client=self.client,
            outlives_client=outlives_client,
            timeout=getattr(params, "timeout", None),
        )
        if joined is None:
            job.on_disconnect = on_disconnect
            job.holder, job.operator = holder, self.caller.operator.name
            if self._route is not None and self._route.obeys_holder:
                job.require_permit = self._permit(vehicle)
        else:
            job.join(on_disconnect)
            self._take_over(job, holder if lease else job.holder)
            begun_before()
        if lease is not None:
            host.leases.ask(job, holder, lease)
        return job

    def _take_over(self, job: Job, holder: str) -> None:
        """Bind a job that another client began to the lease, or the hold, of this one."""
        hold = self.service.host.leases.hold(job.vehicle)
        job.holder = holder
        if hold is not None and hold.holder == self.caller.operator.name:
            job.operator = hold.holder
            job.require_permit = self._permit(job.vehicle)

    async def outcome(self, job: Job, script: str | None = None) -> str:
        """Await a job for the client; `script` is the client's session, if it is a script.

        Raises:
            UavApiError: the error that the job failed with.
        """
        self.job = job
        return await job.outcome(script)

    @property
    def recorded_parameters(self) -> dict[str, Any]:
        """The parameters that were sent or have a default, or `remembered`."""
        return self.remembered.model_dump(exclude_none=True)

    @contextlib.contextmanager
    def naming_source(self) -> Iterator[None]:
        """Within the context an Invalid error names the part of the request that its value came from."""
        try:
            yield
        except Invalid as error:
            error.set_source("query" if self.request.method == "GET" else "body")
            raise

    @property
    def client(self) -> str:
        """The client's address, with the name of its token before it."""
        return client_of(self.request)

    @property
    def peer(self) -> tuple[str, int] | None:
        """The client's end of the connection; None when it has hung up."""
        transport = self.request.transport
        address = None if transport is None else transport.get_extra_info("peername")
        return None if address is None else (address[0], address[1])

    @property
    def is_async(self) -> bool:
        """Whether the client wants the job's number instead of its outcome."""
        prefers = self.request.headers.get("Prefer", "").replace(" ", "").lower().split(",")
        return not self.job_options.wait or "respond-async" in prefers

    @property
    def job_options(self) -> JobOptions:
        """What the query says of the job that the call begins."""
        assert isinstance(self.options, JobOptions)
        return self.options

    @property
    def holder(self) -> str:
        """The name under which the client has leases."""
        return holder_of(self.request, self.options)

    def accepted(self, job: Job) -> web.Response:
        """202: the job goes on; the answer says where to find it."""
        self.job = job
        body: Accepted = {**self.answer(f"Job {job.id} accepted"), "job": job.id}
        return web.json_response(body, status=202, headers={"Location": f"/jobs/{job.id}"})


def holder_of(request: web.BaseRequest, options: CallOptions) -> str:
    """The name under which a client has leases: as in the trail, and what the query's `client` adds to it."""
    address = client_of(request)
    return address if options.client is None else f"{options.client}@{address}"


SERVICE = web.RequestKey("service", Service)
