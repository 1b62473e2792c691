"""Values of MAVLink by their names, where a table has many with one prefix."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink


def named(prefix: str, words: str) -> tuple[int, ...]:
    """The values of the names that are the prefix, such as `MAV_CMD_`, and one of the words each."""
    return tuple(int(getattr(mavlink, prefix + word)) for word in words.split())


def commands(words: str) -> frozenset[int]:
    """MAV_CMDs by their names without the prefix."""
    return frozenset(named("MAV_CMD_", words))
