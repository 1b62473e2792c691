from __future__ import annotations

import pytest

from mavproxy_uavapi.core.addresses import is_our_name, masked


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
        ("mqtt://pilot:s3", "mqtt://pilot:***"),
        ("mqtt://pilot:1s3cret", "mqtt://pilot:***"),
        ("http://[::1]:8000/x", "http://[::1]:8000/x"),
        ("http://host:8000", "http://host:8000"),
        ("http://host:8000?key=s3cret", "http://host:8000?***"),
    ],
)
def test_url_is_shown_without_its_secrets(url: str, shown: str) -> None:
    assert masked(url) == shown


@pytest.mark.parametrize("host", ["drone.lan", "DRONE.lan:8000", "drone.lan.", "b", "192.168.1.5", "localhost."])
def test_other_names_are_ours_however_they_are_written(host: str) -> None:
    assert is_our_name(host, "Drone.LAN", "b")


@pytest.mark.parametrize("host", ["drone.lan.evil.example", "xdrone.lan", "", ".", "drone.lan@evil.example"])
def test_names_that_only_contain_ours_are_not(host: str) -> None:
    assert not is_our_name(host, "drone.lan", "b")
