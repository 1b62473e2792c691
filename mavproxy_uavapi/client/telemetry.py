"""What the vehicle last told, by the API's stream, with its age."""

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
AGAIN_AFTER = 0.5  # s from a stream that ended to the next attempt
NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: a gimbal, a companion, a ground station


class Told(NamedTuple):
    """A message's fields as MAVLink has them, and when it arrived here (s)."""

    fields: dict[str, Any]
    at: float


class Telemetry:
    """The newest message of each name that the vehicle's autopilot sent.

    Args:
        http: the API.
        system: the vehicle's system id.
        max_age: s after which a message is not served any more.
        clock: monotonic s.
    """

    def __init__(self, http: Http, system: int, max_age: float, clock: Callable[[], float]) -> None:
        self._http = http
        self._system = system
        self._max_age = max_age
        self._clock = clock
        self._messages: dict[str, Told] = {}
        self._component: int | None = None
        self._news: list[asyncio.Event] = []

    def fields(self, name: str) -> dict[str, Any]:
        """The fields of the newest message of that name.

        Raises:
            Stale: there is none, or it is too old.
        """
        age = self.age(name)
        if age is None:
            raise Stale(f"vehicle {self._system} has not told {name} yet")
        if age > self._max_age:
            raise Stale(f"vehicle {self._system} last told {name} {age:.1f} s ago (max_age is {self._max_age:g} s)")
        return self._messages[name].fields

    def age(self, name: str) -> float | None:
        """Seconds since the newest message of that name arrived; None where there is none."""
        told = self._messages.get(name)
        return None if told is None else self._clock() - told.at

    async def shows(self, condition: Callable[[], bool], within: float) -> bool:
        """Wait until that holds; it is looked at with each message. Whether it came to hold within so many s."""
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
        """Listen for ever; a stream that ends is opened again."""
        while True:
            try:
                await self._listen()
            except (aiohttp.ClientError, asyncio.TimeoutError, OSError, ValueError, KeyError, TypeError) as error:
                log.info("the stream of %s ended: %s", self._http.url, str(error) or type(error).__name__)
            await asyncio.sleep(AGAIN_AFTER)

    async def _listen(self) -> None:
        async with self._http.stream("/telemetry/stream", names=",".join(NAMES), sysid=self._system) as socket:
            async for message in socket:
                if message.type is not aiohttp.WSMsgType.TEXT:
                    break
                event = json.loads(message.data)
                self.hear(event["name"], event["component"], event["fields"])

    def hear(self, name: str, component: int, fields: dict[str, Any]) -> None:
        """Take a message of one of the system's components; only its autopilot's count."""
        if name == "HEARTBEAT" and fields["autopilot"] != NO_AUTOPILOT:
            self._component = component
        if component != self._component:
            return
        self._messages[name] = Told(fields, self._clock())
        for news in self._news:
            news.set()
