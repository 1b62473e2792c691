"""Any value for any number, by query, JSON and form: an error of the table, and nothing bad on the link."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable
from typing import Any
from urllib.parse import quote, urlencode

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_uavapi.http.contract.route import Route
from mavproxy_uavapi.http.routes import ROUTES
from tests.support.make_world import MakeWorld
from tests.support.world import World

pytestmark = pytest.mark.matrix

quick = settings(
    derandomize=True,  # the same values in each run
    database=None,
    deadline=None,
    max_examples=8,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)

METRES = (-100_000.0, 100_000.0)
DOWN = (-10_000.0, 10_000.0)
VELOCITY = (-50.0, 50.0)
LEAST = math.ulp(0.0)  # of what must be more than 0
# What the contract allows, both ends included; None where the value may be left out or null.
BOUNDS: dict[str, tuple[float, float]] = {
    "alt": (-1000.0, 10_000.0),
    "limit": (1, 1000),
    "capture_time": (0.0, 10_000.0),
    "channel": (1, 16),
    "down": DOWN,
    "duration": (LEAST, 3600.0),
    "exposure": (LEAST, 10_000.0),
    "focus_distance": (0.01, 1000.0),
    "front": METRES,
    "heading": (0.0, 360.0),
    "lat": (-90.0, 90.0),
    "lease": (1.0, 3600.0),
    "long": (-180.0, 180.0),
    "max_age": (LEAST, 86_400.0),
    "new_v": (0.0, 50.0),
    "pitch_deg": (-90.0, 90.0),
    "pwm": (800, 2200),
    "rate": (LEAST, 1000.0),
    "right": METRES,
    "sim_factor": (0.25, 1000.0),
    "seed": (0, 2**31 - 1),
    "sysid": (1, 255),
    "timeout": (LEAST, 86_400.0),
    "tolerance": (LEAST, 100.0),
    "vehicle": (1, 255),
    "vx": VELOCITY,
    "vy": VELOCITY,
    "vz": VELOCITY,
    "x": METRES,
    "y": METRES,
    "yaw_rate": (-360.0, 360.0),
    "z": DOWN,
}
TAKEOFF_ALT = (LEAST, 1000.0)
WHOLE = {"channel", "pwm", "seed", "sysid", "vehicle"}
OPTIONAL = {"duration", "focus_distance", "max_age", "pitch_deg", "rate", "sysid", "timeout", "vehicle"}
# The other parameters of a request that is good.
GOOD: dict[str, dict[str, Any]] = {
    "/envelope/check": {"lat": -35.363, "long": 149.165, "alt": 50},
    "/movement/go_to_gps": {"lat": -35.363, "long": 149.165, "alt": 50},
    "/movement/go_to_ned": {"x": 1, "y": 1, "z": -50},
    "/movement/drive": {"x": 1, "y": 1, "z": 0},
    "/movement/drive_body": {"front": 1, "right": 1},
    "/movement/travel_at_ned": {"vx": 1, "vy": 1, "vz": 0},
    "/movement/travel_at_body": {"front": 1, "right": 1},
    "/movement/set_heading": {"heading": 90},
    "/movement/set_yaw_rate": {"yaw_rate": 10},
    "/peripherical/servo_output": {"channel": 9, "pwm": 1500},
    "/command/set_sim_speedup": {"sim_factor": 1},
    "/peripherical/take_photo": {"command": "no tool of ours"},
    "/rehearsals": {"script_name": "no script of ours"},
}
SPEEDS = {f"/command/set_{kind}_speed" for kind in ("air", "ground", "climb", "descent")}
ASKS = {"/envelope/check", "/rehearsals"}  # they command nothing
ENDLESS = {"/telemetry/stream"}  # a stream does not end: tests/uavapi/http/handlers/test_stream.py
TABLE = {200, 202, 400, 404, 409, 422, 500, 503, 504}


def good(path: str) -> dict[str, Any]:
    return {"new_v": 5} if path in SPEEDS else GOOD.get(path.removesuffix("_wait"), {})


def numeric(route: Route) -> list[str]:
    """The names of its parameters that are numbers."""
    properties = route.model.model_json_schema().get("properties", {})
    kinds = {name: {kind.get("type") for kind in field.get("anyOf", [field])} for name, field in properties.items()}
    return [name for name, types in kinds.items() if types & {"number", "integer"}]


PARAMETERS = [
    (route.path, "POST" if "POST" in route.methods else "GET", name)
    for route in ROUTES
    if "{" not in route.path and route.path not in ENDLESS and "DELETE" not in route.methods and not route.raw
    if not route.fleet  # its values are checked as those of the verb
    if not route.verb or Copter.has(route.verb)
    for name in numeric(route)
]


# One path for each model: its parameters are checked alike wherever they come in.
ONE_OF_EACH = list(
    {
        (route.model, name): (path, method, name)
        for path, method, name in PARAMETERS
        for route in ROUTES
        if route.path == path and name in numeric(route)
    }.values()
)


def bounds(path: str, name: str) -> tuple[float, float]:
    if path == "/movement/travel_at_body" and name in ("front", "right", "down"):
        return VELOCITY
    assert name in BOUNDS, f"{path}: add {name} to BOUNDS, to WHOLE if it is whole; what else it needs to GOOD"
    return TAKEOFF_ALT if (path, name) == ("/command/takeoff", "alt") else BOUNDS[name]


ODD = [
    "",
    " ",
    "NaN",
    "nan",
    "inf",
    "-Infinity",
    "1e400",
    "-1e400",
    "1e-400",
    "0x10",
    "1_0",
    "1,5",
    "٣",
    "½",
    "\x00",
    "--1",
    "true",
    "null",
    "[1]",
    "9" * 5000,
    math.nan,
    math.inf,
    -math.inf,
    1e-50,
    5e-324,
    -5e-324,
    1.8e308,
    3.5e38,
    10**400,
    -(10**400),
    2**31,
    2**63,
    2**64,
    True,
    False,
    None,
    [],
    {},
    [1],
    {"value": 1},
    [[[[[]]]]],
]
JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("ab"), inner, max_size=3),
    max_leaves=5,
)


def values(path: str, name: str) -> st.SearchStrategy[Any]:
    low, high = bounds(path, name)
    inside = st.floats(low, high) | st.integers(math.ceil(low), math.floor(high))
    return st.one_of(JUNK, inside, st.sampled_from([low, high]))


def is_bad(value: Any, path: str, name: str, as_text: bool) -> bool:
    """Whether it must be refused; a text that spells a good number may be taken."""
    if value is None:
        return as_text or not (name in OPTIONAL or (name == "heading" and path != "/movement/set_heading"))
    if isinstance(value, bool | list | dict):
        return True
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            return True
    low, high = bounds(path, name)
    return not low <= value <= high or (name in WHOLE and value != int(value))


def request(world: World, method: str, path: str, by: str, values: dict[str, Any]) -> Any:
    if by == "json":
        return world.ask(method, path + "?wait=false", json.dumps(values).encode())
    texts = {name: value if isinstance(value, str) else json.dumps(value) for name, value in values.items()}
    if by == "form":
        content = urlencode(texts).encode()
        return world.ask(method, path + "?wait=false", content, "application/x-www-form-urlencoded")
    return world.ask(method, f"{path}?{urlencode({**texts, 'wait': 'false'}, quote_via=quote)}")


SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
ALLOWED: dict[int, dict[str, tuple[float, float]]] = {
    mavlink.MAV_CMD_NAV_TAKEOFF: {"param7": (1e-30, 1000.0)},
    SPEED: {"param1": (0, 3), "param2": (0.0, 50.0)},
    mavlink.MAV_CMD_CONDITION_YAW: {"param1": (0.0, 360.0)},
    mavlink.MAV_CMD_DO_SET_SERVO: {"param1": (1, 16), "param2": (800, 2200)},
}
MARGIN = 1000.0  # m; an offset is sent as a place, and the vehicle is not at the origin


def is_fit_to_fly(message: Any) -> bool:
    """Whether all of it is finite, and within what the contract allows."""
    fields = {name: getattr(message, name) for name in message.get_fieldnames()}
    if not all(math.isfinite(value) for value in fields.values() if isinstance(value, float)):
        return False
    limits: dict[str, tuple[float, float]] = {}
    if message.get_type() == "COMMAND_LONG":
        limits = ALLOWED.get(message.command, {})
    elif message.get_type() == "PARAM_SET":
        limits = {"param_value": (1e-30, 1000.0)}
    elif message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT":
        limits = {"lat_int": (-90e7, 90e7), "lon_int": (-180e7, 180e7), "alt": (-1000.0, 10_000.0)}
    elif message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
        reach, depth = METRES[1] * math.sqrt(2) + MARGIN, DOWN[1] + MARGIN
        limits = {"x": (-reach, reach), "y": (-reach, reach), "z": (-depth, depth)}
        limits |= dict.fromkeys(("vx", "vy", "vz"), VELOCITY)
        limits |= dict.fromkeys(("yaw", "yaw_rate"), (-6.2832, 6.2832))
    return all(low <= fields[name] <= high for name, (low, high) in limits.items())


def stage_for(path: str) -> Callable[[Any], None]:
    if path == "/command/takeoff":
        return lambda world: world.armed()
    return lambda world: world.flying()


def put_back(world: World, path: str) -> None:
    """Where the example before had it: on the ground and armed, or high in the air, in GUIDED."""
    copter = world.copter
    if path == "/command/takeoff":
        world.fault("refuse", command=mavlink.MAV_CMD_NAV_TAKEOFF)
        if not copter.armed:
            world.by_hand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
            world.pass_time(1.1)
    elif copter.mode.name == "GUIDED":
        body = copter.body
        body.north, body.east, body.down = 0.0, 0.0, -50.0
        body.velocity_north = body.velocity_east = body.velocity_down = 0.0
    else:  # it was told to land
        world.by_hand(mavlink.MAV_CMD_DO_SET_MODE, 1, 4)
        world.pass_time(0.1)


SENDS_NOTHING = {
    "timeout",
    "tolerance",
    "max_age",
    "capture_time",
    "exposure",
    "focus_distance",
    "lease",
    "vehicle",
    "limit",
}


class Trial:
    """One parameter of one path, and a vehicle to try it on."""

    def __init__(self, world: World, path: str, method: str, name: str) -> None:
        self.world, self.path, self.method, self.name = world, path, method, name
        self.orders = 0

    def try_it(self, value: Any, by: str) -> None:
        """Send that value, and judge the answer and what reached the vehicle."""
        world = self.world
        put_back(world, self.path)
        world.simulator.received.clear()
        sent = len(world.sent)
        reply = request(world, self.method, self.path, by, {**good(self.path), self.name: value})
        world.loop.settle()
        orders = world.orders_of(world.sent[sent:])
        if orders:
            world.pass_time(0.05)
        world.end_jobs()
        world.loop.settle()
        trace = f"{self.name} = {value!r:.200} by {by}: {reply}"
        assert reply.status in TABLE and reply.body.get("code") != "internal", trace
        if is_bad(value, self.path, self.name, by != "json"):
            assert reply.status in (400, 422) and not orders, trace
        assert all(is_fit_to_fly(entry.message) for entry in world.simulator.received), trace
        self.orders += len(orders)


@pytest.mark.parametrize(("path", "method", "name"), PARAMETERS)
def test_any_value_is_taken_or_refused_and_only_good_ones_reach_the_link(
    make_world: MakeWorld, path: str, method: str, name: str
) -> None:
    trial = Trial(make_world(stage_for(path), max_rate=100_000, max_jobs=1000), path, method, name)
    ways = ["json", "form", "query"] if method == "POST" else ["query"]
    quick(given(value=values(path, name), by=st.sampled_from(ways))(trial.try_it))()
    if name in ("lat", "long"):  # almost every place on earth is out of reach: 409
        trial.try_it(good(path)[name], "json")
    assert trial.orders or name in SENDS_NOTHING or path in ASKS, (
        "no good value ever got through: this has shown nothing"
    )


@pytest.mark.parametrize(("path", "method", "name"), ONE_OF_EACH)
def test_odd_values_are_refused(make_world: MakeWorld, path: str, method: str, name: str) -> None:
    trial = Trial(make_world(stage_for(path), max_rate=100_000, max_jobs=1000), path, method, name)
    for number, value in enumerate(ODD):
        by_text = method == "GET" or isinstance(value, str)
        trial.try_it(value, ("query", "form")[method == "POST" and number % 2] if by_text else "json")


@quick
@given(name=st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=50))
def test_any_name_in_a_path_is_found_or_not(make_world: MakeWorld, name: str) -> None:
    world = next(iter(make_world.worlds), None) or make_world()
    for path in ("/jobs/", "/telemetry/message/", "/mission/scripts/", "/"):
        reply = world.ask("GET", path + quote(name, safe=""))
        assert reply.status in TABLE and reply.body.get("code") != "internal", reply


def test_value_that_is_0_in_single_precision_is_refused(make_world: MakeWorld) -> None:
    assert struct.unpack("f", struct.pack("f", 1e-50)) == (0.0,)
    world = make_world()
    assert world.ask("GET", "/command/set_ground_speed?new_v=1e-50").outcome == "422 invalid"
