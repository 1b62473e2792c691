"""The embedded plane, QuadPlane and rover beside ArduPilot's own: the same sequence, and where they differ.

    python benchmarks/bench_sim_types_sitl.py --ardupilot ~/ardupilot [--vehicle rover] [--speedup 10]

A ground station without MAVProxy talks to both. All seconds are the vehicle's. A line that begins with `*` differs:
texts, acknowledgements and modes at all, measured values by more than their tolerance.
"""

from __future__ import annotations

import sys

from sim_flights import SEQUENCES
from sim_pair import compare

if __name__ == "__main__":
    sys.exit(compare(__doc__, SEQUENCES))
