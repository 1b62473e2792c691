from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.core.errors import Busy


def test_no_parameter_is_set_of_two_autopilots(
    loop: Any, flying: Any, copter: Any, link: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    copter.state.parameters["WP_SPD"] = 5.0
    sent: list[str] = []
    before = link.on_send
    link.on_send = lambda message, system: (sent.append(message.get_type()), before(message, system))
    monkeypatch.setattr(copter.state.time_ratio, "has_two_clocks", lambda now: True)
    with pytest.raises(Busy, match="two autopilots"):
        loop.run(copter.parameters.set("WP_SPD", 6.0))
    assert "PARAM_SET" not in sent
