"""The newest telemetry of a vehicle, from the API's stream, with its age."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Callable
from typing import Any, NamedTuple

import aiohttp

from mavproxy_uavapi.client.http import Http
from mavproxy_uavapi.core.errors import Stale
from mavproxy_uavapi.core.timeout import wait_with_timeout

log = logging.getLogger("uavapi.client")

NAMES = (
    "HEARTBEAT",
    "GLOBAL_POSITION_INT",
    "LOCAL_POSITION_NED",
    "ATTITUDE",
    "GPS_RAW_INT",
    "SYS_STATUS",
    "EXTENDED_SYS_STATE",
)
RETRY_AFTER = 0.5  # s from the end of a stream to the next attempt
NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: a gimbal, a companion, a ground station


class StreamedMessage(NamedTuple):
    """A message's fields as MAVLink has them, and its time of arrival here (s)."""

    fields: dict[str, Any]
    at: float


class Telemetry:
    """The newest message of each name that the vehicle's autopilot sent.

    Args:
        http: the API.
        system: the vehicle's system id.
        max_age: s after which a message is too old.
        clock: monotonic s.
    """

    def __init__(self, http: Http, system: int, max_age: float, clock: Callable[[], float]) -> None:
        self._http = http
        self._system = system
        self._max_age = max_age
        self._clock = clock
        self._messages: dict[str, StreamedMessage] = {}
        self._component: int | None = None
        self._news: list[asyncio.Event] = []

    def fields(self, name: str) -> dict[str, Any]:
        """The fields of the newest message of that name.

        Raises:
            Stale: there is none, or it is too old.
        """
        age = self.age(name)
        if age is None:
            raise Stale(f"vehicle {self._system} has not reported {name} yet")
        if age > self._max_age:
            limit = f"max_age is {self._max_age:g} s"
            raise Stale(f"vehicle {self._system} last reported {name} {age:.1f} s ago ({limit})")
        return self._messages[name].fields

    def age(self, name: str) -> float | None:
        """Seconds since the newest message of that name arrived; None without one."""
        message = self._messages.get(name)
        return None if message is None else self._clock() - message.at

    async def shows(self, condition: Callable[[], bool], within: float) -> bool:
        """Wait up to `within` s until `condition` holds; each message checks it again. Returns whether it holds."""
        news = asyncio.Event()
        self._news.append(news)

        async def until() -> None:
            while not condition():
                await news.wait()
                news.clear()

        try:
            await wait_with_timeout(within, until())
        except asyncio.TimeoutError:
            return False
        finally:
            self._news.remove(news)
        return True

    async def run(self) -> None:
        """Read the stream until cancelled; a stream that ends is reopened."""
        while True:
            try:
                await self._listen()
            except (aiohttp.ClientError, asyncio.TimeoutError, OSError, ValueError, KeyError, TypeError) as error:
                log.info("the stream of %s ended: %s", self._http.url, str(error) or type(error).__name__)
            await asyncio.sleep(RETRY_AFTER)

    async def _listen(self) -> None:
        async with self._http.stream("/telemetry/stream", names=",".join(NAMES), sysid=self._system) as socket:
            async for message in socket:
                if message.type is not aiohttp.WSMsgType.TEXT:
                    break
                event = json.loads(message.data)
                self.hear(event["name"], event["component"], event["fields"])

    def hear(self, name: str, component: int, fields: dict[str, Any]) -> None:
        """Process a message of one of the system's components; only the autopilot's are kept."""
        if name == "HEARTBEAT" and fields["autopilot"] != NO_AUTOPILOT:
            self._component = component
        if component != self._component:
            return
        self._messages[name] = StreamedMessage(fields, self._clock())
        for news in self._news:
            news.set()
