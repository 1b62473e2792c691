from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.core.link.messages import VelocityTarget
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.fake_link import FakeLink
from tests.support.pilotage import Pilotage
from tests.support.piloting import STILL, nothing_more
from tests.support.virtual_time import FastLoop


def test_travel_sends_one_velocity(loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.do(copter.travel, VelocityTarget(1.0, 2.0, -0.5))
    assert [(m.vx, m.vy, m.vz, m.type_mask) for m in flying.setpoints()] == [(1.0, 2.0, -0.5, 0b1101_1100_0111)]
    nothing_more(loop, flying)


def test_travel_with_duration_repeats_the_velocity_then_stops(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage, link: FakeLink
) -> None:
    started, times = loop.time(), []
    link.on_send = lambda message, system: (
        times.append(loop.time() - started),
        flying.on_send(message, system),
    )
    loop.run(copter.limits())
    times.clear()
    pilotage.do(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=10.0)
    assert loop.time() - started == pytest.approx(10.0, abs=0.3)
    velocities = [(m.vx, m.vy, m.vz) for m in flying.setpoints()]
    assert velocities == [(1.0, 0.0, 0.0)] * 10 + [STILL]
    gaps = [after - before for before, after in zip(times, times[1:], strict=False)]
    assert max(gaps) <= 1.1  # ArduCopter drops a velocity after GUID_TIMEOUT, 3 s
    nothing_more(loop, flying)


def test_travel_follows_the_vehicles_own_timeout(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.parameters["GUID_TIMEOUT"] = 0.6
    pilotage.do(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=2.0)
    assert len(flying.setpoints()) == 11


def test_travel_counts_the_vehicles_seconds(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    copter.state.time_ratio.ratio = 5.0
    copter.state.time_ratio.update = lambda *args: False
    started = loop.time()
    pilotage.do(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=10.0)
    assert loop.time() - started == pytest.approx(2.0, abs=0.2)


def test_late_setpoints_do_not_add_to_a_travel(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage, link: FakeLink
) -> None:
    def late(message: Any, system: int) -> None:
        flying.on_send(message, system)
        loop.now += 0.4  # the machine is busy

    loop.run(copter.limits())
    link.on_send = late
    started = loop.time()
    pilotage.do(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=10.0)
    assert loop.time() - started == pytest.approx(10.8, abs=0.2)  # the first and the last one are late
    assert [(m.vx, m.vy, m.vz) for m in flying.setpoints()][-1] == STILL


def test_position_from_before_a_stop_does_not_show_that_the_vehicle_stands(
    loop: FastLoop, flying: Drone, copter: Vehicle
) -> None:
    loop.pass_time(3.0)
    sent_at = loop.time()
    assert copter.stands_still and not copter.has_stopped_since(sent_at)
    loop.pass_time(3.0)
    assert copter.has_stopped_since(sent_at)
