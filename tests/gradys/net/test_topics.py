from __future__ import annotations

import pytest

from mavproxy_gradys.net.topics import checked_filter, checked_topic
from mavproxy_uavapi.core.errors import SettingError

PLACES = ("device", "quantity")


@pytest.mark.parametrize("topic", ["fleet/{device}/{quantity}", "a", "plant/status", "/a//b", "größe/{device}"])
def test_topics_to_publish_to(topic: str) -> None:
    assert checked_topic(topic, PLACES) == topic


@pytest.mark.parametrize(
    "topic", ["", "a/+", "a/#", "a?b", "$SYS/a", "a\0b", "a\nb", "x" * 1001, "{devise}", "{device", "device}", "a/{}"]
)
def test_other_topics_are_refused(topic: str) -> None:
    with pytest.raises(SettingError):
        checked_topic(topic, PLACES)


@pytest.mark.parametrize("text", ["fleet/#", "fleet/+/position", "#", "+/+", "a", "a//+"])
def test_filters(text: str) -> None:
    assert checked_filter(text) == text


@pytest.mark.parametrize("text", ["", "a/#/b", "a+", "a/b#", "+a/b", "$share/g/a", "a\x1b", "##", "x" * 1001])
def test_other_filters_are_refused(text: str) -> None:
    with pytest.raises(SettingError):
        checked_filter(text)
