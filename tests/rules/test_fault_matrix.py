"""Every blocking verb meets every fault: the right answer, in time, and nothing more is sent for it."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.rules import clients, outcomes
from tests.rules.fault_scenes import (
    ARM,
    BEFORE,
    DARK,
    DEAF,
    DONE,
    INSTEAD,
    MEANWHILE,
    OF_OTHERS,
    PILOTS_MODES,
    REQUESTS,
    STAGES,
    UNDER_WAY,
    WAITING,
)
from tests.rules.faults import ENDED, FAULTS, GOES_ON, HEARTBEAT, HOLDS, REFUSAL
from tests.support import world as support
from tests.support.make_world import MakeWorld
from tests.support.world import World

pytestmark = pytest.mark.matrix

GUARD = 2.0  # s for which nothing must be sent after the answer: a resend comes after 1.5 s, a setpoint after 1
AT_REST = 0.5  # m/s: slower than this a vehicle holds
# Verbs that go the way of another one of the table.
ALIKE = ("vision/search", "prompt: vision land", "script: land", "script: go_to_ned_wait", "drive_body_wait")
ALIKE += ("travel_at_body, with duration", "set_air_speed", "set_climb_speed", "set_descent_speed")
ALIKE += ("prompt: uavapi fly", "go_to_gps_wait", "drive_wait")
CELLS = [
    pytest.param(name, fault, marks=pytest.mark.long if name in ALIKE else ())
    for name, verb in outcomes.VERBS.items()
    for fault in FAULTS
    if verb.outcomes[fault]
]


# Cells whose moments lie between two steps of the test world, which are twice as long as a vehicle's.
FINE = {("set_heading", "disarmed"), ("set_yaw_rate", "main loop stands"), ("brake", "client gone")}


@pytest.mark.parametrize(("verb", "fault"), CELLS)
def test_verb_meets_fault(make_world: MakeWorld, monkeypatch: pytest.MonkeyPatch, verb: str, fault: str) -> None:
    if (verb, fault) in FINE:
        monkeypatch.setattr(support, "TICK", support.TICK / 2)
    stage = REQUESTS[verb].stage
    begin = INSTEAD.get(fault, STAGES[stage])
    world = make_world(begin, REQUESTS[verb].camera, outcomes.VERBS[verb].vehicle)
    prepare(world, stage, fault)
    expected, holds, _ = outcomes.VERBS[verb].outcomes[fault].partition(HOLDS)
    struck, wire = strike(world, verb, fault)
    allowed = FAULTS[fault].within
    if expected == "200":
        allowed += outcomes.VERBS[verb].takes
    elif expected in ("500 rejected", "504 timeout"):
        allowed = max(allowed, REFUSAL)
        allowed += outcomes.VERBS[verb].takes if verb in OF_OTHERS else 0.0
        allowed += (
            HEARTBEAT if (verb, fault) == ("arm", "reboot") else 0.0
        )  # a second one: nothing missing comes late
    if expected in (ENDED, GOES_ON):
        after_hanging_up(world, verb, wire, struck)
        return
    reply = world.answer(wire, 200.0)
    assert reply.outcome == expected, reply.body
    assert reply.at - struck <= allowed + 1e-6
    assert says_why(reply.body, fault)
    world.end_streams()
    quiet_since = hold_after(world, reply.at) if holds else max(reply.at, world.now)
    world.pass_time(GUARD)
    assert world.orders(since=quiet_since) == []
    if (verb, fault) == ("arm", "disarmed"):
        assert not world.vehicle.armed
    if fault == "two autopilots":
        assert world.orders() == []


def prepare(world: World, stage: str, fault: str) -> None:
    """Bring it to where the verb begins, by the API, and let others fly it."""
    if fault == "during a take-off":
        world.begin("GET", f"/command/takeoff?alt=60&vtol={str(world.kind == 'quadplane').lower()}")
        world.pass_time(UNDER_WAY)
    if stage == "stopped" and fault not in INSTEAD:
        assert world.ask("GET", "/movement/stop").outcome == "200"
    if fault == "another client streams":
        world.stream({"vx": 0.5, "vy": 0, "vz": 0}, every=0.2)
        world.pass_time(1.0)


def strike(world: World, verb: str, fault: str) -> tuple[float, Any]:
    """Ask, and let it happen; when it happened, and the request in flight."""
    request = REQUESTS[verb]
    flight = request.far is not None
    far = flight and not (", with duration" in verb and fault == "another station flies it")
    far = far and fault != "main loop stands"  # it ends well
    BEFORE.get(fault, lambda _: None)(world)
    meanwhile = MEANWHILE.get(fault)
    delay = UNDER_WAY if flight else WAITING
    if meanwhile is not None and not flight:
        # What is done within a few milliseconds is caught in the act by a vehicle that does not hear it yet.
        world.uplink_until = world.now + DEAF
    if (verb, fault) == ("arm", "disarmed"):
        # Nobody is disarmed before it is armed: it hears, its acks are lost, and a heartbeat has shown it.
        world.uplink_until, delay = 0.0, 1.3
        world.fault("lose_acks", command=ARM)
    began = world.now
    wire = begin(world, verb, request.far if far and meanwhile is not None else request.near)
    if meanwhile is None:
        return began, wire
    world.pass_time(delay)
    assert wire.reply.done() == ((verb, fault) == ("arm", "disarmed"))
    meanwhile(world, wire)
    return world.now, wire


def begin(world: World, verb: str, content: Any) -> Any:
    path = outcomes.VERBS[verb].path
    if verb in AT_THE_PROMPT:
        return AT_THE_PROMPT[verb](world, content)
    call = ("POST", path, content) if isinstance(content, dict) else ("GET", path + content)
    return clients.Script(world, *call) if verb.startswith("script: ") else world.begin(*call)


AT_THE_PROMPT = {"prompt: vision land": clients.vision_land, "prompt: uavapi fly": clients.fly_track}


def says_why(body: dict[str, Any], fault: str) -> bool:
    """Whether the answer names the pilot's mode, or repeats what the autopilot said."""
    if body.get("code") == "mode_changed" and fault == "pilot's mode":
        return any(mode in body["detail"] for modes in PILOTS_MODES.values() for mode in modes)
    if body.get("code") == "rejected" and fault in ("refused", "foreign acceptance"):
        return body["ack"] == "MAV_RESULT_DENIED" and set(body["statustext"]) == {"Not now."}
    return True


