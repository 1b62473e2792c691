"""No verb can forget the envelope: all that is sent to a vehicle passes its guard; what is new to it is refused."""

from __future__ import annotations

import ast
import math
import re
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace.guard import GuardedLink
from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link import orders
from mavproxy_uavapi.core.telemetry.flight_modes import STOPPING_MODES
from mavproxy_uavapi.core.vehicle.registry import CLASSES
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.rules import outcomes
from tests.rules.test_fault_matrix import REQUESTS, STAGES, begin, prepare
from tests.support.drone import Drone
from tests.support.envelopes import feature, square
from tests.support.make_world import MakeWorld
from tests.support.sources import trees
from tests.support.virtual_time import FastLoop
from tests.support.world import World

ROOT = Path(__file__).parents[2]
CORE = ROOT / "mavproxy_uavapi" / "core"
FAR_AWAY = {"type": "FeatureCollection", "features": [feature("elsewhere", square(50, 3000, 3000))]}
STOP_MODES = STOPPING_MODES | {"GUIDED"}  # GUIDED is where the next setpoint of ours counts


@pytest.mark.parametrize("kind", CLASSES)
def test_every_way_to_the_link_passes_the_guard(host: Host, kind: str) -> None:
    from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

    vehicle = CLASSES[kind](VehicleState(1, 1, 2, 0.0), host.link, host.pending, host.clock)
    ways = vehicle._link, vehicle._sender._link, vehicle.waypoints._transfers._link, vehicle.parameters._link
    assert all(way is vehicle._link for way in ways) and isinstance(vehicle._link._link, GuardedLink)


def test_nobody_but_the_registry_is_given_the_bare_link() -> None:
    bare = []
    for file, tree in trees(r"host_*\s*\.\s*(link|_mavproxy_link)\b").items():
        for node in ast.walk(tree):
            is_link = isinstance(node, ast.Attribute) and node.attr in ("link", "_mavproxy_link")
            if is_link and isinstance(node.value, ast.Name | ast.Attribute):
                owner = node.value.id if isinstance(node.value, ast.Name) else node.value.attr
                if owner.strip("_") == "host":
                    bare.append(f"{file}: {owner}.{node.attr}")
    assert bare == []


def test_every_command_that_is_not_known_is_unknown() -> None:
    known = orders.HARMLESS_COMMANDS | orders.COMMANDS.keys()
    for number in mavlink.enums["MAV_CMD"]:
        message = mavlink.MAVLink_command_long_message(1, 1, number, 0, *(1.0,) * 7)
        assert isinstance(orders.order_of(message), orders.Unknown) == (number not in known or number == 192)


def test_every_command_that_we_make_is_known() -> None:
    made = re.findall(r"\bmavlink\.(MAV_CMD_\w+)", (CORE / "link" / "messages.py").read_text(encoding="utf-8"))
    known = orders.HARMLESS_COMMANDS | orders.COMMANDS.keys()
    refused = sorted({name for name in made if getattr(mavlink, name) not in known})
    assert refused == [], "where an envelope is in force it is refused: add it to core/link/orders.py"


def test_every_message_that_is_not_known_is_unknown() -> None:
    known = orders.HARMLESS_MESSAGES | orders.READERS.keys()
    assert (
        "SET_ATTITUDE_TARGET" not in known and "RC_CHANNELS_OVERRIDE" not in known and "MANUAL_CONTROL" not in known
    )

    class Message:
        def __init__(self, name: str) -> None:
            self._name = name

        def get_type(self) -> str:
            return self._name

    for cls in mavlink.mavlink_map.values():
        if cls.msgname not in known:
            assert isinstance(orders.order_of(Message(cls.msgname)), orders.Unknown)


def test_every_message_that_a_verb_makes_is_known() -> None:
    known = {name.lower() for name in orders.HARMLESS_MESSAGES | orders.READERS.keys()}
    for file in (CORE / "vehicle").glob("*.py"):
        built = set(re.findall(r"MAVLink_(\w+)_message\b", file.read_text(encoding="utf-8")))
        assert built <= known, file.name


def test_setpoint_of_a_kind_that_no_verb_uses_is_refused(
    host: Host, copter: Vehicle, flying: Drone, loop: FastLoop
) -> None:
    from mavproxy_uavapi.core.airspace import formats

    host.envelopes.put("api", 0, formats.of_geojson(FAR_AWAY, "a test"))
    head = (0, 1, 1)
    accelerating = mavlink.MAVLink_set_position_target_local_ned_message(*head, 1, 0b110000111111, *(1.0,) * 9, 0, 0)
    offset = mavlink.MAVLink_set_position_target_local_ned_message(*head, 7, 0b110111111000, *(1.0,) * 9, 0, 0)
    amsl = mavlink.MAVLink_set_position_target_global_int_message(*head, 5, 0b110111111000, 0, 0, 1.0, *(0.0,) * 8)
    moded = mavlink.MAVLink_command_int_message(1, 1, 6, 192, 0, 0, -1, 1, 0, 0, 0, 0, 10)
    for message in (accelerating, offset, amsl, moded):
        with pytest.raises(OutsideEnvelope):
            loop.run(copter.post(message))
    assert flying.setpoints() == []


@pytest.mark.matrix
@pytest.mark.parametrize("verb", [name for name in REQUESTS if name not in ("stop", "resume")])
def test_verbs_only_stop_or_bring_down_a_vehicle_that_is_outside(make_world: MakeWorld, verb: str) -> None:
    request = REQUESTS[verb]
    world = make_world(STAGES[request.stage], camera=request.camera, vehicle=outcomes.VERBS[verb].vehicle)
    prepare(world, request.stage, "none")
    assert world.ask("PUT", "/envelope", FAR_AWAY).outcome == "200"
    since = world.now
    begin(world, verb, request.far if request.far is not None else request.near)
    world.pass_time(6.0)
    for message in world.orders(since=since):
        assert stays_or_comes_down(message, world), message.to_dict()


def stays_or_comes_down(message: Any, world: World) -> bool:
    order = orders.order_of(message)
    if isinstance(order, orders.Fly):
        return order.velocity == (0.0, 0.0, 0.0)
    if isinstance(order, orders.GoTo):
        return math.dist((order.target.x, order.target.y, order.target.z), world.at) < 0.5
    if isinstance(order, orders.SwitchMode):
        holds = world.host.registry.find().holding_modes
        return mavutil.mode_mapping_bynumber(world.vehicle.mav_type)[order.number] in STOP_MODES.union(holds)
    return (
        order is None
        or isinstance(order, orders.FlyMission | orders.ChangeSpeed)  # the guard lets it pass only while disarmed
        or (isinstance(order, orders.Arm) and world.vehicle.mode.name != "AUTO")
        or (isinstance(order, orders.SetParameter) and order.name.startswith("PLND_"))
    )
