"""A copter that climbs without anybody's command, in no more time than it takes."""

from __future__ import annotations

import math

from mavproxy_uavapi.sim import Simulator

LONGEST = 40.0  # s


def until_it_hovers(simulator: Simulator, height: float) -> None:
    """Run the simulator until the vehicle hovers at that height above home, in m."""
    body = simulator.copter.body
    for _ in range(round(LONGEST / simulator.options.step)):
        simulator.step()
        if abs(body.position.down + height) < 0.05 and math.hypot(*body.velocity) < 0.05:
            return
    raise AssertionError(f"it is {-body.position.down:.1f} m high")
