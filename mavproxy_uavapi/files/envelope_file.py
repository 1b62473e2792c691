"""The operator's envelope: the file that the setting `envelope` names, read again whenever it changes."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.airspace.store import ALL, OPERATOR, Envelopes, missing
from mavproxy_uavapi.core.errors import SettingError, UavApiError
from mavproxy_uavapi.core.file_text import bytes_of
from mavproxy_uavapi.core.values import is_unset
from mavproxy_uavapi.files.watched_file import WatchedFile

log = logging.getLogger("uavapi.api")

VEHICLE = "vehicle"  # in place of a file: the fence that MAVProxy has loaded


def read(name: str) -> Space:
    """The envelope of a file.

    Raises:
        SettingError: it cannot be read, or makes no sense.
    """
    path = Path(name).expanduser()
    try:
        return Space(formats.of_bytes(bytes_of(path, formats.LARGEST), path.name))
    except UavApiError as error:
        raise SettingError(f"{path}: {error}", "envelope") from error


def check(name: str) -> None:
    """Raise SettingError unless the setting may be `name`."""
    if not is_unset(name) and name != VEHICLE:
        read(name)


class EnvelopeFile:
    """Keeps the operator's envelope as the file says. Asyncio thread only.

    Args:
        envelopes: where it is put.
        warn: told in a sentence what went wrong.
        tell: told in a sentence what is in force now.
    """

    def __init__(
        self, envelopes: Envelopes, warn: Callable[[str], None], tell: Callable[[str], object] = log.info
    ) -> None:
        self._envelopes = envelopes
        self._warn = warn
        self._tell = tell
        self._name = ""
        self._file = WatchedFile(warn)

    def use(self, name: str) -> None:
        """Take up the setting: a file, `vehicle`, or nothing."""
        if name == self._name and not self._file.has_changed():
            return
        self._name = name
        self._envelopes.expects_fences = name == VEHICLE
        is_file = not is_unset(name) and name != VEHICLE
        self._file.use(name if is_file else "")
        if not is_file:
            self._envelopes.clear(OPERATOR)
        else:
            self._take()

    async def watch(self) -> None:
        """Look every few seconds whether the file has changed, until cancelled."""
        await self._file.watch(self._take)

    def _remaining(self) -> str:
        """What is in force without it."""
        if any(key.by == OPERATOR for key, _ in self._envelopes.all()):
            return "the one before stays in force"
        reason = f"the envelope {self._name} could not be read"
        self._envelopes.put(OPERATOR, ALL, missing(reason, self._name))
        return "until it can be, nothing that moves a vehicle is sent"

    def _take(self) -> None:
        """Read the file, and put it in force at once; a file that cannot be read keeps the former one in force."""
        self._file.look()
        try:
            space = read(self._name)
        except SettingError as error:
            self._warn(f"envelope: {error}; {self._remaining()}")
            return
        for key, _ in list(self._envelopes.all()):
            if key.by == OPERATOR and key.system != ALL:
                self._envelopes.put(*key, None)
        self._envelopes.put(OPERATOR, ALL, space)
        self._tell(f"envelope: {self._name} is in force: {space.envelope.summary()}")
