"""Follow another vehicle by GPS positions, then land.

The altitude of a GPS position is above the home of the vehicle that flies there: the follower's. The
leader's height is above the leader's home, so the difference of the two homes' altitudes is added.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from client import METRES_PER_DEGREE, Api, parser, positive, rtl_on_interrupt

NEAREST_M = 2.0
LOWEST_M = 2.0
PERIOD_S = 0.2


class Spot(NamedTuple):
    """Latitude and longitude in degrees, and height in m above the follower's home."""

    lat: float
    lon: float
    above_home: float


def read_arguments(description: str | None) -> argparse.Namespace:
    """`--leader`, `--distance`, `--above` and `--duration` beside the usual ones."""
    arguments = parser(description)
    arguments.add_argument("--leader", default="http://127.0.0.1:8001", help="the leader's API (%(default)s)")
    arguments.add_argument("--distance", type=positive, default=5.0, help="m behind it, at least 2 (%(default)g)")
    arguments.add_argument("--above", type=float, default=0.0, help="m above the leader (%(default)g)")
    arguments.add_argument("--duration", type=positive, default=60.0, help="s until it lands (%(default)g)")
    args = arguments.parse_args()
    if not args.distance >= NEAREST_M:
        arguments.error(f"--distance must be at least {NEAREST_M:g} m")
    if not math.isfinite(args.above):
        arguments.error("--above must be a number")
    return args


def behind(leader: dict[str, Any], rise: float, distance: float, above: float) -> Spot:
    """The spot behind the leader, by its heading.

    Args:
        leader: its `/telemetry/gps`.
        rise: how much higher the leader's home is than the follower's, in m.
        distance: m behind the leader.
        above: m above the leader.
    """
    position = leader["position"]
    # Without a compass the heading is null: then the spot is south of the leader.
    heading = math.radians(leader["heading"] or 0.0)
    north, east = -distance * math.cos(heading), -distance * math.sin(heading)
    return Spot(
        lat=position["lat"] + north / METRES_PER_DEGREE,
        lon=position["lon"] + east / METRES_PER_DEGREE / math.cos(math.radians(position["lat"])),
        # Each vehicle's barometer counts from its own home, so heights are compared by way of the homes. The
        # floor keeps the follower flying when the leader lands.
        above_home=max(LOWEST_M, position["relative_alt"] + rise + above),
    )


def follow(leader: Api, go: Callable[[Spot], object], rise: float, args: argparse.Namespace) -> None:
    """Send the follower behind the leader again and again until the duration is over."""
    print(f"Following for {args.duration:g} s", flush=True)
    end = time.monotonic() + args.duration
    while time.monotonic() < end:
        go(behind(leader.gps(), rise, args.distance, args.above))
        time.sleep(PERIOD_S)


def home_rise(leader: Api, api: Api) -> float:
    """How much higher the leader's home is than the follower's, in m."""
    theirs, ours = (vehicle.get("/telemetry/home_info")["altitude"] for vehicle in (leader, api))
    return float(theirs - ours)


def main() -> None:
    args = read_arguments(__doc__)
    api, leader = Api(args.url), Api(args.leader)

    def go(spot: Spot) -> None:
        api.post("/movement/go_to_gps", lat=spot.lat, long=spot.lon, alt=spot.above_home)

    with rtl_on_interrupt(api):
        api.get("/command/arm")
        rise = home_rise(leader, api)
        api.get("/command/takeoff", alt=args.altitude)
        api.verbose = False
        follow(leader, go, rise, args)
        api.verbose = True
        api.get("/command/land")


if __name__ == "__main__":
    main()
