from __future__ import annotations

import pytest

from mavproxy_uavapi.core.addresses import masked


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("rtsp://host/stream", "rtsp://host/stream"),
        ("rtsp://pilot@host/stream", "rtsp://pilot@host/stream"),
        ("rtsp://pilot:s3cret@host:554/stream", "rtsp://pilot:***@host:554/stream"),
        ("rtsp://:s3cret@host", "rtsp://:***@host"),
        ("mqtt://pilot:s3@cr:e/t@host/topic", "mqtt://pilot:***@host/topic"),
        ("http://pilot:s3\ncret@host", "http://pilot:***@host"),
        ("http://host/video?user=a&pwd=s3cret", "http://host/video?***"),
        ("http://host/readings?key=s3cret#ack=status", "http://host/readings?***#ack=status"),
        ("http://pilot:s3cret?@host", "http://pilot:***@host"),
    ],
)
def test_url_is_shown_without_its_secrets(url: str, shown: str) -> None:
    assert masked(url) == shown
