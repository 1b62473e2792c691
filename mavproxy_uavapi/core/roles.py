"""Who may do what: roles, and the operators that have them. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Role(IntEnum):
    """What a caller may do; a higher one includes the lower ones."""

    WATCH = 1  # read and stream; it causes no message to a vehicle
    FLY = 2  # command the vehicles that it names
    ADMIN = 3  # parameters, scripts, envelopes, raw messages, reboots, of every vehicle
    PROMPT = 4  # MAVProxy's prompt; no token has it

    @property
    def word(self) -> str:
        """As files and answers spell it."""
        return self.name.lower()


@dataclass(frozen=True)
class Operator:
    """Somebody who may hold a vehicle.

    Attributes:
        name: of the token, or else the address.
        role: what the operator may do.
    """

    name: str
    role: Role

    def takes_from(self, holder: Operator) -> bool:
        """Whether the operator may take a vehicle from somebody else who holds it."""
        return self.role >= Role.ADMIN and self.role >= holder.role


THE_PROMPT = Operator("console", Role.PROMPT)
