"""What the command line (or a test) can choose about a simulated vehicle."""

from __future__ import annotations

from dataclasses import dataclass, field

SITL_BASE_PORT = 5760
"""TCP port of instance 0, as ArduPilot's SITL has it; each further instance adds ten."""


@dataclass(frozen=True)
class Home:
    """Where the vehicle stands at boot.

    latitude and longitude in degrees, altitude in metres AMSL, heading in degrees from true north.
    The default is SITL's own field, CMAC near Canberra.
    """

    latitude: float = -35.363261
    longitude: float = 149.165230
    altitude: float = 584.0
    heading: float = 353.0

    @classmethod
    def parse(cls, text: str) -> Home:
        """Read `lat,lon,alt,heading`; ValueError names what is wrong."""
        try:
            latitude, longitude, altitude, heading = (float(part) for part in text.split(","))
        except ValueError:
            raise ValueError(f"expected lat,lon,alt,heading and got {text!r}") from None
        if not (-90 <= latitude <= 90 and -180 <= longitude <= 180):
            raise ValueError(f"latitude or longitude out of range in {text!r}")
        return cls(latitude, longitude, altitude, heading % 360)


@dataclass(frozen=True)
class Wind:
    """A steady wind: SIM_WIND_SPD in m/s and SIM_WIND_DIR, the direction in degrees that it blows FROM."""

    speed: float = 0.0
    direction: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Wind:
        """Read `speed,direction`; ValueError names what is wrong."""
        try:
            speed, direction = (float(part) for part in text.split(","))
        except ValueError:
            raise ValueError(f"expected speed,direction and got {text!r}") from None
        if speed < 0:
            raise ValueError(f"wind speed must not be negative in {text!r}")
        return cls(speed, direction % 360)


@dataclass(frozen=True)
class Options:
    """Everything that makes one simulation differ from another.

    vehicle is a name of `kinds.KINDS`, speedup simulated seconds per wall second, gps_noise metres (1 sigma),
    ready_after the simulated seconds from boot until the estimator has a position, battery the mAh after which the
    battery is empty; with 0 it never is. step is the simulated seconds of one step, at any speedup; with 0.02 it all
    costs half, and flights differ by centimetres. firmware, of `parameters.FIRMWARES`, gives parameters their names;
    defaults are those with which it boots, by the names and in the units of any firmware; it leaves out those that it
    does not have.
    """

    vehicle: str = "copter"
    sysid: int = 1
    speedup: float = 1.0
    home: Home = field(default_factory=Home)
    seed: int = 0
    wind: Wind = field(default_factory=Wind)
    gps_noise: float = 0.0
    ready_after: float = 5.0
    battery: float = 0.0
    defaults: tuple[tuple[str, float], ...] = ()
    step: float = 0.01
    firmware: str = "4.7"
