"""What our three MAVProxy modules have in common: hooks, console command, settings, the share in the host."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, TypeVar

from MAVProxy.modules.lib import mp_module

from mavproxy_uavapi.core import host as hosts
from mavproxy_uavapi.core.background import BackgroundCommands
from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.remembered_settings import RememberedSettings
from mavproxy_uavapi.core.settings import ModuleSettings
from mavproxy_uavapi.core.terminal import say, say_text
from mavproxy_uavapi.core.text import nearest
from mavproxy_uavapi.core.windows import View, Windows

log = logging.getLogger("uavapi.api")

Action = Callable[[list[str]], None]
Snapshot = TypeVar("Snapshot")


def value_of(words: list[str]) -> str:
    """The typed value without quotation marks around it, which MAVProxy leaves there; an empty pair means nothing."""
    text = " ".join(words)
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"" else text


class SharedModule(mp_module.MPModule, Generic[Snapshot]):  # type: ignore[misc]
    """A MAVProxy module that shares the host and has settings.

    Args:
        mpstate: MAVProxy's state.
        keywords: of `module load`.
        settings_type: validates and holds the settings; the name of their module is this module's name and its
            console command.
        description: one line for `module list` and `help`.
        actions: what each word after the command does; `set` and `config` are added.
        completions: rules for tab completion; those for `set` are added.

    Raises:
        ImportError: a setting does not exist or its value is wrong; MAVProxy reports this kind of error in one line,
            and goes on.
    """

    def __init__(
        self,
        mpstate: Any,
        keywords: Mapping[str, Any],
        settings_type: type[ModuleSettings[Snapshot]],
        description: str,
        *,
        actions: dict[str, Action],
        completions: list[str],
    ) -> None:
        name = settings_type.module
        self.remembered = RememberedSettings(mpstate, name, keywords)
        try:
            self.module_settings = settings_type(self.remembered.combined)
        except SettingError as error:
            raise ImportError(f"{name}: {error}") from error
        super().__init__(mpstate, name, description, multi_vehicle=True)
        self._actions: dict[str, Action] = {**actions, "set": self._set, "config": lambda _: self._list_settings()}
        # MAVProxy's completion fails if the typed line is longer than a rule. So the rule for `set NAME` also has a
        # place for the value.
        self._completed = {f"({name.upper()}SETTING)": settings_type.names, f"({name.upper()}VALUE)": list}
        self._begun = False
        self._reported_failure = ""
        self._routes: dict[str, Any] = {}
        self.host = hosts.join(mpstate, self)
        rules = [*completions, f"set {' '.join(self._completed)}", *settings_type.value_completions()]
        self._background = BackgroundCommands(self.host, name)
        self.windows = Windows(name, mpstate, self.host.bridge, self.host.clock, self.view)
        self.add_command(name, self.command, description, rules)
        for place, words_of in self._completed.items():
            self.add_completion_function(place, lambda _, words_of=words_of: words_of())

    def finish_loading(self, routes: Iterable[Any] = ()) -> None:
        """The last step of each constructor. A script's next line, and any call, then finds all in place.

        Args:
            routes: `uavapi` serves them until the module is unloaded.
        """
        self.remembered.keep(self.module_settings.shown)
        self._routes = {route.path: route for route in routes}
        self.host.extensions.update(self._routes)
        if self.host.bridge.running:  # MAVProxy's main loop runs, and has just called us
            self.idle_task()

    def begin(self) -> None:
        """Called once, in the first idle task: open sockets here, not earlier. It must not block.

        MAVProxy loads the modules of its command line before it forks, and a child would keep the socket.
        """

    async def end(self) -> None:
        """Called in the asyncio thread when the module is unloaded."""

    def view(self) -> View:
        """What MAVProxy's console and map show of this module. Called in the asyncio thread."""
        return View()

    def check_change(self, name: str) -> None:
        """Refuse to change a setting now.

        Raises:
            SettingError: with the reason.
        """

    def use_settings(self, name: str, before: Snapshot, after: Snapshot) -> None:
        """Called when the setting `name` was changed, once the main loop runs. It must not block."""

    def mavlink_packet(self, packet: Any) -> None:
        """A message arrived, from any vehicle."""
        self.host.feed(self, packet)

    def idle_task(self) -> None:
        """MAVProxy calls this several hundred times a second, and hides what it raises."""
        try:
            self.host.idle(self)
            if not self._begun:
                self._begun = True
                self.begin()
            self.windows.turn()
        except Exception as error:  # noqa: BLE001  MAVProxy does not report it
            self._report_failure(error)

    def _report_failure(self, error: Exception) -> None:
        """Print why an idle task failed: once, not several hundred times a second."""
        failure = f"{type(error).__name__}: {error}"
        if failure != self._reported_failure:
            self._reported_failure = failure
            say(f"{self.name}: its idle task fails, `module reload {self.name}` may help: {failure}")
            log.debug("idle task of %s", self.name, exc_info=error)

    def unload(self) -> None:
        """Give everything back. Runs in another thread than the main loop, which waits for it."""
        for path, route in self._routes.items():
            if self.host.extensions.get(path) is route:  # not its successor's
                del self.host.extensions[path]
        super().unload()
        self.windows.clear()
        self.remove_command(self.name)
        for place in self._completed:
            self.mpstate.completion_functions.pop(place, None)
        try:
            if self.host.bridge.running:
                self.host.bridge.run(self.end())
        finally:
            hosts.leave(self.mpstate, self)

    def command(self, args: list[str]) -> None:
        """The module's command at the prompt."""
        self.host.mavproxy_watch.share_target()  # `vehicle 2` may stand before it in the same line
        word = args[0] if args else "status"
        action = self._actions.get(word)
        if action is not None:
            action(args[1:])
            return
        say(f"{self.name}: no command {word!r}; {nearest(word, self._actions)}")

    def _set(self, args: list[str]) -> None:
        """`NAME set [SETTING [VALUE]]`: list the settings, or change one."""
        if len(args) < 2:
            self._list_settings(*args)
            return
        try:
            self.change_setting(args[0], value_of(args[1:]))
        except SettingError as error:
            say(f"{self.name}: {error}")

    def change_setting(self, name: str, value: Any) -> None:
        """Set a setting, remember that, and have it take effect. Main loop only.

        Raises:
            SettingError: it cannot be set now, or not to that value; nothing has changed.
        """
        before = self.module_settings.snapshot()
        self.check_change(name)
        self.module_settings.set(name, value)
        self.remembered.change(name, value)
        after = self.module_settings.snapshot()
        if after != before and self._begun:
            self.use_settings(name, before, after)

    def _print_text(self, make_text: Callable[[], str]) -> None:
        """Print the text that `make_text` makes of the state, which belongs to the asyncio thread."""

        async def text() -> str:
            return make_text()

        say_text(self.host.bridge.run(text()) if self._begun else make_text())

    def _list_settings(self, pattern: str = "") -> None:
        try:
            say(*self.module_settings.listing(pattern))
        except SettingError as error:
            say(f"{self.name}: {error}")
