from __future__ import annotations

import pytest

from mavproxy_gradys.net.mqtt_packets import (
    CONNACK,
    DISCONNECT,
    PING,
    SUBACK,
    Packet,
    Packets,
    connect,
    published,
    reason_code,
    subscribe,
)

HELLO = b"\x30\x0a\x00\x03a/b\x00cafe"  # the topic a/b, no properties
LONG = b"\x30\xce\x01" + b"\x00\x03a/b\x00" + b"x" * 200


def test_a_greeting_without_and_with_a_user() -> None:
    assert connect(None, None, 15, 16384) == b"\x10\x12\x00\x04MQTT\x05\x02\x00\x0f\x05\x27\x00\x00\x40\x00\x00\x00"
    assert connect("me", "päss", 15, 1)[:11] == b"\x10\x1d\x00\x04MQTT\x05\xc2\x00"
    assert connect("me", "päss", 15, 1).endswith(b"\x00\x00\x00\x02me\x00\x05p\xc3\xa4ss")


def test_a_subscription() -> None:
    assert subscribe("fleet/+") == b"\x82\x0d\x00\x01\x00\x00\x07fleet/+\x00"


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_packets_come_whole_however_the_stream_is_cut(size: int) -> None:
    stream, packets = HELLO + PING + LONG + HELLO, Packets(300)
    came = [packet for at in range(0, len(stream), size) for packet in packets.feed(stream[at : at + size])]
    assert [packet.kind for packet in came] == [3, 12, 3, 3]
    assert published(came[0]) == published(came[3]) == ("a/b", b"cafe")
    assert published(came[2]) == ("a/b", b"x" * 200)


def test_properties_are_passed_over() -> None:
    assert published(Packet(3, 0, b"\x00\x01a\x05\x02\x00\x00\x00\x09cafe")) == ("a", b"cafe")


@pytest.mark.parametrize("data", [b"\x30\xff\xff\xff\xff", b"\x30\xad\x02", b"\x30\x80\x80\x80\x80\x01"])
def test_a_packet_that_is_too_large_is_refused_by_its_length(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"301 bytes|no end"):
        list(Packets(300).feed(data))


@pytest.mark.parametrize(
    ("flags", "body"),
    [(0, b""), (0, b"\x00"), (0, b"\x00\x03a/b"), (0, b"\x00\x09a/b\x00"), (0, b"\x00\x01a\x05\x00"),
     (2, b"\x00\x01a\x00\x01\x00x")],
)  # fmt: skip
def test_a_malformed_message_is_refused(flags: int, body: bytes) -> None:
    with pytest.raises(ValueError):
        published(Packet(3, flags, body))


def test_a_topic_that_is_no_text_ends_nothing() -> None:
    assert published(Packet(3, 0, b"\x00\x02\xffa\x00x")) == ("\ufffda", b"x")


def test_reason_codes() -> None:
    assert reason_code(Packet(CONNACK, 0, b"\x00\x86\x00")) == 0x86
    assert reason_code(Packet(CONNACK, 0, b"\x00\x01")) == 1  # of a broker that knows MQTT 3.1.1 only
    assert reason_code(Packet(SUBACK, 0, b"\x00\x01\x00\x87")) == 0x87
    assert reason_code(Packet(DISCONNECT, 0, b"")) == 0
    with pytest.raises(ValueError):
        reason_code(Packet(CONNACK, 0, b"\x00"))
