"""The API as a whole: its server and its watch over the telemetry."""

from __future__ import annotations

import logging

from mavproxy_uavapi.core import memory
from mavproxy_uavapi.core.errors import NotFound
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.oversight.endings import Policy
from mavproxy_uavapi.core.terminal import say
from mavproxy_uavapi.core.vehicle.stream_requester import StreamRequester
from mavproxy_uavapi.files.envelope_file import EnvelopeFile
from mavproxy_uavapi.flights.recorder import FlightRecorder
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.app import ApiServer
from mavproxy_uavapi.remote_settings import RemoteSettings
from mavproxy_uavapi.settings import ApiSettings

log = logging.getLogger("uavapi.api")


class Api:
    """The part of uavapi in the asyncio thread; all methods except `filenos` belong to that thread.

    Args:
        host: the vehicles and their jobs.
        remote: the settings for callers; None where no module has them.
    """

    def __init__(self, host: Host, remote: RemoteSettings | None = None) -> None:
        self.host = host
        self._remote = remote
        self._server: ApiServer | None = None
        self._tasks = HeldTasks()
        self._streams = StreamRequester(host.registry)
        self._envelope = EnvelopeFile(host.envelopes, host.warn, self._say)

    @property
    def flights(self) -> FlightRecorder:
        """The records of flights.

        Raises:
            NotFound: the API does not listen, so that none are made.
        """
        if self._server is None:
            raise NotFound("flights are recorded while the API listens (`uavapi start`)")
        return self._server.service.flights

    def _say(self, sentence: str) -> None:
        """Print a sentence at the prompt. Asyncio thread."""
        log.info("%s", sentence)
        self.host.bridge.post(lambda: say(sentence))

    @property
    def listening(self) -> bool:
        """Whether the server is up."""
        return self._server is not None

    async def start(self, settings: ApiSettings) -> None:
        """Listen according to the settings; does nothing if it already listens.

        Raises:
            OSError: the port is taken, or there is no such address.
        """
        if self._server is not None:
            return
        apply(settings, self.host)
        self.use_envelope(settings.envelope)
        server = ApiServer(Service(self.host, settings, self._remote))
        try:
            await server.start()
        except BaseException:  # also a cancellation: the port must be closed
            await server.stop()
            raise
        self._server = server
        self.host.api_address = settings.host, settings.port
        self._streams = StreamRequester(self.host.registry)
        self._tasks.start(self._streams.run(), "the watch over the telemetry")
        self._tasks.start(self._envelope.watch(), "the watch over the envelope's file")
        self._tasks.start(server.service.tokens.watch(), "the watch over the tokens' file")
        memory.keep_what_is_loaded()
        self._tasks.start(memory.give_back(), "the return of freed memory")
        self._tasks.start(server.service.flights.run(), "the records of flights")
        self._tasks.start(server.service.flights.tidy(), "the packing of flights")
        self._tasks.start(server.service.scripts.start(), "the search for running scripts")

    async def renew(self, settings: ApiSettings) -> None:
        """Apply settings that do not need another port (`ApiSettings.listens_as`); calls in flight go on."""
        if self._server is None:
            return
        apply(settings, self.host)
        self.use_envelope(settings.envelope)
        service = self._server.service
        service.settings = settings
        service.scripts.renew(settings)

    def use_envelope(self, name: str) -> None:
        """Take up the setting `envelope`, whether the API listens or not."""
        self._envelope.use(name)

    def take_tokens(self) -> None:
        """Take up the tokens' file now: the prompt has changed it."""
        if self._server is not None:
            self._server.service.tokens.take()

    async def stop(self) -> None:
        """Close the port and end the calls in flight."""
        server, self._server = self._server, None
        if server is None:
            return
        self.host.api_address = None
        for vehicle in self.host.registry.all():
            vehicle.repeat_nothing()  # at once: what follows takes its time
        await self._tasks.end()
        self.host.send_unwaited(self._streams.closing_messages())
        await server.service.scripts.stop()
        await server.service.rehearser.end()
        await server.stop()

    def filenos(self) -> list[int]:
        """Descriptors that a forked child must close."""
        return [] if self._server is None else self._server.filenos()


def apply(settings: ApiSettings, host: Host) -> None:
    """Set what the vehicles do by these settings, whoever commands them."""
    host.registry.use(settings.sysid)
    host.link_watch.timeout = settings.link_timeout
    host.registry.traffic.separation = settings.separation
    host.registry.traffic.waits = settings.on_conflict == "wait"
    host.endings.on_disconnect = Policy.HOLD if settings.on_disconnect == "hold" else Policy.NOTHING
    host.endings.on_lease_end = Policy(settings.on_lease_end)
    host.endings.on_script_exit = Policy(settings.on_script_exit)
