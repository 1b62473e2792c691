from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core import host as hosts
from mavproxy_uavapi.core.audit import FILE
from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.message_waiter import MessageWaiter
from mavproxy_uavapi.core.mainloop.bridge import Bridge
from mavproxy_uavapi.core.sent_messages import note_sent
from tests.support.mavproxy import MainLoop
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink


@pytest.fixture
def hear(loop: FastLoop, host: Host) -> Callable[..., None]:
    """Feed one message and let it be received."""

    def hear(name: str, **fields: Any) -> None:
        host.bridge.feed(message_of(name, **fields))
        host.bridge.turn()
        loop.settle()

    return hear


@pytest.fixture
def wait_for(loop: FastLoop, host: Host) -> Callable[..., Any]:
    """A task that waits for a message of a vehicle."""

    def wait_for(name: str, system: int = 1, timeout: float = 60.0) -> Any:
        waiting = MessageWaiter(host.fleet.vehicles[system], host.pending, host.clock)
        task = loop.create_task(waiting.message({name}, lambda message: message, timeout, f"send {name}"))
        loop.settle()
        return task

    return wait_for


def test_message_is_known_before_its_waiters_wake(
    loop: FastLoop, host: Host, hear: Callable[..., None], wait_for: Callable[..., Any]
) -> None:
    hear("heartbeat")
    task = wait_for("ATTITUDE")
    hear("attitude", yaw=1.5)
    assert loop.run(task).yaw == 1.5
    assert host.fleet.vehicles[1].field("ATTITUDE", "yaw") == 1.5


def test_listeners_hear_of_vehicles_only(host: Host, hear: Callable[..., None]) -> None:
    heard: list[Any] = []
    host.listeners.append(lambda state, message, now: heard.append((state.system, message.get_type(), now)))
    hear("attitude", system=5)
    hear("heartbeat")
    hear("attitude")
    assert heard == [(1, "HEARTBEAT", 1000.0), (1, "ATTITUDE", 1000.0)]


def test_wait_ends_when_the_heartbeats_stop(
    loop: FastLoop, host: Host, hear: Callable[..., None], wait_for: Callable[..., Any]
) -> None:
    hear("heartbeat")
    task = wait_for("ATTITUDE")
    started = loop.time()
    with pytest.raises(LinkLost, match=r"no heartbeat from vehicle 1 for 5\.0 s"):
        loop.run(task)
    assert loop.time() - started == pytest.approx(host.link_watch.timeout, abs=0.1)


def test_other_messages_do_not_keep_a_link_alive(
    loop: FastLoop, host: Host, hear: Callable[..., None], wait_for: Callable[..., Any]
) -> None:
    hear("heartbeat")
    task = wait_for("VFR_HUD")
    for _ in range(12):
        loop.pass_time(0.5)
        hear("attitude")
    assert isinstance(task.exception(), LinkLost)
    assert not host.link_watch.is_alive(host.fleet.vehicles[1])


def test_wait_that_begins_on_a_lost_link_fails_soon(
    loop: FastLoop, hear: Callable[..., None], wait_for: Callable[..., Any]
) -> None:
    hear("heartbeat")
    loop.pass_time(20.0)
    task = wait_for("ATTITUDE")
    started = loop.time()
    with pytest.raises(LinkLost):
        loop.run(task)
    assert loop.time() - started <= 1.0


def test_link_recovers(loop: FastLoop, host: Host, hear: Callable[..., None], wait_for: Callable[..., Any]) -> None:
    hear("heartbeat")
    loop.pass_time(20.0)
    assert not host.link_watch.is_alive(host.fleet.vehicles[1])
    hear("heartbeat")
    assert host.link_watch.is_alive(host.fleet.vehicles[1])
    task = wait_for("ATTITUDE")
    loop.pass_time(3.0)
    hear("attitude", yaw=2.0)
    assert loop.run(task).yaw == 2.0


def test_heartbeats_keep_a_wait_going(
    loop: FastLoop, hear: Callable[..., None], wait_for: Callable[..., Any]
) -> None:
    hear("heartbeat")
    task = wait_for("ATTITUDE")
    for _ in range(30):
        loop.pass_time(1.0)
        hear("heartbeat")
    assert not task.done()


def test_loss_of_one_vehicle_leaves_the_waits_on_another(
    loop: FastLoop, hear: Callable[..., None], wait_for: Callable[..., Any]
) -> None:
    hear("heartbeat", system=1)
    hear("heartbeat", system=2)
    lost, kept = wait_for("ATTITUDE", 1), wait_for("ATTITUDE", 2)
    for _ in range(8):
        loop.pass_time(1.0)
        hear("heartbeat", system=2)
    assert isinstance(lost.exception(), LinkLost)
    assert not kept.done()


