"""Fly a square over home with calls that answer at once, and watch the telemetry for the arrival.

So a program can do something else on the way. Arrival means all three axes.
"""

import math
import sys
import time

from client import Api, Ned, parser, positive, rtl_on_interrupt

TOLERANCE_M = 1.0
PERIOD_S = 0.2


def is_at(here: Ned, target: Ned) -> bool:
    """Whether both the horizontal and the vertical distance are within the tolerance."""
    horizontal = math.hypot(here.x - target.x, here.y - target.y)
    return horizontal <= TOLERANCE_M and abs(here.z - target.z) <= TOLERANCE_M


def fly_to(api: Api, target: Ned, timeout_s: float) -> None:
    """Fly there; where it takes longer than the timeout, return to launch and end the program."""
    api.post("/movement/go_to_ned", **target._asdict())
    deadline = time.monotonic() + timeout_s
    while not is_at(api.ned(), target):
        if time.monotonic() > deadline:
            print(f"not there after {timeout_s:g} s, returning to launch", file=sys.stderr)
            api.get("/command/rtl")
            sys.exit(1)
        time.sleep(PERIOD_S)
    print("Arrived", flush=True)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--side", type=positive, default=20.0, help="m (%(default)g)")
    arguments.add_argument("--timeout", type=positive, default=120.0, help="s for each side (%(default)g)")
    args = arguments.parse_args()
    api = Api(args.url)
    with rtl_on_interrupt(api):
        api.get("/command/arm")
        home = api.ned()
        api.get("/command/takeoff", alt=args.altitude)
        side = args.side
        for north, east in ((side, 0.0), (side, side), (0.0, side), (0.0, 0.0)):
            fly_to(api, home.plus(north, east, -args.altitude), args.timeout)
        api.get("/command/land")


if __name__ == "__main__":
    main()
