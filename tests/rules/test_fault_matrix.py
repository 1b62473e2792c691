"""Every blocking verb meets every fault: the right answer, in time, and nothing more is sent for it."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.envelope import formats
from mavproxy_uavapi.core.envelope.store import ALL, API
from tests.rules import clients, outcomes
from tests.support.envelopes import feature, square

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF
COMMANDS = (
    ARM,
    TAKEOFF,
    mavlink.MAV_CMD_DO_SET_MODE,
    mavlink.MAV_CMD_DO_SET_HOME,
    mavlink.MAV_CMD_DO_CHANGE_SPEED,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE,
    mavlink.MAV_CMD_CONDITION_YAW,
)
GUARD = 4.0  # s for which nothing must be sent after the answer: a resend comes after 1.5 s, a setpoint after 1
UNDER_WAY = 3.0  # s after which something happens to a flight
WAITING = 0.5  # s after which something happens to a command that is waiting for its ack
DEAF = 1.0  # s for which the vehicle does not hear that command
DARK = 2.0  # s that a reboot takes
OVERHEAR = (1, 190)  # another component of the vehicle
AT_REST = 0.5  # m/s: slower than this a vehicle holds
CAMERA = {"width": 240, "height": 180, "fps": 8.0, "sim_noise": 0.0, "sim_blur": 0.0, "sim_jitter": 0.0}
TAG_BELOW, TAG_BESIDE = "0:0.30@0.6,-0.4", "0:0.30@0.5,3"  # in view at once, or when it was searched for
PLACE = (-35.363261, 149.165230)  # where it stands: the simulator's default home


class Request(NamedTuple):
    """How a verb is asked for, and where its vehicle is before: far is a flight that is not over soon."""

    stage: str
    near: dict[str, Any] | str
    far: dict[str, Any] | str | None = None
    camera: dict[str, Any] | None = None


def track(north: float) -> str:
    """A track of one place, so many degrees north of home and 10 m above it: CentMesh's tuple."""
    return str((1, round((PLACE[0] + north) * 1e7), round(PLACE[1] * 1e7), 594000, 0, 65535, 0, 0, 3, 10))


REQUESTS = {
    "arm": Request("boot", ""),
    "takeoff": Request("armed", "?alt=4", "?alt=100"),
    "land": Request("flying", "", ""),
    "rtl": Request("flying", "", ""),
    "go_to_ned_wait": Request("flying", {"x": 6, "y": 3, "z": -9}, {"x": 300, "y": 0, "z": -9}),
    "go_to_gps_wait": Request(
        "flying",
        {"lat": PLACE[0] + 6e-5, "long": PLACE[1], "alt": 9},
        {"lat": PLACE[0] + 3e-3, "long": PLACE[1], "alt": 9},
    ),
    "drive_wait": Request("flying", {"x": 6, "y": 3, "z": -1}, {"x": 300, "y": 0, "z": 0}),
    "drive_body_wait": Request("flying", {"front": 6, "right": 3}, {"front": 300, "right": 0}),
    "travel, with duration": Request(
        "flying", {"vx": 1, "vy": 0, "vz": 0, "duration": 5}, {"vx": 1, "vy": 0, "vz": 0, "duration": 60}
    ),
    "travel_at_body, with duration": Request(
        "flying", {"front": 1, "right": 0, "duration": 5}, {"front": 1, "right": 0, "duration": 60}
    ),
    "fly-track": Request("flying", {"track": track(6e-5), "ground": 584}, {"track": track(3e-3), "ground": 584}),
    "set_heading": Request("flying", "?heading=90"),
    "set_yaw_rate": Request("flying", "?yaw_rate=20"),
    "stop": Request("flying", ""),
    "resume": Request("stopped", ""),
    "brake": Request("flying", ""),
    "guided": Request("loitering", ""),
    "set_mode": Request("flying", "?mode=ALT_HOLD"),
    "set_home": Request("flying", ""),
    **dict.fromkeys(
        ("set_air_speed", "set_ground_speed", "set_climb_speed", "set_descent_speed"), Request("flying", "?new_v=2")
    ),
}
REQUESTS |= {
    "vision/land": Request("above a tag", {}, {}, {**CAMERA, "sim_tags": TAG_BELOW}),
    "vision/search": Request("above a tag", {}, {}, {**CAMERA, "sim_tags": TAG_BESIDE}),
    "vision/mission": Request(
        "flying",
        {"alt": 6, "north": 6, "east": 3, "tag": False},
        {"alt": 6, "north": 300, "east": 0, "tag": False},
        {**CAMERA, "fps": 0.5},  # it looks for nothing
    ),
    "prompt: uavapi fly": REQUESTS["fly-track"],
    "script: go_to_ned_wait": REQUESTS["go_to_ned_wait"],
    "script: land": REQUESTS["land"],
}
REQUESTS["prompt: vision land"] = REQUESTS["vision/land"]
# Verbs that are made of others, of which the last one is refused.
OF_OTHERS = {"fly-track", "vision/land", "vision/mission", "prompt: vision land", "prompt: uavapi fly"}
STAGES: dict[str, Callable[[Any], None]] = {
    "boot": lambda world: world.boot(),
    "armed": lambda world: world.armed(),
    "flying": lambda world: world.flying(),
    "above a tag": lambda world: world.flying(height=3.5),
    "loitering": lambda world: world.flying("LOITER"),
    "stopped": lambda world: world.flying(),
}
# Where the vehicle is instead, because that is what goes wrong.
INSTEAD = {"during a take-off": STAGES["armed"], "in AUTO": lambda world: world.on_mission()}


