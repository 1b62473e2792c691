"""Another computer on the LAN, which is a network namespace."""

from __future__ import annotations

from typing import NamedTuple


class Lan(NamedTuple):
    """A network namespace with an address of its own, as another computer on the LAN has one.

    Attributes:
        here: our address on it.
        network: both addresses.
        inside: the words before a command that is to run on the other computer.
    """

    here: str
    network: str
    inside: tuple[str, ...]
