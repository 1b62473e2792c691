"""Movements as tasks, for aerpawlib's v2: StateMachine, a check before a command, progress, a cancelled flight.

python -m mavproxy_uavapi.aerpaw --script examples/aerpaw/tasks.py --vehicle drone
"""

import asyncio

from aerpawlib.v2 import Drone, StateMachine, TaskCancelledError, VectorNED, background, state, timed_state

ALTITUDE = 6  # m above home


class Tasks(StateMachine):
    highest = 0.0

    @background
    async def look(self, drone: Drone) -> None:
        self.highest = max(self.highest, drone.position.alt)
        await asyncio.sleep(0.1)

    @state(name="take_off", first=True)
    async def take_off(self, drone: Drone) -> str | None:
        allowed, why_not = await drone.can_takeoff(ALTITUDE)
        if not allowed:
            print(f"no takeoff: {why_not}", flush=True)
            return None
        await drone.takeoff(altitude=ALTITUDE)
        return "go"

    @timed_state(name="go", duration=0.5)
    async def go(self, drone: Drone) -> str:
        there = drone.position + VectorNED(15, 0, 0)
        print("may go there:", await drone.can_goto(there), flush=True)
        task = await drone.goto_coordinates(there, tolerance=1.5, blocking=False)
        print("under way", flush=True)
        await task.wait_done()
        print(f"{task.progress:.0%} of the way", flush=True)
        return "come_back"

    @state(name="come_back")
    async def come_back(self, drone: Drone) -> None:
        task = await drone.goto_south(200, blocking=False)
        await asyncio.sleep(1)
        task.cancel()  # it returns to launch
        try:
            await task.wait_done()
        except TaskCancelledError:
            print(f"cancelled, {'in the air' if drone.armed else 'landed'}", flush=True)
            print(f"it was {self.highest:.0f} m high", flush=True)