def test_link_timeout_can_be_set(
    loop: FastLoop, host: Host, hear: Callable[..., None], wait_for: Callable[..., Any]
) -> None:
    host.link_watch.timeout = 2.0
    hear("heartbeat")
    task = wait_for("ATTITUDE")
    started = loop.time()
    with pytest.raises(LinkLost):
        loop.run(task)
    assert loop.time() - started == pytest.approx(2.0, abs=0.1)


# -- membership -------------------------------------------------------------------------------------------


def received(host: Host) -> list[int]:
    """The yaws that the host has received so far, after all that was fed."""

    async def look() -> list[int]:
        await asyncio.sleep(0)
        state = host.fleet.vehicles.get(1)
        return [] if state is None else [state.packets.received]

    return host.bridge.run(look())


def test_first_member_makes_the_host_and_the_last_ends_it(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, "uavapi")
    assert hosts.join(mpstate, "vision") is host
    host.idle("uavapi")
    hosts.leave(mpstate, "uavapi")
    assert host.bridge.running
    assert getattr(mpstate, hosts.ATTRIBUTE) is host
    hosts.leave(mpstate, "vision")
    assert not host.bridge.running
    assert not hasattr(mpstate, hosts.ATTRIBUTE)
    assert mpstate.select_extra == {}


def test_first_members_feed_counts_alone_and_moves_on_when_it_leaves(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, "uavapi")
    hosts.join(mpstate, "vision")
    try:
        host.idle("uavapi")
        heartbeat = message_of("heartbeat")
        host.feed("uavapi", heartbeat)
        host.feed("vision", heartbeat)
        host.feed("uavapi", message_of("attitude", sequence=1))
        host.feed("vision", message_of("attitude", sequence=2))
        host.idle("uavapi")
        assert received(host) == [2]
        hosts.leave(mpstate, "uavapi")
        host.feed("vision", message_of("attitude", sequence=2))
        host.idle("vision")
        assert received(host) == [3]
    finally:
        hosts.leave(mpstate, "vision")


def test_nothing_is_opened_for_select_before_the_first_idle_task(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, "uavapi")
    try:
        assert mpstate.select_extra == {}
        assert not host.bridge.running
        host.idle("vision")
        assert not host.bridge.running
    finally:
        hosts.leave(mpstate, "uavapi")


def test_idle_passes_mavproxys_target_to_the_asyncio_side(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, "uavapi")
    try:
        host.idle("uavapi")
        mpstate.settings.target_system = 3
        host.idle("uavapi")
        received(host)
        assert host.registry.current == 3
    finally:
        hosts.leave(mpstate, "uavapi")


def test_idle_passes_on_whether_mavproxy_requests_streams(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, "uavapi")
    now = [100.0]
    host.registry.clock = lambda: now[0]
    try:
        for name, rate, are_off in (("streamrate", -1, True), ("streamrate", 4, False), ("streamrate2", 0, True)):
            setattr(mpstate.settings, name, rate)
            now[0] += 1.0
            host.idle("uavapi")
            received(host)
            assert host.registry.streams_are_off is are_off
    finally:
        hosts.leave(mpstate, "uavapi")


def test_what_nobody_waits_for_is_sent_by_the_main_loop_or_at_the_end(mpstate: SimpleNamespace) -> None:
    written = mpstate.the_master.written
    host = hosts.join(mpstate, "uavapi")
    try:
        host.idle("uavapi")
        host.send_unwaited([("first", 1)])
        host.idle("uavapi")
        assert written == ["first"]
        host.send_unwaited([("second", 1)])
    finally:
        hosts.leave(mpstate, "uavapi")
    assert written == ["first", "second"]


def parameters(host: Host, system: int = 1) -> dict[str, float]:
    """What the asyncio side knows of a vehicle's parameters, after all that was fed."""

    async def look() -> dict[str, float]:
        await asyncio.sleep(0)
        return dict(host.fleet.vehicles[system].parameters)

    return host.bridge.run(look())


def test_parameters_mavproxy_fetched_are_known_from_the_first_idle_task(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, "uavapi")
    now = [100.0]
    host.clock = lambda: now[0]
    try:
        mpstate.mav_param_by_sysid[1, 1] = {"RTL_ALT": 1500.0, "LAND_SPEED": 50.0}
        host.idle("uavapi")
        host.feed("uavapi", message_of("heartbeat"))
        host.idle("uavapi")
        assert parameters(host) == {"RTL_ALT": 1500.0, "LAND_SPEED": 50.0}
        mpstate.mav_param_by_sysid[1, 1]["RTL_ALT"] = 1800.0  # by FTP, without a PARAM_VALUE
        now[0] += 2.0
        host.idle("uavapi")
        host.feed("uavapi", message_of("param_value", param_id="RTL_ALT", param_value=2000.0))
        host.idle("uavapi")
        assert parameters(host) == {"RTL_ALT": 2000.0, "LAND_SPEED": 50.0}
    finally:
        hosts.leave(mpstate, "uavapi")


