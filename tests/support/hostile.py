"""A client that tries to get a copter out of its envelope by every command there is."""

from __future__ import annotations

import math
import random
from collections import Counter
from typing import Any

from hypothesis import strategies as st

from tests.support.envelopes import place

WPL_HEAD = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t{}\t{}\t584\t1\n"
WPL_ITEM = "{}\t0\t3\t{}\t0\t0\t0\t0\t{}\t{}\t{}\t1\n"
MODES = ("GUIDED", "AUTO", "BRAKE", "LOITER", "STABILIZE", "ALT_HOLD", "RTL", "LAND", "CIRCLE")
PARAMETERS = {
    "WP_SPD": (1, 20),
    "WP_ACC": (0.5, 5),
    "WP_SPD_UP": (0.5, 5),
    "RTL_ALT_M": (0, 300),
    "GUID_TIMEOUT": (1, 60),
    "FENCE_ENABLE": (0, 1),
}
Command = tuple[str, str, dict[str, Any] | str | None]


class Attacks:
    """Makes commands near the borders of a square field and of a mast in it.

    Args:
        dice: random numbers.
        half: m from home to each side.
        mast: m north of home.
    """

    def __init__(self, dice: random.Random, half: float, mast: float) -> None:
        self.dice, self.half, self.mast = dice, half, mast

    def near(self) -> tuple[float, float, float]:
        """A place (m north, east, up) on a border, beside it, or anywhere."""
        dice, kind = self.dice, self.dice.random()
        along, beside = dice.uniform(-self.half, self.half), dice.choice([-3.0, -0.5, 0.0, 0.01, 0.5, 3.0, 30.0])
        up = dice.choice([1.0, 5.0, 10.0, 20.0, 39.9, 40.1, 59.5, 60.0, 60.1, 80.0])
        if kind < 0.5:
            out = dice.choice([-1, 1]) * (self.half + beside)
            return (out, along, up) if dice.random() < 0.5 else (along, out, up)
        if kind < 0.7:
            angle = dice.uniform(0, 2 * math.pi)
            return self.mast + 11.0 * math.cos(angle), 11.0 * math.sin(angle), up
        return dice.uniform(-self.half, self.half), along, up

    def velocity(self) -> tuple[float, float, float]:
        """m/s: mostly fast."""
        speed, angle = self.dice.choice([0.5, 2.0, 5.0, 9.0, 12.0, 13.0]), self.dice.uniform(0, 2 * math.pi)
        return (
            speed * math.cos(angle),
            speed * math.sin(angle),
            self.dice.choice([0.0, 0.0, 0.0, -4.0, -2.0, 1.0, 3.0]),
        )

    def command(self) -> Command:
        """The next one: method, path, body."""
        return getattr(self, f"_{self.dice.choice(KINDS)}")()

    def _go_to_ned(self) -> Command:
        north, east, up = self.near()
        body = {"x": north, "y": east, "z": -up}
        return "POST", self.dice.choice(["/movement/go_to_ned", "/movement/go_to_ned_wait"]), body

    def _go_to_gps(self) -> Command:
        north, east, up = self.near()
        lat, lon = place(north, east)
        return "POST", "/movement/go_to_gps", {"lat": lat, "long": lon, "alt": up}

    def _drive(self) -> Command:
        x, y, z = (self.dice.uniform(-reach, reach) for reach in (80, 80, 20))
        if self.dice.random() < 0.5:
            return "POST", "/movement/drive_body", {"front": x, "right": y, "down": z}
        return "POST", "/movement/drive", {"x": x, "y": y, "z": z}

    def _travel(self) -> Command:
        north, east, down = self.velocity()
        more = {} if self.dice.random() < 0.4 else {"duration": self.dice.choice([0.5, 5.0, 60.0])}
        if self.dice.random() < 0.3:
            return "POST", "/movement/travel_at_body", {"front": north, "right": east, "down": down, **more}
        return "POST", "/movement/travel_at_ned", {"vx": north, "vy": east, "vz": down, **more}

    def _turn(self) -> Command:
        if self.dice.random() < 0.5:
            return "GET", f"/movement/set_yaw_rate?yaw_rate={self.dice.uniform(-90, 90):.1f}", None
        return "GET", f"/movement/set_heading?heading={self.dice.uniform(0, 360):.1f}", None

    def _speed(self) -> Command:
        kind = self.dice.choice(["ground", "climb", "descent", "air"])
        return "GET", f"/command/set_{kind}_speed?new_v={self.dice.uniform(0.5, 20):.2f}", None

    def _stop(self) -> Command:
        return "GET", self.dice.choice(["/movement/stop", "/movement/resume", "/command/brake"]), None

    def _up(self) -> Command:
        return "GET", f"/command/takeoff?alt={self.dice.choice([3, 10, 30, 59, 61, 200])}", None

    def _mode(self) -> Command:
        if self.dice.random() < 0.7:
            return "GET", "/command/guided", None
        return "GET", f"/command/set_mode?mode={self.dice.choice(MODES)}", None

    def _down(self) -> Command:
        return "GET", self.dice.choice(["/command/land", "/command/rtl", "/command/set_home"]), None

    def _mission(self) -> Command:
        if self.dice.random() < 0.5:
            return "POST", "/mission/start", {}
        rows = [WPL_HEAD.format(*place(0, 0))]
        for number in range(1, self.dice.randint(2, 5)):
            north, east, up = self.near()
            inner = self.dice.choice([0.6, 0.9, 1.0])
            rows.append(WPL_ITEM.format(number, 16, *place(inner * north, inner * east), up))
        return "POST", "/mission/waypoints", "".join(rows)

    def _parameter(self) -> Command:
        name = self.dice.choice(list(PARAMETERS))
        return "PUT", f"/parameters/{name}", {"value": round(self.dice.uniform(*PARAMETERS[name]), 1)}

    def _fleet(self) -> Command:
        north, east, up = self.near()
        return "POST", "/fleet/go_to_ned", {"x": north, "y": east, "z": -up, "all_or_none": False}


KINDS = ["go_to_ned"] * 5 + ["travel"] * 6 + ["go_to_gps", "drive", "drive"] * 2
KINDS += [
    "turn",
    "speed",
    "stop",
    "stop",
    "up",
    "mode",
    "mode",
    "mode",
    "down",
    "mission",
    "mission",
    "parameter",
    "fleet",
]
LATER = [0.0, 0.05, 0.3, 1.0, 2.0, 4.0]  # s to the next command


def attacks(half: float, mast: float) -> st.SearchStrategy[list[tuple[Command, float]]]:
    """Lists of commands, each with the s to the next one."""
    seeds = st.integers(0, 2**32 - 1)
    one = st.tuples(
        seeds.map(lambda seed: Attacks(random.Random(seed), half, mast).command()), st.sampled_from(LATER)
    )
    return st.lists(one, min_size=40, max_size=40)


class Tally(Counter[str]):
    """Outcomes of commands, by status and code."""

    def note(self, status: int, body: Any) -> None:
        """Count an answer."""
        self[f"{status} {body.get('code', '')}".strip()] += 1
