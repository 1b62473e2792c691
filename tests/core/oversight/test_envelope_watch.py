from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.oversight.envelope_watch import EnvelopeWatch
from tests.support.virtual_time import FastLoop


def position(system: int) -> Any:
    message = mavlink.MAVLink_global_position_int_message(0, 0, 0, 0, 0, 0, 0, 0, 0)
    return SimpleNamespace(get_type=message.get_type, get_srcComponent=lambda: 1, system=system)


def test_positions_of_one_burst_are_looked_at_in_callbacks_of_their_own(
    loop: FastLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each look may take milliseconds; together they would hold the asyncio thread."""
    states = {n: SimpleNamespace(system=n, component=1) for n in (1, 2, 3)}
    registry: Any = SimpleNamespace(find=lambda n: SimpleNamespace(state=states[n]))
    envelopes: Any = SimpleNamespace(of=lambda _system: ["one"])
    watch = EnvelopeWatch(registry, Any, envelopes, print)  # type: ignore[arg-type]
    looked: list[int] = []
    monkeypatch.setattr(watch, "_prepare", lambda vehicle: None)
    monkeypatch.setattr(watch, "look", lambda vehicle: looked.append(vehicle.state.system))
    before: list[list[int]] = []

    async def burst() -> None:
        for system in (1, 2, 1, 3):
            watch.listen(states[system], position(system))  # type: ignore[arg-type]
        before.append(list(looked))

    loop.run(burst())
    loop.settle()
    assert looked == [1, 2, 3], "the newest position of each, once"
    loop.run(burst())
    loop.settle()
    assert looked == [1, 2, 3] * 2 and before == [[], [1, 2, 3]]
