"""The logs that a vehicle holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any


@dataclass(frozen=True)
class Log:
    """A log of a flight, in ArduPilot's binary format.

    Attributes:
        id: the vehicle's number for it.
        size: bytes.
        began: when it began, UTC; None if the vehicle did not know the time.
        downloaded: whether the API's machine has it already.
    """

    id: int
    size: int
    began: datetime | None
    downloaded: bool

    @classmethod
    def of(cls, report: Mapping[str, Any]) -> Log:
        """A log as `GET /logs` reports it."""
        time = report["time"]
        began = None if time is None else datetime.fromisoformat(time.replace("Z", "+00:00"))
        return cls(report["id"], report["size"], began, report["downloaded"])
