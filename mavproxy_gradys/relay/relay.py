"""Subscribes to the readings of a fleet and posts each vehicle's position to ground stations."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from urllib.parse import SplitResult

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.forwarding.quantities import STATES, STATUS
from mavproxy_gradys.net.addresses import StationAddress
from mavproxy_gradys.net.http_client import FORM, Poster
from mavproxy_gradys.net.mqtt_subscription import MqttSubscription
from mavproxy_gradys.net.outage_log import Outage
from mavproxy_gradys.net.refusal_log import RefusalLog
from mavproxy_gradys.net.schedule import Ticker
from mavproxy_gradys.push.position_update import encode
from mavproxy_gradys.relay.positions import Positions
from mavproxy_uavapi.core.held_tasks import HeldTasks

AT_ONCE = 8  # updates in flight to a station
log = logging.getLogger("relay")


class Pushes:
    """Posts updates to one station. Positions are not kept: an update that fails is not sent again.

    Attributes:
        sent, failed: number of updates that the station answered with 200, and that it did not.
    """

    def __init__(self, station: StationAddress, poster: Poster) -> None:
        self._station = station
        self._poster = poster
        self._outage = Outage(log, f"{station.url} does not take updates", f"{station.url} takes updates again")
        self.sent = self.failed = 0

    async def push(self, forms: Sequence[dict[str, str]]) -> None:
        """Post these updates; after a failed one the others of this turn are left out."""
        waiting = list(reversed(forms))

        async def post() -> None:
            while waiting:
                form = waiting.pop()
                try:
                    await self._poster.post(self._station.update_url, encode(form), FORM)
                except NotDelivered as error:
                    self.failed += 1 + len(waiting)
                    waiting.clear()
                    self._outage.update(str(error))
                    return
                self.sent += 1
                self._outage.update("")

        await asyncio.gather(*(post() for _ in range(AT_ONCE)))

    async def close(self) -> None:
        """Close the connections."""
        await self._poster.close()


class Relay:
    """The subscription, and a task for each station.

    Args:
        broker: the parts and the port of mqtt(s)://[USER:PASSWORD@]HOST[:PORT].
        topic: the topic filter of the readings.
        timeout: s for an answer of the broker.
        ca_file: certificates to check TLS with; empty for the system's.
        wall: s since 1970.
    """

    def __init__(
        self,
        broker: tuple[SplitResult, int],
        topic: str,
        timeout: float = 5.0,
        ca_file: str = "",
        wall: Callable[[], float] = time.time,
    ) -> None:
        self._wall = wall
        self._positions = Positions()
        outage = Outage(log, "no readings from the broker", "readings from the broker again")
        self._subscription = MqttSubscription(broker, topic, outage, timeout, ca_file)
        self._refusals = RefusalLog(log, time.monotonic, "messages are not readings of the present")

    async def listen(self) -> None:
        """Take readings, until cancelled."""
        await self._subscription.run(self.take)

    def take(self, topic: str, payload: bytes) -> None:
        """Take one message; a vehicle's status is not a reading."""
        if payload in STATES and topic.endswith(f"/{STATUS}"):
            return
        try:
            self._positions.put(payload, self._wall())
        except (ValueError, RecursionError) as error:
            self._refusals.add(topic, str(error))

    async def push(self, stations: Sequence[Pushes], period: float) -> None:
        """Every `period` s, post what has changed to all stations, until cancelled.

        A station that is too slow skips turns; it gets the newest positions in its next one.
        """
        loop = asyncio.get_running_loop()
        ticker, turns = Ticker(period, loop.time()), [_Turn(station) for station in stations]
        try:
            while True:
                await asyncio.sleep(ticker.wait(loop.time()))
                forms = {one.device: self._positions.form(one) for one in self._positions.take_changed(self._wall())}
                for turn in turns:
                    turn.begin(forms)
        finally:
            await asyncio.gather(*(turn.end() for turn in turns))


class _Turn:
    """The updates that one station has not been sent yet, and the task that posts."""

    def __init__(self, station: Pushes) -> None:
        self._station = station
        self._forms: dict[str, dict[str, str]] = {}
        self._tasks = HeldTasks()
        self._task: asyncio.Task[None] | None = None

    def begin(self, forms: dict[str, dict[str, str]]) -> None:
        """Add updates, and post all if the last turn has ended."""
        self._forms.update(forms)
        if self._forms and (self._task is None or self._task.done()):
            waiting, self._forms = list(self._forms.values()), {}
            self._task = self._tasks.start(self._station.push(waiting), "the posts to a ground station")

    async def end(self) -> None:
        """Cancel, and close the connections."""
        await self._tasks.end()
        await self._station.close()
