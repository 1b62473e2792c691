"""An operator takes a vehicle: until it is back, others of the same or a lower role only stop it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import BadRequest, NoVehicle
from mavproxy_uavapi.core.oversight.endings import Policy
from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_uavapi.prompt import authority
from tests.support import tokens
from tests.support.make_world import MakeWorld
from tests.support.wire import Wire
from tests.support.world import PLACE, World, item_at

FAR = {"x": 300, "y": 0, "z": -8}
GO = "/movement/go_to_ned"
STOPS = ("/command/land", "/command/rtl", "/command/brake", "/movement/stop", "/command/disarm?force=true")


@pytest.fixture
def world(make_world: MakeWorld, tmp_path: Path) -> Any:
    return make_world(tokens=tokens.write(tmp_path / "tokens", tokens.ALL), allow_raw="true")


def ask(world: World, name: str, method: str, path: str, body: Any = None) -> Any:
    wire = world.begin(method, path, body, headers=tokens.bearer(name))
    return world.answer(wire, 60.0)


def take(world: World, name: str, **body: Any) -> Any:
    return ask(world, name, "POST", "/authority/take", body)


def release(world: World, name: str) -> Any:
    return ask(world, name, "POST", "/authority/release")


def held_by(world: World) -> Any:
    (report,) = ask(world, "tower", "GET", "/authority").body["vehicles"]
    return report["held_by"]


def prompt(world: World, *words: str) -> str:
    return str(world.run(authority.command(world.host, words)))


def speed(world: World) -> float:
    return math.hypot(*world.copter.body.velocity)


def test_take_sends_nothing_and_keeps_others_of_the_same_role_out(world: World) -> None:
    before = len(world.sent)
    answer = take(world, "anna", lease=20)
    assert (answer.status, answer.body["held_by"], answer.body["role"]) == (200, "anna", "fly")
    assert answer.body["remaining_s"] == 20 and answer.body["commanded_by"] is None
    for method, path, body in (
        ("POST", GO, FAR),
        ("GET", "/command/guided", None),
        ("GET", "/command/set_mode?mode=LOITER", None),
        ("POST", "/peripherical/servo_output", {"channel": 9, "pwm": 1500}),
        ("DELETE", "/mission/waypoints", None),
        ("POST", "/mission/start", {}),
        ("POST", "/vehicles/1/movement/drive", {"x": 1, "y": 1, "z": 0}),
    ):
        refused = ask(world, "bo", method, path, body)
        assert refused.outcome == "409 busy" and "anna holds vehicle 1" in refused.body["detail"], path
    fleet = ask(world, "bo", "POST", "/fleet/go_to_ned", {"vehicles": "all", **FAR})
    assert fleet.status == 207 and fleet.body["vehicles"]["1"]["code"] == "busy"
    assert world.orders_of(world.sent[before:]) == []
    assert ask(world, "bo", "GET", "/telemetry/home_info").status == 200, "reads go on"
    assert ask(world, "anna", "POST", GO, FAR).status == 200
    assert ask(world, "tower", "GET", "/vehicles/1").body["held_by"] == "anna"


def test_a_list_of_parameters_ends_where_somebody_takes_the_vehicle(world: World) -> None:
    values = {f"SERVO{number}_FUNCTION": 0 for number in range(1, 17)}
    setting = world.begin("POST", "/parameters", {"parameters": values}, headers=tokens.bearer("boss"))
    world.until(lambda: "PARAM_SET" in [sent.message.get_type() for sent in world.sent])
    take(world, "chief")
    answer = world.answer(setting, 60.0)
    assert answer.status == 207 and answer.body["parameters"]
    assert {failure["code"] for failure in answer.body["failed"].values()} == {"busy"}


@pytest.mark.parametrize("path", STOPS)
def test_whoever_may_fly_it_stops_it(world: World, path: str) -> None:
    take(world, "boss")
    ask(world, "boss", "POST", GO, FAR)
    before = len(world.sent)
    answer = ask(world, "bo", "GET", path + ("&" if "?" in path else "?") + "wait=false")
    assert answer.status == 202 and world.pass_time(0.5) is None
    assert world.orders_of(world.sent[before:]) != []
    assert held_by(world) == "boss", "it stays held"
    assert ask(world, "second", "GET", path).status == 403
    assert ask(world, "tower", "GET", path).status == 403


def test_landing_at_a_place_of_the_callers_is_no_stop(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Copter, "has", classmethod(lambda _cls, _verb: True))
    take(world, "anna")
    assert ask(world, "bo", "GET", "/command/land_at?lat=-35&long=149").outcome == "409 busy"
    assert ask(world, "anna", "GET", "/command/land_at?lat=-35&long=149").outcome == "404 not_supported"


def test_mission_that_comes_while_another_takes_it_is_not_uploaded(world: World) -> None:
    text = json.dumps({"items": [{"command": "NAV_TAKEOFF", "alt": 10}]}).encode()
    head = ["POST /mission/waypoints HTTP/1.1", "Host: localhost", "Connection: close"]
    head += ["Content-Type: application/json", f"Content-Length: {len(text)}"]
    head += [f"{name}: {value}" for name, value in tokens.bearer("bo").items()]

    async def begin() -> Wire:
        wire = Wire(world.loop, world.connection())
        wire.ask("\r\n".join([*head, "", ""]).encode() + text[:10])
        return wire

    async def send_the_rest() -> None:
        wire.ask(text[10:])

    wire = world.run(begin())
    world.pass_time(1.0)
    before = len(world.sent)
    take(world, "anna")
    world.run(send_the_rest())
    assert world.answer(wire).outcome == "409 busy"
    assert world.orders_of(world.sent[before:]) == []


def test_delete_of_a_job_stops_it_too(world: World) -> None:
    take(world, "anna")
    job = ask(world, "anna", "POST", GO + "_wait?wait=false", FAR).body["job"]
    assert ask(world, "bo", "DELETE", f"/jobs/{job}").status == 200
    world.pass_time(5.0)
    assert speed(world) < 0.3


def test_only_an_admin_and_the_prompt_take_from_another(world: World) -> None:
    take(world, "anna")
    refused = take(world, "bo")
    assert refused.outcome == "409 busy" and "anna holds vehicle 1" in refused.body["detail"]
    assert release(world, "bo").outcome == "409 busy"
    assert take(world, "second").outcome == take(world, "tower").outcome == "403 forbidden"
    assert held_by(world) == "anna"
    assert ask(world, "boss", "POST", GO, FAR).status == 200, "a higher role commands, too"
    assert take(world, "boss").status == 200 and held_by(world) == "boss"
    assert ask(world, "anna", "POST", GO, FAR).outcome == "409 busy"
    assert ask(world, "chief", "POST", GO, FAR).outcome == "409 busy", "admins are of the same role"
    assert take(world, "anna").outcome == "409 busy"
    assert take(world, "chief").status == 200 and held_by(world) == "chief"
    assert "console holds it" in prompt(world, "take", "1")
    assert take(world, "boss").outcome == release(world, "boss").outcome == "409 busy"
    assert ask(world, "boss", "POST", GO, FAR).outcome == "409 busy"
    assert ask(world, "bo", "GET", "/command/brake").status == 200
    world.pass_time(60.0)
    assert held_by(world) == "console", "the prompt does not vanish"
    assert "nobody holds it" in prompt(world, "release")
    assert take(world, "bo").status == 200
    assert "bo holds it (fly, 30 s without a call)" in prompt(world)
    assert "nobody holds it" in prompt(world, "release", "1")


def test_release_gives_it_back_and_the_flight_goes_on(world: World) -> None:
    take(world, "anna")
    ask(world, "anna", "POST", GO, {**FAR, "x": 1000})
    assert release(world, "anna").body["result"] == "Vehicle 1 is released"
    assert release(world, "anna").body["result"] == "Nobody held vehicle 1"
    world.pass_time(40.0)
    assert speed(world) > 4.0 and held_by(world) is None
    assert ask(world, "bo", "POST", GO, {**FAR, "x": -300}).status == 200


def test_handing_over_in_flight_moves_nothing(world: World) -> None:
    take(world, "anna")
    ask(world, "anna", "POST", GO, FAR)
    world.pass_time(5.0)
    before = len(world.sent)
    release(world, "anna")
    take(world, "bo")
    world.pass_time(5.0)
    assert world.orders_of(world.sent[before:]) == [] and speed(world) > 4.0
    assert ask(world, "anna", "POST", GO, FAR).outcome == "409 busy"
    assert ask(world, "bo", "POST", GO, {**FAR, "x": -300}).status == 200


# -- the holder vanishes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("policy", "mode"), [(Policy.HOLD, "GUIDED"), (Policy.LAND, "LAND"), (Policy.RTL, "RTL")])
def test_hold_of_a_silent_operator_ends_and_the_flight_is_seen_to(world: World, policy: Policy, mode: str) -> None:
    world.host.endings.on_lease_end = policy
    take(world, "anna", lease=5)
    ask(world, "anna", "POST", GO, FAR)
    world.pass_time(4.0)
    assert speed(world) > 4.0 and held_by(world) == "anna"
    world.pass_time(8.0)
    assert held_by(world) is None and world.copter.mode.name == mode
    assert "the lease of anna ran out" in world.screen()
    if policy is Policy.HOLD:
        assert speed(world) < 0.3
        assert take(world, "bo").status == 200


def test_any_call_of_the_operator_renews_it_from_wherever_it_comes(world: World) -> None:
    take(world, "anna", lease=5)
    for _ in range(4):
        world.pass_time(4.0)
        assert ask(world, "anna", "GET", "/telemetry/gps?client=page").status == 200
        assert held_by(world) == "anna"
    for _ in range(2):
        world.pass_time(3.0)
        assert ask(world, "bo", "GET", "/telemetry/gps").status == 200
    assert held_by(world) is None


def test_refused_calls_renew_nothing(world: World, tmp_path: Path) -> None:
    take(world, "anna", lease=5)
    world.pass_time(4.0)
    tokens.write(tmp_path / "tokens", {**tokens.ALL, "anna": "watch"})
    world.service.tokens.take()
    assert ask(world, "anna", "GET", "/command/arm").status == 403
    world.pass_time(2.0)
    assert held_by(world) is None


def test_silent_operators_vehicle_that_others_command_is_left_alone(world: World) -> None:
    take(world, "anna", lease=5)
    ask(world, "anna", "POST", GO, FAR)
    ask(world, "boss", "POST", GO, {**FAR, "x": -300})
    before = len(world.sent)
    world.pass_time(15.0)
    assert world.orders_of(world.sent[before:]) == [] and held_by(world) is None


def test_pilot_and_prompt_are_above_a_hold(world: World) -> None:
    take(world, "boss")
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(1.0)
    assert world.copter.mode.name == "LOITER"
    before = len(world.sent)
    world.pass_time(60.0)
    assert world.orders_of(world.sent[before:]) == [] and held_by(world) is None


# -- without tokens, and what makes no sense ----------------------------------------------------------------


def test_without_tokens_an_operator_is_an_address(make_world: MakeWorld) -> None:
    world = make_world()
    assert world.ask("POST", "/authority/take", {"vehicle": 1}).body["held_by"] == "127.0.0.1"
    assert world.ask("POST", GO + "?client=other", FAR).status == 200
    assert world.ask("GET", "/vehicles/1/authority").body["vehicles"][0]["held_by"] == "127.0.0.1"
    assert world.ask("POST", "/vehicles/1/authority/release").status == 200


@pytest.mark.parametrize(
    ("path", "body", "outcome"),
    [
        ("/authority/take", {"vehicle": 9}, "503 no_vehicle"),
        ("/authority/take", {"vehicle": 0}, "422 invalid"),
        ("/authority/take", {"vehicle": 256}, "422 invalid"),
        ("/authority/take", {"lease": 0}, "422 invalid"),
        ("/authority/take", {"lease": 4000}, "422 invalid"),
        ("/authority/take", {"lease": True}, "422 invalid"),
        ("/vehicles/2/authority/take", {"vehicle": 1}, "422 invalid"),
        ("/vehicles/2/authority/take", {}, "503 no_vehicle"),
        ("/authority/release", {"vehicle": 9}, "503 no_vehicle"),
    ],
)
def test_nonsense_takes_nothing(world: World, path: str, body: dict[str, Any], outcome: str) -> None:
    assert ask(world, "boss", "POST", path, body).outcome == outcome
    assert held_by(world) is None
    assert ask(world, "boss", "GET", "/authority/take").status == 405


@pytest.mark.parametrize("words", [("give",), ("take", "x"), ("take", "-1")])
def test_prompt_says_what_it_takes(world: World, words: tuple[str, ...]) -> None:
    with pytest.raises(BadRequest, match="authority takes"):
        prompt(world, *words)
    with pytest.raises(NoVehicle):
        prompt(world, "take", "9")


@pytest.mark.parametrize(("first", "second"), [("bo", "anna"), ("anna", "boss")])
def test_hold_that_runs_out_ends_a_flight_that_two_requested(world: World, first: str, second: str) -> None:
    path = "/movement/go_to_ned_wait?wait=false"
    if first == "anna":
        take(world, "anna", lease=5)
    assert ask(world, first, "POST", path, FAR).status == 202
    if second == "anna":
        take(world, "anna", lease=5)
    assert ask(world, second, "POST", path, FAR).status == 202
    world.pass_time(4.0)
    assert speed(world) > 4.0
    world.pass_time(8.0)
    assert speed(world) < 0.3


def test_frames_that_landings_follow_come_from_nobody_else(make_world: MakeWorld, tmp_path: Path) -> None:
    world = make_world(camera={}, tokens=tokens.write(tmp_path / "tokens", tokens.ALL))
    taken = "400 bad_request"  # the simulated camera takes no frames, from whomever
    assert ask(world, "bo", "POST", "/vision/frame", b"").outcome == taken
    take(world, "anna", lease=20)
    outcomes = {name: ask(world, name, "POST", "/vision/frame", b"").outcome for name in ("bo", "anna", "boss")}
    assert outcomes == {"bo": "409 busy", "anna": taken, "boss": taken}


def test_who_reads_the_mission_all_the_time_does_not_delay_its_start(world: World) -> None:
    def seconds_to_start() -> float:
        began = world.now
        assert ask(world, "anna", "POST", "/mission/start", {}).status == 200
        taken = world.now - began
        assert ask(world, "anna", "GET", "/command/guided").status == 200
        return float(taken)

    async def read() -> None:
        while True:
            wire = await world.request("GET", "/mission/waypoints", headers=tokens.bearer("bo"))
            await wire.reply

    world.held_up = 0.15
    world.copter.mission.items[:] = [item_at(PLACE[0] + n / 1e4, PLACE[1]) for n in range(40)]
    take(world, "anna", lease=600)
    alone = seconds_to_start()
    world.streams.update({client: world.loop.create_task(read()) for client in range(3)})
    world.pass_time(5.0)
    assert alone > 5.0 and [seconds_to_start() < alone + 1.0 for _ in range(3)] == [True] * 3


@pytest.mark.parametrize("joined", [False, True])
def test_an_arm_that_waits_ends_when_another_operator_takes_the_vehicle(
    make_world: MakeWorld, tmp_path: Path, joined: bool
) -> None:
    def unready(world: World) -> None:
        world.boot()
        world.fault("ekf_bad", seconds=10.0)
        world.simulator.run(1.0)

    world = make_world(unready, tokens=tokens.write(tmp_path / "tokens", tokens.ALL))
    arm = world.begin("GET", "/command/arm", headers=tokens.bearer("bo"))
    world.pass_time(2.0)
    take(world, "anna", lease=100)
    if joined:  # then it is the new holder's, too
        assert ask(world, "anna", "GET", "/command/arm").outcome == "200"
    assert world.answer(arm).outcome == ("200" if joined else "409 busy")
    assert world.copter.armed is joined


def test_mission_that_is_read_does_not_begin_for_another_operators_vehicle(world: World) -> None:
    world.copter.mission.items[:] = [item_at(PLACE[0] + 1e-6 * number, PLACE[1]) for number in range(100)]
    start = world.begin("POST", "/mission/start", b"{}", headers=tokens.bearer("bo"))
    world.pass_time(0.5)
    take(world, "anna")
    assert world.answer(start).outcome == "409 busy"
    assert world.copter.mode.name == "GUIDED"
