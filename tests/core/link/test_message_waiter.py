from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.core.errors import Busy, LinkLost, ModeChanged, TimedOut
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop


def test_message_gives_what_the_test_makes_of_it(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.mute.add("VFR_HUD")
    loop.call_later(2.0, lambda: drone.send("vfr_hud", heading=12))
    heading = loop.run(copter.waiting.message({"VFR_HUD"}, lambda m: m.heading, 5.0, "tell its heading"))
    assert heading == 12
    assert loop.time() == pytest.approx(1002.0)


def test_timeout_says_what_did_not_happen_and_forgets_the_wait(
    loop: FastLoop, host: Host, drone: Drone, copter: Vehicle
) -> None:
    started = loop.time()
    with pytest.raises(TimedOut, match=r"^vehicle 1 did not sing within 2\.5 s$"):
        loop.run(copter.waiting.message({"ATTITUDE"}, lambda m: None, 2.5, "sing"))
    assert loop.time() - started == pytest.approx(2.5)
    assert len(host.pending) == 0


def test_cancelled_wait_is_forgotten(loop: FastLoop, host: Host, drone: Drone, copter: Vehicle) -> None:
    task = loop.create_task(copter.waiting.message({"NAMED"}, lambda m: m, 60.0, "sing"))
    loop.settle()
    assert len(host.pending) == 1
    task.cancel()
    loop.settle()
    assert len(host.pending) == 0


def test_until_looks_at_once(loop: FastLoop, copter: Vehicle) -> None:
    started = loop.time()
    assert loop.run(copter.waiting.until({"HEARTBEAT"}, lambda: "now", 5.0, "sing")) == "now"
    assert loop.time() == started


def test_until_looks_after_each_message_of_those_names(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    loop.call_later(1.6, lambda: setattr(drone, "armed", True))
    loop.run(copter.waiting.until({"HEARTBEAT"}, lambda: copter.state.armed or None, 5.0, "arm"))
    assert loop.time() == pytest.approx(1001.75)


def test_what_a_condition_raises_ends_the_wait(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    def condition() -> None:
        if copter.mode != "STABILIZE":
            raise ModeChanged("the pilot")

    loop.call_later(1.0, drone.pilot, "LOITER")
    with pytest.raises(ModeChanged):
        loop.run(copter.waiting.until({"HEARTBEAT"}, condition, 5.0, "sing"))


def test_link_loss_ends_a_wait(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.power_off()
    with pytest.raises(LinkLost):
        loop.run(copter.waiting.message({"ATTITUDE"}, lambda m: None, 60.0, "sing"))


def test_expecting_catches_what_comes_before_it_is_awaited(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    async def send_first() -> Any:
        with copter.waiting.expecting({"VFR_HUD"}, lambda m: m.heading) as reported:
            drone.send("vfr_hud", heading=7)
            await copter.waiting.message({"VFR_HUD"}, lambda m: m, 1.0, "come")
            return await reported.within(1.0, "tell")

    drone.mute.add("VFR_HUD")
    assert loop.run(send_first()) == 7


def test_what_one_of_two_autopilots_shows_is_no_outcome(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    copter.state.are_two = lambda now: now > 1003.0
    loop.call_later(4.0, lambda: setattr(drone, "armed", True))
    with pytest.raises(Busy):
        loop.run(copter.waiting.until({"HEARTBEAT"}, lambda: copter.state.armed or None, 9.0, "arm"))
