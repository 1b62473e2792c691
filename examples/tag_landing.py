"""Fly to a place, and land on the AprilTag there; without one in sight, search for it, and in the end come home.

The API needs the module vision with a camera. `mavproxy-uavapi run tag_landing.py` rehearses it with a simulated one.
"""

from client import Api, parser, rtl_on_interrupt


def main() -> None:
    arguments = parser(__doc__, altitude=5.0)
    arguments.add_argument("--north", type=float, default=8.0, help="m from here (%(default)g)")
    arguments.add_argument("--east", type=float, default=-5.0, help="m from here (%(default)g)")
    args = arguments.parse_args()
    api = Api(args.url)
    with rtl_on_interrupt(api):
        api.get("/command/arm")
        api.get("/command/takeoff", alt=args.altitude)
        api.post("/movement/drive_wait", x=args.north, y=args.east, z=0.0)
        print(api.post("/vision/land")["result"], flush=True)


if __name__ == "__main__":
    main()
