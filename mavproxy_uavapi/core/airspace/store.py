"""Which envelopes are in force for which vehicle. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from mavproxy_uavapi.core.airspace.model import Envelope, EnvelopeLimits
from mavproxy_uavapi.core.airspace.space import Space

ALL = 0  # in place of a system id: every vehicle
OPERATOR, API = "setting", "api"  # owners: the operator by the setting, a client by the API


class Key(NamedTuple):
    """The owner of an envelope, and the system id that it is for."""

    by: str
    system: int


class Envelopes:
    """The envelopes by owner and vehicle. A vehicle must be inside all envelopes that apply to it.

    So a client can make the operator's envelope narrower, never wider.

    Attributes:
        expects_fences: whether each vehicle's own fence is its envelope; until it is known, no place is inside.
    """

    def __init__(self) -> None:
        self.expects_fences = False
        self._spaces: dict[Key, Space] = {}
        self._of: dict[int, tuple[Space, ...]] = {}  # by system id, what `of` has answered

    def put(self, by: str, system: int, envelope: Envelope | Space | None) -> None:
        """Replace the owner's envelope for that system id. None removes it.

        Raises:
            Invalid: it makes no sense as geometry; the former one stays in force.
        """
        space = Space(envelope) if isinstance(envelope, Envelope) else envelope
        spaces = {key: former for key, former in self._spaces.items() if key != (by, system)}
        if space is not None:
            spaces[Key(by, system)] = space
        self._spaces, self._of = spaces, {}

    def clear(self, by: str) -> None:
        """Remove all envelopes of one owner. Call it also after a change of `expects_fences`."""
        self._spaces = {key: space for key, space in self._spaces.items() if key.by != by}
        self._of = {}

    def of(self, system: int) -> tuple[Space, ...]:
        """Those in force for a vehicle: the same object until one of them changes."""
        if system not in self._of:
            known = [space for key, space in self._spaces.items() if key.system in (ALL, system)]
            if self.expects_fences and Key(OPERATOR, system) not in self._spaces:
                reason = f"MAVProxy has not loaded the fence of vehicle {system}: `fence list`"
                known.append(missing(reason, "the fence", is_own=True))
            self._of[system] = tuple(known)
        return self._of[system]

    def all(self) -> Iterator[tuple[Key, Space]]:
        """All of them."""
        return iter(self._spaces.items())


def missing(reason: str, source: str, *, is_own: bool = False) -> Space:
    """An envelope that is not known yet: no place is inside."""
    return Space(Envelope(limits=EnvelopeLimits(height=1e-3), source=source, is_own=is_own), reason)
