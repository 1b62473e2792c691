"""The truth about a simulated vehicle, and what goes wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.rehearsal.record import Sample
from mavproxy_uavapi.rehearsal.sitl import SitlVehicle
from mavproxy_uavapi.sim.control import Control
from mavproxy_uavapi.sim.simulator import Simulator


class VehicleTruth:
    """What is true of one vehicle, whatever it tells.

    Args:
        simulator: the vehicle.

    Attributes:
        system: its system id.
        simulator: see above.
    """

    def __init__(self, simulator: Simulator | SitlVehicle) -> None:
        self.simulator = simulator
        self.system = simulator.options.sysid
        self._control = Control(simulator) if isinstance(simulator, Simulator) else simulator
        self._clock: int | None = None  # ms; the vehicle's, at the last look
        self._passed = 0  # ms since the first look

    def tell(self, line: Mapping[str, Any]) -> dict[str, Any]:
        """Do a line of the control protocol (`sim.control`), and return the answer.

        Raises:
            LaunchError: the vehicle refuses it.
        """
        answer = self._control.handle(line)
        if not answer["ok"]:
            raise LaunchError(f"vehicle {self.system}: {answer['error']}")
        return answer

    def sample(self) -> Sample:
        """The vehicle now; times begin with the first one."""
        state = self.tell({"op": "state"})
        clock = state["time_boot_ms"]
        if self._clock is not None:  # its clock begins anew when it boots
            self._passed += clock - self._clock if clock >= self._clock else clock
        self._clock = clock
        north, east, down = state["velocity"]
        remaining = state["battery"]["remaining"]
        return Sample(
            self._passed / 1000,
            state["latitude"],
            state["longitude"],
            state["altitude_above_home"],
            (north**2 + east**2 + down**2) ** 0.5,
            down,
            state["mode"],
            state["armed"],
            state["landed"],
            None if remaining is None or remaining < 0 else float(remaining),
            state["mission"]["current"] if state["mode"] == "AUTO" else 0,
        )
