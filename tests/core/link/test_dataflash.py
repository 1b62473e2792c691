"""The log protocol against a scripted vehicle that loses messages, falls silent, or serves others."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import Aborted, Busy, LinkLost, NotFound, TimedOut, ToolFailed
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.dataflash import CHUNK, NO_NEWS_TIMEOUT
from mavproxy_uavapi.core.link.log_pieces import PIECE, LogEntry
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.fake_link import FakeLink
from tests.support.log_vehicle import LogVehicle
from tests.support.virtual_time import FastLoop


@pytest.fixture
def vehicle(loop: FastLoop, drone: Drone, link: FakeLink) -> LogVehicle:
    loop.settle()
    return LogVehicle(loop, drone, link)


class Saved:
    """What was saved of a log, and the reports."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.reports: list[tuple[int, int]] = []

    async def save(self, parts: Sequence[tuple[int, bytes]]) -> None:
        for start, data in parts:
            self.data.extend(bytes(max(start + len(data) - len(self.data), 0)))
            self.data[start : start + len(data)] = data

    def report(self, done: int, of: int) -> None:
        self.reports.append((done, of))


async def download(copter: Vehicle, saved: Saved, number: int = 2, **options: Any) -> None:
    entry = await copter.logs.find(number, **options)
    await copter.logs.fetch(entry, saved.save, saved.report, **options)


def begin(loop: FastLoop, copter: Vehicle, seconds: float = 0.5) -> tuple[asyncio.Task[None], Saved]:
    """A download of which some has arrived."""
    saved = Saved()
    task = loop.create_task(download(copter, saved))
    loop.pass_time(seconds)
    assert copter.logs.fetching is not None and not task.done()
    return task, saved


def test_list_has_size_and_time(loop: FastLoop, copter: Vehicle, vehicle: LogVehicle) -> None:
    assert copter.logs.newest is None
    expected = [LogEntry(1, 1024, None), LogEntry(2, 250_001, 1_790_000_000)]
    assert loop.run(copter.logs.read_list()) == expected
    assert copter.logs.newest == (expected, loop.time())
    assert vehicle.names() == ["LOG_REQUEST_LIST"]
    vehicle.logs = {}
    assert loop.run(copter.logs.read_list()) == []


def test_lost_entries_are_requested_again(loop: FastLoop, copter: Vehicle, vehicle: LogVehicle) -> None:
    vehicle.logs = {number: bytes(number) for number in range(1, 30)}
    vehicle.loss = 0.4
    listed = loop.run(copter.logs.read_list())
    assert [(entry.id, entry.size) for entry in listed] == [(number, number) for number in range(1, 30)]


def test_vehicle_that_lists_nothing_is_a_timeout_with_its_texts(
    loop: FastLoop, copter: Vehicle, vehicle: LogVehicle, drone: Drone
) -> None:
    vehicle.mute.add("LOG_ENTRY")
    began = loop.time()
    loop.call_later(1.0, drone.say, "No logs here")
    with pytest.raises(TimedOut, match="did not list its logs") as caught:
        loop.run(copter.logs.read_list())
    assert caught.value.statustext == ["No logs here"]
    assert NO_NEWS_TIMEOUT <= loop.time() - began < NO_NEWS_TIMEOUT + 2.0


@pytest.mark.parametrize("loss", [0.0, 0.02, 0.2])
def test_download_is_complete_whatever_is_lost(
    loop: FastLoop, copter: Vehicle, vehicle: LogVehicle, loss: float
) -> None:
    vehicle.loss = loss
    saved = Saved()
    loop.run(download(copter, saved))
    assert saved.data == vehicle.logs[2]
    assert len(saved.reports) == math.ceil(250_001 / PIECE) and saved.reports[-1] == (250_001, 250_001)
    assert [done for done, _ in saved.reports] == sorted({done for done, _ in saved.reports})
    assert copter.logs.fetching is None
    if not loss:
        loop.pass_time(0.1)
        requests = [fields for name, fields in vehicle.received if name == "LOG_REQUEST_DATA"]
        assert [(fields["ofs"], fields["count"]) for fields in requests] == [
            (0, CHUNK),
            (CHUNK, CHUNK),
            (2 * CHUNK, 250_001 - 2 * CHUNK),
        ]
        assert vehicle.names()[-1] == "LOG_REQUEST_END"


def test_empty_log_is_downloaded(loop: FastLoop, copter: Vehicle, vehicle: LogVehicle) -> None:
    vehicle.logs[2] = b""
    saved = Saved()
    loop.run(download(copter, saved))
    assert saved.data == b""


def test_log_that_the_vehicle_does_not_have_is_not_found(
    loop: FastLoop, copter: Vehicle, vehicle: LogVehicle
) -> None:
    with pytest.raises(NotFound, match="has no log 7"):
        loop.run(download(copter, Saved(), 7))


def test_vehicle_that_falls_silent_ends_the_download_and_is_told(
    loop: FastLoop, copter: Vehicle, vehicle: LogVehicle
) -> None:
    task, _ = begin(loop, copter)
    vehicle.mute.add("LOG_DATA")
    began = loop.time()
    with pytest.raises(TimedOut, match="did not send the rest of log 2"):
        loop.run(task)
    assert NO_NEWS_TIMEOUT <= loop.time() - began < NO_NEWS_TIMEOUT + 2.0
    loop.pass_time(0.1)
    assert vehicle.names()[-1] == "LOG_REQUEST_END"
    vehicle.mute.clear()
    loop.run(download(copter, Saved()))


