"""Commands of the prompt that MAVProxy does not wait for; the asyncio thread runs them and prints the result."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.terminal import say_text
from mavproxy_uavapi.core.text import line_of

BackgroundCommand = Callable[[], Coroutine[Any, Any, str]]  # a line to print, or several of `joined`
SLOW = 2.0  # s after which a line says that it still runs


class BackgroundCommands:
    """Runs them side by side.

    Args:
        host: connects the main loop and the asyncio thread.
        name: the module's name, which begins each line.
    """

    def __init__(self, host: Host, name: str) -> None:
        self._host = host
        self._name = name
        self._tasks = HeldTasks()

    def send(self, command: BackgroundCommand, doing: str = "") -> None:
        """Begin a command; its result or error is printed. Main loop only.

        Args:
            command: returns the line to print, several lines of `joined`, or an empty text.
            doing: what it does, for a line if it takes long; empty for no line.
        """
        self._host.bridge.call_soon(self._begin, command, doing)

    def say(self, text: str) -> None:
        """Print a text, unless it is empty. Any thread."""
        if text:
            self._host.bridge.post(lambda: say_text(f"{self._name}: {text}"))

    async def close(self) -> None:
        """Cancel those under way, and wait until they have cleaned up. Asyncio thread only."""
        await self._tasks.end()

    def _begin(self, command: BackgroundCommand, doing: str) -> None:
        self._tasks.start(self._run(command, doing), f"what {self._name} did for the prompt")

    async def _run(self, command: BackgroundCommand, doing: str) -> None:
        loop = asyncio.get_running_loop()
        slow = loop.call_later(SLOW, self.say, f"still {doing}; a line follows when it is done") if doing else None
        try:
            self.say(await command())
        except UavApiError as error:
            self.say(line_of(str(error)))
        except Exception as error:  # noqa: BLE001  the pilot at the prompt learns of a defect, too
            loop.call_exception_handler({"message": f"{self._name}: a defect", "exception": error})
            self.say(line_of(f"a defect ended this: {error!r}"))
        finally:
            if slow is not None:
                slow.cancel()
