"""A scenario of gradysim's, as its users write them: three drones fly out, tell each other, and come back.

python tests/support/gradysim_scenario.py PORT     (needs gradysim; prints where each drone was, and what it heard)
"""

from __future__ import annotations

import logging
import math
import sys

from gradysim.protocol.interface import IProtocol
from gradysim.protocol.messages.communication import BroadcastMessageCommand
from gradysim.protocol.messages.mobility import GotoCoordsMobilityCommand
from gradysim.simulator.handler.ardupilot_mobility import ArdupilotMobilityConfiguration, ArdupilotMobilityHandler
from gradysim.simulator.handler.communication import CommunicationHandler, CommunicationMedium
from gradysim.simulator.handler.timer import TimerHandler
from gradysim.simulator.simulation import SimulationBuilder, SimulationConfiguration


class Drone(IProtocol):
    """Flies 20 m north, and tells the others when it is there."""

    def initialize(self) -> None:
        self.goal = (20.0, 5.0 * self.provider.get_id(), 12.0)
        self.arrived, self.heard = False, set()
        self.provider.send_mobility_command(GotoCoordsMobilityCommand(*self.goal))

    def handle_timer(self, timer: str) -> None:
        self.provider.send_communication_command(BroadcastMessageCommand(str(self.provider.get_id())))
        self.provider.schedule_timer(timer, self.provider.current_time() + 1.0)

    def handle_packet(self, message: str) -> None:
        self.heard.add(int(message))

    def handle_telemetry(self, telemetry) -> None:
        if not self.arrived and math.dist(telemetry.current_position, self.goal) < 1.5:
            self.arrived = True
            self.handle_timer("tell")

    def finish(self) -> None:
        print(f"drone {self.provider.get_id()} arrived={self.arrived} heard={sorted(self.heard)}", flush=True)


def main() -> None:
    logging.basicConfig(level=logging.INFO)
    builder = SimulationBuilder(SimulationConfiguration(duration=40, real_time=2))
    builder.add_handler(CommunicationHandler(CommunicationMedium(transmission_range=60)))
    builder.add_handler(TimerHandler())
    builder.add_handler(ArdupilotMobilityHandler(ArdupilotMobilityConfiguration(starting_api_port=int(sys.argv[1]))))
    for number in range(3):
        builder.add_node(Drone, (0, 5 * number, 10))
    builder.build().start_simulation()


if __name__ == "__main__":
    main()
