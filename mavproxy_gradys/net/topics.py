"""Topics and topic filters of MQTT, as settings and options have them. Pure."""

from __future__ import annotations

import re
from collections.abc import Collection

from mavproxy_uavapi.core.errors import SettingError

LONGEST = 1000  # bytes; names that are filled in make it longer, and a broker takes 65535
PLACE = re.compile(r"\{(.*?)\}")


def checked_topic(topic: str, places: Collection[str]) -> str:
    """A topic to publish to.

    Args:
        topic: with places for names, such as `fleet/{device}`.
        places: the names that there are.

    Raises:
        SettingError: nobody can publish to it, or it has a place for another name.
    """
    if set("+#?") & set(topic):
        raise SettingError(f"{topic!r}: a topic has none of + # ?")
    unknown = [name for name in PLACE.findall(topic) if name not in places] or re.findall(
        "[{}]", PLACE.sub("", topic)
    )
    if unknown:
        names = ", ".join(f"{{{name}}}" for name in places)
        raise SettingError(f"{topic!r} has {unknown[0]!r} in brackets; the names are {names}")
    return _checked(topic)


def checked_filter(text: str) -> str:
    """A topic filter to subscribe to.

    Raises:
        SettingError: a broker refuses it.
    """
    levels = text.split("/")
    wild = [level for level in levels if set("+#") & set(level)]
    if "#" in levels[:-1] or not {"+", "#"}.issuperset(wild):
        raise SettingError(f"{text!r}: + and # are whole levels, and # is the last one")
    return _checked(text)


def _checked(text: str) -> str:
    if not text or text.startswith("$") or not text.isprintable() or len(text.encode()) > LONGEST:
        raise SettingError(
            f"{text!r:.60}: a topic is 1 to {LONGEST} bytes of printable text, and does not begin with $"
        )
    return text