def hold_after(world: World, since: float) -> float:
    """See that it is commanded to hold and nothing else; since when telemetry has shown that it does (s)."""
    closing = world.host.jobs.all()[-1]
    assert closing.verb.startswith("hold after ")
    world.run(closing.outcome())
    reported = world.orders(since=since)
    assert reported
    assert {m.get_type() for m in reported} == {"SET_POSITION_TARGET_LOCAL_NED"}
    assert {(m.vx, m.vy, m.vz) for m in reported} == {(0.0, 0.0, 0.0)}
    assert math.hypot(*world.vehicle.body.velocity) < AT_REST
    return float(world.now)


def after_hanging_up(world: World, verb: str, wire: Any, struck: float) -> None:
    """The verb has ended and nothing more is sent but for a hold, or it goes on to its end by itself."""
    expected, holds, _ = outcomes.VERBS[verb].outcomes["client gone"].partition(HOLDS)
    world.loop.settle()
    running = world.host.jobs.running()
    quiet_since = struck
    if holds:
        assert [job.verb.partition(" ")[0] for job in running] == ["hold"]
        quiet_since = hold_after(world, struck)
    elif expected == ENDED:
        assert running == []
    else:
        assert len(running) == 1
        world.run(asyncio.wait_for(running[0].outcome(), outcomes.VERBS[verb].takes))
        assert DONE[verb](world)
    world.pass_time(GUARD)
    assert world.host.jobs.running() == []
    if isinstance(wire, clients.Script):
        assert wire.death.result() == "hold is done" if holds else wire.death.result().startswith("left alone")
    else:
        entry = world.service.host.audit.entries[-1]  # of what went on without its client, when that had ended
        assert entry.outcome == "client_gone"
    repeated = {m.command for m in world.orders(since=struck) if m.get_type() == "COMMAND_LONG"}
    assert len(repeated) <= 1  # a command that was not heard yet is sent again, and nothing else is
    assert expected == GOES_ON or world.orders(since=quiet_since) == []


