"""Fly a square over home with calls that answer on arrival.

NED counts from the origin of the estimator, which need not be home: the corners are counted from where the
vehicle stood when it was armed.
"""

from client import Api, parser, positive, rtl_on_interrupt


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--side", type=positive, default=20.0, help="m (%(default)g)")
    args = arguments.parse_args()
    api = Api(args.url)
    with rtl_on_interrupt(api):
        api.get("/command/arm")
        home = api.ned()
        api.get("/command/takeoff", alt=args.altitude)
        side = args.side
        for north, east in ((side, 0.0), (side, side), (0.0, side), (0.0, 0.0)):
            corner = home.plus(north, east, -args.altitude)
            api.post("/movement/go_to_ned_wait", **corner._asdict())
        api.get("/command/land")


if __name__ == "__main__":
    main()
