"""A return ends at home, also where nobody has told yet where that is."""

from __future__ import annotations

import pytest

from mavproxy_uavapi.sim import Options, Simulator
from tests.support.make_world import MakeWorld
from tests.support.world import TICK, World

SYSTEM = 2


@pytest.mark.parametrize("vehicle", ["rover", "plane"])
def test_a_return_asks_where_home_is(make_world: MakeWorld, vehicle: str) -> None:
    def stage(world: World) -> None:
        simulator = Simulator(Options(sysid=SYSTEM, vehicle=vehicle, ready_after=1.0, step=TICK))
        world.join(simulator)
        simulator.run(2.0)

    world = make_world(stage)
    prefix = f"/vehicles/{SYSTEM}/command"
    assert world.ask("GET", f"{prefix}/arm").outcome == "200"
    if vehicle == "plane":
        assert world.ask("GET", f"{prefix}/takeoff?alt=40").outcome == "200"
    world.host.registry.find(SYSTEM).state.messages.pop("HOME_POSITION", None)
    assert world.ask("GET", f"{prefix}/rtl").outcome == "200"
