"""Samples the sensors of the companion computer: files and commands."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Sequence
from typing import Protocol

from mavproxy_gradys.errors import NoReading
from mavproxy_gradys.forwarding.quantities import LONGEST_TEXT, Quantity
from mavproxy_gradys.forwarding.readings import UAV, Reading, Value, device_of
from mavproxy_gradys.forwarding.sensor_command import SensorCommand
from mavproxy_gradys.forwarding.sensor_file import Measured, SensorFile
from mavproxy_gradys.net.outage_log import Causes
from mavproxy_uavapi.core.values import NUMBER

log = logging.getLogger("gradys.sensor")
LARGEST = 2**63  # an integer must be smaller; see the readings that are posted
VALUE = "value"  # the cause if the content is not a value
STALE_PERIODS = 2.0  # a writer that is as slow as the reader is not stale


class SensorSource(Protocol):
    """Where a sensor's value comes from."""

    async def read(self) -> Measured | None:
        """The newest content; None if it was taken before.

        Raises:
            NoReading: there is none.
        """


class SensorFiles:
    """The files of sensors. They outlast a change of the settings: what was taken from one is not taken again, and a
    read that hangs is not begun again.

    Args:
        wall: s since 1970.
    """

    def __init__(self, wall: Callable[[], float]) -> None:
        self._wall = wall
        self._files: dict[tuple[str, str], SensorFile] = {}  # by the quantity's name and the file's

    def source_of(self, quantity: Quantity, max_age: float) -> SensorSource:
        """The source of a sensor.

        Args:
            quantity: the sensor.
            max_age: s after which a file is stale, or two periods if that is longer.
        """
        if quantity.command:
            return SensorCommand(quantity.command, wall=self._wall)
        longest, key = max(max_age, STALE_PERIODS * quantity.period), (quantity.name, quantity.file)
        file = self._files.setdefault(key, SensorFile(quantity.file, longest, self._wall))
        file.longest = longest
        return file

    def keep(self, quantities: Sequence[Quantity]) -> None:
        """Forget the files of all other quantities."""
        kept = {(quantity.name, quantity.file) for quantity in quantities}
        for key in self._files.keys() - kept:
            self._files.pop(key).close()


class SensorSampler:
    """Samples one sensor.

    Attributes:
        taken: number of readings.
        problem: why the last turn gave none; empty if it gave one.

    Args:
        quantity: the sensor.
        source: its source.
        clock: s, for the log.
        device: the beginning of the device names.
    """

    def __init__(
        self, quantity: Quantity, source: SensorSource, clock: Callable[[], float], device: str = UAV
    ) -> None:
        self.quantity, self.source = quantity, source
        self._device = device
        self.taken = 0
        self.problem = ""
        self._cause = ""
        self._causes = Causes(log, f"no reading of {quantity.name}", f"{quantity.name} is read again", clock)

    async def sample(self, system: int) -> Reading | None:
        """A reading that belongs to vehicle `system`; None if there is none, or no vehicle yet (0)."""
        if not system:
            self.problem = "no vehicle was heard yet"
            return None
        try:
            measured = await self.source.read()
            value = None if measured is None else value_of(self.quantity, measured.content)
        except NoReading as error:
            self._cause, self.problem = error.cause, str(error)
            self._causes.failed(error.cause, self.problem)
            return None
        if value is None and self._cause == VALUE:  # what is there is still no value
            return None
        self._causes.succeeded()
        self._cause, self.problem = "", ""
        if measured is None or value is None:
            self.problem = "nothing new was written"
            return None
        self.taken += 1
        quantity = self.quantity
        device = device_of(system, self._device)
        return Reading(device, system, quantity.name, quantity.representation, value, measured.time)


def value_of(quantity: Quantity, content: bytes) -> Value:
    """The number, scaled, or the text that a sensor gave.

    Raises:
        NoReading: it is neither.
    """
    try:
        text = content.decode().strip()
    except UnicodeDecodeError:
        raise NoReading(VALUE, "the content is not UTF-8") from None
    if not text:
        raise NoReading(VALUE, "the content is empty")
    if quantity.is_text:
        return checked_text(text)
    if not re.fullmatch(NUMBER, text):
        raise NoReading(VALUE, f"{text[:40]!r} is not a number")
    number = int(text) if re.fullmatch(r"[-+]?\d{1,20}", text) else float(text)
    value = quantity.scaled(number)
    if value is None or abs(value) >= LARGEST and isinstance(value, int):
        raise NoReading(VALUE, f"{text[:40]!r} is too large")
    return value


def checked_text(text: str) -> str:
    """The text, if a receiver can take it.

    Raises:
        NoReading: it is too long, or has control characters other than tabs and line ends.
    """
    if len(text) > LONGEST_TEXT:
        raise NoReading(VALUE, f"the text has more than {LONGEST_TEXT} characters")
    if not all(character.isprintable() or character in "\t\r\n" for character in text):
        raise NoReading(VALUE, "the text has control characters")
    return text
