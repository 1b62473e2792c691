from __future__ import annotations

import asyncio
from typing import Any

import pytest

from mavproxy_uavapi.core.control.authority import CommandAuthority, Rank
from mavproxy_uavapi.core.control.jobs import FINISHED_KEPT, Ending, Job, JobBook
from mavproxy_uavapi.core.errors import Aborted, NotArmed, Superseded, TimedOut, UavApiError
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from tests.support.virtual_time import FastLoop


class Bench:
    """A job book, a vehicle's authority, and verbs that take it and last until they are let go."""

    def __init__(self, loop: FastLoop) -> None:
        self.loop, self.book = loop, JobBook()
        self.authority = CommandAuthority(VehicleState(1, 1, 2, 0.0))
        self.go = asyncio.Event()
        self.begun: list[str] = []
        self.ended: list[str] = []

    def begin(self, verb: str = "/a", settle: bool = True, outlives_client: bool = False, **request: Any) -> Job:
        async def body(job: Job) -> str:
            self.authority.take(job, Rank.MOVEMENT)
            self.begun.append(verb)
            try:
                await self.go.wait()
            finally:
                self.ended.append(verb)
            return f"{verb} done"

        return self.begin_body(body, verb, settle, outlives_client, **request)

    def begin_body(
        self, body: Any, verb: str = "/a", settle: bool = True, outlives: bool = False, **request: Any
    ) -> Job:
        async def begin() -> Job:
            return self.book.begin(self.authority, verb, request, body, client="10.0.0.7", outlives_client=outlives)

        job = self.loop.run(begin())
        if settle:
            self.loop.settle()
        return job

    def client(self, job: Job, script: str | None = None) -> asyncio.Task[str]:
        task = self.loop.create_task(job.outcome(script))
        self.loop.settle()
        return task

    def go_on_for(self, job: Job, script: str | None) -> None:
        async def session() -> str | None:
            return script

        self.loop.run(job.go_on_for(session()))


@pytest.fixture
def bench(loop: FastLoop) -> Bench:
    return Bench(loop)


def test_outcome_is_the_text_of_success(bench: Bench) -> None:
    job = bench.begin()
    client = bench.client(job)
    assert job.running
    bench.go.set()
    assert bench.loop.run(client) == "/a done"
    assert not job.running
    assert job.result == "/a done"


def test_outcome_raises_what_the_verb_raised(bench: Bench) -> None:
    async def body(_job: Job) -> str:
        raise NotArmed("arm first")

    job = bench.begin_body(body)
    with pytest.raises(NotArmed, match="arm first"):
        bench.loop.run(job.outcome())


def test_defect_of_ours_reaches_the_client_and_the_log(bench: Bench) -> None:
    async def body(_job: Job) -> str:
        raise KeyError("oops")

    job = bench.begin_body(body)
    with pytest.raises(
        UavApiError, match=r"/a failed because of a defect in this program: KeyError\('oops'\)"
    ) as caught:
        bench.loop.run(job.outcome())
    assert (caught.value.status, caught.value.code) == (500, "internal")
    job._task = None  # the log is written when the task is collected
    import gc

    gc.collect()
    assert [str(defect["exception"]) for defect in bench.loop.defects] == ["'oops'"]
    bench.loop.defects.clear()


def test_newer_verb_supersedes_at_once_and_the_older_does_nothing_more(bench: Bench) -> None:
    older = bench.client(bench.begin("/old"))
    started = bench.loop.time()
    newer = bench.client(bench.begin("/new"))
    with pytest.raises(Superseded, match="^/old was superseded by /new$"):
        bench.loop.run(older)
    assert bench.ended == ["/old"]
    assert bench.loop.time() == started
    assert not newer.done()


def test_same_verb_with_another_target_supersedes(bench: Bench) -> None:
    older = bench.client(bench.begin("/go", x=1))
    bench.begin("/go", x=2)
    with pytest.raises(Superseded):
        bench.loop.run(older)


def test_identical_request_joins(bench: Bench) -> None:
    first = bench.begin("/go", x=1)
    second = bench.begin("/go", x=1)
    assert second is first
    assert bench.begun == ["/go"]
    clients = [bench.client(first), bench.client(second)]
    bench.go.set()
    assert [bench.loop.run(client) for client in clients] == ["/go done"] * 2


def test_identical_request_joins_even_before_the_first_has_begun(bench: Bench) -> None:
    async def body(job: Job) -> str:
        bench.begun.append(job.id)
        await bench.go.wait()
        return "done"

    async def in_one_go() -> list[Job]:
        vehicles = (bench.authority, bench.authority, object())
        return [bench.book.begin(vehicle, "/go", {"x": 1}, body) for vehicle in vehicles]

    first, second, for_another_vehicle = bench.loop.run(in_one_go())
    bench.loop.settle()
    assert second is first
    assert for_another_vehicle is not first
    assert bench.begun == [first.id, for_another_vehicle.id]


def test_request_after_the_end_of_an_identical_one_begins_a_new_job(bench: Bench) -> None:
    bench.go.set()
    first = bench.begin("/go", x=1)
    assert bench.begin("/go", x=1) is not first
    assert bench.begun == ["/go", "/go"]


def test_job_ends_when_its_last_client_has_gone(bench: Bench) -> None:
    job = bench.begin()
    clients = [bench.client(job), bench.client(job)]
    clients[0].cancel()
    bench.loop.settle()
    assert job.running
    clients[1].cancel()
    bench.loop.settle()
    assert isinstance(job.error, Aborted)
    assert bench.ended == ["/a"]


