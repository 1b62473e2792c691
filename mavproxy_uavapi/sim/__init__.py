"""An embedded ArduCopter-like vehicle: `python -m mavproxy_uavapi.sim`, or `Simulator` in a test.

It speaks MAVLink 2 as ArduPilot's SITL does in what this project uses, needs nothing but pymavlink, and is
deterministic for a seed. The parts: `physics` is the truth, `estimator` what the vehicle believes, `aircraft`
what the `modes` fly, `copter` the flight code that chooses among them, `simulator` the MAVLink side, `server` the
sockets.
"""

from .options import Home, Options, Wind
from .simulator import STEP, Simulator

__all__ = ["STEP", "Home", "Options", "Simulator", "Wind"]
