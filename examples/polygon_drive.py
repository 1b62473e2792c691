"""Draw regular polygons standing upright, by driving from corner to corner.

A drive is counted from where the vehicle is, which is not quite at the corner. So each leg is measured
from there to the next corner: the errors do not add up, towards the ground least of all.
"""

from client import Api, Ned, rtl_on_interrupt
from polygon_ned import TOLERANCE_M, read_arguments, upright_polygon


def drive_to(api: Api, target: Ned) -> None:
    """Drive from here to a point of the NED frame."""
    here = api.ned()
    leg = target.plus(-here.x, -here.y, -here.z)
    api.post("/movement/drive_wait", **leg._asdict(), tolerance=TOLERANCE_M)


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
                drive_to(api, centre.plus(*corner))
            drive_to(api, centre)
        api.get("/command/land")


if __name__ == "__main__":
    main()