def test_command_in_progress_for_ever_is_given_up(make_world: MakeWorld) -> None:
    world = make_world()
    world.fault("in_progress", command=mavlink.MAV_CMD_DO_CHANGE_SPEED, seconds=200)
    began = world.now
    reply = world.ask("GET", "/command/set_ground_speed?new_v=5")
    assert reply.outcome == "504 timeout"
    assert reply.at - began <= 61.0
    world.pass_time(GUARD)
    assert world.orders(since=reply.at) == []


def test_pilot_who_switches_while_arming_is_refused_is_not_armed_on(make_world: MakeWorld) -> None:
    world = make_world(STAGES["boot"])
    world.fault("refuse", command=ARM, result=mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    wire = world.begin("GET", "/command/arm")
    world.pass_time(2.5)
    world.fault("pilot_mode", mode="LOITER")
    switched = world.now
    reply = world.answer(wire)
    assert reply.outcome == "409 mode_changed"
    assert world.orders(since=switched) == []


def test_all_recovers_by_itself_when_the_link_returns(make_world: MakeWorld) -> None:
    world = make_world()
    wire = begin(world, "go_to_ned_wait", REQUESTS["go_to_ned_wait"].far)
    world.fault("silence", seconds=9.0)
    assert world.answer(wire).outcome == "503 link_lost"
    assert world.ask("GET", "/command/brake").outcome == "503 link_lost"
    world.pass_time(6.0)
    assert world.ask("GET", "/telemetry/gps").outcome == "200"
    assert world.ask("POST", "/movement/drive_wait", {"x": 3, "y": 0, "z": 0}).outcome == "200"


def test_vehicle_that_rebooted_can_be_flown_again(make_world: MakeWorld) -> None:
    world = make_world()
    world.reboot(DARK)
    world.pass_time(DARK + 3.0)  # its streams are requested again, show the reboot, and a heartbeat follows
    assert world.host.fleet.vehicles[1].reboots == 1
    assert world.ask("GET", "/telemetry/status").body["info"]["armed"] is False
    assert world.ask("GET", "/command/arm").outcome == "200"
    assert world.ask("GET", "/command/takeoff?alt=3").outcome == "200"


def test_a_turn_right_after_a_takeoff_is_flown(make_world: MakeWorld) -> None:
    world = make_world(STAGES["armed"])
    assert world.ask("GET", "/command/takeoff?alt=10").outcome == "200"
    assert world.ask("GET", "/movement/set_yaw_rate?yaw_rate=20").outcome == "200"


@pytest.mark.parametrize("waits", [True, False])
@pytest.mark.parametrize("verb", ["go_to_ned_wait", "land", "vision/search", "fly-track"])
def test_what_a_script_leaves_behind_is_the_same_whether_it_waited_or_not(
    make_world: MakeWorld, verb: str, waits: bool
) -> None:
    request = REQUESTS[verb]
    world = make_world(STAGES[request.stage], camera=request.camera)
    method = "GET" if request.far == "" else "POST"
    script = clients.Script(world, method, outcomes.VERBS[verb].path, request.far or None, waits=waits)
    world.pass_time(UNDER_WAY)
    died = world.now
    script.hang_up()
    world.loop.settle()
    if verb == "land":
        assert script.death.result() == "left alone: the vehicle is in LAND"
        world.pass_time(outcomes.VERBS[verb].takes)
        assert DONE[verb](world)
        return
    quiet_since = hold_after(world, died)
    world.pass_time(GUARD)
    assert script.death.result() == "hold is done"
    assert world.orders(since=quiet_since) == []
    assert world.host.jobs.running() == []


def test_page_about_faults_is_up_to_date() -> None:
    assert outcomes.FILE.read_text(encoding="utf-8") == outcomes.page(), "python -m tests.rules.outcomes"
