"""Embedded vehicles like ArduPilot's: `python -m mavproxy_uavapi.sim`, or `Simulator` in a test.

They speak MAVLink 2 as ArduPilot's SITL does in what this project uses, need nothing but pymavlink, and are
deterministic for a seed. The parts: `physics` is the truth, `estimator` the estimated state, `vehicle` what all types
have in common, `copter`, `plane` and `rover` what each type adds (`kinds` lists them), `simulator` the MAVLink side,
`server` the sockets.
"""

from .options import Home, Options, Wind
from .simulator import Simulator

__all__ = ["Home", "Options", "Simulator", "Wind"]