def about_each_command(world: Any, name: str, **fields: Any) -> None:
    for command in COMMANDS:
        world.fault(name, command=command, **fields)


def lose_the_first_acks(world: Any) -> None:
    for command in COMMANDS:
        world.fault("lose_acks", command=command, count=1 if command == TAKEOFF else 2)


def accept_for_another(world: Any) -> None:
    about_each_command(world, "foreign_ack", result=mavlink.MAV_RESULT_ACCEPTED, **_overheard())
    about_each_command(world, "refuse", result=mavlink.MAV_RESULT_DENIED, text="Not now.")


def be_busy_once(world: Any) -> None:
    """A vehicle on the ground is busy with what arming waits for; its mode it changes all the same."""
    for command in COMMANDS if world.copter.armed else (ARM,):
        world.fault("refuse", command=command, result=mavlink.MAV_RESULT_TEMPORARILY_REJECTED, count=1)


def _overheard() -> dict[str, int]:
    system, component = OVERHEAR
    return {"system": system, "component": component}


def put_envelope(world: Any) -> None:
    """It ends 1.5 m beside the vehicle and half a metre above it."""
    north, east, down = world.at
    area = feature("box", square(1.5, north, east), ceiling=0.5 - down)
    world.host.envelopes.put(API, ALL, formats.of_geojson({"type": "FeatureCollection", "features": [area]}, "a box"))
    world.loop.pass_time(1.5)  # in which the vehicle is asked how it brakes


# What is so already when the request comes.
BEFORE: dict[str, Callable[[Any], None]] = {
    "ack lost": lose_the_first_acks,
    "acks lost for good": lambda world: about_each_command(world, "lose_acks"),
    "late ack": lambda world: about_each_command(world, "delay_acks", seconds=2.0),
    "foreign acceptance": accept_for_another,
    "foreign refusal": lambda world: about_each_command(
        world, "foreign_ack", result=mavlink.MAV_RESULT_DENIED, **_overheard()
    ),
    "refused": lambda world: about_each_command(world, "refuse", result=mavlink.MAV_RESULT_DENIED, text="Not now."),
    "busy once": be_busy_once,
    "outside the envelope": put_envelope,
    "in progress": lambda world: about_each_command(world, "in_progress", seconds=4.0),
}


