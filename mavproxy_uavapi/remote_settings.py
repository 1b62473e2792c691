"""The settings as callers of the API see and change them: as `uavapi set` does it, in MAVProxy's main loop.

They see those of all our loaded modules, and change those of `uavapi`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from mavproxy_uavapi.core.errors import NotFound, SettingError, TimedOut
from mavproxy_uavapi.core.mainloop.bridge import Bridge
from mavproxy_uavapi.core.settings import ModuleSettings
from mavproxy_uavapi.core.terminal import say
from mavproxy_uavapi.core.text import nearest
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.settings import SETTABLE, ApiSettings

LONGEST = 10.0  # s until a change is in force: MAVProxy's main loop may be busy, or the disk of a log slow


class RemoteSettings:
    """All methods belong to the asyncio thread; the settings themselves to the main loop.

    Args:
        bridge: to the main loop.
        settings: those of the loaded module.
        change: sets one of them as the prompt does; the main loop only.
        settled: waits until what was changed before is in force.
        members: our loaded modules.
    """

    def __init__(
        self,
        bridge: Bridge,
        settings: ModuleSettings[ApiSettings],
        change: Callable[[str, Any], None],
        settled: Callable[[], Awaitable[None]],
        members: Sequence[Any],
    ) -> None:
        self._bridge = bridge
        self._settings = settings
        self._change = change
        self._settled = settled
        self._members = members

    async def reports(self) -> dict[str, list[dict[str, Any]]]:
        """All settings by module, as `ModuleSettings.reports` has them.

        Raises:
            TimedOut: MAVProxy's main loop is blocked.
        """

        def of_all() -> dict[str, list[dict[str, Any]]]:
            return {member.module_settings.module: member.module_settings.reports() for member in self._members}

        try:
            return await wait_with_timeout(LONGEST, self._bridge.on_main(of_all))
        except asyncio.TimeoutError as error:
            raise TimedOut(f"MAVProxy's main loop did not answer within {LONGEST:g} s") from error

    def require_settable(self, name: str) -> None:
        """Refuse a setting that is the prompt's.

        Raises:
            NotFound: there is no such setting.
            SettingError: it is set at the prompt only.
        """
        names = self._settings.names()
        if name not in names:
            raise NotFound(f"no setting {name[:32]!r}; {nearest(name, names)}")
        if name not in SETTABLE:
            raise SettingError(f"it is set at MAVProxy's prompt only: `uavapi set {name} …`", name)

    async def set(self, name: str, value: Any, client: str) -> None:
        """Set a setting; it is in force then. The prompt shows that, and who did it.

        Raises:
            NotFound, SettingError: as `require_settable`, or the value is refused; nothing has changed.
            TimedOut: it is not known to be in force.
        """
        self.require_settable(name)

        def change() -> None:
            before = self._settings.shown(name)
            self._change(name, value)
            after = self._settings.shown(name)
            if after != before:
                say(f"uavapi: {name} is {after or 'empty'}, set by {client}")

        async def set_and_wait() -> None:
            await self._bridge.on_main(change)
            await self._settled()

        try:
            await wait_with_timeout(LONGEST, set_and_wait())
        except asyncio.TimeoutError as error:
            raise TimedOut(f"{name} is not in force after {LONGEST:g} s; GET /settings shows it") from error
