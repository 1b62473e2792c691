from __future__ import annotations

import pytest

from mavproxy_gradys.forwarding.sink_address import sink_address, sink_addresses
from mavproxy_uavapi.core.errors import SettingError


@pytest.mark.parametrize(
    "text,shown",
    [
        ("http://host/x", "http://host/x"),
        ("mqtt://me:s3cret@broker/x", "mqtt://me:***@broker/x"),
        ("mqtts://me:s3cret@r/e@t", "mqtts://me:***@t"),  # rather too much than too little
        ("mqtt://me:s3cret/x@broker/t", None),
        ("http://host/x?key=s3cret#ack=status", "http://host/x?***#ack=status"),
        ("mqtt://me:s3c,s3cret,@broker/x", "mqtt://me:***@broker/x"),
        ("mqtt://me:s3cret,", None),
        ("https://me:s3cret@host:8443/x?key=s3cret", "https://me:***@host:8443/x?***"),
    ],
)
def test_no_secret_is_shown_or_stored(text: str, shown: str | None) -> None:
    try:
        sink = sink_address(text)
    except SettingError as error:
        assert shown is None and "s3cret" not in str(error)
        return
    assert str(sink) == shown
    assert "s3cret" not in sink.name and "s3cret" not in f"{sink.name}{sink}"


def test_sink_is_the_same_by_all_but_password_and_options() -> None:
    same = {
        sink_address(text).name
        for text in ("http://h/r?k=1", "http://h/r?k=1#ack=status", "http://:p@h/r?k=1", "http://h:80/r?k=1")
    }
    others = {
        sink_address(text).name
        for text in ("https://h/r?k=1", "http://h/s?k=1", "http://h/r?k=2", "http://me@h/r?k=1", "http://h:81/r?k=1")
    }
    assert len(same) == 1 and len(others) == 5 and not same & others


def test_comma_in_a_password_begins_no_other_sink() -> None:
    sinks = sink_addresses("http://h:80/a , mqtt://u:p,a,@b:1884/t,http://[::1]:81/c,mqtts://u:7,8@d/t")
    assert [sink.url for sink in sinks] == [
        "http://h:80/a", "mqtt://u:p,a,@b:1884/t", "http://[::1]:81/c", "mqtts://u:7,8@d/t",
    ]  # fmt: skip


@pytest.mark.parametrize("text", ["mqtt://u:s3/cr,et@b/t", "mqtt://u:s3cr,", "http://h/a,mqtt://u:s3cr et@b/t"])
def test_list_that_is_wrong_shows_no_part_of_a_password(text: str) -> None:
    with pytest.raises(SettingError) as caught:
        sink_addresses(text)
    assert "s3" not in str(caught.value)


def test_one_that_is_named_twice_is_one_and_the_later_word_counts() -> None:
    sinks = sink_addresses("http://h/r, mqtt://u:old@b/t, http://h/r#ack=status, mqtt://u:new@b/t")
    assert [sink.url for sink in sinks] == ["http://h/r", "mqtt://u:new@b/t"]
    assert sinks[0].status_counts
