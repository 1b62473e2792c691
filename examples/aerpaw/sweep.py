"""Velocities and states for aerpawlib: sweep to and fro while a log is written beside it.

python -m mavproxy_uavapi.aerpaw --script examples/aerpaw/sweep.py --vehicle drone --output sweep.csv
"""

import csv
from argparse import ArgumentParser
from pathlib import Path

from aerpawlib.v1.runner import StateMachine, at_init, background, sleep, state, timed_state
from aerpawlib.v1.util import VectorNED
from aerpawlib.v1.vehicle import Drone, Vehicle

SPEED = 2.0  # m/s
LEGS = 2


class Sweep(StateMachine):
    legs_left = LEGS

    def initialize_args(self, extra_args: list[str]) -> None:
        parser = ArgumentParser()
        parser.add_argument("--output", type=Path, default=Path("sweep.csv"), help="where the log goes")
        self.file = parser.parse_args(extra_args).output.open("w", newline="")

    def cleanup(self) -> None:
        self.file.close()

    @at_init
    async def say_where(self, vehicle: Vehicle) -> None:
        print(f"home is {vehicle.home_coords}", flush=True)

    @background
    async def write_position(self, vehicle: Vehicle) -> None:
        here = vehicle.position
        csv.writer(self.file).writerow([here.lat, here.lon, here.alt, vehicle.battery.voltage, vehicle.gps.fix_type])
        await sleep(0.2)

    @state(name="climb", first=True)
    async def climb(self, drone: Drone) -> str:
        await drone.takeoff(5)
        await drone.set_heading(359)
        return "go"

    @timed_state(name="go", duration=2)
    async def go(self, drone: Drone) -> str:
        await drone.set_velocity(VectorNED(SPEED if self.legs_left % 2 == 0 else -SPEED, 0))
        self.legs_left -= 1
        return "go" if self.legs_left else "land_or_return"

    @state(name="land_or_return")
    async def land_or_return(self, drone: Drone) -> None:
        print(f"heading {drone.heading:.0f}", flush=True)
        await drone.land()
