"""What the prompt asks for and MAVProxy does not wait for: done in the asyncio thread, printed when it is done."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from mavproxy_gradys.tasks import begin
from mavproxy_uavapi.errors import UavApiError
from mavproxy_uavapi.host.host import Host

Errand = Callable[[], Coroutine[Any, Any, str]]


class Errands:
    """Runs them side by side."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._tasks: set[asyncio.Task[None]] = set()

    def send(self, errand: Errand) -> None:
        """Begin one; what it returns or raises is printed. Main loop only."""
        self._host.bridge.call_soon(self._begin, errand)

    def _begin(self, errand: Errand) -> None:
        task = begin(self._run(errand), "a command")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _run(self, errand: Errand) -> None:
        try:
            self.say(await errand())
        except UavApiError as error:
            self.say(str(error))

    def say(self, text: str) -> None:
        """Print a line; an empty one is none."""
        if text:
            self._host.bridge.post(lambda: print(f"gradys: {text}"))
