"""A square for aerpawlib, seen from its first corner: BasicRunner, movements, the script's own arguments.

python -m mavproxy_uavapi.aerpaw --script examples/aerpaw/square.py --vehicle drone --side 15
"""

from argparse import ArgumentParser

from aerpawlib.v1.runner import BasicRunner, entrypoint
from aerpawlib.v1.util import VectorNED
from aerpawlib.v1.vehicle import Drone

SIDES = {"north": (1, 0), "east": (0, 1), "south": (-1, 0), "west": (0, -1)}


class Square(BasicRunner):
    def initialize_args(self, extra_args: list[str]) -> None:
        parser = ArgumentParser()
        parser.add_argument("--side", type=float, default=10.0, help="m")
        parser.add_argument("--altitude", type=float, default=6.0, help="m above home")
        self.args = parser.parse_args(extra_args)

    @entrypoint
    async def fly(self, drone: Drone) -> None:
        await drone.takeoff(self.args.altitude)
        corner = drone.position
        for name, (north, east) in SIDES.items():
            corner = corner + self.args.side * VectorNED(north, east)
            await drone.goto_coordinates(corner, tolerance=1.5)
            print(f"{name}: {drone.position.distance(corner):.1f} m from the corner", flush=True)
        await drone.land()