def test_landing_outlives_its_client(bench: Bench) -> None:
    job = bench.begin("/land", outlives_client=True)
    bench.client(job).cancel()
    bench.loop.settle()
    assert job.running
    bench.go.set()
    bench.loop.settle()
    assert job.result == "/land done"


def test_job_that_goes_on_for_somebody_outlives_the_client_who_began_it(bench: Bench) -> None:
    job = bench.begin()
    client = bench.client(job)
    bench.go_on_for(job, None)
    client.cancel()
    bench.loop.settle()
    assert job.running


def test_job_goes_on_while_it_is_not_known_who_asks(bench: Bench) -> None:
    job = bench.begin()
    session: asyncio.Future[str | None] = bench.loop.create_future()
    asks = bench.loop.create_task(job.go_on_for(session))
    bench.loop.settle()
    bench.client(job).cancel()
    bench.loop.settle()
    assert job.running
    asks.cancel()  # it hung up before that was known
    bench.loop.settle()
    bench.client(job).cancel()
    bench.loop.settle()
    assert job.running


def test_job_ends_with_the_script_that_alone_requested_it(bench: Bench) -> None:
    job = bench.begin()
    bench.go_on_for(job, "a")
    bench.client(job, "a")
    job.end_with_script()
    assert (job.ending, str(job.error)) == (Ending.SCRIPT_GONE, "/a: its script died")


@pytest.mark.parametrize("first", [None, "a"])
def test_job_that_somebody_else_requested_goes_on_without_the_script(bench: Bench, first: str | None) -> None:
    job = bench.begin()
    for asker in (None, "a") if first is None else ("a", None):
        bench.go_on_for(job, asker)
    assert job.script == "a"
    job.end_with_script()
    assert (job.running, job.script) == (True, None)


def test_awaited_job_ends_with_its_client_once_the_script_is_dead(bench: Bench) -> None:
    job = bench.begin()
    client = bench.client(job)
    bench.go_on_for(job, "a")
    job.end_with_script()
    assert job.running
    client.cancel()
    bench.loop.settle()
    assert job.ending is Ending.CLIENT_GONE


def test_job_of_two_scripts_ends_with_the_one_that_requested_last(bench: Bench) -> None:
    job = bench.begin()
    bench.go_on_for(job, "a")
    bench.go_on_for(job, "b")
    assert job.script == "b"
    job.end_with_script()
    assert job.ending is Ending.SCRIPT_GONE


def test_verb_that_is_refused_does_not_take_the_command(bench: Bench) -> None:
    async def refused(_job: Job) -> str:
        raise NotArmed("arm first")

    flying = bench.begin("/go")
    bench.begin_body(refused, "/other")
    assert flying.running


def test_abort_remote_ends_every_job_that_came_over_the_network(bench: Bench) -> None:
    clients = [bench.client(bench.begin("/land", outlives_client=True))]
    bench.loop.run(asyncio.sleep(0))
    assert [job.verb for job in bench.book.running()] == ["/land"]
    bench.book.abort_remote("the API is stopping")
    with pytest.raises(Aborted, match="^/land: the API is stopping$"):
        bench.loop.run(clients[0])
    assert bench.book.running() == []


def test_abort_remote_leaves_what_protects_a_vehicle(bench: Bench) -> None:
    protecting = bench.begin("brake at the envelope", outlives_client=True)
    protecting.protects = True
    bench.book.abort_remote("the API is stopping")
    assert protecting.running


def test_old_finished_jobs_are_forgotten_and_running_ones_are_not(bench: Bench) -> None:
    running = bench.begin("/land")

    async def quick(_job: Job) -> str:
        return "done"

    for _ in range(FINISHED_KEPT + 20):
        bench.begin_body(quick, "/quick")
    assert bench.book.running() == [running]
    assert len(bench.book._jobs) <= FINISHED_KEPT + 2


def test_first_outcome_counts(bench: Bench) -> None:
    job = bench.begin()
    job.abort(Superseded("first"))
    job.abort(Aborted("second"))
    with pytest.raises(Superseded, match="first"):
        bench.loop.run(job.outcome())


def test_job_never_outlives_its_timeout_and_says_how_far_it_had_to_go(bench: Bench) -> None:
    async def body(job: Job) -> str:
        bench.authority.take(job, Rank.MOVEMENT)
        job.progress = {"distance_to_go": 12.34, "altitude": 5.0}
        await asyncio.sleep(100)
        return "never"

    async def begin() -> Job:
        return bench.book.begin(bench.authority, "/a", {}, body, timeout=3.0)

    began = bench.loop.time()
    job = bench.loop.run(begin())
    with pytest.raises(TimedOut, match="/a was not done within 3 s: 12.3 m to go"):
        bench.loop.run(job.outcome())
    assert bench.loop.time() - began == pytest.approx(3.0)


def test_job_keeps_its_error_without_what_led_to_it(bench: Bench) -> None:
    async def body(job: Job) -> str:
        try:
            raise TimeoutError
        except TimeoutError as error:
            raise NotArmed("the vehicle is not armed") from error

    job = bench.begin_body(body)
    with pytest.raises(NotArmed):
        bench.loop.run(job.outcome())
    assert job.error is not None
    assert job.error.__cause__ is job.error.__context__ is None
