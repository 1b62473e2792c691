"""Any order of verbs, pilots, losses and hang-ups with a plane, a QuadPlane and a rover: the rules of the air hold.

The machine of copters is `test_authority_machine.py`; this one drives the embedded vehicles, with fewer steps.
MACHINE_STEPS=20000 takes more steps, other ones each time.
"""

from __future__ import annotations

import os
from typing import Any

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.rules.rules_for_types import LOW, PILOTS_MODES, STAGES, TypesJudge
from tests.support.machines import meet_second_autopilot, run_machine
from tests.support.world import World

STEPS_OF_ONE = 25
IN_CI = 150  # steps of each type
PARTS = 3  # of the machine, each with steps of its own
WANTED = int(os.environ.get("MACHINE_STEPS", IN_CI))
SWITCH_ON_ITS_WAY = 2.0  # s
STOPPED = 8.0  # s from a DELETE or a hang-up until it holds
CLIMBED_AWAY = 15.0  # s more for a plane that is low over the ground
STOPS_LATE = 3.0  # s
ANSWERED = 60.0  # s

SETTINGS = {"max_rate": 100000.0, "max_jobs": 1000}
LATER = st.sampled_from([0.0, 0.0, 0.1, 0.5, 1.5, 4.0])  # s to the next step
PLACES = [(0.001, 0.0), (-0.002, 0.001), (0.004, -0.003), (0.0, 0.0)]  # degrees north and east of home
STOPS = st.sampled_from(["/command/land", "/command/rtl", "/command/brake", "/movement/stop"])
BEGINS = ["/command/arm", "/command/disarm", "/command/guided", "/command/takeoff?alt=40"]
BEGINS += ["/command/takeoff?alt=20&vtol=true", "/command/set_ground_speed?new_v=3"]
BEGINS += [f"/command/set_mode?mode={mode}" for mode in ("GUIDED", "AUTO", "RTL", "LOITER")]
STANDS_FOR = st.sampled_from([0.2, 0.7, 2.0, 5.5, 12.0, 60.0])  # s that MAVProxy's main loop stands
TOLD_ONCE = ("HOME_POSITION", "PARAM_VALUE", "STATUSTEXT", "EXTENDED_SYS_STATE", "MISSION_ACK", "MISSION_COUNT")
FLEET = [
    ("takeoff", {"alt": 40}),
    ("land", {}),
    ("rtl", {}),
    ("arm", {}),
    ("disarm", {}),
    ("stop", {}),
    ("guided", {}),
]
LINKS = [(0.0, 0.0), (0.3, 0.3), (2.0, 2.0)]  # s each way, and more by chance
CIRCLING = ("plane", "quadplane")