def test_cancelled_download_tells_the_vehicle_to_stop(loop: FastLoop, copter: Vehicle, vehicle: LogVehicle) -> None:
    task, _ = begin(loop, copter)
    task.cancel()
    loop.pass_time(0.1)
    assert vehicle.names()[-1] == "LOG_REQUEST_END"
    assert copter.logs.fetching is None
    saved = Saved()
    loop.run(download(copter, saved, 1))
    assert saved.data == vehicle.logs[1], "what still arrived of the first one harms nobody"


def test_lost_link_ends_the_download_and_nothing_more_is_sent(
    loop: FastLoop, copter: Vehicle, vehicle: LogVehicle, drone: Drone, host: Host
) -> None:
    task, _ = begin(loop, copter)
    vehicle.mute.add("LOG_DATA")
    loop.call_later(0.5, host.pending.fail, 1, lambda: LinkLost("no heartbeat"))
    with pytest.raises(LinkLost):
        loop.run(task)
    loop.pass_time(0.1)
    assert "LOG_REQUEST_END" not in vehicle.names()


def test_disk_that_is_full_ends_the_download_and_the_vehicle_is_told(
    loop: FastLoop, copter: Vehicle, vehicle: LogVehicle
) -> None:
    async def full(_parts: Any) -> None:
        raise ToolFailed("no room")

    entry = loop.run(copter.logs.find(2))
    with pytest.raises(ToolFailed):
        loop.run(copter.logs.fetch(entry, full, lambda *_: None))
    loop.pass_time(0.1)
    assert vehicle.names()[-1] == "LOG_REQUEST_END"


def test_armed_vehicle_is_not_asked(loop: FastLoop, copter: Vehicle, vehicle: LogVehicle, drone: Drone) -> None:
    entry = loop.run(copter.logs.find(1))
    drone.fly()
    loop.settle()
    vehicle.received.clear()
    for refused in (copter.logs.read_list(), copter.logs.fetch(entry, Saved().save, lambda *_: None)):
        with pytest.raises(Busy, match="is armed"):
            loop.run(refused)
    assert vehicle.received == []
    with pytest.raises(TimedOut):
        loop.run(copter.logs.read_list(while_armed=True))
    assert "LOG_REQUEST_LIST" in vehicle.names()


def test_vehicle_that_is_armed_ends_the_download(
    loop: FastLoop, copter: Vehicle, vehicle: LogVehicle, drone: Drone
) -> None:
    task, _ = begin(loop, copter)
    drone.fly()
    with pytest.raises(Busy, match="is armed"):
        loop.run(task)


def test_vehicle_that_boots_ends_the_download(
    loop: FastLoop, copter: Vehicle, vehicle: LogVehicle, drone: Drone
) -> None:
    task, _ = begin(loop, copter)
    drone.reboot()
    drone.tell_all()
    with pytest.raises(Aborted, match="booted"):
        loop.run(task)


def test_one_download_at_a_time(loop: FastLoop, copter: Vehicle, vehicle: LogVehicle) -> None:
    task, saved = begin(loop, copter)
    for refused in (copter.logs.read_list(), download(copter, Saved(), 1)):
        with pytest.raises(Busy, match="log 2 of vehicle 1 is being downloaded"):
            loop.run(refused)
    loop.run(task)
    assert saved.data == vehicle.logs[2]


def test_lists_wait_for_each_other(loop: FastLoop, copter: Vehicle, vehicle: LogVehicle) -> None:
    async def both() -> Any:
        return await asyncio.gather(copter.logs.read_list(), copter.logs.read_list())

    first, second = loop.run(both())
    assert first == second


def test_download_of_another_program_is_not_disturbed(loop: FastLoop, copter: Vehicle, vehicle: LogVehicle) -> None:
    vehicle.send_to_others(2)
    loop.pass_time(0.1)
    for refused in (copter.logs.read_list(), download(copter, Saved(), 1)):
        with pytest.raises(Busy, match="another program downloads log 2"):
            loop.run(refused)
    assert vehicle.received == []
    loop.pass_time(10.0)
    saved = Saved()
    loop.run(download(copter, saved, 1))
    assert saved.data == vehicle.logs[1]


def test_other_program_that_comes_in_between_keeps_the_vehicle(
    loop: FastLoop, copter: Vehicle, vehicle: LogVehicle
) -> None:
    task, _ = begin(loop, copter)
    vehicle.logs[1], vehicle.interval = bytes(150_000), 0.3
    vehicle.send_to_others(1)
    with pytest.raises(Busy, match="another program downloads log 1"):
        loop.run(task)
    loop.pass_time(0.1)
    assert "LOG_REQUEST_END" not in vehicle.names()


def test_piece_that_no_log_has_is_ignored(loop: FastLoop, copter: Vehicle, vehicle: LogVehicle, drone: Drone) -> None:
    task, saved = begin(loop, copter)
    drone.send("log_data", id=2, ofs=0xFFFFFFF0, count=90, data=[7] * 90)
    drone.send("log_data", id=2, ofs=250_000, count=255, data=[*vehicle.logs[2][250_000:], *[7] * 89])
    drone.send("log_data", component=9, id=2, ofs=200_000, count=90, data=[7] * 90)
    loop.run(task)
    assert saved.data == vehicle.logs[2]