def test_parameters_of_an_earlier_session_are_not_taken_for_the_vehicles(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, "uavapi")
    try:
        mpstate.continue_mode = True
        mpstate.mav_param_by_sysid[1, 1] = {"RTL_ALT": 1500.0}
        host.idle("uavapi")
        host.feed("uavapi", message_of("heartbeat"))
        host.idle("uavapi")
        assert parameters(host) == {}
    finally:
        hosts.leave(mpstate, "uavapi")


def test_idle_sends_what_is_to_be_sent_even_when_select_does_not_wake(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, "uavapi")
    try:
        host.idle("uavapi")
        ran: list[int] = []
        host.bridge.post(lambda: ran.append(1))
        host.idle("uavapi")
        assert ran == [1]
    finally:
        hosts.leave(mpstate, "uavapi")


def test_host_is_made_again_after_the_last_member_left(
    mpstate: SimpleNamespace, descriptors: Callable[[], int], threads: Callable[[], list[str]]
) -> None:
    names, before, seen = threads(), descriptors(), set()
    for _ in range(50):
        host = hosts.join(mpstate, "uavapi")
        host.idle("uavapi")
        seen.add(id(host.bridge.loop))
        hosts.leave(mpstate, "uavapi")
    assert threads() == names
    assert descriptors() == before


def test_trail_of_a_job_without_http_is_written_as_the_last_module_leaves(
    mpstate: SimpleNamespace, main_loop: MainLoop, tmp_path: Path
) -> None:
    mpstate.status.logdir = str(tmp_path)
    host = hosts.join(mpstate, "vision")
    host.bridge.start()

    async def fly() -> None:
        async def body(_job: Any) -> str:
            note_sent("COMMAND_LONG")
            return "landed"

        await host.jobs.begin(
            SimpleNamespace(state=SimpleNamespace(system=7)), "/vision/land", {"id": 3}, body
        ).outcome()

    host.bridge.run(fly())
    hosts.leave(mpstate, "vision")
    (line,) = (tmp_path / FILE).read_text(encoding="ascii").splitlines()
    entry = json.loads(line)
    assert (entry["client"], entry["verb"], entry["outcome"]) == ("console", "/vision/land", "ok")
    assert (entry["detail"], entry["sent"], entry["system"]) == ("landed", ["COMMAND_LONG"], 7)


def test_chore_that_fails_keeps_no_message_from_its_vehicle(
    loop: FastLoop, host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    host.members.append("uavapi")
    monkeypatch.setattr(host.bridge, "start", lambda: None)  # the test's loop runs already
    monkeypatch.setattr(host.mavproxy_watch, "_share_load", lambda: 1 / 0)
    host.feed("uavapi", message_of("heartbeat"))
    with pytest.raises(ZeroDivisionError):
        host.idle("uavapi")
    loop.settle()
    host.idle("uavapi")  # the next look comes later
    assert 1 in host.fleet.vehicles


def test_host_ends_even_if_its_loop_does_not_answer(
    mpstate: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Bridge.run, "__defaults__", (0.1,))
    host = hosts.join(mpstate, "uavapi")
    host.idle("uavapi")
    host.bridge.call_soon(time.sleep, 0.5)
    time.sleep(0.05)
    with pytest.raises(TimeoutError):
        hosts.leave(mpstate, "uavapi")
    assert not host.bridge.running and mpstate.select_extra == {}


def test_picture_is_told_if_somebody_took_it_with_the_autopilots_place(host: Host, hear: Callable[..., None]) -> None:
    told: list[Any] = []
    taken: list[Any] = []

    def observe(name: str, system: int, _ago: float, info: Any) -> None:
        if name == "picture":
            told.append((name, system, info["lat"]))

    host.observers.append(observe)
    host.on_picture.append(lambda system, tag, jpeg: taken.append((system, tag.lat, len(jpeg))))
    hear("heartbeat")
    hear("global_position_int", lat=-353632621, lon=1491652374, alt=584_000)
    jpeg = b"\xff\xd8\xff\xdb\x00\x04\x00\x00"
    looked_at = host.geotagged(1, jpeg, host.clock(), is_taken=False)
    assert looked_at != jpeg and told == taken == []
    host.geotagged(1, jpeg, host.clock())
    assert told == [("picture", 1, None)], "it has no position yet"
    flags = mavlink.EKF_POS_HORIZ_ABS | mavlink.EKF_ATTITUDE
    hear("ekf_status_report", flags=flags)
    picture = host.geotagged(1, jpeg, host.clock())
    assert told[-1] == ("picture", 1, -35.3632621) and taken[-1] == (1, -35.3632621, len(picture))
    host.geotagged(99, jpeg, host.clock())
    assert told[-1] == ("picture", 99, None), "nobody knows that vehicle"


def test_ports_of_links_and_outputs_are_known(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, "uavapi")
    try:
        host.idle("uavapi")
        assert host.mavlink_ports == [12345, 14560]
    finally:
        hosts.leave(mpstate, "uavapi")
