"""MAVProxy's main loop stands for seconds: nothing that is old by then is sent, and everybody has his answer."""

from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.core.mainloop.permit import ORDER_LASTS, STOP_LASTS
from tests.support.slow_links import standing
from tests.support.world import LEGS, PLACE, World, item_at

SWITCHES = {
    "/command/guided": "LOITER",
    "/command/brake": "GUIDED",
    "/command/rtl": "GUIDED",
    "/command/land": "GUIDED",
    "/command/set_mode?mode=AUTO": "GUIDED",
}


class Case:
    """A world whose main loop may stand."""

    def __init__(self, make_world: Any, stage: Any) -> None:
        def staged(world: World) -> None:
            self.stand = standing(world)
            stage(world)
            world.copter.mission.items[:] = [item_at(*PLACE), *(item_at(PLACE[0] + n, PLACE[1]) for n in LEGS)]

        self.world = make_world(staged)
        self.world.loop.pass_time(3.0)


@pytest.mark.parametrize("seconds", [0.5, 1.5, 4.0, 9.0, 60.0])
@pytest.mark.parametrize("path", SWITCHES)
def test_what_waited_does_not_take_the_vehicle_from_its_pilot(make_world: Any, path: str, seconds: float) -> None:
    case = Case(make_world, lambda world: world.flying(mode=SWITCHES[path]))
    world = case.world
    case.stand(True)
    wire = world.begin("GET", path)
    world.loop.pass_time(seconds / 2)
    world.fault("pilot_mode", mode="ALT_HOLD")
    world.loop.pass_time(seconds / 2)
    case.stand(False)
    world.loop.pass_time(5.0)
    assert world.vehicle.mode.name == "ALT_HOLD" and not world.orders_of(
        [sent for sent in world.sent if getattr(sent.message, "command", 0) == 176]
    )
    wire.hang_up()


@pytest.mark.parametrize("path", ["/command/brake", "/command/land", "/command/rtl"])
def test_what_stops_or_lands_it_goes_out_late_if_it_is_still_right(make_world: Any, path: str) -> None:
    case = Case(make_world, World.flying)
    case.stand(True)
    wire = case.world.begin("GET", path)
    case.world.loop.pass_time(STOP_LASTS - 2.0)
    case.stand(False)
    case.world.until(lambda: case.world.vehicle.mode.name != "GUIDED", 0.02, 3.0)
    wire.hang_up()


def test_arm_that_waited_for_a_minute_arms_nothing(make_world: Any) -> None:
    case = Case(make_world, lambda world: (world.boot(), world.in_mode("GUIDED")))
    case.stand(True)
    wire = case.world.begin("GET", "/command/arm?timeout=100")
    case.world.loop.pass_time(60.0)
    case.stand(False)
    case.world.loop.pass_time(5.0)
    assert not case.world.copter.armed and wire.reply.done()


@pytest.mark.parametrize(
    ("method", "path", "body", "within"),
    [
        ("GET", "/movement/stop", None, STOP_LASTS),
        ("GET", "/command/land", None, STOP_LASTS),
        ("GET", "/command/brake", None, STOP_LASTS),
        ("GET", "/command/disarm", None, STOP_LASTS),
        ("GET", "/command/set_mode?mode=LOITER", None, ORDER_LASTS),
        ("GET", "/command/set_ground_speed?new_v=3", None, ORDER_LASTS),
        ("POST", "/movement/go_to_ned", {"x": 5, "y": 5, "z": -8}, ORDER_LASTS),
        ("POST", "/movement/travel_at_ned", {"vx": 1, "vy": 0, "vz": 0}, ORDER_LASTS),
        ("POST", "/peripherical/servo_output", {"channel": 9, "pwm": 1500}, 6.0),
        ("GET", "/mission/waypoints", None, 6.0),
        ("GET", "/telemetry/home_info", None, 6.0),
    ],
)
def test_everybody_has_his_answer_while_the_main_loop_stands(
    make_world: Any, method: str, path: str, body: Any, within: float
) -> None:
    case = Case(make_world, World.flying)
    case.world.host.link_watch.timeout = 3600.0  # so that no lost link ends the waits
    case.stand(True)
    wire = case.world.begin(method, path, body)
    case.world.loop.pass_time(within + 0.5)
    assert wire.reply.done() and wire.reply.result().status != 200
