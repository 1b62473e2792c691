"""Draw regular polygons standing upright, by corners in the NED frame."""

from __future__ import annotations

import argparse
import math

from client import Api, Ned, parser, positive, rtl_on_interrupt

TOLERANCE_M = 0.5


def upright_polygon(sides: int, radius: float) -> list[Ned]:
    """The corners of a regular polygon in the vertical plane through north, from its centre, the top one
    first and last.

    Args:
        sides: how many, at least 3.
        radius: from the centre to a corner, in m.
    """
    angles = [2 * math.pi * corner / sides for corner in range(sides + 1)]
    return [Ned(radius * math.sin(angle), 0.0, -radius * math.cos(angle)) for angle in angles]


def read_arguments(description: str | None) -> argparse.Namespace:
    """`--sides`, `--radius` and `--height`, once they are known to stay above the ground."""
    arguments = parser(description, altitude=None)
    arguments.add_argument("--sides", type=int, nargs="+", default=[3, 4, 5], help="one polygon for each (3 4 5)")
    arguments.add_argument("--radius", type=positive, default=3.0, help="m from centre to corner (%(default)g)")
    arguments.add_argument("--height", type=positive, default=6.0, help="m from home up to the centre (%(default)g)")
    args = arguments.parse_args()
    if min(args.sides) < 3:
        arguments.error("--sides: a polygon has at least 3")
    if args.radius >= args.height:
        arguments.error("--radius must be smaller than --height, or the lowest corner is in the ground")
    return args


def main() -> None:
    args = read_arguments(__doc__)
    api = Api(args.url)
    with rtl_on_interrupt(api):
        api.get("/command/arm")
        home = api.ned()
        api.get("/command/takeoff", alt=args.height)
        centre = home.plus(z=-args.height)
        for sides in args.sides:
            print(f"Polygon of {sides} sides", flush=True)
            for corner in upright_polygon(sides, args.radius):
                target = centre.plus(*corner)
                api.post("/movement/go_to_ned_wait", **target._asdict(), tolerance=TOLERANCE_M)
            api.post("/movement/go_to_ned_wait", **centre._asdict())
        api.get("/command/land")


if __name__ == "__main__":
    main()
