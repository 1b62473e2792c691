"""Any order of verbs, streams, pilots, stations, losses and hang-ups: the rules of the air hold after every step.

MACHINE_STEPS=200000 takes more steps, other ones each time. What it finds is written down below as a case.
"""

from __future__ import annotations

import importlib.util
import math
import os
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot
from mavproxy_uavapi.core.airspace.model import Area, Envelope
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.airspace.store import ALL, API
from mavproxy_uavapi.core.link.messages import POSITION_IGNORED
from mavproxy_uavapi.scripts import on_exit
from tests.rules import rules_of_the_air
from tests.support.drone import HOME
from tests.support.faulty_link import every
from tests.support.flights import Flight, Sent
from tests.support.machines import meet_second_autopilot, run_machine
from tests.support.scripted_world import ScriptedWorld
from tests.support.wire import Wire

PLACE_UNUSED = POSITION_IGNORED
HELD = 3.0  # m that it may have moved since the position that it is told to hold
STEPS_OF_ONE = 50
IN_CI = 10_000
PARTS = 20  # of the machine, each with steps of its own
WANTED = int(os.environ.get("MACHINE_STEPS", IN_CI))
WAITS_LEFT = 0  # when all is over
DELETED_STANDS = 5.0  # s from a DELETE, or from when the vehicle hears again: BRAKE is sent anew after 1.5 s
OUR_MODES = ("GUIDED", "LAND", "RTL", "BRAKE", "AUTO", "LOITER")
MODE_ON_ITS_WAY = 2.0  # s
PILOTS_MODES = ("STABILIZE", "ALT_HOLD", "LOITER")
PLACES = [(30, 0, -10), (-20, 15, -20), (0, 0, -5), (400, -60, -30), (1, 1, -10)]
VELOCITIES = [(4, 0, 0), (0, -6, 0), (2, 2, -1), (0, 0, 2), (0, 0, 0)]

NED = st.sampled_from([dict(zip("xyz", place, strict=True)) for place in PLACES])


def of_axes(velocity: tuple[int, int, int]) -> dict[str, int]:
    """As a request has it."""
    return dict(zip(("vx", "vy", "vz"), velocity, strict=True))


VELOCITY = st.sampled_from([of_axes(velocity) for velocity in VELOCITIES])
WAIT = st.sampled_from(["true", "false"])
LATER = st.sampled_from([0.0, 0.0, 0.02, 0.1, 0.3, 1.0, 3.0])  # s to the next step
A_WHILE = st.sampled_from([0.5, 2.0, 4.0, 8.0])  # s that a loss takes
CLIMBS = [("arm", {}), ("takeoff", {"alt": 10}), ("takeoff", {"alt": 25}), ("disarm", {})]
CLIMBS += [("disarm", {"force": "true"})]
BESIDE = [("movement/resume", {}), ("command/set_home", {}), ("movement/set_heading", {"heading": 90})]
BESIDE += [("movement/set_yaw_rate", {"yaw_rate": 20}), ("movement/resume", {})]
BESIDE += [(f"command/set_{kind}_speed", {"new_v": speed}) for kind, speed in (("ground", 3), ("descent", 1))]
MISFORTUNES = ["acks", "uplink", "downlink", "link", "losses", "few losses", "nan", "reboot", "quick reboot"]
MISFORTUNES += ["not ready", "silent"]
LOSSES = {"losses": 2, "few losses": 5}  # one of how many messages
LINKS = [(0.0, 0.0), (0.3, 0.0), (0.9, 0.9), (2.0, 2.0)]  # s each way, and more by chance
AGROUND = 10  # steps, after which somebody flies it up again: that is where most can go wrong
STANDS_FOR = st.sampled_from([0.2, 0.7, 2.0, 5.5, 12.0, 60.0])  # s that MAVProxy's main loop stands
TOLD_ONCE = ("HOME_POSITION", "PARAM_VALUE", "STATUSTEXT", "EXTENDED_SYS_STATE", "POSITION_TARGET_GLOBAL_INT")
FLEET = [
    ("takeoff", {"alt": 10}),
    ("land", {}),
    ("rtl", {}),
    ("arm", {}),
    ("disarm", {}),
    ("brake", {}),
    ("stop", {}),
]
FLEET += [("go_to_ned", {"x": 30, "y": 0, "z": -10}), ("guided", {})]
VISION = [("land", {}), ("search", {}), ("mission", {"alt": 8, "north": 2, "east": 1})]
VISION += [("mission", {"alt": 8, "north": north, "east": 0, "tag": False}) for north in (4, 40)]
HAS_OPENCV = importlib.util.find_spec("cv2") is not None
CAMERA = {"source": "sim", "width": 240, "height": 180, "fps": 4.0, "sim_tags": "0:0.6@2,1", "tags": "0:0.6"}
LOOKS_FOR = 0.6  # s that a camera is open before a flight of vision
STOPS = st.sampled_from(["command/land", "command/rtl", "command/brake", "movement/stop"])
MOVES = st.sampled_from(["go_to_ned", "go_to_ned_wait", "drive", "drive_wait"])
POLICY = st.sampled_from(["nothing", "hold", "land", "rtl"])


