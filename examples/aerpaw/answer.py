"""The other one: see ask.py."""

from aerpawlib.v1.runner import ZmqStateMachine, expose_field_zmq, sleep, state
from aerpawlib.v1.util import Coordinate
from aerpawlib.v1.vehicle import Drone


class Flyer(ZmqStateMachine):
    @expose_field_zmq(name="position")
    async def position(self, drone: Drone) -> Coordinate:
        return drone.position

    @state(name="idle", first=True)
    async def idle(self) -> str:
        await sleep(0.1)
        return "idle"

    @state(name="fly")
    async def fly(self, drone: Drone) -> str:
        await drone.takeoff(4)
        await self.transition_runner("base", "flyer_is_up")
        return "idle"

    @state(name="land_or_return")
    async def land_or_return(self, drone: Drone) -> None:
        await drone.land()
