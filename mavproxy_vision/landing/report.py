"""The report of a flight. Pure data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass
class Report:
    """The report of a flight; see `docs/vision.md`."""

    verb: str
    method: str = ""
    tag: int | None = None
    attempts: int = 0
    duration: float = 0.0
    phases: dict[str, float] = field(default_factory=dict)
    last_offset: float | None = None
    touchdown_error: float | None = None
    action: str | None = None
    reason: str | None = None
    warning: str | None = None
    place: tuple[float, float, float] | None = None
    track: str | None = None
    plot: str | None = None

    def line(self) -> str:
        """One line about a flight that ended well."""
        if self.verb == "search" and self.place is not None:
            north, east, _ = self.place
            return f"Found tag {self.tag} at {north:.2f} m north, {east:.2f} m east of the EKF origin"
        if self.tag is None:
            return "Landed"
        off = "" if self.touchdown_error is None else f", {self.touchdown_error:.2f} m off it"
        return f"Landed {'near' if self.last_offset is None else 'on'} tag {self.tag}{off}"

    def as_dict(self) -> dict[str, Any]:
        """The report as a JSON object without unknown values; lengths in m, times in s on the vehicle's clock."""
        rounded = {name: round(value, 2) for name, value in self.phases.items()}
        members = {**vars(self), "phases": rounded, "duration": round(self.duration, 2)}
        for name in ("last_offset", "touchdown_error"):
            if members[name] is not None:
                members[name] = round(members[name], 3)
        return {name: value for name, value in members.items() if value is not None and value != ""}
