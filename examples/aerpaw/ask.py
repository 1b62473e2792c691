"""One of two runners that talk by ZMQ: `base` has no vehicle; it has `flyer` take off, asks where it is, and ends it.

    python -m mavproxy_uavapi.aerpaw.zmq_proxy
    python -m mavproxy_uavapi.aerpaw --script examples/aerpaw/answer.py --vehicle drone \
        --zmq-identifier flyer --zmq-proxy-server 127.0.0.1
    python -m mavproxy_uavapi.aerpaw --script examples/aerpaw/ask.py --vehicle none \
        --zmq-identifier base --zmq-proxy-server 127.0.0.1
"""

import asyncio

from aerpawlib.v1.runner import ZmqStateMachine, sleep, state


class Base(ZmqStateMachine):
    @state(name="begin", first=True)
    async def begin(self) -> str:
        try:
            await self.query_field("flyer", "position", timeout=1)
        except asyncio.TimeoutError:
            return "begin"  # it is not there yet
        await self.transition_runner("flyer", "fly")
        return "wait"

    @state(name="wait")
    async def wait(self) -> str:
        await sleep(0.1)
        return "wait"

    @state(name="flyer_is_up")
    async def flyer_is_up(self) -> None:
        there = await self.query_field("flyer", "position")
        print(f"the flyer is {there.alt:.0f} m high", flush=True)
        await self.transition_runner("flyer", "land_or_return")
