"""Arm, take off, land: the smallest flight there is."""

from client import Api, parser, rtl_on_interrupt


def main() -> None:
    args = parser(__doc__).parse_args()
    api = Api(args.url)
    with rtl_on_interrupt(api):
        api.get("/command/arm")
        api.get("/command/takeoff", alt=args.altitude)
        api.get("/command/land")


if __name__ == "__main__":
    main()