def another_station(world: Any, _wire: Any) -> None:
    if world.copter.mode.name == "GUIDED":
        world.fault("other_station", position=ELSEWHERE)


# What happens while the verb waits.
MEANWHILE: dict[str, Callable[[Any, Any], None]] = {
    "link silence": lambda world, wire: world.fault("silence"),
    "reboot": lambda world, wire: world.reboot(DARK),
    "pilot's mode": lambda world, wire: world.fault(
        "pilot_mode", mode="LOITER" if world.copter.mode.name == "GUIDED" else "ALT_HOLD"
    ),
    "disarmed": lambda world, wire: world.fault("pilot_disarm"),
    "client gone": lambda world, wire: wire.hang_up(),
    "another station flies it": another_station,
}
# How a verb shows that has gone on without its client.
DONE: dict[str, Callable[[Any], bool]] = {
    **dict.fromkeys(
        ("land", "rtl", "script: land", "vision/land", "vision/mission"),
        lambda world: not world.copter.armed and world.at[2] > -0.1,
    ),
    "vision/search": lambda world: world.copter.armed and math.hypot(world.at[0] - 0.5, world.at[1] - 3.0) < 2.0,
    "brake": lambda world: world.copter.mode.name == "BRAKE",
    "stop": lambda world: world.copter.guided.paused,
}
ELSEWHERE = [-80.0, 40.0, -12.0]  # m NED
CELLS = [(name, fault) for name, verb in outcomes.VERBS.items() for fault in outcomes.FAULTS if verb.outcomes[fault]]


@pytest.mark.parametrize(("verb", "fault"), CELLS)
def test_verb_meets_fault(make_world: Any, verb: str, fault: str) -> None:
    stage = REQUESTS[verb].stage
    world = make_world(INSTEAD.get(fault, STAGES[stage]), camera=REQUESTS[verb].camera)
    prepare(world, stage, fault)
    expected, holds, _ = outcomes.VERBS[verb].outcomes[fault].partition(outcomes.HOLDS)
    struck, wire = strike(world, verb, fault)
    allowed = outcomes.FAULTS[fault].within
    if expected == "200":
        allowed += outcomes.VERBS[verb].takes
    elif expected == "500 rejected":
        allowed = max(allowed, outcomes.REFUSAL)
        allowed += outcomes.VERBS[verb].takes if verb in OF_OTHERS else 0.0
    if expected in (outcomes.ENDED, outcomes.GOES_ON):
        after_hanging_up(world, verb, wire, struck)
        return
    reply = world.answer(wire, 200.0)
    assert reply.outcome == expected, reply.body
    assert reply.at - struck <= allowed + 1e-6
    assert says_why(reply.body, fault)
    world.end_streams()
    quiet_since = hold_after(world, reply.at) if holds else max(reply.at, world.loop.time())
    world.loop.pass_time(GUARD)
    assert world.orders(since=quiet_since) == []
    if (verb, fault) == ("arm", "disarmed"):
        assert not world.copter.armed


def prepare(world: Any, stage: str, fault: str) -> None:
    """Bring it to where the verb begins, by the API, and let others fly it."""
    if fault == "during a take-off":
        world.begin("GET", "/command/takeoff?alt=60")
        world.loop.pass_time(UNDER_WAY)
    if stage == "stopped" and fault not in INSTEAD:
        assert world.ask("GET", "/movement/stop").outcome == "200"
    if fault == "another client streams":
        world.stream({"vx": 0.5, "vy": 0, "vz": 0}, every=0.2)


