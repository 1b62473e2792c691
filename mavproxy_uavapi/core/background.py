"""What the prompt asks for and MAVProxy does not wait for: done in the asyncio thread, printed when it is done."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host

Command = Callable[[], Coroutine[Any, Any, str]]
SLOW = 2.0  # s after which a line says that it still goes on


class BackgroundCommands:
    """Runs them side by side.

    Args:
        host: the way into the asyncio thread and back.
        name: of the module; at the head of each line.
    """

    def __init__(self, host: Host, name: str) -> None:
        self._host = host
        self._name = name
        self._tasks = HeldTasks()

    def send(self, command: Command, doing: str = "") -> None:
        """Begin one; what it returns or raises is printed. Main loop only.

        Args:
            command: what to do; its result is a line, or nothing.
            doing: what to call it when it takes long; empty for what may.
        """
        self._host.bridge.call_soon(self._begin, command, doing)

    def say(self, text: str) -> None:
        """Print a line; an empty one is none. Any thread."""
        if text:
            self._host.bridge.post(lambda: print(f"{self._name}: {text}"))

    async def close(self) -> None:
        """Cancel those under way, and wait until they have cleaned up. Asyncio thread only."""
        await self._tasks.end()

    def _begin(self, command: Command, doing: str) -> None:
        self._tasks.start(self._run(command, doing), f"what {self._name} did for the prompt")

    async def _run(self, command: Command, doing: str) -> None:
        loop = asyncio.get_running_loop()
        slow = loop.call_later(SLOW, self.say, f"still {doing}; a line tells when that is done") if doing else None
        try:
            self.say(await command())
        except UavApiError as error:
            self.say(str(error))
        except Exception as error:  # noqa: BLE001  whoever waits at the prompt is told of a defect too
            loop.call_exception_handler({"message": f"{self._name}: a defect", "exception": error})
            self.say(f"a defect ended this: {error!r}")
        finally:
            if slow is not None:
                slow.cancel()
