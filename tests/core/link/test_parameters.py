from __future__ import annotations

import pytest

from mavproxy_uavapi.core.errors import Busy
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.fake_link import FakeLink
from tests.support.virtual_time import FastLoop


def test_no_parameter_is_set_of_two_autopilots(
    loop: FastLoop, flying: Drone, copter: Vehicle, link: FakeLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    copter.state.parameters["WP_SPD"] = 5.0
    sent: list[str] = []
    before = link.on_send
    link.on_send = lambda message, system: (sent.append(message.get_type()), before(message, system))
    monkeypatch.setattr(copter.state.time_ratio, "has_two_clocks", lambda now: True)
    with pytest.raises(Busy, match="two autopilots"):
        loop.run(copter.parameters.set("WP_SPD", 6.0))
    assert "PARAM_SET" not in sent
