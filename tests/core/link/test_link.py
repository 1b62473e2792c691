from __future__ import annotations

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import LinkLost, UavApiError
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.link import Address, MavproxyLink
from mavproxy_uavapi.core.telemetry.vehicle_state import is_finite
from tests.support.fake_link import FakeLink
from tests.support.virtual_time import FastLoop

HELLO = mavlink.MAVLink_attitude_message(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def send(loop: FastLoop, mpstate: SimpleNamespace, host: Host) -> Callable[..., None]:
    """Send by MAVProxy's link, with a turn of the main loop in between."""

    def send(message: Any, system: int) -> None:
        link = MavproxyLink(host.bridge, mpstate)
        task = loop.create_task(link.send(message, system))
        loop.settle()
        assert not task.done()
        host.bridge.turn()
        loop.run(task)

    return send


def test_message_goes_out_by_the_vehicles_best_link(send: Callable[..., None], mpstate: SimpleNamespace) -> None:
    masters = {
        1: mpstate.the_master,
        7: SimpleNamespace(mav=SimpleNamespace(send=lambda m: pytest.fail("wrong link"))),
    }
    mpstate.master = masters.get
    send(HELLO, 1)
    assert mpstate.the_master.written == [HELLO]


def test_without_a_link_sending_is_link_lost(send: Callable[..., None], mpstate: SimpleNamespace) -> None:
    mpstate.master = lambda system: None
    with pytest.raises(LinkLost, match="MAVProxy has no link"):
        send(HELLO, 1)


def test_write_error_is_link_lost(send: Callable[..., None], mpstate: SimpleNamespace) -> None:
    def broken(_message: Any) -> None:
        raise OSError(5, "Input/output error")

    mpstate.the_master.mav.send = broken
    with pytest.raises(LinkLost, match="Input/output error"):
        send(HELLO, 1)


def test_source_is_mavproxys_own_address(mpstate: SimpleNamespace, host: Host) -> None:
    mpstate.settings.source_system, mpstate.settings.source_component = 250, 190
    assert MavproxyLink(host.bridge, mpstate).source == Address(250, 190)


def test_fake_link_remembers_and_sends(loop: asyncio.AbstractEventLoop) -> None:
    reported: list[Any] = []
    link = FakeLink(lambda message, system: reported.append((message, system)))
    loop.run_until_complete(link.send(HELLO, 3))
    assert link.sent == [HELLO]
    assert reported == [(HELLO, 3)]


@pytest.mark.parametrize("number", [float("nan"), float("inf"), float("-inf")])
def test_number_that_is_not_finite_does_not_leave(
    send: Callable[..., None], mpstate: SimpleNamespace, host: Host, number: float
) -> None:
    message = mavlink.MAVLink_attitude_message(0, 0.0, number, 0.0, 0.0, 0.0, 0.0)
    link = MavproxyLink(host.bridge, mpstate)
    with pytest.raises(UavApiError, match="not finite"):
        asyncio.run(link.send(message, 1))
    assert mpstate.the_master.written == []


def test_number_that_is_not_finite_is_found_in_an_array() -> None:
    covariance = [0.0] * 8 + [float("nan")]
    assert not is_finite(mavlink.MAVLink_attitude_quaternion_cov_message(0, [1.0, 0, 0, 0], 0, 0, 0, covariance))