class TypesAuthority(RuleBasedStateMachine):
    """Everybody who may do something to a plane, a QuadPlane or a rover, in any order."""

    kind = "plane"

    def __init__(self) -> None:
        super().__init__()
        self.world: World
        self.judge: TypesJudge
        self.wires: list[Any] = []
        self.touched_at = 0.0

    @initialize(stage=st.integers(0, 2))
    def begin(self, stage: int) -> None:
        names = list(STAGES[self.kind])
        self.world = World(SETTINGS, self.kind)
        self.judge = TypesJudge(self.world)
        self.world.host.endings.on_disconnect = Policy.HOLD
        STAGES[self.kind][names[stage % len(names)]](self.world)
        self.world.go_live(3.5)
        self.touched_at = -SWITCH_ON_ITS_WAY

    def then(self, seconds: float) -> None:
        """Let time go by, and look at the rules."""
        self.world.loop.settle()
        self.judge.look()
        if seconds:
            self.world.pass_time(seconds)
            self.judge.look()
        assert not self.judge.broken, self.judge.broken[0]

    def ask(self, method: str, path: str, later: float, body: Any = None) -> Any:
        wire = self.world.begin(method, path, body)
        self.wires = [one for one in self.wires if not one.reply.done()] + [wire]
        self.then(later)
        return wire

    # -- clients ------------------------------------------------------------------------------------------------

    @rule(path=STOPS, later=LATER)
    def ask_to_stop(self, path: str, later: float) -> None:
        self.ask("GET", path, later)

    @rule(place=st.sampled_from(PLACES), wait=st.booleans(), later=LATER)
    def ask_to_move(self, place: tuple[float, float], wait: bool, later: float) -> None:
        home = self.world.vehicle.estimator.start
        where = {"lat": home.latitude + place[0], "long": home.longitude + place[1], "alt": 40}
        self.ask("POST", "/movement/go_to_gps" + "_wait" * wait, later, where)

    @rule(path=st.sampled_from(BEGINS), later=LATER)
    def ask_to_begin(self, path: str, later: float) -> None:
        self.ask("GET", path, later)

    @rule(until_complete=st.booleans(), later=LATER)
    def ask_for_mission(self, until_complete: bool, later: float) -> None:
        self.ask("POST", "/mission/start", later, {"until_complete": until_complete})

    @rule(verb=st.sampled_from(FLEET), together=st.booleans(), later=LATER)
    def ask_a_fleet(self, verb: tuple[str, dict[str, Any]], together: bool, later: float) -> None:
        self.ask("POST", f"/fleet/{verb[0]}", later, {"vehicles": [1], "all_or_none": together, **verb[1]})

    @rule(place=st.sampled_from(PLACES), vtol=st.booleans(), later=LATER)
    def ask_to_land_at(self, place: tuple[float, float], vtol: bool, later: float) -> None:
        """A job of several verbs: it uploads a mission, and begins it."""
        home = self.world.vehicle.estimator.start
        query = f"lat={home.latitude + place[0]}&long={home.longitude + place[1]}&vtol={str(vtol).lower()}"
        self.ask("GET", f"/command/land_at?{query}", later)

    @rule()
    def stop_and_see_it_hold(self) -> None:
        """A `stop` that was answered with 200 holds until somebody does something."""
        self.all_well()
        wire = self.ask("GET", "/movement/stop", 0.0)
        reply = self.world.answer(wire, ANSWERED)
        self.then(STOPS_LATE)
        if reply.outcome == "200" and not self.is_recent:
            assert self.judge.is_held, f"stopped, and it goes on in {self.where}"

    @precondition(lambda self: self.judge.commanders)
    @rule(how=st.sampled_from(["DELETE", "hang up", "DELETE, deaf"]))
    def leave_and_see_it_hold(self, how: str) -> None:
        """Nothing flies on for a caller that has gone, except landings and returns of one that hung up."""
        world = self.world
        self.all_well()
        flight = self.judge.commanders[-1]
        newest = max(map(int, world.flights))
        if how == "hang up":
            for wire in self.wires:
                wire.hang_up()
        else:
            world.uplink_until = world.now + (1.0 if "deaf" in how else 0.0)
            self.ask("DELETE", f"/jobs/{flight.job.id}", 0.0)
        low = self.kind in CIRCLING and -world.at[2] < LOW
        self.then(STOPPED + CLIMBED_AWAY * low)
        if getattr(flight.job.error, "code", "") != "aborted" or self.is_recent:
            return  # it had ended before, or goes on
        after = [one for number, one in world.flights.items() if int(number) > newest and not one.follows]
        others = after or self.judge.commanders or world.known.mode in PILOTS_MODES[self.kind] or self.is_a_failsafes
        assert self.judge.is_held or others, f"{flight} was left, and it goes on in {self.where}"

    @property
    def where(self) -> str:
        world = self.world
        return f"{world.vehicle.mode.name} at {world.speed:.1f} m/s, {-world.at[2]:.1f} m high"

    @property
    def is_a_failsafes(self) -> bool:
        """Whether the vehicle returns, and none of ours has asked for that."""
        mode = self.world.known.mode
        return mode.endswith("RTL") and mode not in {one for _, one in self.judge.requested}

    @property
    def is_recent(self) -> bool:
        """Whether a pilot's switch may have overtaken ours."""
        return bool(self.world.now - self.touched_at < SWITCH_ON_ITS_WAY + STOPPED + CLIMBED_AWAY)

    # -- the pilot, and misfortunes -------------------------------------------------------------------------------

    @rule(which=st.integers(0, 1), later=LATER)
    def pilot_flies(self, which: int, later: float) -> None:
        self.touched_at = self.world.now
        self.judge.pilot(PILOTS_MODES[self.kind][which])
        self.then(later)

    @precondition(lambda self: self.world.vehicle.mode.name == "GUIDED" and self.world.vehicle.armed)
    @rule()
    def pilot_takes_a_movement(self) -> None:
        """What needs GUIDED ends; `TypesJudge.look` says if it does not."""
        self.all_well()
        self.ask_to_move((0.004, -0.003), True, 1.5)
        self.touched_at = self.world.now
        self.judge.pilot(PILOTS_MODES[self.kind][0])
        self.then(2.0)
        self.then(6.0)

    @rule(mode=st.sampled_from(["GUIDED", "RTL", "AUTO", "LOITER"]), later=LATER)
    def pilot_chooses(self, mode: str, later: float) -> None:
        self.touched_at = self.world.now
        self.judge.pilot(mode)
        self.then(later)

    @rule(what=st.sampled_from(["uplink", "link"]), seconds=st.sampled_from([0.4, 2.0]), later=LATER)
    def loss(self, what: str, seconds: float, later: float) -> None:
        until = self.world.now + seconds
        self.touched_at = until
        if what == "uplink":
            self.world.uplink_until = until
        else:
            self.world.cut(until)
        self.then(later)

    @rule(seconds=STANDS_FOR, later=LATER)
    def main_loop_stands(self, seconds: float, later: float) -> None:
        self.touched_at = self.world.stands_until = self.world.now + seconds
        self.then(later)

    @rule(later=LATER)
    def what_is_told_once_is_lost(self, later: float) -> None:
        self.world.to_lose.update(dict.fromkeys(TOLD_ONCE, 2))
        self.then(later)

    @rule(path=STOPS, place=st.sampled_from(PLACES), seconds=st.sampled_from([3.0, 12.0]))
    def second_autopilot(self, path: str, place: tuple[float, float], seconds: float) -> None:
        """One with the same system id comes and goes; whatever is asked for meanwhile, two are sent nothing."""
        self.all_well()
        self.judge.is_blind = True

        def ask() -> None:
            self.ask_to_stop(path, 0.0)
            self.ask_to_move(place, False, 0.0)

        meet_second_autopilot(self.world, seconds, self.then, ask)
        self.judge.is_blind = False
        self.touched_at = self.world.now

    @rule(link=st.sampled_from(LINKS), later=LATER)
    def link_takes(self, link: tuple[float, float], later: float) -> None:
        self.touched_at = self.world.now
        self.world.way, self.world.jitter = link
        self.then(later)

    def all_well(self) -> None:
        if self.world.way:
            self.touched_at = self.world.now + self.world.way + self.world.jitter
        if self.world.stands_until > self.world.now:
            self.touched_at = self.world.now
        self.world.link_is_well()

    @rule(seconds=st.sampled_from([3.0, 10.0]))
    def nothing_happens(self, seconds: float) -> None:
        self.then(seconds)

    def teardown(self) -> None:
        if hasattr(self, "world"):
            self.world.close()
            assert not self.judge.broken, self.judge.broken[0]


