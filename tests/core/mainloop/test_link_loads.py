from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from mavproxy_uavapi.core.mainloop.link_loads import LinkLoads


def serial(baudrate: int) -> Any:
    return SimpleNamespace(
        port=SimpleNamespace(baudrate=baudrate), mav=SimpleNamespace(total_bytes_received=0, total_bytes_sent=0)
    )


def passes(loads: LinkLoads, master: Any, received: int, sent: int, seconds: float, began: float) -> bool:
    """Whether the link is full after so many bytes in so many s."""
    loads.any_is_full([master], began)
    master.mav.total_bytes_received += received
    master.mav.total_bytes_sent += sent
    return loads.any_is_full([master], began + seconds)


def test_radio_that_carries_almost_all_it_can_is_full() -> None:
    assert passes(LinkLoads(), serial(57600), 9_000, 1_000, 2.0, 50.0)


def test_radio_with_room_is_not_full() -> None:
    assert not passes(LinkLoads(), serial(57600), 3_000, 500, 2.0, 50.0)


def test_full_radio_has_room_again() -> None:
    loads, radio = LinkLoads(), serial(57600)
    assert passes(loads, radio, 11_000, 0, 2.0, 50.0)
    assert not passes(loads, radio, 100, 0, 2.0, 52.0)


def test_link_that_is_not_serial_is_never_full() -> None:
    udp = SimpleNamespace(mav=SimpleNamespace(total_bytes_received=0, total_bytes_sent=0), port=SimpleNamespace())
    assert not passes(LinkLoads(), udp, 10**9, 0, 2.0, 50.0)


def test_link_that_is_removed_counts_no_more() -> None:
    loads, radio = LinkLoads(), serial(57600)
    assert passes(loads, radio, 11_000, 0, 2.0, 50.0)
    assert not loads.any_is_full([], 53.0)
