"""A copter that climbs without anybody's command, in no more time than it takes."""

from __future__ import annotations

import math

from mavproxy_uavapi.sim import Simulator

LONGEST = 40.0  # s


def until_it_hovers(simulator: Simulator, height: float) -> None:
    """Run the simulator until the vehicle hovers at that height above home, in m."""
    body, near = simulator.copter.body, 0.05 + simulator.options.gps_noise  # the height that it believes wanders
    for _ in range(round(LONGEST / simulator.options.step)):
        simulator.step()
        if abs(body.position.down + height) < near and math.hypot(*body.velocity) < 0.05:
            return
    raise AssertionError(f"it is {-body.position.down:.1f} m high")