@pytest.mark.parametrize(
    "part", [pytest.param(part, marks=pytest.mark.long if part else ()) for part in range(PARTS)]
)
@pytest.mark.parametrize("kind", list(STAGES))
def test_any_order_of_events_keeps_the_rules_of_the_air(kind: str, part: int) -> None:
    machine = type(f"Authority of a {kind} {part}", (TypesAuthority,), {"kind": kind})
    run_machine(machine, WANTED, IN_CI, PARTS, STEPS_OF_ONE)


def must_ask(machine: TypesAuthority) -> None:
    """Nothing tells whether it is a QuadPlane: its landing asks for a parameter first."""
    machine.world.to_lose["EXTENDED_SYS_STATE"] = 1000
    del machine.world.known.state.messages["EXTENDED_SYS_STATE"]


@pytest.mark.parametrize("kind", ["plane", "quadplane"])
def test_landing_that_asks_first_leaves_the_pilots_mode(kind: str) -> None:
    machine = TypesAuthority()
    machine.kind = kind
    machine.begin(stage=1)
    must_ask(machine)
    machine.pilot_chooses(mode="RTL", later=0.0)
    machine.ask_to_stop(path="/command/land", later=4.0)
    assert machine.world.vehicle.mode.name == "RTL"
    machine.teardown()


def test_landing_on_the_ground_does_not_disarm_what_the_pilot_took() -> None:
    machine = TypesAuthority()
    machine.begin(stage=0)
    must_ask(machine)
    machine.pilot_flies(which=0, later=0.0)
    machine.ask_to_stop(path="/command/land", later=4.0)
    assert machine.world.vehicle.armed
    machine.teardown()


def test_mission_asked_for_in_auto_is_not_begun_over_the_pilots_guided() -> None:
    machine = TypesAuthority()
    machine.kind = "quadplane"
    machine.begin(stage=1)
    machine.ask("GET", "/command/set_mode?mode=RTL", 4.0)
    machine.ask_to_land_at(place=(0.001, 0.0), vtol=True, later=1.5)
    assert machine.world.vehicle.mode.name == "AUTO"
    machine.ask_for_mission(until_complete=False, later=0.0)
    machine.pilot_chooses(mode="GUIDED", later=3.0)
    assert machine.world.vehicle.mode.name == "GUIDED"
    machine.teardown()
