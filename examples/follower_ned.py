"""Follow another vehicle by NED positions, then land.

Each vehicle's NED frame has its own origin, where its estimator started; the leader's NED position means
nothing to the follower. What both share is the globe: the leader's latitude and longitude are turned into
metres from a place that the follower knows in both ways, the one where it stood when it was armed. Heights go
by way of the two homes' altitudes in the same manner.
"""

import math

from client import METRES_PER_DEGREE, Api, Ned, rtl_on_interrupt
from follower_gps import Spot, follow, home_rise, read_arguments


def in_ned(spot: Spot, lat: float, lon: float, home: Ned) -> Ned:
    """The spot in the frame in which the place at `lat`, `lon` (degrees) on the ground is `home`."""
    north = (spot.lat - lat) * METRES_PER_DEGREE
    east = (spot.lon - lon) * METRES_PER_DEGREE * math.cos(math.radians(lat))
    return home.plus(north, east, -spot.above_home)


def main() -> None:
    args = read_arguments(__doc__)
    api, leader = Api(args.url), Api(args.leader)
    with rtl_on_interrupt(api):
        api.get("/command/arm")
        rise = home_rise(leader, api)
        # Standing still, the two answers belong together.
        home, place = api.ned(), api.gps()["position"]

        def go(spot: Spot) -> None:
            target = in_ned(spot, place["lat"], place["lon"], home)
            api.post("/movement/go_to_ned", **target._asdict())

        api.get("/command/takeoff", alt=args.altitude)
        api.verbose = False
        follow(leader, go, rise, args)
        api.verbose = True
        api.get("/command/land")


if __name__ == "__main__":
    main()