def strike(world: Any, verb: str, fault: str) -> tuple[float, Any]:
    """Ask, and let it happen; when it happened, and the request in flight."""
    request = REQUESTS[verb]
    flight = request.far is not None
    far = flight and not (", with duration" in verb and fault == "another station flies it")
    BEFORE.get(fault, lambda _: None)(world)
    meanwhile = MEANWHILE.get(fault)
    delay = UNDER_WAY if flight else WAITING
    if meanwhile is not None and not flight:
        # What is done within a few milliseconds is caught in the act by a vehicle that does not hear it yet.
        world.uplink_until = world.loop.time() + DEAF
    if (verb, fault) == ("arm", "disarmed"):
        # Nobody is disarmed before it is armed: it hears, its acks are lost, and a heartbeat has shown it.
        world.uplink_until, delay = 0.0, 1.3
        world.fault("lose_acks", command=ARM)
    began = world.loop.time()
    wire = begin(world, verb, request.far if far and meanwhile is not None else request.near)
    if meanwhile is None:
        return began, wire
    world.loop.pass_time(delay)
    assert wire.reply.done() == ((verb, fault) == ("arm", "disarmed"))
    meanwhile(world, wire)
    return world.loop.time(), wire


def begin(world: Any, verb: str, given: Any) -> Any:
    path = outcomes.VERBS[verb].path
    if verb in AT_THE_PROMPT:
        return AT_THE_PROMPT[verb](world, given)
    if verb.startswith("script: "):
        return clients.Script(world, *(("POST", path, given) if isinstance(given, dict) else ("GET", path + given)))
    if isinstance(given, dict):
        return world.begin("POST", path, given)
    return world.begin("GET", path + given)


AT_THE_PROMPT = {"prompt: vision land": clients.vision_land, "prompt: uavapi fly": clients.fly_track}


def says_why(body: dict[str, Any], fault: str) -> bool:
    """Whether the answer names the pilot's mode, or repeats what the autopilot said."""
    if body.get("code") == "mode_changed" and fault == "pilot's mode":
        return "LOITER" in body["detail"] or "ALT_HOLD" in body["detail"]
    if body.get("code") == "rejected" and fault in ("refused", "foreign acceptance"):
        return body["ack"] == "MAV_RESULT_DENIED" and body["statustext"] == ["Not now."]
    return True


def hold_after(world: Any, since: float) -> float:
    """See that it is commanded to hold and nothing else; since when telemetry has shown that it does (s)."""
    closing = world.host.jobs.all()[-1]
    assert closing.verb.startswith("hold after ")
    world.loop.run(closing.outcome())
    reported = world.orders(since=since)
    assert reported
    assert {m.get_type() for m in reported} == {"SET_POSITION_TARGET_LOCAL_NED"}
    assert {(m.vx, m.vy, m.vz) for m in reported} == {(0.0, 0.0, 0.0)}
    assert math.hypot(*world.copter.body.velocity) < AT_REST
    return float(world.loop.time())


def after_hanging_up(world: Any, verb: str, wire: Any, struck: float) -> None:
    """The verb has ended and nothing more is sent but for a hold, or it goes on to its end by itself."""
    expected, holds, _ = outcomes.VERBS[verb].outcomes["client gone"].partition(outcomes.HOLDS)
    world.loop.settle()
    running = world.host.jobs.running()
    quiet_since = struck
    if holds:
        assert [job.verb.partition(" ")[0] for job in running] == ["hold"]
        quiet_since = hold_after(world, struck)
    elif expected == outcomes.ENDED:
        assert running == []
    else:
        assert len(running) == 1
        world.loop.run(asyncio.wait_for(running[0].outcome(), outcomes.VERBS[verb].takes))
        assert DONE[verb](world)
    world.loop.pass_time(GUARD)
    assert world.host.jobs.running() == []
    if isinstance(wire, clients.Script):
        assert wire.death.result() == "hold is done" if holds else wire.death.result().startswith("left alone")
    else:
        entry = world.service.host.audit.entries[-1]  # of what went on without its client, when that had ended
        assert entry.outcome == "client_gone"
    repeated = {m.command for m in world.orders(since=struck) if m.get_type() == "COMMAND_LONG"}
    assert len(repeated) <= 1  # a command that was not heard yet is sent again, and nothing else is
    assert expected == outcomes.GOES_ON or world.orders(since=quiet_since) == []


