"""The mission protocol against a scripted store that loses, refuses and truncates."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Busy, LinkLost, Rejected, TimedOut
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.mission.list_transfers import FENCE, MISSION, RALLY
from mavproxy_uavapi.core.mission.mission_files import HOME, MissionItem, from_message
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.fake_link import FakeLink
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink

PLACE = (0.0, 0.0, 0.0, 0.0)
OLD = [MissionItem(22, 3, PLACE, 0, 0, 10.0), MissionItem(16, 3, PLACE, -349999990, 1490000020, 15.0)]
NEW = [
    MissionItem(22, 3, PLACE, 0, 0, 5.0),
    MissionItem(16, 3, PLACE, -349999970, 1490000040, 7.0),
    MissionItem(20, 3, PLACE, 0, 0, 0.0),
]


class Store:
    """The vehicle's end of the protocol, as ArduPilot has it: an upload overwrites as it goes.

    Attributes:
        lists: by MAV_MISSION_TYPE; a mission has home first.
        lost: how many messages to it are lost, by name; negative loses all.
        mute: names of its own messages that are lost, and how many.
        refuse: list and item number -> MAV_MISSION_RESULT.
    """

    def __init__(self, loop: FastLoop, drone: Drone) -> None:
        self._loop, self._drone = loop, drone
        fence = [MissionItem(5001, 0, (3.0, 0, 0, 0), x, y, 0.0) for x, y in ((0, 0), (0, 9), (9, 0))]
        self.lists = {MISSION: [HOME, *OLD], FENCE: fence, RALLY: list[MissionItem]()}
        self.lost: dict[str, int] = {}
        self.mute: dict[str, int] = {}
        self.refuse: dict[tuple[int, int], int] = {}
        self.counts = 0
        self._expected: list[Any] | None = None
        self.received: list[str] = []
        self.spoil = False
        self.spoil_radius = 0.0

    def take(self, message: Any) -> None:
        name = message.get_type()
        if not name.startswith("MISSION"):
            return
        self.received.append(name)
        if self.lost.get(name):
            self.lost[name] -= 1
            return
        handler = getattr(self, name.lower(), None)
        if handler is not None:
            self._loop.call_later(0.01, handler, message)

    def say(self, name: str, component: int = 1, target: tuple[int, int] = (255, 230), **fields: Any) -> None:
        if self.mute.get(name):
            self.mute[name] -= 1
            return
        self._drone.send(name, component, target_system=target[0], target_component=target[1], **fields)

    @property
    def items(self) -> list[MissionItem]:
        return self.lists[MISSION]

    @items.setter
    def items(self, items: list[MissionItem]) -> None:
        self.lists[MISSION] = items

    @property
    def fence(self) -> list[MissionItem]:
        return self.lists[FENCE]

    def ack(self, result: int, kind: int = MISSION) -> None:
        self.say("mission_ack", type=result, mission_type=kind)

    def mission_request_list(self, message: Any) -> None:
        kind = message.mission_type
        self.say("mission_count", count=len(self.lists[kind]), mission_type=kind)

    def mission_request_int(self, message: Any) -> None:
        sent = self.lists[message.mission_type][message.seq].to((255, 230), message.seq, message.mission_type)
        fields = {name: getattr(sent, name) for name in sent.fieldnames if not name.startswith("target")}
        self.say("mission_item_int", **fields)

    def mission_clear_all(self, message: Any) -> None:
        self.lists[message.mission_type] = self.items[:1] if message.mission_type == MISSION else []
        self.ack(mavlink.MAV_MISSION_ACCEPTED, message.mission_type)

    def mission_count(self, message: Any) -> None:
        self.counts += 1
        self._expected = list(range(message.count))
        self.lists[message.mission_type] = self.lists[message.mission_type][: message.count]
        self._ask(message.mission_type)

    def _ask(self, kind: int) -> None:
        assert self._expected is not None
        self.say("mission_request", seq=self._expected[0], mission_type=kind)

    def mission_item_int(self, message: Any) -> None:
        kind = message.mission_type
        if self._expected is None or message.seq != self._expected[0]:
            self.ack(mavlink.MAV_MISSION_INVALID_SEQUENCE, kind)
            return
        if (kind, message.seq) in self.refuse:
            self._expected = None
            self.ack(self.refuse.pop((kind, message.seq)), kind)
            return
        item = from_message(message)
        if self.spoil_radius:
            item = replace(item, params=(item.params[0] + self.spoil_radius, *item.params[1:]))
        self.lists[kind][message.seq : message.seq + 1] = [replace(item, z=item.z + 3) if self.spoil else item]
        self._expected = self._expected[1:] or None
        if self._expected is None:
            self.ack(mavlink.MAV_MISSION_ACCEPTED, kind)
        else:
            self._ask(kind)


@pytest.fixture
def store(loop: FastLoop, drone: Drone, link: FakeLink) -> Store:
    store = Store(loop, drone)
    before = link.on_send

    def on_send(message: Any, system: int) -> None:
        before(message, system)
        store.take(message)

    link.on_send = on_send
    return store


@pytest.mark.parametrize("name", ["MISSION_COUNT", "MISSION_ITEM_INT"])
def test_nothing_more_is_handed_over_once_two_autopilots_have_the_id(
    loop: FastLoop, copter: Vehicle, store: Store, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(copter.state.time_ratio, "has_two_clocks", lambda now: name in store.received)
    with pytest.raises(Busy, match=r"two autopilots.*incomplete now"):
        loop.run(copter.waypoints.upload({MISSION: NEW}))
    assert store.received[-1] == name


def test_download_has_home_and_the_items(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    assert loop.run(copter.waypoints.download()) == (HOME, OLD)
    assert store.received[-1] == "MISSION_ACK"
    store.items = []
    assert loop.run(copter.waypoints.download()) == (None, [])


def test_simultaneous_reads_share_a_download(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    async def read() -> list[Any]:
        return await asyncio.gather(*(copter.waypoints.read() for _ in range(3)))

    assert loop.run(read()) == [(HOME, OLD)] * 3
    assert store.received.count("MISSION_REQUEST_LIST") == 1


def test_read_whose_caller_has_gone_is_there_for_the_next_one(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    gone = loop.create_task(copter.waypoints.read())
    loop.pass_time(0.03)
    gone.cancel()
    assert loop.run(copter.waypoints.read()) == (HOME, OLD)
    assert store.received.count("MISSION_REQUEST_LIST") == 1


def test_reads_fail_together_and_the_next_one_asks_again(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    store.lost["MISSION_REQUEST_LIST"] = 4
    reads = [loop.create_task(copter.waypoints.read()) for _ in range(2)]
    loop.pass_time(10.0)
    assert [type(task.exception()) for task in reads] == [TimedOut, TimedOut]
    assert loop.run(copter.waypoints.read()) == (HOME, OLD)


@pytest.mark.parametrize("verb", ["download", "upload", "clear"])
def test_read_gives_way_to_a_verb_and_begins_anew(loop: FastLoop, copter: Vehicle, store: Store, verb: str) -> None:
    def duration_of(arguments: tuple[Any, ...]) -> float:
        started = loop.time()
        loop.run(getattr(copter.waypoints, verb)(*arguments))
        return float(loop.time() - started)

    store.items = [HOME, *OLD * 50]
    arguments = ({MISSION: store.items[1:]},) if verb == "upload" else ()
    alone = duration_of(arguments)
    store.items = [HOME, *OLD * 50]
    reads = [loop.create_task(read) for read in (copter.waypoints.read(), copter.waypoints.read_list(FENCE))]
    loop.pass_time(0.5)
    assert not reads[0].done()
    assert duration_of(arguments) < alone + 0.1
    assert loop.run(reads[0]) == (HOME, [] if verb == "clear" else OLD * 50)
    assert len(loop.run(reads[1])) == len(store.fence)


def test_the_fence_is_read_by_its_own_list(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    loop.call_later(0.005, store.say, "mission_count")  # another's question about the mission is no answer
    assert loop.run(copter.waypoints.read_list(FENCE)) == store.fence
    assert store.items == [HOME, *OLD]


@pytest.mark.parametrize("name", ["MISSION_REQUEST_LIST", "MISSION_REQUEST_INT"])
def test_lost_requests_are_repeated(loop: FastLoop, copter: Vehicle, store: Store, name: str) -> None:
    store.lost[name] = 3
    assert loop.run(copter.waypoints.download()) == (HOME, OLD)
    store.lost[name] = -1
    with pytest.raises(TimedOut, match="after 4 requests"):
        loop.run(copter.waypoints.download())


def test_upload_replaces_the_mission_and_reports_its_progress(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    reported: list[tuple[int, int]] = []
    loop.run(copter.waypoints.upload({MISSION: NEW}, lambda done, of: reported.append((done, of))))
    assert store.items[1:] == NEW
    assert reported == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_shorter_and_empty_missions_are_replaced_too(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    store.items = [HOME, *NEW]
    loop.run(copter.waypoints.upload({MISSION: OLD}))
    assert store.items[1:] == OLD
    store.items = []
    loop.run(copter.waypoints.upload({MISSION: NEW}))
    assert store.items[1:] == NEW


def test_lost_offer_is_made_again_and_a_lost_ack_is_found_by_reading_back(
    loop: FastLoop, copter: Vehicle, store: Store
) -> None:
    store.lost["MISSION_COUNT"] = 2
    store.mute["mission_ack"] = 1
    loop.run(copter.waypoints.upload({MISSION: NEW}))
    assert store.items[1:] == NEW


def test_refused_item_puts_the_old_mission_back_and_says_so(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    store.refuse[MISSION, 2] = mavlink.MAV_MISSION_UNSUPPORTED
    with pytest.raises(Rejected, match="its old mission .2 items. was put back") as caught:
        loop.run(copter.waypoints.upload({MISSION: NEW}))
    assert caught.value.ack == "MAV_MISSION_UNSUPPORTED"
    assert f"refused to take item 2 ({NEW[1].name}, command {NEW[1].command}) of the mission" in str(caught.value)
    assert store.items[1:] == OLD


def test_refused_upload_to_an_empty_vehicle_leaves_it_empty(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    store.items = [HOME]
    store.refuse[MISSION, 2] = mavlink.MAV_MISSION_INVALID_PARAM7
    with pytest.raises(Rejected, match="no mission, as before"):
        loop.run(copter.waypoints.upload({MISSION: NEW}))
    assert store.items == [HOME]


def test_mission_that_is_read_back_otherwise_is_an_error(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    store.spoil = True
    with pytest.raises(Rejected, match=r"is not the one that was sent: item 1 .* could not be put back"):
        loop.run(copter.waypoints.upload({MISSION: NEW}))


def test_upload_that_nobody_takes_up_leaves_the_old_mission(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    store.lost["MISSION_COUNT"] = -1
    with pytest.raises(TimedOut, match="its old mission is unchanged"):
        loop.run(copter.waypoints.upload({MISSION: NEW}))
    assert store.items[1:] == OLD


def test_transfer_that_was_cancelled_is_tried_once_more(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    store.refuse[MISSION, 1] = mavlink.MAV_MISSION_OPERATION_CANCELLED
    loop.run(copter.waypoints.upload({MISSION: NEW}))
    assert store.items[1:] == NEW
    assert store.counts == 2


def test_lost_link_is_reported_at_once_and_nothing_more_is_sent(
    loop: FastLoop, copter: Vehicle, store: Store, host: Host, drone: Drone
) -> None:
    store.lost["MISSION_ITEM_INT"] = -1
    task = loop.create_task(copter.waypoints.upload({MISSION: NEW}))
    loop.pass_time(1.0)
    drone.power_off()
    with pytest.raises(LinkLost, match="may be incomplete"):
        loop.run(task)


def test_clear_is_verified(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    store.lost["MISSION_CLEAR_ALL"] = 1
    loop.run(copter.waypoints.clear())
    assert store.items == [HOME]


def test_refused_clearing_is_reported(
    loop: FastLoop, copter: Vehicle, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "mission_clear_all", lambda _: store.ack(mavlink.MAV_MISSION_ERROR))
    with pytest.raises(Rejected) as caught:
        loop.run(copter.waypoints.clear())
    assert caught.value.ack == "MAV_MISSION_ERROR"


def test_messages_of_others_to_others_and_about_the_fence_do_not_count(
    loop: FastLoop, copter: Vehicle, store: Store
) -> None:
    store.lost["MISSION_REQUEST_LIST"] = 1
    task = loop.create_task(copter.waypoints.download())
    loop.pass_time(0.1)
    store.say("mission_count", component=190, count=9)
    store.say("mission_count", target=(1, 9), count=9)
    store.say("mission_count", count=9, mission_type=mavlink.MAV_MISSION_TYPE_FENCE)
    assert loop.run(task) == (HOME, OLD)


def test_one_transfer_at_a_time(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    async def both() -> Any:
        return await asyncio.gather(copter.waypoints.upload({MISSION: NEW}), copter.waypoints.download())

    _, downloaded = loop.run(both())
    assert downloaded == (HOME, NEW)
    assert store.counts == 1


def test_read_behind_a_long_transfer_is_refused_and_the_next_has_its_turn(
    loop: FastLoop, copter: Vehicle, store: Store
) -> None:
    store.lost["MISSION_COUNT"] = -1
    upload = loop.create_task(copter.waypoints.upload({MISSION: NEW}))
    loop.pass_time(0.1)
    asked_at = loop.time()
    with pytest.raises(Busy, match="try again"):
        loop.run(copter.waypoints.download())
    assert loop.time() - asked_at == pytest.approx(10.0, abs=0.1) and not upload.done()
    assert loop.run(copter.waypoints.download()) == (HOME, OLD)
    with pytest.raises(TimedOut):
        loop.run(upload)


def test_who_is_cancelled_as_its_turn_comes_leaves_the_turn_to_the_next(
    loop: FastLoop, copter: Vehicle, store: Store
) -> None:
    async def cancelled() -> None:
        task = asyncio.ensure_future(copter.waypoints.download())
        await asyncio.sleep(0)
        await asyncio.sleep(0)  # it has its turn, and does not know it yet
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    for _ in range(3):
        loop.run(cancelled())
    assert loop.run(copter.waypoints.download()) == (HOME, OLD)


CIRCLE = MissionItem(5003, 0, (40.0, 0.0, 0.0, 0.0), 10, 20, 0.0)
POINT = MissionItem(5100, 3, PLACE, 10, 20, 30.5)


def test_all_lists_of_an_upload_are_put_and_the_others_stay(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    reported: list[tuple[int, int]] = []
    loop.run(copter.waypoints.upload({FENCE: [CIRCLE], RALLY: [POINT]}, lambda done, of: reported.append((done, of))))
    assert store.lists == {MISSION: [HOME, *OLD], FENCE: [CIRCLE], RALLY: [POINT]}
    assert reported == [(1, 2), (2, 2)]
    loop.run(copter.waypoints.clear(FENCE))
    assert store.lists == {MISSION: [HOME, *OLD], FENCE: [], RALLY: [POINT]}


@pytest.mark.parametrize("refused", [FENCE, RALLY, MISSION])
def test_a_list_that_is_refused_takes_those_before_it_back(
    loop: FastLoop, copter: Vehicle, store: Store, refused: int
) -> None:
    before = {kind: list(items) for kind, items in store.lists.items()}
    store.refuse[refused, 0 if refused != MISSION else 1] = mavlink.MAV_MISSION_UNSUPPORTED
    with pytest.raises(Rejected, match="item 1 ") as caught:
        loop.run(copter.waypoints.upload({FENCE: [CIRCLE], RALLY: [POINT], MISSION: NEW}))
    assert store.lists == before
    assert str(caught.value).count(";") == {FENCE: 1, RALLY: 2, MISSION: 3}[refused]


def test_a_fence_of_another_size_than_was_sent_is_refused(loop: FastLoop, copter: Vehicle, store: Store) -> None:
    item = replace(CIRCLE, params=(40.5, 0.0, 0.0, 0.0))
    store.spoil_radius = 1.0
    with pytest.raises(Rejected, match="has 41.5 corners or m, not 40.5"):
        loop.run(copter.waypoints.upload({FENCE: [item]}))


def test_a_flown_mission_is_not_changed_and_its_fence_is(
    loop: FastLoop, copter: Vehicle, flying: Drone, store: Store
) -> None:
    flying.pilot("AUTO")
    loop.settle()
    for verb in (copter.waypoints.upload({MISSION: NEW}), copter.waypoints.clear()):
        with pytest.raises(Busy, match="flies its mission"):
            loop.run(verb)
    assert store.items == [HOME, *OLD]
    loop.run(copter.waypoints.upload({FENCE: [CIRCLE]}))