def around_home(half: float) -> Area:
    """A square field around the drone's home."""
    frame = LocalFrame(HOME)
    ring = tuple(frame.degrees(Spot(n * half, e * half, 0)) for n, e in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return Area("field", inclusion=True, rings=(ring,))


class Authority(RuleBasedStateMachine):
    """Everybody who may do something to a vehicle, in any order."""

    envelopes = {half: Space(Envelope((around_home(half),))) if half else None for half in (0, 25, 120)}

    def __init__(self) -> None:
        super().__init__()
        self.world: ScriptedWorld
        self.wires: list[Wire] = []
        self.aground = self.half = 0
        self.sees_until = 0.0  # s; 0 while the camera is closed
        self.has_met = False  # a second autopilot

    @initialize(
        where=st.sampled_from(["ground", "GUIDED", "GUIDED", "GUIDED", "LOITER", "AUTO", "armed"]),
        on_disconnect=POLICY,
        on_script_exit=POLICY,
    )
    def begin(self, where: str, on_disconnect: str = "nothing", on_script_exit: str = "hold") -> None:
        self.world = ScriptedWorld(on_disconnect, on_script_exit)
        if HAS_OPENCV:
            self.world.mount_camera(CAMERA)
        self.world.go_live(0.6)
        self.judge = rules_of_the_air.Judge(self.world)
        self.world.on_send.append(self.stays_inside)
        drone = self.world.drone
        if where == "armed":
            drone.mode, drone.armed = "GUIDED", True
        elif where != "ground":
            drone.fly(where, at=(0.0, 0.0, -10.0))
        self.then(0.6)

    def then(self, seconds: float) -> None:
        """Let time go by, and look at the rules."""
        self.world.loop.settle()
        self.close_eye_unless_needed()
        self.judge.look()
        if seconds:
            self.world.pass_time(seconds)
            self.world.loop.settle()  # a request of this very moment is not answered yet
            self.judge.look()
        assert not self.judge.broken, self.judge.broken[0]
        drone = self.world.drone
        self.aground = 0 if drone.armed and drone.mode == "GUIDED" and drone.at[2] < -1.0 else self.aground + 1
        if self.aground > AGROUND:
            self.judge.touched()
            self.all_well()
            drone.fly("GUIDED", at=(0.0, 0.0, -10.0))
            self.world.pass_time(0.3)

    def begin_request(self, method: str, path: str, body: Any = None, **query: Any) -> Wire:
        """A client's request, which arrives now."""
        wire = self.world.begin(method, path, body, query=query)
        self.wires = [one for one in self.wires if not one.reply.done()] + [wire]
        self.world.loop.settle()
        return wire

    def ask(self, path: str, later: float, method: str = "GET", **query: Any) -> Wire:
        """A client's request, and time that goes by."""
        wire = self.begin_request(method, f"/{path}", **query)
        self.then(later)
        return wire

    def see(self, seconds: float) -> None:
        """Open the camera for so many s, or until no flight of vision goes on: it is most of the work here."""
        if HAS_OPENCV and not self.sees_until:
            self.world.listen()
            self.world.open_eye()
        self.sees_until = self.world.now + seconds

    def close_eye_unless_needed(self) -> None:
        flies = any(flight.verb.startswith("vision") for flight in self.world.running)
        if self.sees_until and not flies and self.world.now >= self.sees_until:
            self.sees_until = 0.0
            if HAS_OPENCV:
                self.world.close_eye()

    def all_well(self) -> None:
        """End all faults."""
        self.world.link_is_well()
        self.world.drone.mute_requests, self.world.drone.ready = False, True

    # -- clients ----------------------------------------------------------------------------------------------

    @rule(path=STOPS, wait=WAIT, later=LATER)
    def ask_to_stop(self, path: str, wait: str, later: float) -> None:
        self.ask(path, later, wait=wait)

    @rule(path=MOVES, place=NED, wait=WAIT, later=LATER)
    def ask_to_move(self, path: str, place: dict[str, int], wait: str, later: float) -> None:
        self.ask(f"movement/{path}", later, "POST", wait=wait, **place)

    @rule(velocity=VELOCITY, duration=st.sampled_from([None, 0.5, 20.0]), wait=WAIT, later=LATER)
    def ask_to_travel(self, velocity: dict[str, int], duration: float | None, wait: str, later: float) -> None:
        more = {} if duration is None else {"duration": duration}
        self.ask("movement/travel_at_ned", later, "POST", wait=wait, **velocity, **more)

    @rule(what=st.sampled_from(CLIMBS), wait=WAIT, later=LATER)
    def ask_to_climb(self, what: tuple[str, dict[str, Any]], wait: str, later: float) -> None:
        self.ask(f"command/{what[0]}", later, wait=wait, **what[1])

    @rule(mode=st.sampled_from(OUR_MODES), wait=WAIT, later=LATER)
    def ask_for_mode(self, mode: str, wait: str, later: float) -> None:
        self.ask("command/set_mode", later, mode=mode, wait=wait)

    @rule(wait=WAIT, later=LATER)
    def ask_for_guided(self, wait: str, later: float) -> None:
        self.ask("command/guided", later, wait=wait)

    @rule(what=st.sampled_from(BESIDE), later=LATER)
    def ask_beside(self, what: tuple[str, dict[str, Any]], later: float) -> None:
        self.ask(what[0], later, **what[1])

    @rule(north=st.sampled_from([0.0, 3.0, 40.0, 200.0]), wait=WAIT, later=LATER)
    def ask_for_track(self, north: float, wait: str, later: float) -> None:
        """A job of several verbs: it arms, takes off, goes to two places, returns and lands."""
        places = [self.world.drone.place((there, 0.0)) for there in (0.0, north)]
        track = "\n".join(f"(1, {lat}, {lon}, 594000, 0, 65535, 0, 0, 3, 10)" for lat, lon in places)
        self.begin_request("POST", "/mission/fly-track", {"track": track, "ground": 584}, wait=wait)
        self.then(later)

    @rule(flight=st.sampled_from(VISION), wait=WAIT, later=LATER)
    def ask_vision(self, flight: tuple[str, dict[str, Any]], wait: str, later: float) -> None:
        """A flight of vision: one job of several verbs, or of setpoints by what a camera sees."""
        self.see(LOOKS_FOR)
        self.then(LOOKS_FOR)
        name, body = flight
        self.begin_request("POST", f"/vision/{name}", body, wait=wait)
        self.then(later)

    @rule(verb=st.sampled_from(FLEET), together=st.booleans(), later=LATER)
    def ask_a_fleet(self, verb: tuple[str, dict[str, Any]], together: bool, later: float) -> None:
        name, values = verb
        body = {"vehicles": [1], "all_or_none": together, **values}
        self.begin_request("POST", f"/fleet/{name}", body)
        self.then(later)

    @rule(client=st.integers(0, 2), velocity=st.sampled_from(VELOCITIES), rate=st.sampled_from([2, 5]), later=LATER)
    def stream(self, client: int, velocity: tuple[int, int, int], rate: int, later: float) -> None:
        self.world.stream(of_axes(velocity), 1.0 / rate, client)
        self.then(later)

    @precondition(lambda self: self.world.streams)
    @rule(later=LATER)
    def end_streams(self, later: float) -> None:
        self.world.end_streams()
        self.then(later)

    @precondition(lambda self: self.wires)
    @rule(which=st.integers(0, 3), later=LATER)
    def hang_up(self, which: int, later: float) -> None:
        self.wires[which % len(self.wires)].hang_up()
        self.then(later)

    @precondition(lambda self: self.world.running)
    @rule(which=st.integers(0, 3), later=LATER)
    def delete(self, which: int, later: float) -> None:
        running = self.world.running
        self.begin_request("DELETE", f"/jobs/{running[which % len(running)].job.id}")
        self.then(later)

    @precondition(lambda self: not self.world.streams and self.commanders)
    @rule(deaf=st.sampled_from([0.0, 0.4, 2.0]))
    def delete_and_see_it_stand(self, deaf: float = 0.0) -> None:
        world, running = self.world, self.commanders
        # A pilot who switches while a switch of ours is on its way has the vehicle, whichever of both arrives last.
        pilot_too = world.now - self.judge.touched_at < MODE_ON_ITS_WAY
        on_its_way = world.way + world.jitter
        self.all_well()
        world.uplink_until = world.now + deaf
        newest = int(max(world.flights, key=int))
        self.begin_request("DELETE", f"/jobs/{running[-1].job.id}")
        self.then(deaf + DELETED_STANDS + max(2 * on_its_way, world.known.state.trip.deadline))
        if world.speed > rules_of_the_air.STILL:  # late answers have come meanwhile: the second sending waits as long
            self.then(world.known.state.trip.deadline)
        if getattr(running[-1].job.error, "code", "") != "aborted":
            return  # it had ended before
        after = [one for number, one in world.flights.items() if int(number) > newest and not one.follows]
        drone = world.drone
        stands = not drone.armed or world.speed <= rules_of_the_air.STILL or drone.mode == "BRAKE"
        others = after or self.commanders or drone.mode in PILOTS_MODES or pilot_too
        how = f"in {drone.mode}: {world.speed:.1f} m/s, at {drone.at}"
        assert stands or others, f"{running[-1]} was deleted, and it flies on {how}"

    @property
    def commanders(self) -> list[Any]:
        """The flights under way that command."""
        beside = rules_of_the_air.goes_beside
        return [one for one in self.world.running if one.sent and not beside(one) and not one.follows]

    @precondition(lambda self: self.world.running)
    @rule(share=st.sampled_from([0, 1, 2]), later=LATER)
    def script_dies_or_module_is_unloaded(self, share: int, later: float) -> None:
        flights = [one for one in self.world.running if not one.follows][::share] if share else []
        if share:
            self.script_dies(flights)
        else:
            closing_messages = {message.get_type() for message in self.unload()}
            assert closing_messages <= {"COMMAND_LONG", "SET_POSITION_TARGET_LOCAL_NED"}
        self.then(later)
        # What somebody else waits for goes on: the clients here are no scripts.
        others = [one for one in flights if one.job._clients]
        left = [one for one in flights if one.job.running and one.verb not in ("land", "rtl") and one not in others]
        assert not left, f"{left[0]} outlives its script"

    def unload(self) -> list[Any]:
        """The module is unloaded; its closing messages."""

        async def end() -> list[Any]:
            self.world.host.jobs.abort_remote("the module is unloaded")
            return [message for message, _ in self.world.host.endings.closing_messages()]

        return self.world.run(end())

    def script_dies(self, flights: list[Flight]) -> None:
        """The script that began those flights dies."""
        for flight in flights:
            flight.job.script = "session"
            flight.job._goes_on_for_others = False  # it was the script that did not wait
        run = SimpleNamespace(session="session", script="mission.py")
        self.world.loop.create_task(on_exit.after_death(self.world.host, 0, run, []))

    # -- the pilot and other stations -------------------------------------------------------------------------

    @rule(mode=st.sampled_from([*PILOTS_MODES, "GUIDED", "LAND", "RTL"]), later=LATER)
    def pilot_switches(self, mode: str, later: float) -> None:
        self.judge.touched()
        self.world.drone.pilot(mode)
        self.then(later)

    @rule(mode=st.sampled_from(PILOTS_MODES), up=st.booleans(), later=LATER)
    def pilot_arms_or_disarms(self, mode: str, up: bool, later: float) -> None:
        self.judge.touched()
        drone = self.world.drone
        if drone.armed:
            drone.armed, drone.landed, drone.at[2] = False, 1, 0.0
        else:
            drone.pilot(mode)
            drone.armed = True
            if up:
                drone.landed, drone.at[2] = 2, -5.0
        drone.tell_all()
        self.then(later)

    @rule(velocity=st.sampled_from(VELOCITIES), later=LATER)
    def other_station_flies(self, velocity: tuple[int, int, int], later: float) -> None:
        self.judge.touched()
        drone = self.world.drone
        if drone.mode == "GUIDED" and drone.armed:
            drone.target, drone.moving, drone.lifting = [40.0, 40.0, -15.0], None, False
            if velocity != (0, 0, 0):
                drone.target, drone.moving, drone._setpoint_at = None, list(velocity), self.world.now
        self.then(later)

    # -- the envelope -----------------------------------------------------------------------------------------

    @rule(half=st.sampled_from([0, 0, 25, 120]), later=LATER)
    def somebody_puts_an_envelope(self, half: int, later: float) -> None:
        self.world.host.envelopes.put(API, ALL, self.envelopes[half])
        self.half = half
        self.then(later)

    def stays_inside(self, sent: Sent) -> None:
        """No place outside of the envelope is sent, but that where the vehicle is."""
        message = sent.message
        if not self.half or message.get_type() != "SET_POSITION_TARGET_LOCAL_NED" or message.type_mask & PLACE_UNUSED:
            return
        to, at = (message.x, message.y, message.z), self.world.drone.at
        assert max(abs(to[0]), abs(to[1])) <= self.half + 0.1 or math.dist(to, at) < HELD, f"{to} of {sent.flight}"

    # -- misfortunes --------------------------------------------------------------------------------------------

    @rule(what=st.sampled_from(MISFORTUNES), seconds=A_WHILE, later=LATER)
    def misfortune(self, what: str, seconds: float, later: float) -> None:
        world = self.world
        until = world.now + seconds
        if what not in ("acks", "nan", "silent", "not ready"):
            self.judge.touched()
        if what in ("uplink", "link", "reboot"):
            world.uplink_until = until
        if what in ("downlink", "link", "reboot"):
            world.downlink_until = until
        if what in ("reboot", "quick reboot"):
            world.drone.reboot()
        world.to_lose["COMMAND_ACK"] += 8 * (what == "acks")
        world.loses = every(LOSSES[what]) if what in LOSSES else world.loses
        world.nan = {"LOCAL_POSITION_NED", "ATTITUDE"} if what == "nan" else world.nan
        world.drone.ready = world.drone.ready and what != "not ready"
        world.drone.mute_requests = world.drone.mute_requests or what == "silent"
        self.then(later)

    @rule(seconds=STANDS_FOR, later=LATER)
    def main_loop_stands(self, seconds: float, later: float) -> None:
        self.judge.touched_at = self.world.now + seconds
        self.world.stands_until = self.world.now + seconds
        self.then(later)

    @rule(later=LATER)
    def what_is_told_once_is_lost(self, later: float) -> None:
        self.world.to_lose.update(dict.fromkeys(TOLD_ONCE, 2))
        self.then(later)

    @precondition(lambda self: not self.has_met)  # once in a flight: it takes longest of all
    @rule(stop=STOPS, velocity=st.sampled_from(VELOCITIES), seconds=st.sampled_from([3.0, 12.0]))
    def second_autopilot(self, stop: str, velocity: tuple[int, int, int], seconds: float) -> None:
        """One with the same system id comes and goes; whatever is asked for meanwhile, two are sent nothing."""
        self.judge.is_blind = self.has_met = True

        def ask() -> None:
            self.begin_request("GET", f"/{stop}")
            self.begin_request("POST", "/movement/travel_at_ned", **of_axes(velocity))

        meet_second_autopilot(self.world, seconds, self.then, ask)
        self.judge.is_blind = False
        self.judge.touched()

    @rule(link=st.sampled_from(LINKS), later=LATER)
    def link_takes(self, link: tuple[float, float], later: float) -> None:
        self.judge.touched()
        self.world.way, self.world.jitter = link
        self.then(later)

    @rule(later=LATER)
    def all_is_well(self, later: float) -> None:
        self.all_well()
        self.then(later)

    @rule(seconds=st.sampled_from([1.0, 5.0, 12.0, 31.0]))
    def nothing_happens(self, seconds: float) -> None:
        while seconds > 0:
            self.then(min(seconds, 10.0))
            seconds -= 10.0

    def teardown(self) -> None:
        if hasattr(self, "world"):
            left = self.world.waits_left()
            self.world.close()
            assert left <= WAITS_LEFT, f"{left} waits are left"
            assert not self.judge.broken, self.judge.broken[0]


@pytest.mark.parametrize("part", range(PARTS))
def test_any_order_of_events_keeps_the_rules_of_the_air(part: int) -> None:
    machine = type(f"Authority{part}", (Authority,), {})  # another name, other steps
    run_machine(machine, WANTED, IN_CI, PARTS, STEPS_OF_ONE)


# -- what it found, each in as few steps as it needs -----------------------------------------------------------


@pytest.fixture
def state() -> Iterator[Authority]:
    """A machine to be driven by hand."""
    machine = Authority()
    yield machine
    machine.teardown()


@pytest.mark.parametrize("deaf", [0.0, 0.4, 2.0])
@pytest.mark.parametrize("mode", ["AUTO", "RTL", "LAND"])
def test_an_old_heartbeat_in_brake_is_no_proof_of_the_brake_after_a_deleted_flight(
    state: Authority, mode: str, deaf: float
) -> None:
    state.begin(where="GUIDED")
    state.ask_for_mode(later=0.02, mode="BRAKE", wait="true")
    state.ask_for_mode(later=0.0, mode=mode, wait="false")
    state.delete_and_see_it_stand(deaf=deaf)
    assert state.world.drone.mode == "BRAKE"


@pytest.mark.parametrize("mode", ["AUTO", "RTL", "LAND"])
def test_mode_that_arrives_after_its_flight_was_deleted_is_left_by_brake(state: Authority, mode: str) -> None:
    state.begin(where="GUIDED")
    state.ask_for_mode(later=0.0, mode=mode, wait="true")
    state.delete_and_see_it_stand(deaf=0.0)
    assert state.world.drone.mode == "BRAKE"


def test_movement_replaces_a_hold_by_zero_velocities_that_began_in_brake(state: Authority) -> None:
    state.begin(where="GUIDED", on_disconnect="hold")
    state.ask_for_mode(later=0.3, mode="BRAKE", wait="true")
    state.ask_for_mode(later=0.0, mode="GUIDED", wait="true")
    state.hang_up(later=2.0, which=3)  # it has come to rest
    state.ask_to_move(later=3.0, path="go_to_ned", place={"x": 30, "y": 0, "z": -10}, wait="false")
    assert state.world.speed > rules_of_the_air.STILL


def test_end_of_a_flight_whose_mode_never_came_leaves_a_mode_that_somebody_else_has_chosen(state: Authority) -> None:
    state.begin(where="GUIDED", on_script_exit="land")
    state.pilot_switches(later=1.0, mode="LAND")
    state.ask_for_mode(later=0.0, mode="AUTO", wait="false")
    state.misfortune(later=3.0, seconds=8.0, what="link")
    state.script_dies_or_module_is_unloaded(later=0.02, share=1)
    state.pilot_switches(later=9.0, mode="GUIDED")
    assert state.world.drone.mode == "GUIDED"


def test_hold_that_was_not_sent_yet_gives_way_to_no_lower_rank(state: Authority) -> None:
    state.begin(where="LOITER")
    state.ask_for_guided(later=1.0, wait="true")
    state.main_loop_stands(later=0.0, seconds=2.0)
    state.ask_for_guided(later=1.0, wait="false")
    state.script_dies_or_module_is_unloaded(later=0.3, share=0)
    state.main_loop_stands(later=1.0, seconds=12.0)
    state.ask_for_guided(later=0.3, wait="true")


def test_order_that_was_never_written_makes_nobody_elses_mode_ours(state: Authority) -> None:
    state.begin(where="armed", on_script_exit="rtl")
    state.pilot_switches(later=1.3, mode="ALT_HOLD")
    state.main_loop_stands(later=0.3, seconds=12.0)
    state.ask_for_guided(later=3.0, wait="false")
    state.pilot_switches(later=1.0, mode="RTL")
    state.ask_for_guided(later=0.0, wait="false")
    state.main_loop_stands(later=0.1, seconds=2.0)
    state.script_dies_or_module_is_unloaded(later=0.02, share=1)
    state.pilot_switches(later=3.0, mode="GUIDED")


def test_second_autopilot_that_has_gone_is_forgotten(state: Authority) -> None:
    state.begin(where="GUIDED")
    state.second_autopilot(seconds=12.0, stop="command/brake", velocity=(0, 0, 2))
    state.ask_to_move(later=3.0, path="go_to_ned", place={"x": 30, "y": 0, "z": -10}, wait="false")


def test_stop_holds_although_the_mode_was_switched_there_and_back_before_it_was_written(state: Authority) -> None:
    state.begin(where="GUIDED")
    state.main_loop_stands(later=3.0, seconds=6.0)
    state.pilot_switches(later=0.5, mode="RTL")
    state.ask_a_fleet(later=0.5, together=True, verb=("stop", {}))
    state.pilot_switches(later=3.0, mode="GUIDED")
    assert state.judge.stopped and state.world.known.authority.paused
    state.stream(client=1, later=1.0, rate=10, velocity=(2, 0, 0))


def test_pilot_who_switches_while_home_is_asked_for_keeps_the_vehicle(state: Authority) -> None:
    state.begin(where="GUIDED")
    state.what_is_told_once_is_lost(later=0.0)
    state.somebody_puts_an_envelope(half=25, later=3.0)
    state.ask_for_guided(later=0.1, wait="false")
    state.pilot_switches(later=8.0, mode="STABILIZE")
    assert state.world.drone.mode == "STABILIZE"


def test_landing_undoes_our_arming_over_a_reboot_that_switches_the_mode(state: Authority) -> None:
    state.begin(where="GUIDED")
    state.pilot_arms_or_disarms(later=0.0, mode="STABILIZE", up=False)
    state.ask_for_track(later=0.0, north=0.0, wait="true")
    state.misfortune(later=0.0, seconds=0.5, what="reboot")
    state.ask_for_mode(later=3.0, mode="LAND", wait="true")
    assert not state.world.drone.armed


def test_older_switch_that_was_answered_is_no_reason_to_take_the_vehicle_from_its_pilot(state: Authority) -> None:
    state.begin(where="GUIDED")
    state.ask_for_guided(later=0.02, wait="false")
    state.ask_to_stop(later=0.0, path="command/brake", wait="true")
    state.nothing_happens(seconds=0.02)
    state.pilot_switches(later=0.3, mode="ALT_HOLD")
    assert state.world.drone.mode == "ALT_HOLD"


def test_stop_that_met_a_pilot_on_its_way_is_not_answered_with_success(state: Authority) -> None:
    state.begin(where="GUIDED")
    state.ask_for_guided(later=0.0, wait="false")
    stop = state.ask("movement/stop", 0.0)
    state.pilot_switches(later=3.0, mode="ALT_HOLD")  # our GUIDED arrives after it
    assert stop.reply.result().status == 409 and not state.judge.stopped


def test_arm_that_still_asks_for_home_is_no_success_when_the_pilot_has_disarmed_meanwhile(state: Authority) -> None:
    state.begin(where="ground")
    state.somebody_puts_an_envelope(half=120, later=1.0)
    state.pilot_switches(mode="GUIDED", later=1.0)
    state.what_is_told_once_is_lost(later=0.0)
    arm = state.ask("command/arm", 1.0)
    assert not arm.reply.done() and state.world.drone.armed
    state.pilot_arms_or_disarms(mode="GUIDED", up=False, later=8.0)
    assert arm.reply.result().status == 409


def test_disarming_that_is_seen_undone_is_no_success(state: Authority) -> None:
    state.begin(where="ground")
    state.pilot_switches(later=1.0, mode="GUIDED")
    state.link_takes(later=0.0, link=(2.0, 2.0))  # nobody has measured that yet
    state.ask_for_track(later=0.3, north=0.0, wait="true")
    state.delete(later=3.0, which=2)
    state.nothing_happens(seconds=5.0)
    assert not state.world.drone.armed
