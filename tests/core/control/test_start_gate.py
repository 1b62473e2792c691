from __future__ import annotations

import asyncio
from typing import Any

import pytest

from mavproxy_uavapi.core.control.start_gate import StartGate, pass_gate
from mavproxy_uavapi.core.errors import Superseded
from tests.support.virtual_time import FastLoop


@pytest.mark.parametrize("still", [True, False])
def test_check_of_one_that_waits_is_looked_at_when_the_last_one_comes(loop: FastLoop, still: bool) -> None:
    gate, allowed = StartGate(2), True

    def check() -> None:
        if not allowed:
            raise Superseded("its vehicle lands")

    async def verb(name: str, after: float, check: Any) -> bool:
        with gate.place(name):
            await asyncio.sleep(after)
            return await pass_gate(check)

    async def both() -> list[Any]:
        nonlocal allowed
        waits = asyncio.ensure_future(verb("vehicle 1", 0.0, check))
        last = asyncio.ensure_future(verb("vehicle 2", 4.0, lambda: None))
        await asyncio.sleep(2.0)
        allowed = still
        return await asyncio.gather(waits, last, return_exceptions=True)

    results = loop.run(both())
    if still:
        assert results == [True, True]
    else:  # whose own error it is has that, the others say whose it is
        assert [str(one) for one in results] == [
            "its vehicle lands",
            "nothing was sent: vehicle 1: its vehicle lands",
        ]