def test_command_in_progress_for_ever_is_given_up(make_world: Any) -> None:
    world = make_world()
    world.fault("in_progress", command=mavlink.MAV_CMD_DO_CHANGE_SPEED, seconds=200)
    began = world.loop.time()
    reply = world.ask("GET", "/command/set_ground_speed?new_v=5")
    assert reply.outcome == "504 timeout"
    assert reply.at - began <= 61.0
    world.loop.pass_time(GUARD)
    assert world.orders(since=reply.at) == []


def test_pilot_who_switches_while_arming_is_refused_for_now_is_not_armed_on(make_world: Any) -> None:
    world = make_world(STAGES["boot"])
    world.fault("refuse", command=ARM, result=mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    wire = world.begin("GET", "/command/arm")
    world.loop.pass_time(2.5)
    world.fault("pilot_mode", mode="LOITER")
    switched = world.loop.time()
    reply = world.answer(wire)
    assert reply.outcome == "409 mode_changed"
    assert world.orders(since=switched) == []


def test_all_recovers_by_itself_when_the_link_returns(make_world: Any) -> None:
    world = make_world()
    wire = begin(world, "go_to_ned_wait", REQUESTS["go_to_ned_wait"].far)
    world.fault("silence", seconds=9.0)
    assert world.answer(wire).outcome == "503 link_lost"
    assert world.ask("GET", "/command/brake").outcome == "503 link_lost"
    world.loop.pass_time(6.0)
    assert world.ask("GET", "/telemetry/gps").outcome == "200"
    assert world.ask("POST", "/movement/drive_wait", {"x": 3, "y": 0, "z": 0}).outcome == "200"


def test_vehicle_that_rebooted_can_be_flown_again(make_world: Any) -> None:
    world = make_world()
    world.reboot(DARK)
    world.loop.pass_time(DARK + 2.0)
    assert world.ask("GET", "/telemetry/status").body["info"]["armed"] is False
    assert world.ask("GET", "/command/arm").outcome == "200"
    assert world.ask("GET", "/command/takeoff?alt=3").outcome == "200"


def test_a_turn_right_after_a_takeoff_is_flown(make_world: Any) -> None:
    world = make_world(STAGES["armed"])
    assert world.ask("GET", "/command/takeoff?alt=10").outcome == "200"
    assert world.ask("GET", "/movement/set_yaw_rate?yaw_rate=20").outcome == "200"


@pytest.mark.parametrize("waits", [True, False])
@pytest.mark.parametrize("verb", ["go_to_ned_wait", "land", "vision/search", "fly-track"])
def test_what_a_script_leaves_behind_is_the_same_whether_it_waited_or_not(
    make_world: Any, verb: str, waits: bool
) -> None:
    request = REQUESTS[verb]
    world = make_world(STAGES[request.stage], camera=request.camera)
    method = "GET" if request.far == "" else "POST"
    script = clients.Script(world, method, outcomes.VERBS[verb].path, request.far or None, waits=waits)
    world.loop.pass_time(UNDER_WAY)
    died = world.loop.time()
    script.hang_up()
    world.loop.settle()
    if verb == "land":
        assert script.death.result() == "left alone: the vehicle is in LAND"
        world.loop.pass_time(outcomes.VERBS[verb].takes)
        assert DONE[verb](world)
        return
    quiet_since = hold_after(world, died)
    world.loop.pass_time(GUARD)
    assert script.death.result() == "hold is done"
    assert world.orders(since=quiet_since) == []
    assert world.host.jobs.running() == []


def test_page_about_faults_is_up_to_date() -> None:
    assert outcomes.FILE.read_text(encoding="utf-8") == outcomes.page(), "python tests/rules/outcomes.py"
