"""The topics; the broker's part is in end_to_end/test_gradys_mqtt.py, with a real one."""

from __future__ import annotations

import pytest

from mavproxy_gradys.mqtt import status_topic, topic_of
from mavproxy_gradys.readings import Reading

ALT = Reading("uav-7", 7, "alt", "m", 1.0, 0.0)


@pytest.mark.parametrize(
    "template,topic,status",
    [
        ("fleet/{sysid}/{quantity}", "fleet/7/alt", "fleet/7/status"),
        ("{device}/{quantity}/raw", "uav-7/alt/raw", "uav-7/status/raw"),
        ("everything", "everything", "everything/status"),
    ],
)
def test_topics(template: str, topic: str, status: str) -> None:
    assert topic_of(template, ALT) == topic
    assert status_topic(template, ALT) == status
