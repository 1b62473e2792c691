"""Pushes the position of every vehicle to ground stations, in one task per station."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.net.addresses import StationAddress, api_note, ip_field, own_address
from mavproxy_gradys.net.http_client import FORM, Poster
from mavproxy_gradys.net.outage_log import Outage
from mavproxy_gradys.net.resolver import Resolver
from mavproxy_gradys.net.schedule import Ticker
from mavproxy_gradys.position import VehiclePosition, position_of
from mavproxy_gradys.push import position_update
from mavproxy_gradys.push.statistics import StationTally, VehicleTally
from mavproxy_gradys.settings import GradysSettings
from mavproxy_uavapi.core.errors import Unavailable
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.timeout import wait_with_timeout

DROPPED = 101  # `type` in the station's answer if no browser watches, so that it dropped the update; otherwise 103
log = logging.getLogger("gradys.push")
ADDRESS_KEPT = 30.0  # s until our own address is looked up again


class Pusher:
    """Sends the vehicles' positions to one station; belongs to the asyncio thread.

    Args:
        station: the station.
        host: the vehicles, and the clock.
        settings: the snapshot in force.
        tally: counts the updates and their outcomes.
        poster: sends them; closed at the end.
    """

    def __init__(
        self, station: StationAddress, host: Host, settings: GradysSettings, tally: StationTally, poster: Poster
    ) -> None:
        self.station = station
        self.tally = tally
        self._host = host
        self._settings = settings
        self._poster = poster
        self._tasks = HeldTasks()
        self._in_flight: set[int] = set()  # system ids
        self._names = Resolver()
        self._outage = Outage(log, f"{station.url} does not answer", f"{station.url} answers again")
        self._refusals: dict[int, Outage] = {}
        self._own = ""
        self._own_at = -ADDRESS_KEPT

    async def run(self) -> None:
        """Push at a fixed rate, until cancelled."""
        loop = asyncio.get_running_loop()
        ticker = Ticker(self._settings.period, loop.time())
        try:
            while True:
                await asyncio.sleep(ticker.wait(loop.time()))
                self.turn()
        finally:
            await self._tasks.end()
            await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._poster.close()

    def turn(self) -> None:
        """Begin an update for every vehicle with a position.

        While a station does not answer, the update of one vehicle is enough to find out that it is back.
        """
        now = self._host.clock()
        if self.tally.backoff.waits(now):
            return
        for system, state in list(self._host.fleet.vehicles.items()):
            vehicle = self.tally.vehicle(system)
            if system in self._in_flight or vehicle.backoff.waits(now):
                continue
            if self.tally.backoff.failures and self._in_flight:
                return
            if self._position(state, vehicle) is not None:
                self._begin(state, vehicle)

    def _begin(self, state: VehicleState, vehicle: VehicleTally) -> None:
        self._in_flight.add(state.system)
        task = self._tasks.start(self._push(state, vehicle), f"the update of vehicle {state.system}")
        task.add_done_callback(lambda _: self._in_flight.discard(state.system))

    def _position(self, state: VehicleState, vehicle: VehicleTally) -> VehiclePosition | None:
        """The vehicle's position; None if it is unknown or too old, and then the tally has the reason."""
        try:
            position = position_of(
                state,
                self._host.clock(),
                max_age=self._settings.max_age,
                link_timeout=self._host.link_watch.timeout,
                has_position=self._host.registry.find(state.system).has_position,
            )
        except Unavailable as error:
            vehicle.withhold(str(error))
            return None
        vehicle.why_not = ""
        return position

    async def _push(self, state: VehicleState, vehicle: VehicleTally) -> None:
        try:
            self.tally.ip = await self._ip()
            position = self._position(state, vehicle)  # the lookup of our own address may have taken long
            if position is None:
                return
            body = position_update.encode(self._form(state, vehicle, position))
            vehicle.sent += 1
            started = self._host.clock()
            answer = await self._poster.post(self.station.update_url, body, FORM)
        except NotDelivered as error:
            self._failed(state.system, vehicle, error)
            return
        now = self._host.clock()
        self.tally.round_trips.add(now - started)
        self.tally.backoff.succeeded()
        vehicle.answered(was_dropped(answer), now)
        self._outage.update("")
        self._refusal(state.system).update("")

    def _refusal(self, system: int) -> Outage:
        began, ended = (
            f"{self.station.url} refuses vehicle {system}",
            f"{self.station.url} takes vehicle {system} again",
        )
        return self._refusals.setdefault(system, Outage(log, began, ended))

    def _failed(self, system: int, vehicle: VehicleTally, error: NotDelivered) -> None:
        now = self._host.clock()
        vehicle.refused(str(error))
        self.tally.failed(str(error), now)
        self._outage.update("" if error.reached else str(error))
        if error.reached:
            self._refusal(system).update(str(error))
            self.tally.backoff.succeeded()
            vehicle.backoff.failed(now)
        elif not self.tally.backoff.waits(now):  # several updates that fail together count as one failure
            self.tally.backoff.failed(now)
            self._own_at = -ADDRESS_KEPT

    def _form(self, state: VehicleState, vehicle: VehicleTally, position: VehiclePosition) -> dict[str, str]:
        return position_update.form(
            state,
            position,
            self._host.clock(),
            seq=vehicle.seq,
            ip=self.tally.ip,
            ready=self._host.registry.find(state.system).is_ready_to_arm,
            max_age=self._settings.max_age,
        )

    async def _ip(self) -> str:
        """The form's `ip`.

        Raises:
            NotDelivered: there is no route to the station.
        """
        api: tuple[str, int] | None = getattr(self._host, "api_address", None)
        self.tally.note = api_note(api, self.station.host)
        if self._settings.ip:
            return ip_field(self._settings.ip, "", api)
        now = self._host.clock()
        if now - self._own_at >= ADDRESS_KEPT:
            look_up = own_address(self._names, self.station.host, self.station.port)
            try:
                self._own = await wait_with_timeout(self._settings.timeout, look_up)
            except asyncio.TimeoutError as error:
                raise NotDelivered(f"the name server did not answer for {self.station.host}") from error
            except OSError as error:
                raise NotDelivered(f"no route to {self.station.host}: {error.strerror or error}") from error
            self._own_at = now
        return ip_field("", self._own, api)


def was_dropped(answer: Any) -> bool:
    """Whether the station dropped the update, by its answer."""
    return isinstance(answer, dict) and str(answer.get("type")) == str(DROPPED)
