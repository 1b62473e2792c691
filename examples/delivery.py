"""Fetch a parcel and deliver it: fly to the pickup, land, take off, fly to the delivery, land, come back.

Each arming makes the place where the vehicle stands its home, so RTL would not lead back to the start. The
places are therefore kept in the NED frame, whose origin stays.
"""

from __future__ import annotations

import argparse

from client import Api, Ned, parser, rtl_on_interrupt


def north_east(text: str) -> tuple[float, float]:
    """`N,E` in m."""
    north, east = (float(part) for part in text.split(","))
    return north, east


north_east.__name__ = "N,E"


def hop(api: Api, place: Ned, altitude: float) -> None:
    """Take off, fly to above the place, and land there. `place` is on the ground, `altitude` above it in m."""
    api.get("/command/takeoff", alt=altitude)
    api.post("/movement/go_to_ned_wait", **place.plus(z=-altitude)._asdict())
    api.get("/command/land")


def read_arguments() -> argparse.Namespace:
    arguments = parser(__doc__, altitude=5.0)
    for name, place in {"pickup": (10.0, 0.0), "delivery": (0.0, 10.0)}.items():
        arguments.add_argument(
            f"--{name}", type=north_east, default=place, metavar="N,E", help=f"m from the start {place}"
        )
    return arguments.parse_args()


def main() -> None:
    args = read_arguments()
    api = Api(args.url)
    with rtl_on_interrupt(api):
        start: Ned | None = None
        for name, place in {"pickup": args.pickup, "delivery": args.delivery, "start": (0.0, 0.0)}.items():
            print(f"To the {name}", flush=True)
            api.get("/command/arm")
            # Armed, the vehicle knows where it is.
            start = start or api.ned()
            hop(api, start.plus(*place), args.altitude)


if __name__ == "__main__":
    main()
