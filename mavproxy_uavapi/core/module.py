"""What our three MAVProxy modules have in common: the hooks, the console command, the share in the host."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from MAVProxy.modules.lib import mp_module

from mavproxy_uavapi.core import host as hosts
from mavproxy_uavapi.core.text import nearest

log = logging.getLogger("uavapi.api")

Action = Callable[[list[str]], None]


def value_of(words: list[str]) -> str:
    """The value that was typed: MAVProxy leaves the quotation marks where they are, and an empty pair is nothing."""
    text = " ".join(words)
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"" else text


class SharedModule(mp_module.MPModule):  # type: ignore[misc]
    """A MAVProxy module that shares the host.

    Args:
        mpstate: MAVProxy's state.
        name: the module's name, which is its console command too.
        description: one line for `module list` and `help`.
        actions: what each word after the command does.
        completions: rules for tab completion.
    """

    def __init__(
        self, mpstate: Any, name: str, description: str, actions: dict[str, Action], completions: list[str]
    ) -> None:
        super().__init__(mpstate, name, description, multi_vehicle=True)
        self._actions = actions
        self._begun = False
        self._told_failure = ""
        self.host = hosts.join(mpstate, self)
        self.add_command(name, self.command, description, completions)

    def begin(self) -> None:
        """Called once, in the first idle task: whatever opens a socket waits until then. It must not block.

        MAVProxy loads the modules of its command line before it forks, and a child would keep the socket.
        """

    async def end(self) -> None:
        """Called in the asyncio thread when the module is unloaded."""

    def mavlink_packet(self, packet: Any) -> None:
        """A message arrived, from any vehicle."""
        self.host.feed(self, packet)

    def idle_task(self) -> None:
        """MAVProxy calls this several hundred times a second, and keeps to itself what it raises."""
        try:
            self.host.idle(self)
            if not self._begun:
                self._begun = True
                self.begin()
        except Exception as error:  # noqa: BLE001  nobody else would tell of it
            self._tell_failure(error)

    def _tell_failure(self, error: Exception) -> None:
        """Say why an idle task failed: once, though it may do so several hundred times a second."""
        failure = f"{type(error).__name__}: {error}"
        if failure != self._told_failure:
            self._told_failure = failure
            print(f"{self.name}: its idle task fails, `module reload {self.name}` may help: {failure}")
            log.debug("idle task of %s", self.name, exc_info=error)

    def unload(self) -> None:
        """Give back all that was taken. Runs in another thread than the main loop, which waits for it."""
        super().unload()
        self.remove_command(self.name)
        try:
            if self.host.bridge.running:
                self.host.bridge.run(self.end())
        finally:
            hosts.leave(self.mpstate, self)

    def command(self, args: list[str]) -> None:
        """The module's command at the prompt."""
        word = args[0] if args else "status"
        action = self._actions.get(word)
        if action is not None:
            action(args[1:])
            return
        print(f"{self.name}: no command {word!r}; {nearest(word, self._actions)}")
