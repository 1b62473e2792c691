"""Reads never wait for verbs, however many wait."""

from __future__ import annotations

import asyncio
import time

import aiohttp
import pytest

WAITING = 180  # max_connections is 200, and a few are kept for callers who have passed the door
READS = 50


@pytest.mark.long
def test_almost_two_hundred_waiting_calls_do_not_hold_up_a_read(embedded_rig):
    rig = embedded_rig
    rig.in_the_air(10)
    x, y, z = rig.ned()
    target = {"x": x + (2000 if x < 0 else -2000), "y": y, "z": z}

    async def scenario() -> tuple[list[float], list[int], int]:
        connector = aiohttp.TCPConnector(limit=0)
        async with aiohttp.ClientSession(rig.url, connector=connector) as client:

            async def wait() -> int:
                async with client.post("/movement/go_to_ned_wait", json=target) as answer:
                    return answer.status

            waiting = [asyncio.create_task(wait()) for _ in range(WAITING)]
            await asyncio.sleep(1)
            assert not any(task.done() for task in waiting)
            times = []
            for _ in range(READS):
                before = time.monotonic()
                async with client.get("/telemetry/ned") as answer:
                    assert answer.status == 200
                times.append(time.monotonic() - before)
            async with client.get("/command/brake") as answer:
                assert answer.status == 200
            return times, await asyncio.gather(*waiting), len(waiting)

    times, statuses, waited = asyncio.run(scenario())
    assert statuses == [409] * waited  # all of them joined one job, which the brake superseded
    assert sorted(times)[READS // 2] < 0.25  # generous: it is a queue behind 200 waits that must not be seen
    rig.ok(rig.get("/command/guided"))
